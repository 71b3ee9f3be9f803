// SPDX-License-Identifier: MIT
#include "history.h"

#include "iwheel_northbound/json_out.h"

#include <inttypes.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>

#define MINUTE_US 60000000LL

bool history_open(history_t *self, const history_config_t *config, FILE *out) {
    memset(self, 0, sizeof *self);
    self->config = *config;
    self->out = out;
    self->machines = calloc(FLEET_MACHINES, sizeof *self->machines);
    return self->machines != NULL;
}

void history_close(history_t *self) {
    free(self->machines);
    self->machines = NULL;
}

void history_time(int64_t wall_us, char out[HISTORY_TIME_SIZE]) {
    const time_t seconds = (time_t)(wall_us / 1000000);
    struct tm parts;
    (void)snprintf(out, HISTORY_TIME_SIZE, "--");
    if (wall_us > 0 && localtime_r(&seconds, &parts) != NULL) {
        (void)strftime(out, HISTORY_TIME_SIZE, "%Y-%m-%d %H:%M:%S", &parts);
    }
}

bool history_when(const char *text, int64_t *out_us) {
    static const char *const forms[] = {"%Y-%m-%dT%H:%M:%S", "%Y-%m-%d %H:%M:%S", "%Y-%m-%dT%H:%M", "%Y-%m-%d %H:%M",
                                        "%Y-%m-%d"};
    for (size_t i = 0; i < sizeof forms / sizeof forms[0]; i++) {
        struct tm parts = {.tm_isdst = -1};
        const char *rest = strptime(text, forms[i], &parts);
        const bool utc = rest != NULL && strcmp(rest, "Z") == 0;
        if (rest == NULL || (rest[0] != '\0' && !utc)) {
            continue;
        }
        const int day = parts.tm_mday;
        const time_t seconds = utc ? timegm(&parts) : mktime(&parts);
        if (seconds <= 0 || parts.tm_mday != day) { // 30 February is not a date, though mktime accepts it.
            return false;
        }
        *out_us = (int64_t)seconds * 1000000;
        return true;
    }
    return false;
}

bool history_span(const char *text, int64_t *out_us) {
    static const struct {
        const char *word;
        int64_t seconds;
    } units[] = {{"s", 1}, {"min", 60}, {"h", 3600}, {"d", 86400}};
    const size_t digits = strspn(text, "0123456789");
    uint32_t number = 0;
    if (digits == 0U || !settings_digits(text, digits, &number) || number == 0U) {
        return false;
    }
    for (size_t i = 0; i < sizeof units / sizeof units[0]; i++) {
        if (strcmp(text + digits, units[i].word) == 0) {
            *out_us = (int64_t)number * units[i].seconds * 1000000;
            return true;
        }
    }
    return false;
}

history_machine_t *history_machine(history_t *self, const char *id) {
    for (size_t i = 0; i < self->count; i++) {
        if (strcmp(self->machines[i].id, id) == 0) {
            return &self->machines[i];
        }
    }
    if (self->count == FLEET_MACHINES) {
        return NULL;
    }
    history_machine_t *machine = &self->machines[self->count++];
    (void)snprintf(machine->id, sizeof machine->id, "%s", id);
    return machine;
}

/// Parses `id`, which is `BOOT-NUMBER`.
static bool read_id(const iwc_message_t *event, char out_boot[MQTT_BOOT_SIZE], uint64_t *out_number) {
    char id[48];
    fleet_text(event, "id", id, sizeof id);
    char *dash = strrchr(id, '-');
    if (dash == NULL || dash == id || (size_t)(dash - id) >= MQTT_BOOT_SIZE || dash[1] == '\0' ||
        strspn(dash + 1, "0123456789") != strlen(dash + 1)) {
        return false;
    }
    *dash = '\0'; // The part before it is shorter than MQTT_BOOT_SIZE.
    memcpy(out_boot, id, (size_t)(dash - id) + 1U);
    *out_number = strtoull(dash + 1, NULL, 10);
    return *out_number > 0U;
}

/// Returns the index of the run of the bridge with this boot id; a new run replaces the oldest.
static size_t run_of(history_machine_t *machine, const char *boot) {
    for (size_t i = 0; i < HISTORY_BOOTS; i++) {
        if (strcmp(machine->runs[i].boot, boot) == 0) {
            return i;
        }
    }
    const size_t next = (machine->number > 0U) ? (machine->run + 1U) % HISTORY_BOOTS : 0U;
    (void)snprintf(machine->runs[next].boot, MQTT_BOOT_SIZE, "%s", boot);
    machine->runs[next].number = 0;
    return next;
}

/// Returns the number of events between `before` and `now`; 0 if `before` is 0. If the numbers restarted, it counts
/// from 1 on.
static uint64_t gap(uint64_t before, uint64_t now) {
    const uint64_t from = (now > before) ? before : 0U;
    return (before > 0U) ? now - from - 1U : 0U;
}

/// Stores the gap of missing events between these two; it replaces the oldest gap.
static void open_gap(history_machine_t *machine, uint64_t before, uint64_t now) {
    if (gap(before, now) > 0U) {
        machine->gaps[machine->next_gap] = (history_gap_t){(now > before) ? before + 1U : 1U, now - 1U};
        machine->next_gap = (machine->next_gap + 1U) % HISTORY_GAPS;
    }
}

/// Returns true for an event that was missing until now, because it was set aside or sent again.
static bool close_gap(history_machine_t *machine, uint64_t number) {
    for (size_t i = 0; i < HISTORY_GAPS; i++) {
        history_gap_t *one = &machine->gaps[i];
        if (one->first == 0U || number < one->first || number > one->last) {
            continue;
        }
        const history_gap_t whole = *one;
        *one = (history_gap_t){number + 1U, whole.last}; // The upper part of the gap, then the lower one.
        if (one->first > one->last) {
            *one = (history_gap_t){0};
        }
        open_gap(machine, whole.first - 1U, number);
        return true;
    }
    return false;
}

/// Subtracts one from the pending count, or if that is 0 from the reported one.
static void take_back(uint64_t *pending, uint64_t *reported) {
    uint64_t *from = (*pending > 0U) ? pending : reported;
    *from -= (*from > 0U) ? 1U : 0U;
}

/// Returns false for a duplicate.
static bool note(history_t *self, history_machine_t *machine, const iwc_message_t *event, bool is_stop) {
    char boot[MQTT_BOOT_SIZE];
    uint64_t number = 0;
    if (!read_id(event, boot, &number)) {
        return true; // Events without an id cannot be compared; a duplicate is better than a loss.
    }
    const size_t run = run_of(machine, boot);
    if (number <= machine->runs[run].number) {
        const bool late = close_gap(machine, number);
        if (late) {
            take_back(&machine->missing, &self->missing);
        }
        if (late && is_stop) {
            take_back(&machine->stops_missing, &self->stops_missing);
        }
        return late;
    }
    machine->missing += gap(machine->number, number);
    open_gap(machine, machine->number, number);
    machine->began = machine->began || (machine->number > 0U && run != machine->run);
    machine->runs[run].number = number;
    machine->run = run;
    machine->number = number;
    machine->event_us = iwc_integer(event, "heard_wall_us").value;
    const iwc_value_t stop = iwc_integer(event, "number");
    if (is_stop && stop.known && stop.value > 0) {
        machine->stops_missing += gap((uint64_t)machine->stop, (uint64_t)stop.value);
        machine->stop = stop.value;
        machine->stop_wall_us = iwc_integer(event, "wall_us").value;
    }
    return true;
}

/// Clears the gap, because it is reported or lies before the span.
static void forget_gap(history_machine_t *machine) {
    machine->missing = 0;
    machine->stops_missing = 0;
    machine->began = false;
}

/// Writes the most important fields of an event that is not a stop.
static void write_fields(const iwc_message_t *event, const char *name, char *out, size_t size) {
    static const struct {
        const char *event;
        const char *fields[3];
    } forms[] = {{"fault", {"cause", "present", NULL}},
                 {"estop", {"state", NULL}},
                 {"bus", {"state", NULL}},
                 {"lease", {"change", "name", NULL}},
                 {"ledger", {"item", "state", NULL}},
                 {"offset", {"side", "provenance", NULL}},
                 {"lost", {"count", NULL}}};
    size_t used = 0;
    out[0] = '\0';
    for (size_t i = 0; i < sizeof forms / sizeof forms[0]; i++) {
        for (size_t k = 0; strcmp(forms[i].event, name) == 0 && forms[i].fields[k] != NULL && used < size; k++) {
            char text[128];
            size_t length = 0;
            const char *raw = iwc_json(event, forms[i].fields[k], &length);
            fleet_text(event, forms[i].fields[k], text, sizeof text);
            if (raw != NULL && raw[0] != '"' && length < sizeof text) { // A number or a boolean.
                memcpy(text, raw, length);
                text[length] = '\0';
            }
            used +=
                (size_t)snprintf(out + used, size - used, "%s%s %s", (used > 0U) ? ", " : "", forms[i].fields[k], text);
        }
    }
}

void history_note(const history_t *self, const history_machine_t *machine, uint64_t events, const char *words) {
    (void)fprintf(self->out, "%-19s %-12s -- %" PRIu64 " %s\n", "", machine->id, events, words);
}

static void show(const history_t *self, const history_machine_t *machine, const iwc_message_t *event, const char *name,
                 const int64_t times_us[2]) {
    char when[HISTORY_TIME_SIZE];
    char stored[HISTORY_TIME_SIZE];
    char text[IWN_SENTENCE_SIZE];
    const int64_t late_us = times_us[1] - times_us[0];
    history_time(times_us[0], when);
    history_time(times_us[1], stored);
    fleet_text(event, "sentence", text, sizeof text);
    if (text[0] == '\0') {
        fleet_text(event, "cause", text, sizeof text);
    }
    if (strcmp(name, "stop") != 0) {
        write_fields(event, name, text, sizeof text);
    }
    if (self->config.all && machine->began) {
        (void)fprintf(self->out, "%-19s %-12s -- its bridge restarted: boot %s\n", "", machine->id,
                      machine->runs[machine->run].boot);
    }
    if (machine->missing > 0U) {
        char cause[128];
        char words[192];
        history_cause(machine, cause, sizeof cause);
        (void)snprintf(words, sizeof words, "events before this one are not in the stream: %s", cause);
        history_note(self, machine, machine->missing, words);
    }
    if (machine->stops_missing > 0U) {
        history_note(self, machine, machine->stops_missing,
                     "stops before this one are not in the stream; to list its recordings: iwheel-fleet recordings ID");
    }
    (void)fprintf(self->out, "%-19s %-12s %-6s %s%s", when, machine->id, name, text,
                  (iwc_truth(event, "missed").value == 1) ? " (reported late: its bridge did not run)" : "");
    if (late_us > MINUTE_US) {
        (void)fprintf(self->out, " (stored %s)", stored);
    } else if (late_us < -MINUTE_US) {
        (void)fprintf(self->out, " (THE CLOCK OF THIS MACHINE IS WRONG: stored %s)", stored);
    }
    (void)fputs("\n", self->out);
}

static void print_event(const history_t *self, const history_machine_t *machine, const iwc_message_t *event,
                        const int64_t times_us[2]) {
    static char line[IWC_LINE_MAX + 1024U];
    iwn_out_t json;
    iwn_out_init(&json, line, sizeof line);
    iwn_out_open(&json, NULL, '{');
    iwn_out_text(&json, "machine", machine->id);
    iwn_out_int(&json, "wall_us", times_us[0]);
    iwn_out_int(&json, "stored_wall_us", times_us[1]);
    iwn_out_int(&json, "missing_before", (int64_t)machine->missing);
    iwn_out_int(&json, "stops_missing_before", (int64_t)machine->stops_missing);
    iwn_out_bool(&json, "bridge_began_anew", machine->began);
    if (machine->missing > 0U) {
        char cause[128];
        history_cause(machine, cause, sizeof cause);
        iwn_out_text(&json, "missing_cause", cause);
    }
    iwn_out_span(&json, iwn_span("message"), (iwn_span_t){event->text, event->length});
    iwn_out_close(&json, '}');
    (void)fwrite(line, 1, iwn_out_finish(&json), self->out);
}

static bool is_within(const history_t *self, const int64_t times_us[2]) {
    return (times_us[0] >= self->config.since_us && times_us[0] < self->config.until_us) ||
           (times_us[1] >= self->config.since_us && times_us[1] < self->config.until_us);
}

static bool is_before(const history_t *self, const int64_t times_us[2]) {
    return times_us[0] < self->config.since_us && times_us[1] < self->config.since_us;
}

bool history_take(void *context, const char *topic, const char *payload, size_t length, int64_t stored_us) {
    static const char begin[] = "event/";
    history_t *self = context;
    char id[MQTT_ID_SIZE];
    char fault[80];
    const char *what = "";
    iwn_json_t root;
    iwn_text_t words = iwn_text_begin(fault, sizeof fault);
    const bool split = fleet_split(topic, id, &what) && strncmp(what, begin, sizeof begin - 1U) == 0 &&
                       mqtt_settings_is_name(what + sizeof begin - 1U);
    history_machine_t *machine = split ? history_machine(self, id) : NULL;
    if (machine == NULL || !iwn_json_check(payload, length, &self->work, &root, &words) ||
        iwn_json_kind(root) != IWN_JSON_OBJECT) {
        self->garbled++;
        return true;
    }
    const char *name = what + sizeof begin - 1U;
    const bool is_stop = strcmp(name, "stop") == 0;
    const iwc_message_t event = {.text = payload, .length = length, .is_event = true};
    const bool missed = iwc_truth(&event, "missed").value == 1 && iwc_integer(&event, "wall_us").value > 0;
    const int64_t times_us[2] = {iwc_integer(&event, missed ? "wall_us" : "heard_wall_us").value, stored_us};
    if (!note(self, machine, &event, is_stop)) {
        self->doubled++;
        return true;
    }
    if (is_before(self, times_us)) {
        forget_gap(machine);
    }
    if (!is_within(self, times_us) || !(self->config.all || is_stop)) {
        return true;
    }
    if (self->config.json) {
        print_event(self, machine, &event, times_us);
    } else {
        show(self, machine, &event, name, times_us);
    }
    self->missing += machine->missing;
    self->stops_missing += machine->stops_missing;
    forget_gap(machine);
    machine->printed = true;
    self->printed++;
    return ferror(self->out) == 0;
}

void history_sum(const history_t *self, const char *host) {
    char since[HISTORY_TIME_SIZE];
    char until[HISTORY_TIME_SIZE];
    size_t machines = 0;
    for (size_t i = 0; i < self->count; i++) {
        machines += self->machines[i].printed ? 1U : 0U;
    }
    if (self->config.json) {
        (void)fprintf(self->out,
                      "{\"events\":%" PRIu64 ",\"machines\":%zu,\"doubled\":%" PRIu64 ",\"garbled\":%" PRIu64
                      ",\"missing\":%" PRIu64 ",\"stops_missing\":%" PRIu64
                      ",\"end_checked\":%s,\"since_wall_us\":%" PRId64 ",\"until_wall_us\":%" PRId64 "}\n",
                      self->printed, machines, self->doubled, self->garbled, self->missing, self->stops_missing,
                      self->has_info ? "true" : "false", self->config.since_us, self->config.until_us);
        return;
    }
    history_time(self->config.since_us, since);
    history_time(self->config.until_us, until);
    (void)fprintf(self->out, "%" PRIu64 " %s%s of %zu machine%s, %s to %s, from the stream at %s", self->printed,
                  self->config.all ? "event" : "stop", (self->printed == 1U) ? "" : "s", machines,
                  (machines == 1U) ? "" : "s", since, until, host);
    if (self->doubled > 0U) {
        (void)fprintf(self->out, "; %" PRIu64 " duplicates left out", self->doubled);
    }
    if (self->garbled > 0U) {
        (void)fprintf(self->out, "; %" PRIu64 " unreadable", self->garbled);
    }
    if (self->missing + self->stops_missing > 0U) {
        (void)fprintf(self->out, "; MISSING: %" PRIu64 " stops, %" PRIu64 " events of any kind", self->stops_missing,
                      self->missing);
    }
    if (!self->has_info) {
        (void)fputs("; its end is not checked, because no broker answers: later stops may be missing", self->out);
    }
    (void)fputs("\n", self->out);
}
