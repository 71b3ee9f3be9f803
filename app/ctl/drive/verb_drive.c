// SPDX-License-Identifier: MIT
// The only verb that moves wheels.
//
//     arm --> drive every lease_ms / 3 --> stop --> wait until zero and at standstill
//                |  time over, signal, refusal, gateway without answer or gone
//                '-------------------------------------------^
//
// The program arms once and never again: whatever ends the lease ends the program. Only if arm is refused because the
// wheels are not at standstill yet, it waits and tries again, for one second at most. A stop of any client in the
// meantime ends the wait.
#include "drive_words.h"
#include "talk/ctl.h"
#include "text/ctl_text.h"

#include <stdio.h>
#include <string.h>

/// If no reply to a drive command arrives for this time, the gateway hangs.
#define SILENT_US 1000000
/// The wheels must be at standstill at this time after the stop: the longest hold of the gateway.
#define REST_US 10000000
#define POLL_US 50000
/// Time for which the gateway refuses the next arm (stale_command).
#define FRESH_US 520000
/// Time for which the wheels may count as turning, after a stop that has just ended or a short stall of the machine.
#define ARM_PATIENCE_US 1000000
/// Range of the lease that the gateway may grant; another value counts as the shortest.
#define LEASE_MIN_MS 20
#define LEASE_MAX_MS 500
/// Without telemetry a wheel is not known to be at standstill. The program waits this time for telemetry.
#define OFFLINE_US 2000000

typedef enum { END_NONE = 0, END_TIME, END_SIGNAL, END_REFUSED, END_SILENT, END_LOST } end_t;

typedef struct {
    ctl_t *ctl;
    drive_words_t words;
    json_t *first; ///< Snapshot at the beginning of the drive, and the last one.
    json_t *latest;
    int64_t lease_us;
    int64_t begin_us; ///< Time when the first drive command was accepted; 0 if none was.
    int64_t next_us;
    int64_t sent_us;     ///< Time when the last drive command was sent.
    int64_t answered_us; ///< Time of the last reply.
    long long applied[2];
    bool limited;
    unsigned live;       ///< Columns for the progress; 0 with --json, or if stdout is not a suitable terminal.
    char last_line[512]; ///< With --json: the last reply to a drive command.
} drive_t;

static void retain(json_t **slot, json_t *snapshot) {
    json_decref(*slot);
    *slot = json_incref(snapshot);
}

static const char *speed_of(const json_t *snapshot, const char *side, char out[TEXT_CELL]) {
    text_integer(json_object_get(json_object_get(snapshot, side), "speed_mm_s"), "", out);
    return out;
}

static double driven_s(const drive_t *self, int64_t now_us) {
    return (self->begin_us > 0) ? (double)(now_us - self->begin_us) / 1e6 : 0.0;
}

static void show_progress(const drive_t *self, int64_t now_us) {
    char left[TEXT_CELL];
    char right[TEXT_CELL];
    char line[256];
    if (self->live > 0U) {
        (void)snprintf(line, sizeof line, "driving %lld/%lld mm/s%s   measured %s/%s mm/s   %.1f s of %.1f s",
                       self->applied[0], self->applied[1], self->limited ? " (limited)" : "",
                       speed_of(self->latest, "left", left), speed_of(self->latest, "right", right),
                       driven_s(self, now_us), (double)self->words.time_ms / 1e3);
        (void)printf("\r\033[K%.*s", (int)self->live, line);
        (void)fflush(stdout);
    }
}

static void clear_progress(const drive_t *self) {
    if (self->live > 0U) {
        (void)fputs("\r\033[K", stdout);
        (void)fflush(stdout);
    }
}

static iwc_result_t send_drive(drive_t *self, int64_t now_us) {
    int64_t id = 0;
    const drive_words_t *words = &self->words;
    json_t *request = json_pack("{s:s,s:i,s:i}", "cmd", "drive", "left_mm_s", words->speed_mm_s[0], "right_mm_s",
                                words->speed_mm_s[1]);
    if (words->has_current) {
        (void)json_object_set_new(request, "left_mA", json_integer(words->current_mA[0]));
        (void)json_object_set_new(request, "right_mA", json_integer(words->current_mA[1]));
    }
    const int64_t period_us = self->lease_us / 3;
    self->next_us += period_us;
    if (self->next_us <= now_us) {
        self->next_us = now_us + period_us; // Late: missed commands are not sent in a burst.
    }
    const iwc_result_t result = client_send(&self->ctl->client, request, now_us, &id);
    if (result == IWC_FULL) {
        return IWC_OK; // The gateway does not read: this command is dropped, and SILENT_US ends the drive.
    }
    self->sent_us = now_us;
    return result;
}

static end_t take_line(drive_t *self, json_t *line, int64_t now_us) {
    const json_t *ok = json_object_get(line, "ok");
    if (ok == NULL) {
        if (strcmp(text_word(line, "event"), "state") == 0) {
            retain(&self->latest, line);
            show_progress(self, now_us);
        }
        return END_NONE;
    }
    (void)snprintf(self->last_line, sizeof self->last_line, "%s", self->ctl->client.line);
    // Replaced or lost on a serial line: the command did not renew the lease, but the next one may while the lease
    // lives. Otherwise SILENT_US ends the drive.
    if (!json_is_true(ok) && self->begin_us > 0 && strcmp(text_word(line, "error"), "stale_command") == 0) {
        return END_NONE;
    }
    if (!json_is_true(ok)) {
        clear_progress(self);
        (void)ctl_refused(line);
        return END_REFUSED;
    }
    if (self->begin_us == 0) {
        self->begin_us = now_us;
        retain(&self->first, self->latest);
    }
    self->answered_us = now_us;
    self->limited = self->limited || json_is_true(json_object_get(line, "limited"));
    self->applied[0] = json_integer_value(json_object_get(line, "left_mm_s"));
    self->applied[1] = json_integer_value(json_object_get(line, "right_mm_s"));
    return END_NONE;
}

static end_t end_of(const drive_t *self, iwc_result_t result) {
    if (result == IWC_INTERRUPTED) {
        return END_SIGNAL;
    }
    if (result != IWC_OK && result != IWC_TIMEOUT) {
        clear_progress(self);
        (void)ctl_lost(result);
        return END_LOST;
    }
    return END_NONE;
}

/// Sends the command until something ends the drive.
static end_t run(drive_t *self) {
    end_t end = END_NONE;
    self->next_us = client_now_us();
    self->answered_us = self->next_us;
    while (end == END_NONE) {
        const int64_t now_us = client_now_us();
        const int64_t end_us = (self->begin_us > 0) ? self->begin_us + (int64_t)self->words.time_ms * 1000 : INT64_MAX;
        iwc_result_t result = IWC_OK;
        json_t *line = NULL;
        if (now_us >= end_us) {
            return END_TIME;
        }
        if (now_us - self->answered_us > SILENT_US) {
            return END_SILENT;
        }
        if (now_us >= self->next_us) {
            result = send_drive(self, now_us);
        }
        if (result == IWC_OK) {
            result = client_receive(&self->ctl->client, (self->next_us < end_us) ? self->next_us : end_us, &line);
        }
        end = (line != NULL) ? take_line(self, line, client_now_us()) : end_of(self, result);
        json_decref(line);
    }
    return end;
}

static bool is_at_standstill(const json_t *wheel) {
    const json_t *applied = json_object_get(wheel, "applied_mm_s");
    const bool zero = json_is_null(applied) || (json_is_integer(applied) && json_integer_value(applied) == 0);
    return zero && json_is_true(json_object_get(wheel, "at_rest"));
}

static bool both_online(const json_t *status) {
    return json_is_true(json_object_get(json_object_get(status, "left"), "heard")) &&
           json_is_true(json_object_get(json_object_get(status, "right"), "heard"));
}

static bool both_stand(const json_t *status) {
    const char *state = text_word(status, "state");
    return strcmp(state, "armed") != 0 && is_at_standstill(json_object_get(status, "left")) &&
           is_at_standstill(json_object_get(status, "right"));
}

/// Asks as ctl_ask does, without printing the line of the reply.
static int ask_quietly(const drive_t *self, json_t *request, json_t **out_reply) {
    const bool json = self->ctl->json;
    self->ctl->json = false;
    const int code = ctl_ask(self->ctl, request, out_reply);
    self->ctl->json = json;
    return code;
}

/// Reads the snapshot. Returns an exit code.
static int read_status(drive_t *self) {
    json_t *status = NULL;
    const int code = ask_quietly(self, json_pack("{s:s}", "cmd", "status"), &status);
    if (code == CTL_OK) {
        retain(&self->latest, status);
    }
    json_decref(status);
    return code;
}

/// Waits until both wheels are at standstill and the next drive is not refused because of this one. Another signal ends
/// the wait.
static int wait_for_rest(drive_t *self) {
    const int64_t begin_us = client_now_us();
    const int64_t fresh_us = self->sent_us + ((self->lease_us > FRESH_US) ? self->lease_us : FRESH_US);
    for (;;) {
        json_t *event = NULL;
        const int code = read_status(self);
        if (code != CTL_OK) {
            return code;
        }
        const int64_t now_us = client_now_us();
        if (both_stand(self->latest) && now_us >= fresh_us) {
            return CTL_OK;
        }
        if (!both_online(self->latest) && now_us >= begin_us + OFFLINE_US) {
            return ctl_fail(CTL_NO, "stopped, but a wheel is offline, so it may still turn; see: iwheelctl status");
        }
        if (now_us >= begin_us + REST_US) {
            return ctl_fail(CTL_TIMEOUT, "a wheel still turns 10 s after the stop; see: iwheelctl status");
        }
        while (client_receive(&self->ctl->client, now_us + POLL_US, &event) == IWC_OK) {
            json_decref(event);
        }
        if (signals_count() != self->ctl->client.seen_signals) {
            return ctl_fail(CTL_NO,
                            "interrupted before both wheels were at standstill; the gateway continues to stop them");
        }
    }
}

/// Returns true if both snapshots count from the same beginning: a wheel that rebooted in between has lost its count.
static bool counted_through(const json_t *first, const json_t *latest) {
    const json_t *before = json_object_get(first, "reboots");
    return json_is_integer(before) && json_equal(before, json_object_get(latest, "reboots")) == 1;
}

/// Writes the distance in metres that a wheel moved between both snapshots.
static void way_of(const drive_t *self, const char *side, char out[TEXT_CELL]) {
    const json_t *first = json_object_get(self->first, side);
    const json_t *latest = json_object_get(self->latest, side);
    const json_t *from = json_object_get(first, "distance_mm");
    const json_t *to = json_object_get(latest, "distance_mm");
    if (!counted_through(first, latest)) {
        (void)snprintf(out, TEXT_CELL, "unknown");
    } else if (json_is_integer(from) && json_is_integer(to)) {
        text_number(json_integer_value(to) - json_integer_value(from), 3, "m", out);
    } else {
        (void)snprintf(out, TEXT_CELL, "--");
    }
}

static void sum_up(const drive_t *self, int64_t stop_us) {
    char left[TEXT_CELL];
    char right[TEXT_CELL];
    way_of(self, "left", left);
    way_of(self, "right", right);
    (void)printf("drove %lld/%lld mm/s%s for %.1f s and stopped: left %s, right %s\n", self->applied[0],
                 self->applied[1], self->limited ? " (limited)" : "", driven_s(self, stop_us), left, right);
}

/// Reports the cause of the last stop: a refusal during a drive only reports a consequence of the stop.
static void report_why(const drive_t *self) {
    json_t *reply = NULL;
    if (ask_quietly(self, json_pack("{s:s}", "cmd", "why"), &reply) == CTL_OK) {
        (void)ctl_fail(CTL_NO, "the last stop: %s", text_word(reply, "sentence"));
    }
    json_decref(reply);
}

/// Reports how the drive ended, once both wheels are at standstill. Returns the exit code.
static int judge(const drive_t *self, end_t end, int64_t stop_us) {
    if (!self->ctl->json) {
        sum_up(self, stop_us);
    }
    if (end == END_REFUSED && self->begin_us > 0) {
        report_why(self);
    }
    if (end == END_SILENT) {
        return ctl_fail(CTL_TIMEOUT, "the gateway did not answer a drive command for 1 s; see its log");
    }
    if (end == END_SIGNAL) {
        return ctl_fail(CTL_NO, "interrupted after %.1f s of %.1f s", driven_s(self, stop_us),
                        (double)self->words.time_ms / 1e3);
    }
    if (end == END_TIME && strcmp(text_word(self->latest, "state"), "latched") == 0) {
        return ctl_fail(CTL_NO, "while stopping the gateway latched (%s); see: iwheelctl why",
                        text_word(self->latest, "cause"));
    }
    return (end == END_TIME) ? CTL_OK : CTL_NO;
}

/// Stops the wheels, whatever happened before.
static int finish(drive_t *self, end_t end) {
    json_t *reply = NULL;
    const int64_t stop_us = client_now_us();
    self->ctl->client.seen_signals = signals_count();
    clear_progress(self);
    if (end == END_LOST) {
        return ctl_fail(CTL_UNAVAILABLE,
                        "the lease ended with the connection: the gateway stops the wheels; if the gateway is dead, "
                        "their own watchdog (1 s) stops them");
    }
    if (self->ctl->json && self->last_line[0] != '\0') {
        text_json(self->last_line, stdout);
    }
    int code = ctl_ask(self->ctl, json_pack("{s:s}", "cmd", "stop"), &reply);
    json_decref(reply);
    if (code == CTL_OK) {
        code = wait_for_rest(self);
    }
    return (code == CTL_OK) ? judge(self, end, stop_us) : code;
}

/// Waits a short time and drops the events of the gateway. Returns an exit code.
static int wait_a_moment(const drive_t *self) {
    const int64_t until_us = client_now_us() + POLL_US;
    iwc_result_t result = IWC_OK;
    while (result == IWC_OK) {
        json_t *event = NULL;
        result = client_receive(&self->ctl->client, until_us, &event);
        json_decref(event);
    }
    return (result == IWC_TIMEOUT) ? CTL_OK : ctl_lost(result);
}

static bool is_refused(const json_t *reply, const char *error) {
    return json_is_false(json_object_get(reply, "ok")) && strcmp(text_word(reply, "error"), error) == 0;
}

/// Waits, and arms again. The request still has the time of an earlier attempt, so a stop in the meantime refuses it.
/// Afterwards it has the time of this attempt, for the next one. Returns an exit code.
static int arm_again(drive_t *self, json_t *request, json_t **out_reply) {
    json_decref(*out_reply);
    *out_reply = NULL;
    int code = wait_a_moment(self);
    if (code == CTL_OK) {
        code = read_status(self);
    }
    if (code == CTL_OK) {
        code = ctl_exchange(self->ctl, json_incref(request), out_reply);
        ctl_set_time(request, self->latest);
    }
    return code;
}

/// Arms, and tries again while the wheels are not at standstill. Returns as ctl_ask does. A gateway before 0.3 does not
/// know the time in the request: there it tries once, because it would undo a stop in the meantime.
static int ask_to_arm(drive_t *self, json_t *request, json_t **out_reply) {
    const int64_t end_us = client_now_us() + ARM_PATIENCE_US;
    ctl_set_time(request, self->latest);
    int code = ctl_exchange(self->ctl, json_incref(request), out_reply);
    const bool is_old = code == CTL_OK && is_refused(*out_reply, "unknown_field");
    if (is_old) {
        json_decref(*out_reply);
        *out_reply = NULL;
        (void)json_object_del(request, "t_us");
        code = ctl_exchange(self->ctl, json_incref(request), out_reply);
    } else if (code == CTL_OK && is_refused(*out_reply, "not_at_rest")) {
        (void)ctl_fail(CTL_OK, "waiting for one second at most, because %s", text_word(*out_reply, "message"));
    }
    while (!is_old && code == CTL_OK && is_refused(*out_reply, "not_at_rest") && client_now_us() < end_us) {
        code = arm_again(self, request, out_reply);
    }
    json_decref(request);
    return (code == CTL_OK) ? ctl_accept(self->ctl, out_reply) : code;
}

/// Subscribes to the state of the wheels and arms. Returns an exit code.
static int arm(drive_t *self) {
    json_t *reply = NULL;
    size_t index = 0;
    const json_t *warning = NULL;
    int code =
        ask_quietly(self, json_pack("{s:s,s:[s],s:i}", "cmd", "watch", "topics", "state", "rate_hz", 10), &reply);
    json_decref(reply);
    if (code == CTL_OK) {
        code = read_status(self);
    }
    if (code != CTL_OK) {
        return code;
    }
    json_t *request = json_pack("{s:s,s:s}", "cmd", "arm", "name", "iwheelctl");
    if (self->words.takeover) {
        (void)json_object_set_new(request, "takeover", json_true());
    }
    code = ask_to_arm(self, request, &reply);
    json_array_foreach(json_object_get(reply, "warnings"), index, warning) {
        (void)ctl_fail(CTL_OK, "warning: %s", json_is_string(warning) ? json_string_value(warning) : "--");
    }
    const json_int_t lease_ms = json_integer_value(json_object_get(reply, "lease_ms"));
    self->lease_us = ((lease_ms >= LEASE_MIN_MS && lease_ms <= LEASE_MAX_MS) ? lease_ms : LEASE_MIN_MS) * 1000;
    json_decref(reply);
    return code;
}

int verb_drive(ctl_t *self, int count, char **words) {
    char why[DRIVE_WHY_SIZE];
    drive_t drive = {.ctl = self, .live = self->json ? 0U : text_live_columns(stdout)};
    if (!drive_words_parse(count, words, &drive.words, why)) {
        return ctl_fail(CTL_USAGE, "%s", why);
    }
    signals_catch();
    int code = arm(&drive);
    if (code == CTL_OK) {
        code = finish(&drive, run(&drive));
    }
    json_decref(drive.first);
    json_decref(drive.latest);
    return code;
}
