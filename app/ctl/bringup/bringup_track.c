// SPDX-License-Identifier: MIT
// Track, by full turns of the machine on the spot; the result of a twist depends on it. Nothing is sent.
//
//     track = (way of the right wheel - way of the left wheel) / angle
#include "bringup.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>

#define TURNS_MAX 20
#define TICKS_MIN 60
/// Bounds of the configuration key.
#define TRACK_MIN 200
#define TRACK_MAX 1500
/// Tolerated movement of the machine's middle, as a share of the way that the wheels rolled.
#define WANDER_PERCENT 20.0
/// If the result differs more from the configured track, the turns may be counted wrongly.
#define OFF_PERCENT 10.0

/// Returns the way in mm that a wheel rolled forwards.
static double rolled(const bringup_t *self, const hand_t *hand, iw_side_t side) {
    const iw_config_t *core = &self->config.core;
    const double assumed = 2.0 * M_PI * core->radius_mm / IW_TICKS_PER_TURN * core->gear_per / core->gear_turns;
    const double way_mm = (double)hand->ticks[side] * ((self->mm_per_tick > 0.0) ? self->mm_per_tick : assumed);
    return core->invert[side] ? -way_mm : way_mm;
}

static bool is_turn(const bringup_t *self, const hand_t *hand) {
    const double left = rolled(self, hand, IW_LEFT);
    const double right = rolled(self, hand, IW_RIGHT);
    if (!hand_is_complete(hand)) {
        return false;
    }
    if (llabs(hand->ticks[IW_LEFT]) < TICKS_MIN || llabs(hand->ticks[IW_RIGHT]) < TICKS_MIN) {
        talk_print("  Too few ticks (left %lld, right %lld): both wheels must stand on the ground and roll.",
                   hand->ticks[IW_LEFT], hand->ticks[IW_RIGHT]);
    } else if ((left > 0.0) == (right > 0.0)) {
        talk_print(
            "  Both wheels rolled in the same direction (left %.2f m, right %.2f m): that was no turn on the spot. "
            "If it was, a sign of step 6 is wrong: begin again.",
            left / 1e3, right / 1e3);
    } else if (!hand_went_one_way(hand, IW_LEFT) || !hand_went_one_way(hand, IW_RIGHT)) {
        talk_print(
            "  It was turned back and forth (left %lld of %lld ticks, right %lld of %lld): turn it in one direction.",
            llabs(hand->ticks[IW_LEFT]), hand->way[IW_LEFT], llabs(hand->ticks[IW_RIGHT]), hand->way[IW_RIGHT]);
    } else if (fabs(left + right) > (fabs(left) + fabs(right)) * WANDER_PERCENT / 100.0) {
        talk_print("  Left rolled %.2f m, right %.2f m: the machine moved away while it turned. Turn it on the spot, "
                   "about the middle between its wheels.",
                   left / 1e3, right / 1e3);
    } else {
        return true;
    }
    return false;
}

static void keep_track(bringup_t *self, const hand_t *hand, int turns, double track_mm) {
    const bool rolled_distance = self->mm_per_tick > 0.0;
    self->config.core.track_mm = (uint16_t)lround(track_mm);
    bringup_note(self, "wheels", "track_mm", rolled_distance ? "track" : NULL,
                 "%d full turns by hand: left %lld, right %lld ticks%s", turns, hand->ticks[IW_LEFT],
                 hand->ticks[IW_RIGHT], rolled_distance ? "" : "; the radius is assumed");
}

/// Reports that the configuration does not confirm the count.
static void report_off(const bringup_t *self) {
    char configured[40] = "No track was configured";
    if (self->config.core.track_mm != 0U) {
        (void)snprintf(configured, sizeof configured, "The configured track is %u mm", self->config.core.track_mm);
    }
    talk_print(
        "  %s. Check the number of turns: measure with a tape from the middle of one tyre to the middle of the other.",
        configured);
}

/// Returns true if the step is done.
static bool judge_track(bringup_t *self, const hand_t *hand, int turns) {
    const double left = rolled(self, hand, IW_LEFT);
    const double right = rolled(self, hand, IW_RIGHT);
    const double track_mm = fabs(right - left) / (2.0 * M_PI * turns);
    const double before_mm = self->config.core.track_mm;
    const bool near = fabs(track_mm - before_mm) <= before_mm * OFF_PERCENT / 100.0;
    if (!is_turn(self, hand)) {
        return false;
    }
    if (track_mm < TRACK_MIN || track_mm > TRACK_MAX) {
        talk_print(
            "  Left rolled %.2f m, right %.2f m in %d turns: the track would be outside %d to %d mm. Was the number of "
            "turns right?",
            left / 1e3, right / 1e3, turns, TRACK_MIN, TRACK_MAX);
        return false;
    }
    talk_print("  Left rolled %.2f m, right %.2f m in %d turns: the track is %.0f mm%s.", left / 1e3, right / 1e3,
               turns, track_mm,
               (self->mm_per_tick > 0.0) ? "" : ", if the radius is as configured: no distance was measured");
    if (!near) {
        report_off(self);
    }
    const bool accepted = talk_yes(self, "Use that?", near);
    if (accepted) {
        keep_track(self, hand, turns, track_mm);
    }
    return accepted;
}

/// Asks for a whole number of turns. Returns 0 if the operator skips the step.
static int ask_turns(bringup_t *self) {
    double turns = 0.0;
    while (talk_number(self, "How many full turns (3 is good; Enter: skip this step)", 1.0, TURNS_MAX, &turns)) {
        if (turns == floor(turns)) {
            return (int)turns;
        }
        talk_print("Please write a number of full turns: 1, 2, 3 ...");
    }
    return 0;
}

static void report_left_out(const bringup_t *self) {
    if (self->config.core.track_mm == 0U) {
        talk_print(
            "Without a track the gateway refuses arm: set track_mm under [wheels], from the middle of one tyre to the "
            "middle of the other, in mm.");
    }
}

void bringup_track(bringup_t *self) {
    char answer[BRINGUP_ANSWER_SIZE];
    char prompt[128];
    int turns = 0;
    hand_t hand;
    talk_step(9, "the track (nothing is sent; you turn the machine)");
    talk_print(
        "The track is the distance between the two wheels; it determines how far a twist turns the machine. Leave "
        "the machine on the ground and mark on the floor where it points. You will turn it on the spot, in one "
        "direction, until it has pointed at the mark that many times.");
    trial_start(self, &self->config);
    do {
        turns = ask_turns(self);
        if (turns == 0) {
            report_left_out(self);
            return;
        }
        (void)snprintf(prompt, sizeof prompt, "Turn it %d full turn%s, stop it at the mark, then press Enter ...",
                       turns, (turns == 1) ? "" : "s");
        talk_ask(self, "Point the machine at the mark, then press Enter", "go", answer);
        hand_follow(self, prompt, &hand);
    } while (!judge_track(self, &hand, turns));
}
