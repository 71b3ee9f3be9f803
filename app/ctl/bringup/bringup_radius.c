// SPDX-License-Identifier: MIT
// Radius, by a measured distance. Nothing is sent.
#include "bringup.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>

#define TICKS_MIN    60
#define DISTANCE_MIN 1.0
#define DISTANCE_MAX 100.0
/// If the radii of both wheels differ by less, the machine moved straight ahead.
#define ALIKE_PERCENT 3.0

/// Returns the radius in mm from a distance and the ticks of a wheel; 0 without ticks.
static double radius_of(const bringup_t *self, double distance_m, long long ticks) {
    const iw_config_t *core = &self->config.core;
    const double turns = (double)llabs(ticks) / IW_TICKS_PER_TURN * core->gear_per / core->gear_turns;
    return (turns > 0.0) ? distance_m * 1000.0 / (2.0 * M_PI * turns) : 0.0;
}

/// Checks that the machine was pushed in one direction and that its odometry, with the signs found before, counted
/// forwards. Prints what is wrong.
static bool counts_forwards(const bringup_t *self, const hand_t *hand) {
    for (unsigned side = 0; side < IW_SIDES; side++) {
        const bool forwards = (hand->ticks[side] > 0) != self->config.core.invert[side];
        if (!forwards) {
            talk_print(
                "  The %s wheel counted backwards while the machine moved forwards. Either it was pushed backwards, "
                "or the sign of step 6 is wrong: begin again if you are not sure.",
                text_side(side));
            return false;
        }
        if (!hand_went_one_way(hand, (iw_side_t)side)) {
            talk_print("  The %s wheel moved back and forth: %lld ticks forwards, %lld in all. Please push again.",
                       text_side(side), llabs(hand->ticks[side]), hand->way[side]);
            return false;
        }
    }
    return true;
}

static bool is_usable(const bringup_t *self, const hand_t *hand) {
    if (!hand_is_complete(hand)) {
        return false;
    }
    if (llabs(hand->ticks[IW_LEFT]) < TICKS_MIN || llabs(hand->ticks[IW_RIGHT]) < TICKS_MIN) {
        talk_print("  Too few ticks (left %lld, right %lld): push further, both wheels on the ground.",
                   hand->ticks[IW_LEFT], hand->ticks[IW_RIGHT]);
        return false;
    }
    return counts_forwards(self, hand);
}

/// Stores the radius that the operator accepted. A straight path with a known gear confirms the radius; a straight path
/// alone results only in the distance per tick.
static void keep_radius(bringup_t *self, const hand_t *hand, double distance_m, double mean, bool straight) {
    const bool geared = bringup_is_confirmed(self, "gear_ratio");
    const double ticks = (double)(llabs(hand->ticks[IW_LEFT]) + llabs(hand->ticks[IW_RIGHT])) / 2.0;
    self->config.core.radius_mm = (uint16_t)lround(mean);
    bringup_fit_rest(&self->config.core);
    self->mm_per_tick = straight ? distance_m * 1000.0 / ticks : 0.0;
    bringup_note(self, "wheels", "radius_mm", (straight && geared) ? "wheel_radius" : NULL,
                 "%.2f m pushed: left %lld, right %lld ticks%s%s", distance_m, hand->ticks[IW_LEFT],
                 hand->ticks[IW_RIGHT], geared ? "" : "; the gear is assumed", straight ? "" : "; not straight");
}

/// Returns true if the step is done.
static bool judge_radius(bringup_t *self, const hand_t *hand, double distance_m) {
    const iw_config_range_t range = iw_config_range(IW_CONFIG_RADIUS);
    const double left = radius_of(self, distance_m, hand->ticks[IW_LEFT]);
    const double right = radius_of(self, distance_m, hand->ticks[IW_RIGHT]);
    const double mean = (left + right) / 2.0;
    const bool straight = fabs(left - right) <= mean * ALIKE_PERCENT / 100.0;
    if (!is_usable(self, hand)) {
        return false;
    }
    talk_print("  Left %.1f mm, right %.1f mm; mean %.0f mm%s.", left, right, mean,
               bringup_is_confirmed(self, "gear_ratio") ? "" : ", if the gear is as configured: it was not measured");
    if (!straight) {
        talk_print("  They differ by more than %.0f %%: it was a curve, or the tyres differ. Push it again, straight.",
                   ALIKE_PERCENT);
    }
    if (mean < range.min || mean > range.max) {
        talk_print("  The radius would be outside %u to %u mm: did you type the distance in metres?", range.min,
                   range.max);
        return false;
    }
    const bool accepted = talk_yes(self, "Use the mean?", straight);
    if (accepted) {
        keep_radius(self, hand, distance_m, mean, straight);
    }
    return accepted;
}

void bringup_radius(bringup_t *self) {
    char answer[BRINGUP_ANSWER_SIZE];
    double distance_m = 0.0;
    hand_t hand;
    talk_step(8, "the radius (nothing is sent; you push)");
    talk_print(
        "In the document it is approximately 192 mm. Put the machine on the ground, mark a straight distance of 3 m "
        "or more, and push the machine along it with its wheels rolling.");
    trial_start(self, &self->config);
    do {
        if (!talk_number(self, "Distance in m (Enter: skip this step)", DISTANCE_MIN, DISTANCE_MAX, &distance_m)) {
            return;
        }
        talk_ask(self, "Place the machine at the start mark, then press Enter", "go", answer);
        hand_follow(self, "Push it forwards to the end mark, let it stop, then press Enter ...", &hand);
    } while (!judge_radius(self, &hand, distance_m));
}
