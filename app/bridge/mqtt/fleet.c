// SPDX-License-Identifier: MIT
#include "fleet.h"

#include "iwheel_northbound/json_out.h"
#include "iwheel_northbound/text.h"

#include <inttypes.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>

bool fleet_open(fleet_t *self) {
    memset(self, 0, sizeof *self);
    self->machines = calloc(FLEET_MACHINES, sizeof *self->machines);
    return self->machines != NULL;
}

void fleet_close(fleet_t *self) {
    free(self->machines);
    self->machines = NULL;
}

/// Returns the row of a machine; adds it in sorted order if it is new. Returns NULL if there are too many.
static fleet_machine_t *machine_of(fleet_t *self, const char *id) {
    size_t place = 0;
    while (place < self->count && strcmp(self->machines[place].id, id) < 0) {
        place++;
    }
    if (place < self->count && strcmp(self->machines[place].id, id) == 0) {
        return &self->machines[place];
    }
    if (self->count == FLEET_MACHINES) {
        return NULL;
    }
    memmove(&self->machines[place + 1U], &self->machines[place], (self->count - place) * sizeof self->machines[0]);
    self->count++;
    self->machines[place] = (fleet_machine_t){.online = false};
    (void)snprintf(self->machines[place].id, sizeof self->machines[place].id, "%s", id);
    return &self->machines[place];
}

void fleet_text(const iwc_message_t *message, const char *path, char *out, size_t size) {
    char raw[IWN_SENTENCE_SIZE];
    if (iwc_text(message, path, raw, sizeof raw)) {
        iwn_plain_copy(raw, out, size);
    } else {
        out[0] = '\0';
    }
}

static void read_contradictions(iwn_json_t root, fleet_machine_t *machine) {
    iwn_json_t assumptions;
    iwn_json_t name;
    iwn_json_t entry;
    iwn_json_t state;
    char word[32];
    size_t used = 0;
    machine->contradicted[0] = '\0';
    if (!iwn_json_find(root, "ledger", &assumptions) || iwn_json_kind(assumptions) != IWN_JSON_OBJECT) {
        return;
    }
    iwn_json_t rest = iwn_json_inside(assumptions);
    while (iwn_json_next(&rest, &name, &entry)) {
        if (iwn_json_kind(entry) == IWN_JSON_OBJECT && iwn_json_find(entry, "state", &state) &&
            iwn_json_is(state, "contradicted") && iwn_json_text(name, word, sizeof word) && iwn_plain_text(word) &&
            used + strlen(word) + 2U < sizeof machine->contradicted) {
            used += (size_t)snprintf(machine->contradicted + used, sizeof machine->contradicted - used, "%s%s",
                                     (used > 0U) ? " " : "", word);
        }
    }
}

static void read_zero(const iwc_message_t *state, const char *side, char out[16]) {
    char path[40];
    (void)snprintf(path, sizeof path, "%s.offset_contaminated", side);
    if (iwc_truth(state, path).value == 1) {
        (void)snprintf(out, 16, "doubted");
        return;
    }
    (void)snprintf(path, sizeof path, "%s.offset_provenance", side);
    fleet_text(state, path, out, 16);
}

static void take_state(fleet_machine_t *machine, const iwc_message_t *state, iwn_json_t root) {
    fleet_text(state, "state", machine->state, sizeof machine->state);
    fleet_text(state, "version", machine->version, sizeof machine->version);
    machine->battery_dV[0] = iwc_integer(state, "left.battery_dV");
    machine->battery_dV[1] = iwc_integer(state, "right.battery_dV");
    read_zero(state, "left", machine->zero[0]);
    read_zero(state, "right", machine->zero[1]);
    read_contradictions(root, machine);
}

/// Stores a last stop. A live event replaces all others; of stored ones, the later one. Its fields have the prefix
/// `path`.
static void take_stop(fleet_machine_t *machine, const iwc_message_t *stop, const char *path, fleet_source_t source) {
    char cause[40];
    char sentence[40];
    char wall_us[40];
    (void)snprintf(cause, sizeof cause, "%scause", path);
    (void)snprintf(sentence, sizeof sentence, "%ssentence", path);
    (void)snprintf(wall_us, sizeof wall_us, "%swall_us", path);
    const int64_t when_us = iwc_integer(stop, wall_us).value;
    char word[sizeof machine->cause];
    fleet_text(stop, cause, word, sizeof word);
    const bool later = machine->stop_from != FLEET_LIVE && when_us > machine->stop_wall_us;
    if (word[0] == '\0' || (source != FLEET_LIVE && machine->stop_from != FLEET_NONE && !later)) {
        return;
    }
    memcpy(machine->cause, word, sizeof word);
    fleet_text(stop, sentence, machine->sentence, sizeof machine->sentence);
    machine->stop_wall_us = when_us;
    machine->stop_from = source;
}

bool fleet_split(const char *topic, char out_id[MQTT_ID_SIZE], const char **out_what) {
    static const char begin[] = "iwheel/";
    const char *slash = (strncmp(topic, begin, sizeof begin - 1U) == 0) ? strchr(topic + sizeof begin - 1U, '/') : NULL;
    const size_t length = (slash != NULL) ? (size_t)(slash - topic) - (sizeof begin - 1U) : 0U;
    if (length == 0U || length >= MQTT_ID_SIZE) {
        return false;
    }
    memcpy(out_id, topic + sizeof begin - 1U, length);
    out_id[length] = '\0';
    *out_what = slash + 1;
    return mqtt_settings_is_name(out_id);
}

/// Returns false and counts the message if it is not a JSON object.
static bool is_object(fleet_t *self, const char *payload, size_t length, iwn_json_t *out_root) {
    char fault[80];
    iwn_text_t words = iwn_text_begin(fault, sizeof fault);
    if (iwn_json_check(payload, length, &self->work, out_root, &words) && iwn_json_kind(*out_root) == IWN_JSON_OBJECT) {
        return true;
    }
    self->left_out++;
    return false;
}

void fleet_take_stored(fleet_t *self, const char *topic, const char *payload, size_t length) {
    char id[MQTT_ID_SIZE];
    const char *what = "";
    iwn_json_t root;
    fleet_machine_t *machine = fleet_split(topic, id, &what) ? machine_of(self, id) : NULL;
    if (machine != NULL && is_object(self, payload, length, &root)) {
        take_stop(machine, &(iwc_message_t){.text = payload, .length = length, .is_event = true}, "", FLEET_STREAM);
    }
}

void fleet_take(fleet_t *self, const char *topic, const char *payload, size_t length, uint64_t now_us) {
    char id[MQTT_ID_SIZE];
    const char *what = "";
    iwn_json_t root;
    fleet_machine_t *machine = fleet_split(topic, id, &what) ? machine_of(self, id) : NULL;
    if (machine == NULL) {
        self->left_out++;
        return;
    }
    if (strcmp(what, "availability") == 0) {
        machine->online = length == 6U && memcmp(payload, "online", 6) == 0;
        return;
    }
    if (!is_object(self, payload, length, &root)) {
        return;
    }
    const iwc_message_t message = {.text = payload, .length = length, .is_event = true};
    if (strcmp(what, "info") == 0) { // Retained, so it does not show that the machine is online.
        take_stop(machine, &message, "last_stop.", FLEET_INFO);
        return;
    }
    machine->received_us = now_us;
    if (strcmp(what, "state") == 0) {
        take_state(machine, &message, root);
    } else if (strcmp(what, "event/stop") == 0) {
        take_stop(machine, &message, "", FLEET_LIVE);
    }
}

static void show_battery(iwc_value_t value, FILE *out) {
    if (value.known) {
        (void)fprintf(out, " %4" PRId64 ".%" PRId64, value.value / 10,
                      (value.value < 0) ? -(value.value % 10) : value.value % 10);
    } else {
        (void)fprintf(out, " %6s", "--");
    }
}

static const char *or_unknown(const char *text) {
    return (text[0] != '\0') ? text : "--";
}

static void show_time(int64_t wall_us, FILE *out) {
    char text[32] = "--";
    const time_t seconds = (time_t)(wall_us / 1000000);
    struct tm parts;
    if (wall_us > 0 && localtime_r(&seconds, &parts) != NULL) {
        (void)strftime(text, sizeof text, "%m-%d %H:%M:%S", &parts);
    }
    (void)fprintf(out, " %-14s", text);
}

/// An assumption and the number of machines that contradict it.
typedef struct {
    char word[32];
    unsigned machines;
} tally_t;

static void count_item(tally_t tallies[FLEET_ITEMS], const char *word) {
    for (size_t i = 0; i < FLEET_ITEMS; i++) {
        if (tallies[i].machines == 0U || strcmp(tallies[i].word, word) == 0) {
            (void)snprintf(tallies[i].word, sizeof tallies[i].word, "%s", word);
            tallies[i].machines++;
            return;
        }
    }
}

static void show_contradictions(const fleet_t *self, FILE *out) {
    tally_t tallies[FLEET_ITEMS] = {{.machines = 0}};
    for (size_t i = 0; i < self->count; i++) {
        char words[sizeof self->machines[i].contradicted];
        char *place = NULL;
        memcpy(words, self->machines[i].contradicted, sizeof words);
        for (char *word = strtok_r(words, " ", &place); word != NULL; word = strtok_r(NULL, " ", &place)) {
            count_item(tallies, word);
        }
    }
    for (size_t i = 0; i < FLEET_ITEMS && tallies[i].machines > 0U; i++) {
        (void)fprintf(out, "contradicted: %s on %u of %zu\n", tallies[i].word, tallies[i].machines, self->count);
    }
}

void fleet_show(const fleet_t *self, uint64_t now_us, FILE *out) {
    size_t online = 0;
    (void)now_us;
    (void)fprintf(out, "%-20s %-8s %-10s %6s %6s %-10s %-10s %-9s %-14s %s\n", "machine", "there", "state", "V left",
                  "right", "zero left", "right", "version", " last stop", "cause");
    for (size_t i = 0; i < self->count; i++) {
        const fleet_machine_t *machine = &self->machines[i];
        online += machine->online ? 1U : 0U;
        (void)fprintf(out, "%-20s %-8s %-10s", machine->id, machine->online ? "online" : "offline",
                      machine->online ? or_unknown(machine->state) : "--");
        for (size_t side = 0; side < 2U; side++) { // The current charge of an offline machine is unknown.
            show_battery(machine->online ? machine->battery_dV[side] : (iwc_value_t){.known = false}, out);
        }
        (void)fprintf(out, " %-10s %-10s %-9s", or_unknown(machine->zero[0]), or_unknown(machine->zero[1]),
                      or_unknown(machine->version));
        show_time(machine->stop_wall_us, out);
        (void)fprintf(out, " %s\n", or_unknown(machine->cause));
    }
    (void)fprintf(out, "%zu machine%s, %zu online", self->count, (self->count == 1U) ? "" : "s", online);
    if (self->left_out > 0U) {
        (void)fprintf(out, "; %" PRIu64 " messages left out", self->left_out);
    }
    (void)fputs("\n", out);
    show_contradictions(self, out);
    if (self->stream != NULL) {
        (void)fprintf(out, "last stops: from the stream at %s, from each machine's info, and from received events\n",
                      self->stream);
    } else {
        (void)fputs("last stops: from each machine's info, which has none from before its bridge started, and from "
                    "received events\n",
                    out);
    }
}

static const char *source_word(fleet_source_t source) {
    static const char *const words[] = {NULL, "info", "stream", "heard"};
    return words[source];
}

#define ROW_SIZE (2U * IWN_SENTENCE_SIZE + 1280U)

/// Writes one machine as a JSON object. Returns its length, without a newline.
static size_t write_row(const fleet_machine_t *machine, uint64_t now_us, char line[ROW_SIZE]) {
    iwn_out_t json;
    iwn_out_init(&json, line, ROW_SIZE);
    iwn_out_open(&json, NULL, '{');
    iwn_out_text(&json, "machine", machine->id);
    iwn_out_bool(&json, "online", machine->online);
    iwn_out_text(&json, "state", (machine->state[0] != '\0') ? machine->state : NULL);
    iwn_out_text(&json, "version", (machine->version[0] != '\0') ? machine->version : NULL);
    iwn_out_known(&json, "left_battery_dV", machine->battery_dV[0].known, machine->battery_dV[0].value);
    iwn_out_known(&json, "right_battery_dV", machine->battery_dV[1].known, machine->battery_dV[1].value);
    iwn_out_text(&json, "left_zero", (machine->zero[0][0] != '\0') ? machine->zero[0] : NULL);
    iwn_out_text(&json, "right_zero", (machine->zero[1][0] != '\0') ? machine->zero[1] : NULL);
    iwn_out_text(&json, "cause", (machine->cause[0] != '\0') ? machine->cause : NULL);
    iwn_out_known(&json, "stop_wall_us", machine->stop_wall_us > 0, machine->stop_wall_us);
    iwn_out_text(&json, "sentence", (machine->sentence[0] != '\0') ? machine->sentence : NULL);
    iwn_out_text(&json, "stop_from", source_word(machine->stop_from));
    iwn_out_text(&json, "contradicted", machine->contradicted);
    iwn_out_known(&json, "heard_ms", machine->received_us > 0U, (int64_t)((now_us - machine->received_us) / 1000U));
    iwn_out_close(&json, '}');
    const size_t length = iwn_out_finish(&json);
    return (length > 0U) ? length - 1U : 0U;
}

void fleet_print(const fleet_t *self, uint64_t now_us, FILE *out) {
    char line[ROW_SIZE];
    for (size_t i = 0; i < self->count; i++) {
        (void)fprintf(out, "%.*s\n", (int)write_row(&self->machines[i], now_us, line), line);
    }
}

void fleet_write(const fleet_t *self, uint64_t now_us, int64_t wall_us, FILE *out) {
    char line[ROW_SIZE];
    (void)fprintf(out, "{\"ok\":true,\"wall_us\":%" PRId64 ",\"stream\":%s,\"left_out\":%" PRIu64 ",\"machines\":[",
                  wall_us, (self->stream != NULL) ? "true" : "false", self->left_out);
    for (size_t i = 0; i < self->count; i++) {
        const int length = (int)write_row(&self->machines[i], now_us, line);
        (void)fprintf(out, "%s%.*s", (i > 0U) ? ",\n" : "\n", length, line);
    }
    (void)fputs("]}\n", out);
}
