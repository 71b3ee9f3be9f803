// SPDX-License-Identifier: MIT
#include "replay.h"

#include "text/ctl_text.h"

#include "iwheel_northbound/why.h"
#include "iwheel_northbound/words.h"

#include <ctype.h>
#include <inttypes.h>
#include <jansson.h>
#include <stdarg.h>
#include <stddef.h>
#include <string.h>

#define TEXT_SIZE 1024U

static void put_object(const replay_out_t *out, json_t *object) {
    (void)json_dumpf(object, out->file, JSON_COMPACT);
    (void)fputc('\n', out->file);
    json_decref(object);
}

/// Writes the name of an event: "stop asked" becomes stop_asked.
static void name_event(const char *what, char out_name[16]) {
    size_t i = 0;
    for (; what[i] != '\0' && i < 15U; i++) {
        const bool letter = isalpha((unsigned char)what[i]) != 0;
        out_name[i] = letter ? (char)tolower((unsigned char)what[i]) : '_';
    }
    out_name[i] = '\0';
}

__attribute__((format(printf, 4, 5))) static void report(const replay_t *self, iw_time_us_t at_us, const char *what,
                                                         const char *format, ...) {
    char text[TEXT_SIZE];
    char event[16];
    va_list list;
    if (self->quiet) {
        return;
    }
    const iw_time_us_t since_us = (at_us > self->zero_us) ? at_us - self->zero_us : 0U;
    va_start(list, format);
    (void)vsnprintf(text, sizeof text, format, list);
    va_end(list);
    name_event(what, event);
    if (self->out.samples_us > 0U) {
        replay_samples_event(self, at_us, event, text);
    } else if (self->out.json) {
        put_object(&self->out, json_pack("{s:I,s:s,s:s}", "t_us", (json_int_t)since_us, "event", event, "text", text));
    } else {
        (void)fprintf(self->out.file, "%6" PRIu64 ".%06" PRIu64 "  %-10s ", since_us / 1000000U, since_us % 1000000U,
                      what);
        text_line(self->out.file, "%s", text); // Names in it come from the recording.
    }
}

void replay_note(const replay_out_t *out, const char *format, ...) {
    char text[TEXT_SIZE];
    va_list list;
    va_start(list, format);
    (void)vsnprintf(text, sizeof text, format, list);
    va_end(list);
    if (out->samples_us > 0U) {
        text_line(stderr, "iwheelctl: %s", text); // A table has no remarks.
        return;
    }
    if (out->json) {
        put_object(out, json_pack("{s:s,s:s}", "event", "note", "text", text));
    } else {
        text_line(out->file, "# %s", text);
    }
}

static void report_wheels(replay_t *self, const iw_snapshot_t *seen) {
    for (unsigned side = 0; side < IW_SIDES; side++) {
        const bool online = seen->wheel[side].heard;
        const iw_force_validity_t force = iw_snapshot_force_validity(seen, (iw_side_t)side);
        if (online != self->online[side]) {
            report(self, self->now_us, "wheel", "%s %s", text_side(side), online ? "online" : "offline");
            self->online[side] = online;
        }
        if (force != self->force[side]) {
            report(self, self->now_us, "force", "%s: %s", text_side(side), iwn_force_validity_name(force));
            self->force[side] = force;
        }
    }
}

static void report_assumptions(replay_t *self, const iw_snapshot_t *seen) {
    for (unsigned item = 0; item < IW_ASSUMPTION_ITEMS; item++) {
        const iw_assumption_entry_t *entry = &seen->assumed[item];
        if (entry->state != self->assumptions[item].state) {
            report(self, self->now_us, "assumption", "%s: %s by the %s (figure %" PRId32 ")",
                   iwn_assumption_item_name((iw_assumption_item_t)item), iwn_assumption_state_name(entry->state),
                   iwn_source_name(entry->source), entry->figure);
        }
        self->assumptions[item] = *entry;
    }
}

static void report_causes(replay_t *self, uint32_t present) {
    for (unsigned cause = 0; cause < IW_CAUSES; cause++) {
        if (((present ^ self->present) & (1U << cause)) != 0U) {
            report(self, self->now_us, "fault", "%s%s", iwn_cause_name((iw_cause_t)cause),
                   ((present & (1U << cause)) != 0U) ? "" : " is gone");
        }
    }
    self->present = present;
}

static void report_stop(replay_t *self, const iw_stop_t *stop) {
    char sentence[IWN_SENTENCE_SIZE];
    char client[32];
    if (stop->number == self->stop_number) {
        return;
    }
    const iw_client_t who = (stop->cause == IW_CAUSE_ESTOP_SOFTWARE) ? stop->detail : stop->client;
    (void)snprintf(client, sizeof client, "client %u", (unsigned)who);
    const iwn_why_context_t context = {.client = client, .estop = self->estop_name, .bus = self->bus_name};
    iwn_why_sentence(stop, &context, sentence, sizeof sentence);
    report(self, self->now_us, "stop", "%u: %s: %s", (unsigned)stop->number, iwn_cause_name(stop->cause), sentence);
    self->stop_number = stop->number;
    self->drive_client = IW_CLIENT_NONE;
}

static void report_arming(replay_t *self, const iw_snapshot_t *seen) {
    if (self->arming && !seen->arming && seen->state != IW_STATE_ARMED) {
        report(self, self->now_us, "arm", "refused: %s", iwn_error_name(iwn_error_of(seen->arm_refusal)));
    }
    self->arming = seen->arming;
}

static void report_state(replay_t *self, iw_state_t state) {
    if (state != self->state) {
        report(self, self->now_us, "state", "%s", iwn_state_name(state));
        self->state = state;
        self->drive_client = IW_CLIENT_NONE;
    }
}

void replay_report_step(replay_t *self) {
    const iw_snapshot_t seen = replay_snapshot(self);
    report_wheels(self, &seen);
    report_assumptions(self, &seen);
    report_causes(self, seen.present);
    report_stop(self, seen.stop);
    report_arming(self, &seen);
    report_state(self, seen.state);
}

static void report_drive(replay_t *self, const blackbox_entry_t *entry, const char *result) {
    const blackbox_drive_t *drive = &entry->as.drive;
    const bool same = self->drive_client == entry->number && self->drive_refusal == entry->b &&
                      memcmp(self->drive.speed_mm_s, drive->speed_mm_s, sizeof drive->speed_mm_s) == 0 &&
                      memcmp(self->drive.current_mA, drive->current_mA, sizeof drive->current_mA) == 0;
    if (same) {
        return;
    }
    report(self, entry->at_us, "drive", "client %u: left %" PRId32 " mm/s, right %" PRId32 " mm/s: %s",
           (unsigned)entry->number, drive->speed_mm_s[IW_LEFT], drive->speed_mm_s[IW_RIGHT], result);
    self->drive = *drive;
    self->drive_client = entry->number;
    self->drive_refusal = entry->b;
}

void replay_report_request(replay_t *self, const blackbox_entry_t *entry, iw_refusal_t refusal) {
    char result[96];
    const char *name = (refusal == IW_REFUSE_NONE) ? "accepted" : iwn_error_name(iwn_error_of(refusal));
    const bool same = (uint8_t)refusal == entry->b || entry->kind == (uint8_t)BLACKBOX_TARE;
    (void)snprintf(result, sizeof result, "%s%s%s%s", name, same ? "" : " (when it was recorded: ",
                   same                                    ? ""
                   : (entry->b == (uint8_t)IW_REFUSE_NONE) ? "accepted"
                                                           : iwn_error_name(iwn_error_of((iw_refusal_t)entry->b)),
                   same ? "" : ")");
    switch (entry->kind) {
    case BLACKBOX_DRIVE:
        report_drive(self, entry, result);
        break;
    case BLACKBOX_ARM:
        report(self, entry->at_us, "arm", "client %u%s: %s", (unsigned)entry->number,
               (entry->a != 0U) ? ", takeover" : "", result);
        break;
    case BLACKBOX_RESET:
        report(self, entry->at_us, "reset", "client %u: %s", (unsigned)entry->number, result);
        break;
    case BLACKBOX_RELEASE:
        report(self, entry->at_us, "release", "client %u: %s", (unsigned)entry->number, result);
        break;
    case BLACKBOX_STOP:
        report(self, entry->at_us, "stop asked", "%s", iwn_cause_name((iw_cause_t)entry->a));
        break;
    case BLACKBOX_TARE:
        report(self, entry->at_us, "tare", "%s", text_side((entry->a == (uint8_t)IW_RIGHT) ? IW_RIGHT : IW_LEFT));
        break;
    default:
        report(self, entry->at_us, "estop", "client %u", (unsigned)entry->number);
        break;
    }
}

void replay_report_answer(const replay_t *self, const blackbox_entry_t *entry) {
    switch (entry->kind) {
    case BLACKBOX_ESTOP:
        if ((int)entry->as.value != self->estop) {
            report(self, entry->at_us, "e-stop", "%s", iwn_estop_name((int)entry->as.value, true));
        }
        break;
    case BLACKBOX_BUS:
        if ((iw_bus_state_t)entry->a != self->bus) {
            report(self, entry->at_us, "bus", "%s", iwn_bus_state_name((iw_bus_state_t)entry->a));
        }
        break;
    default:
        report(self, entry->at_us, "machine", "was suspended for %" PRId64 " ms", entry->as.value / 1000);
        break;
    }
}

void replay_report_difference(const replay_t *self, const blackbox_entry_t *entry) {
    if (entry->kind == (uint8_t)BLACKBOX_STATE) {
        report(self, entry->at_us, "DIFFERENT", "state %s, when it was recorded %s",
               iwn_state_name(iw_gateway_state(&self->gateway)), iwn_state_name((iw_state_t)entry->a));
    } else {
        const iw_stop_t *stop = replay_snapshot(self).stop;
        report(self, entry->at_us, "DIFFERENT", "last stop %s (%u), when it was recorded %s (%" PRId64 ")",
               iwn_cause_name(stop->cause), (unsigned)stop->detail, iwn_cause_name((iw_cause_t)entry->a),
               entry->as.value);
    }
}

static const struct {
    const char *name;
    const char *what;
    size_t offset;
} scores[] = {
    {"setpoints", "setpoints on the bus", offsetof(replay_t, setpoints)},
    {"requests", "answers to requests", offsetof(replay_t, requests)},
    {"states", "changes of state", offsetof(replay_t, states)},
    {"stops", "stops", offsetof(replay_t, stops)},
};
#define SCORES (sizeof scores / sizeof scores[0])

static replay_score_t score_of(const replay_t *self, size_t number) {
    replay_score_t score;
    memcpy(&score, (const char *)self + scores[number].offset, sizeof score);
    return score;
}

static void sum_up_as_json(const replay_t *self) {
    json_t *compared = json_object();
    for (size_t i = 0; i < SCORES; i++) {
        const replay_score_t score = score_of(self, i);
        (void)json_object_set_new(
            compared, scores[i].name,
            json_pack("{s:I,s:I}", "same", (json_int_t)score.same, "different", (json_int_t)score.different));
    }
    put_object(&self->out,
               json_pack("{s:s,s:s,s:I,s:I,s:I,s:o}", "event", "summary", "state",
                         iwn_state_name(iw_gateway_state(&self->gateway)), "stops",
                         (json_int_t)replay_snapshot(self).stop->number, "frames", (json_int_t)self->total_frames,
                         "setpoint_frames", (json_int_t)self->total_sent, "as_recorded", compared));
}

void replay_finish(const replay_t *self) {
    if (self->out.samples_us > 0U) {
        return;
    }
    if (self->out.json) {
        sum_up_as_json(self);
        return;
    }
    const uint32_t stops = replay_snapshot(self).stop->number;
    replay_note(&self->out, "end: %s, %u stop%s, %" PRIu64 " frames in, %" PRIu64 " setpoint frames out",
                iwn_state_name(iw_gateway_state(&self->gateway)), (unsigned)stops, (stops == 1U) ? "" : "s",
                self->total_frames, self->total_sent);
    for (size_t i = 0; i < SCORES; i++) {
        const replay_score_t score = score_of(self, i);
        if (score.same + score.different > 0U) {
            replay_note(&self->out, "%s: %" PRIu64 " of %" PRIu64 " as recorded", scores[i].what, score.same,
                        score.same + score.different);
        }
    }
}
