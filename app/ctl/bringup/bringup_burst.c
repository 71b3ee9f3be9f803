// SPDX-License-Identifier: MIT
// A short, slow turn of the wheels that any key ends.
#include "bringup.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

/// Interval between commands: a third of the trial gateway's lease.
#define SPACING_US 60000
#define REST_US    8000000
#define SILENT_US  1000000
#define ARM_TRIES  5U
/// Minimum number of snapshots at 50 Hz with the whole command in force. With fewer snapshots the burst has no result.
#define IN_FORCE_MIN 4
/// The speed of one wheel alone is enough at this multiple of `enough_mm_s`.
#define ENOUGH_OF_ONE 4

typedef struct {
    bringup_t *bringup;
    const burst_t *burst;
    outcome_t *outcome;
    int64_t begin_us;
    int64_t end_us;
    int64_t next_us;
    int64_t received_us;
    int64_t sum_mm_s[IW_SIDES];
    int samples;
    int in_force;     ///< Snapshots in which the applied command was the whole command, after ramps.
    json_int_t stops; ///< Number of stops of the gateway before this burst.
    int unknown;      ///< Snapshots without the speed of both wheels.
    bool enough;
} run_t;

static burst_end_t fail(run_t *run, burst_end_t end, const char *why) {
    (void)snprintf(run->outcome->why, sizeof run->outcome->why, "%s", why);
    return end;
}

static json_t *compose(const burst_t *burst) {
    json_t *request = json_pack("{s:s,s:i,s:i}", "cmd", "drive", "left_mm_s", burst->speed_mm_s[IW_LEFT], "right_mm_s",
                                burst->speed_mm_s[IW_RIGHT]);
    if (burst->has_current) {
        (void)json_object_set_new(request, "left_mA", json_integer(burst->current_mA[IW_LEFT]));
        (void)json_object_set_new(request, "right_mA", json_integer(burst->current_mA[IW_RIGHT]));
    }
    return request;
}

static bool is_applied(const json_t *wheel, const char *field, int wanted) {
    const json_t *value = json_object_get(wheel, field);
    return json_is_integer(value) && json_integer_value(value) == wanted;
}

static bool is_in_force(const burst_t *burst, const json_t *state) {
    for (unsigned side = 0; side < IW_SIDES; side++) {
        const json_t *wheel = json_object_get(state, text_side(side));
        if (!is_applied(wheel, "applied_mm_s", burst->speed_mm_s[side]) ||
            (burst->has_current && !is_applied(wheel, "applied_mA", burst->current_mA[side]))) {
            return false;
        }
    }
    return true;
}

/// Reads the speeds of both wheels from a snapshot. Returns false if one is not known: an unknown speed is not a
/// standstill.
static bool speeds_of(const json_t *state, int out_mm_s[IW_SIDES]) {
    for (unsigned side = 0; side < IW_SIDES; side++) {
        const json_t *speed = json_object_get(json_object_get(state, text_side(side)), "speed_mm_s");
        if (!json_is_integer(speed)) {
            return false;
        }
        out_mm_s[side] = (int)json_integer_value(speed);
    }
    return true;
}

static bool is_enough(const burst_t *burst, const outcome_t *outcome) {
    const int left = abs(outcome->peak_mm_s[IW_LEFT]);
    const int right = abs(outcome->peak_mm_s[IW_RIGHT]);
    const int fast = (left > right) ? left : right;
    const int slow = (left > right) ? right : left;
    return burst->enough_mm_s > 0 && (slow >= burst->enough_mm_s || fast >= ENOUGH_OF_ONE * burst->enough_mm_s);
}

static void take_speeds(run_t *run, const json_t *state, int64_t now_us) {
    const bool late = now_us > (run->begin_us + run->end_us) / 2;
    int speed[IW_SIDES];
    if (!speeds_of(state, speed)) {
        run->unknown++;
        return;
    }
    for (unsigned side = 0; side < IW_SIDES; side++) {
        int *peak = &run->outcome->peak_mm_s[side];
        if (abs(speed[side]) > abs(*peak)) {
            *peak = speed[side];
        }
        run->sum_mm_s[side] += late ? speed[side] : 0;
    }
    run->enough = run->enough || is_enough(run->burst, run->outcome);
    run->samples += late ? 1 : 0;
    run->in_force += is_in_force(run->burst, state) ? 1 : 0;
}

static burst_end_t take_line(run_t *run, const json_t *line, int64_t now_us) {
    const json_t *ok = json_object_get(line, "ok");
    if (ok == NULL) {
        if (strcmp(text_word(line, "event"), "state") == 0) {
            take_speeds(run, line, now_us);
        }
        return BURST_DONE;
    }
    run->received_us = now_us;
    return json_is_true(ok) ? BURST_DONE : fail(run, BURST_STOPPED, text_word(line, "message"));
}

/// Drives until the time is over, the speed is enough, or something ends the burst.
static burst_end_t drive(run_t *run) {
    client_t *client = &run->bringup->ctl->client;
    burst_end_t end = BURST_DONE;
    while (end == BURST_DONE && !run->enough) {
        const int64_t now_us = client_now_us();
        json_t *line = NULL;
        int64_t id = 0;
        if (talk_key_pressed()) {
            return fail(run, BURST_ABORTED, "a key was pressed");
        }
        if (now_us >= run->end_us) {
            return BURST_DONE;
        }
        if (now_us - run->received_us > SILENT_US) {
            return fail(run, BURST_LOST, "the gateway does not answer");
        }
        if (now_us >= run->next_us) {
            run->next_us = now_us + SPACING_US;
            const iwc_result_t sent = client_send(client, compose(run->burst), now_us, &id);
            if (sent != IWC_OK && sent != IWC_FULL) { // Full: the gateway does not read. SILENT_US ends the burst.
                return fail(run, BURST_LOST, "the gateway is gone");
            }
        }
        const iwc_result_t result = client_receive(client, now_us + SPACING_US / 3, &line);
        if (result == IWC_INTERRUPTED) {
            client->seen_signals = signals_count();
            end = fail(run, BURST_ABORTED, "interrupted");
        } else if (result != IWC_OK && result != IWC_TIMEOUT) {
            end = fail(run, BURST_LOST, "the gateway is gone");
        } else if (line != NULL) {
            end = take_line(run, line, client_now_us());
        }
        json_decref(line);
    }
    return end;
}

/// Returns true if a wheel ran away although its command was zero. The gateway may detect this first and stop the
/// wheels; that the wheel turns is the result of the burst.
static bool ran_away(run_t *run, const json_t *why) {
    const burst_t *burst = run->burst;
    const char *side_word = text_word(why, "side");
    const int measured = (int)json_integer_value(json_object_get(why, "detail"));
    if (burst->enough_mm_s == 0 || burst->speed_mm_s[IW_LEFT] != 0 || burst->speed_mm_s[IW_RIGHT] != 0 ||
        json_integer_value(json_object_get(why, "number")) <= run->stops ||
        strcmp(text_word(why, "cause"), "overspeed") != 0) {
        return false;
    }
    for (unsigned side = 0; side < IW_SIDES; side++) {
        int *peak = &run->outcome->peak_mm_s[side];
        const bool commanded = strcmp(side_word, text_side(side)) == 0 || strcmp(side_word, "both") == 0;
        if (commanded && abs(measured) > abs(*peak)) {
            *peak = measured;
        }
    }
    run->enough = true;
    return true;
}

/// Returns true if the gateway stopped both wheels because one did not follow its command: in the air this is a result
/// like any other.
static bool diverged(const run_t *run, const json_t *why) {
    return json_integer_value(json_object_get(why, "number")) > run->stops &&
           strcmp(text_word(why, "cause"), "pair_diverges") == 0;
}

/// Judges the end of a burst: whether the stop of this program ended it, and whether the command was in force. A wheel
/// that did not turn is a result only if it had a command.
static burst_end_t judge(run_t *run, burst_end_t end) {
    json_t *why = near_ask(run->bringup->ctl, json_pack("{s:s}", "cmd", "why"));
    const bool ours = json_integer_value(json_object_get(why, "number")) == run->stops + 1 &&
                      strcmp(text_word(why, "cause"), "client_stop") == 0;
    if ((end == BURST_DONE || end == BURST_STOPPED) && (ran_away(run, why) || diverged(run, why))) {
        end = BURST_DONE;
        run->bringup->known_us = json_integer_value(json_object_get(why, "at_us"));
    } else if (end == BURST_STOPPED || (end == BURST_DONE && !ours)) {
        end = fail(run, BURST_STOPPED, text_word(why, "sentence"));
    } else if (end == BURST_DONE && run->unknown > 0) {
        end = fail(run, BURST_STOPPED, "the speed of a wheel was not known");
    } else if (end == BURST_DONE && !run->enough && run->in_force < IN_FORCE_MIN) {
        end = fail(run, BURST_STOPPED, "the command was in force for too short a time; this machine is too busy");
    }
    json_decref(why);
    return end;
}

/// Returns how the operator ended the burst, by a key or a signal; NULL: neither.
static const char *ended_by_operator(const run_t *run) {
    client_t *client = &run->bringup->ctl->client;
    if (signals_count() != client->seen_signals) {
        client->seen_signals = signals_count();
        return "interrupted";
    }
    return talk_key_pressed() ? "a key was pressed" : NULL;
}

static void ask_estop(ctl_t *ctl) {
    json_decref(near_ask(ctl, json_pack("{s:s,s:s}", "cmd", "estop", "reason", "a key in bringup")));
}

/// Stops immediately after a key or a signal, otherwise with a ramp. Then waits until both wheels are at standstill; a
/// key or a signal stops them immediately here too. Returns the end of the burst.
static burst_end_t stop(run_t *run, burst_end_t end) {
    ctl_t *ctl = run->bringup->ctl;
    const int64_t rest_us = client_now_us() + REST_US;
    bool latched = end == BURST_ABORTED;
    if (latched) {
        ask_estop(ctl);
    } else {
        json_decref(near_ask(ctl, json_pack("{s:s}", "cmd", "stop")));
    }
    json_decref(near_ask(ctl, json_pack("{s:s,s:[]}", "cmd", "watch", "topics")));
    for (bool resting = false; !resting && client_now_us() < rest_us;) {
        json_t *line = NULL;
        const char *why = ended_by_operator(run);
        if (!latched && why != NULL) {
            latched = true;
            ask_estop(ctl);
            end = (end == BURST_DONE) ? fail(run, BURST_ABORTED, why) : end;
        }
        json_t *status = trial_status(run->bringup);
        resting = json_is_true(json_object_get(json_object_get(status, "left"), "at_rest")) &&
                  json_is_true(json_object_get(json_object_get(status, "right"), "at_rest"));
        json_decref(status);
        (void)client_receive(&ctl->client, client_now_us() + SPACING_US, &line);
        json_decref(line);
    }
    return end;
}

/// Ends the burst before the first command, for the reason in the outcome unless the operator ended it.
static burst_end_t refuse(run_t *run) {
    const char *why = ended_by_operator(run);
    return (why != NULL) ? fail(run, BURST_REFUSED, why) : BURST_REFUSED;
}

/// Waits until the wheels are ready, and arms. It tries again because a wheel with late telemetry counts as not at
/// standstill for a moment longer. A stop of any client in the meantime ends this.
static burst_end_t arm(run_t *run) {
    bringup_t *self = run->bringup;
    outcome_t *outcome = run->outcome;
    json_t *request = json_pack("{s:s,s:s}", "cmd", "arm", "name", "bringup");
    bool ok = false;
    bool waits = true;
    for (unsigned tries = 0; tries < ARM_TRIES && waits; tries++) {
        if (!ready_to_move(self, outcome->why, sizeof outcome->why)) {
            break;
        }
        json_t *status = trial_status(self);
        if (tries == 0U) {
            ctl_set_time(request, status);
        }
        json_t *why = near_ask(self->ctl, json_pack("{s:s}", "cmd", "why"));
        run->stops = json_integer_value(json_object_get(why, "number"));
        json_decref(why);
        json_decref(
            near_ask(self->ctl, json_pack("{s:s,s:[s],s:i}", "cmd", "watch", "topics", "state", "rate_hz", 50)));
        json_t *armed = near_ask(self->ctl, json_incref(request));
        ctl_set_time(request, status);
        json_decref(status);
        ok = json_is_true(json_object_get(armed, "ok"));
        waits = strcmp(text_word(armed, "error"), "not_at_rest") == 0;
        (void)snprintf(outcome->why, sizeof outcome->why, "%s", text_word(armed, "message"));
        json_decref(armed);
    }
    json_decref(request);
    return ok ? BURST_DONE : refuse(run);
}

/// Arms, drives, stops and waits until both are at standstill. Any key stops immediately.
static void burst_run(bringup_t *self, const burst_t *burst, outcome_t *out_outcome) {
    run_t run = {.bringup = self, .burst = burst, .outcome = out_outcome};
    memset(out_outcome, 0, sizeof(*out_outcome));
    out_outcome->end = arm(&run);
    if (out_outcome->end != BURST_DONE) {
        return;
    }
    run.begin_us = client_now_us();
    run.received_us = run.begin_us;
    run.end_us = run.begin_us + (int64_t)burst->for_ms * 1000;
    const burst_end_t end = stop(&run, drive(&run));
    out_outcome->end = judge(&run, end);
    for (unsigned side = 0; side < IW_SIDES; side++) {
        out_outcome->mean_mm_s[side] =
            (run.enough || run.samples == 0) ? out_outcome->peak_mm_s[side] : (int)(run.sum_mm_s[side] / run.samples);
    }
}

bool burst_show(bringup_t *self, const burst_t *burst, outcome_t *out_outcome) {
    do {
        talk_keys_begin(); // Before the sentence: from now on any key stops it.
        (void)fputs("  ... now; any key stops it\n", stdout);
        (void)fflush(stdout);
        burst_run(self, burst, out_outcome);
        talk_keys_end();
        if (out_outcome->end == BURST_DONE) {
            talk_print("  left %d mm/s, right %d mm/s measured", out_outcome->mean_mm_s[IW_LEFT],
                       out_outcome->mean_mm_s[IW_RIGHT]);
            return true;
        }
        talk_print("  %s: %s", (out_outcome->end == BURST_REFUSED) ? "The movement did not start" : "STOPPED",
                   out_outcome->why);
    } while (talk_yes(self, "Try again?", false));
    return false;
}

void burst_insist(bringup_t *self, const burst_t *burst, outcome_t *out_outcome) {
    if (!burst_show(self, burst, out_outcome)) {
        bringup_fail(self);
    }
}
