// SPDX-License-Identifier: MIT
// Direction of each wheel: the bus shows the sign of the measurement, and only the operator sees the direction.
#include "bringup.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#define TURN_MS    1500U
#define MOVES_MM_S 40

/// Returns a burst with the current that a command needs in the role just found.
static burst_t turn(const bringup_t *self, int left_mm_s, int right_mm_s) {
    burst_t burst = {.speed_mm_s = {left_mm_s, right_mm_s}, .for_ms = TURN_MS};
    burst.has_current = self->config.core.current_role == IW_ROLE_SETPOINT;
    for (unsigned side = 0; side < IW_SIDES; side++) {
        burst.current_mA[side] = (burst.speed_mm_s[side] != 0) ? self->current_mA : 0;
    }
    return burst;
}

/// Checks what the bus shows: the commanded wheel turned, the other one did not, and the measured sign is the commanded
/// one. Prints what is wrong.
static bool bus_agrees(const bringup_t *self, const outcome_t *outcome, iw_side_t side) {
    const int driven = outcome->mean_mm_s[side];
    const int other = outcome->mean_mm_s[(side == IW_LEFT) ? IW_RIGHT : IW_LEFT];
    if (abs(driven) < MOVES_MM_S && abs(other) >= MOVES_MM_S) {
        talk_print("The bus shows that the OTHER wheel turned: left and right are exchanged. Their ids are fixed, so "
                   "exchange the wheels (or their plugs), then start bringup again.");
        return false;
    }
    if (abs(other) >= MOVES_MM_S) {
        talk_print(
            "The bus shows that BOTH wheels turned (%d and %d mm/s), although only the %s one was commanded. Find out "
            "what turned the other one, then start bringup again.",
            driven, other, text_side(side));
        return false;
    }
    if (driven <= -MOVES_MM_S) {
        talk_print(
            "The %s wheel measures the opposite of its command. No configuration key corrects that, and the gateway "
            "would stop for it (feedback_sign): check the wiring between motor and sensor, or ask the maker.",
            text_side(side));
        return false;
    }
    if (driven < MOVES_MM_S) {
        talk_print("The %s wheel did not turn. Is it blocked? If it needs more current: --current (now %d mA).",
                   text_side(side), self->current_mA);
        return false;
    }
    return true;
}

static void keep_sign(bringup_t *self, iw_side_t side, bool forward) {
    bool *invert = &self->config.core.invert[side];
    if (!forward) {
        *invert = !*invert;
    }
    bringup_note(self, text_side(side), "invert", (side == IW_LEFT) ? "mount_sign_left" : "mount_sign_right",
                 "the operator saw it turn %s with invert = %s", forward ? "forwards" : "backwards",
                 (forward ? *invert : !*invert) ? "yes" : "no");
}

/// Turns one wheel and asks for its direction. Returns false if the wheel must be shown again.
static bool measure_sign(bringup_t *self, iw_side_t side) {
    char answer[BRINGUP_ANSWER_SIZE];
    char question[96];
    outcome_t outcome;
    const burst_t burst =
        turn(self, (side == IW_LEFT) ? BRINGUP_SPEED_MM_S : 0, (side == IW_RIGHT) ? BRINGUP_SPEED_MM_S : 0);
    (void)snprintf(question, sizeof question, "Watch the %s wheel. Enter turns it for %.1f s", text_side(side),
                   TURN_MS / 1e3);
    talk_ask(self, question, "go", answer);
    burst_insist(self, &burst, &outcome);
    if (!bus_agrees(self, &outcome, side)) {
        bringup_fail(self);
    }
    for (;;) {
        talk_ask(self, "Direction of the machine: f forwards, b backwards (o: other wheel, r: repeat)", "r", answer);
        if (strcmp(answer, "r") == 0) {
            return false;
        }
        if (strcmp(answer, "o") == 0) {
            talk_print(
                "Then left and right are exchanged. Their ids are fixed, so exchange the wheels (or their plugs), "
                "then start bringup again.");
            bringup_fail(self);
        }
        if (strcmp(answer, "f") == 0 || strcmp(answer, "b") == 0) {
            keep_sign(self, side, answer[0] == 'f');
            return true;
        }
        talk_print("Please write f, b, o or r.");
    }
}

/// Turns both wheels with the signs found. Returns true if the operator agrees.
static bool verify(bringup_t *self) {
    char answer[BRINGUP_ANSWER_SIZE];
    outcome_t outcome;
    const burst_t burst = turn(self, BRINGUP_SPEED_MM_S, BRINGUP_SPEED_MM_S);
    trial_start(self, &self->config);
    talk_ask(self, "Now both wheels. Enter turns them for a movement straight ahead", "go", answer);
    burst_insist(self, &burst, &outcome);
    if (outcome.mean_mm_s[IW_LEFT] < MOVES_MM_S || outcome.mean_mm_s[IW_RIGHT] < MOVES_MM_S) {
        talk_print(
            "The bus shows that a wheel did not turn forwards. It was blocked, or one of your answers was wrong. "
            "Both wheels are tested again.");
        return false;
    }
    return talk_yes(self, "Would the machine have moved straight ahead?", false);
}

void bringup_signs(bringup_t *self) {
    talk_step(6, "the direction of each wheel (WHEELS TURN, in the air)");
    talk_print(
        "Stand behind the machine, like its user. Each wheel turns alone and slowly; answer in which direction it "
        "would have moved the machine on the ground.");
    do {
        trial_start(self, &self->config);
        for (unsigned side = 0; side < IW_SIDES;) {
            side += measure_sign(self, (iw_side_t)side) ? 1U : 0U;
        }
    } while (!verify(self));
}
