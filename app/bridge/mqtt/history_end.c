// SPDX-License-Identifier: MIT
// Events that the stream lacks at its end, by the `info` of the machines, and the cause.
#include "history.h"

#include "iwheel_northbound/json_out.h"

#include <inttypes.h>
#include <string.h>

static uint64_t count_of(const iwc_message_t *info, const char *path) {
    const iwc_value_t value = iwc_integer(info, path);
    return (value.known && value.value > 0) ? (uint64_t)value.value : 0U;
}

void history_take_info(history_t *self, const char *topic, const char *payload, size_t length) {
    char id[MQTT_ID_SIZE];
    char fault[80];
    const char *what = "";
    iwn_json_t root;
    iwn_text_t words = iwn_text_begin(fault, sizeof fault);
    const bool is_info = fleet_split(topic, id, &what) && strcmp(what, "info") == 0 && length > 0U;
    if (!is_info || !iwn_json_check(payload, length, &self->work, &root, &words) ||
        iwn_json_kind(root) != IWN_JSON_OBJECT) {
        return;
    }
    history_machine_t *machine = history_machine(self, id);
    const iwc_message_t message = {.text = payload, .length = length, .is_event = true};
    if (machine != NULL) {
        machine->info = (history_info_t){.known = true,
                                         .stop = (int64_t)count_of(&message, "last_stop.number"),
                                         .stop_wall_us = (int64_t)count_of(&message, "last_stop.wall_us"),
                                         .last = count_of(&message, "events.last"),
                                         .waiting = count_of(&message, "events.waiting"),
                                         .dropped = count_of(&message, "events.dropped")};
        fleet_text(&message, "boot", machine->info.boot, sizeof machine->info.boot);
    }
}

/// Returns the number of stops that its `info` counts and the stream does not have, as far as they may lie in the span.
static uint64_t stops_behind(const history_t *self, const history_machine_t *machine) {
    const history_info_t *info = &machine->info;
    const bool later = machine->stop_wall_us > 0 && info->stop_wall_us > machine->stop_wall_us;
    if (info->stop == 0 || (info->stop_wall_us > 0 && info->stop_wall_us < self->config.since_us) ||
        machine->stop_wall_us >= self->config.until_us) {
        return 0;
    }
    if (machine->stop == 0) { // The stream has no stop: at least this one is missing.
        return (info->stop_wall_us < self->config.until_us) ? 1U : 0U;
    }
    if (info->stop > machine->stop) {
        return (uint64_t)(info->stop - machine->stop);
    }
    return later ? (uint64_t)info->stop : 0U; // The gateway restarted and counts from one.
}

/// Returns the same for events. The number of an event never restarts.
static uint64_t events_behind(const history_t *self, const history_machine_t *machine) {
    const uint64_t there = machine->number + machine->info.waiting;
    return (machine->number > 0U && machine->info.last > there && machine->event_us < self->config.until_us)
               ? machine->info.last - there
               : 0U;
}

/// Writes why events may be missing, as far as the machine knows.
void history_cause(const history_machine_t *machine, char *out, size_t size) {
    const history_info_t *info = &machine->info;
    if (!info->known || strcmp(info->boot, machine->runs[machine->run].boot) != 0) {
        (void)snprintf(out, size, "dropped from its full spool, or confirmed by the broker and not stored");
    } else if (info->dropped == 0U) {
        (void)snprintf(out, size, "the broker confirmed them and did not store them; its spool dropped none");
    } else {
        (void)snprintf(out, size, "its full spool dropped %" PRIu64 " events; the broker did not store the others",
                       info->dropped);
    }
}

/// Prints up to three lines about one machine.
static void show_end(const history_t *self, const history_machine_t *machine, uint64_t events, uint64_t stops) {
    char words[256];
    char when[HISTORY_TIME_SIZE];
    char cause[128];
    history_time(machine->info.stop_wall_us, when);
    history_cause(machine, cause, sizeof cause);
    if (stops > 0U) {
        (void)snprintf(words, sizeof words,
                       "stops after its last one here are not in the stream; its info names stop %" PRId64
                       " of %s; to list its recordings: iwheel-fleet recordings ID",
                       machine->info.stop, when);
        history_note(self, machine, stops, words);
    }
    if (events > 0U) {
        (void)snprintf(words, sizeof words, "events after its last one here are not in the stream: %s", cause);
        history_note(self, machine, events, words);
    }
    if (machine->info.waiting > 0U) {
        history_note(self, machine, machine->info.waiting, "events wait at the machine and may still come");
    }
}

static void print_end(const history_t *self, const history_machine_t *machine, uint64_t events, uint64_t stops) {
    char line[512];
    char cause[128];
    iwn_out_t json;
    history_cause(machine, cause, sizeof cause);
    iwn_out_init(&json, line, sizeof line);
    iwn_out_open(&json, NULL, '{');
    iwn_out_text(&json, "machine", machine->id);
    iwn_out_int(&json, "missing_after", (int64_t)events);
    iwn_out_int(&json, "stops_missing_after", (int64_t)stops);
    iwn_out_known(&json, "info_stop", machine->info.stop > 0, machine->info.stop);
    iwn_out_known(&json, "info_stop_wall_us", machine->info.stop_wall_us > 0, machine->info.stop_wall_us);
    iwn_out_int(&json, "waiting", (int64_t)machine->info.waiting);
    iwn_out_text(&json, "missing_cause", cause);
    iwn_out_close(&json, '}');
    (void)fwrite(line, 1, iwn_out_finish(&json), self->out);
}

void history_end(history_t *self) {
    for (size_t i = 0; i < self->count; i++) {
        const history_machine_t *machine = &self->machines[i];
        const bool selected = self->config.machine == NULL || strcmp(self->config.machine, machine->id) == 0;
        const uint64_t events = machine->missing + events_behind(self, machine);
        const uint64_t stops = machine->stops_missing + stops_behind(self, machine);
        if (!selected || events + stops == 0U) {
            continue;
        }
        self->missing += events;
        self->stops_missing += stops;
        if (self->config.json) {
            print_end(self, machine, events, stops);
        } else {
            show_end(self, machine, events, stops);
        }
    }
}
