// SPDX-License-Identifier: MIT
// Gear, by hand: the operator turns each wheel a counted number of times. Nothing is sent.
#include "bringup.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>

#define TURNS        3
#define GEAR_MAX     100.0
#define GEAR_PERCENT 4.0
/// Tolerance of the turns by rpm, which are summed up from polls of the status.
#define RPM_SLACK 0.3

/// One wheel: turns of the rotor per turn of the wheel, and the share of them that the rpm show.
typedef struct {
    long long ticks;
    double gear;
    double share;
} turned_t;

/// Turns that the rpm count, as far as both wheels showed it.
typedef enum { RPM_UNSEEN = 0, RPM_WHEEL, RPM_ROTOR } rpm_of_t;

/// Returns true after it has printed why the turns have no result, otherwise false.
static bool is_no_turn(const hand_t *hand, iw_side_t side, const turned_t *turned) {
    const iw_side_t other = (side == IW_LEFT) ? IW_RIGHT : IW_LEFT;
    const char *name = text_side(side);
    if (!hand_is_complete(hand)) {
        return true;
    }
    if (hand->way[other] > hand->way[side]) {
        talk_print("  The %s wheel counted %lld ticks and the %s one %lld: was the wrong one turned, or are they "
                   "exchanged?",
                   text_side(other), hand->ticks[other], name, hand->ticks[side]);
    } else if (!hand_went_one_way(hand, side)) {
        talk_print("  The %s wheel was turned back and forth: %lld ticks forwards, %lld in all.", name,
                   hand->ticks[side], hand->way[side]);
    } else if (turned->gear < 1.0 - GEAR_PERCENT / 100.0 || turned->gear > GEAR_MAX) {
        talk_print("  %lld ticks of the %s wheel in %d turns fit no gear ratio from 1 to %.0f.", hand->ticks[side],
                   name, TURNS, GEAR_MAX);
    } else {
        return false;
    }
    return true;
}

/// Measures one wheel. Returns false if the operator does not want to try again.
static bool turn(bringup_t *self, iw_side_t side, turned_t *out_turned) {
    char prompt[96];
    hand_t hand;
    (void)snprintf(prompt, sizeof prompt, "Turn the %s wheel exactly %d times in one direction, then press Enter ...",
                   text_side(side), TURNS);
    do {
        hand_follow(self, prompt, &hand);
        const double rotor = (double)llabs(hand.ticks[side]) / IW_TICKS_PER_TURN;
        *out_turned =
            (turned_t){.ticks = llabs(hand.ticks[side]), .gear = rotor / TURNS, .share = hand_rpm_share(&hand, side)};
        if (!is_no_turn(&hand, side, out_turned)) {
            return true;
        }
    } while (talk_yes(self, "Try again?", true));
    return false;
}

/// Sets the gear: a whole number if it is nearly one, otherwise tenths. The configuration can hold no more.
static void keep_gear(iw_config_t *core, double gear) {
    const double whole = round(gear);
    const bool is_whole = fabs(gear - whole) <= gear * GEAR_PERCENT / 100.0;
    core->gear_turns = (uint16_t)(is_whole ? whole : round(gear * 10.0));
    core->gear_per = is_whole ? 1U : 10U;
}

static bool is_about(double value, double wanted) {
    return fabs(value - wanted) <= wanted * RPM_SLACK;
}

/// Returns the turns that the rpm count. Both wheels must show the same, and must not fit both.
static rpm_of_t judge_rpm(const turned_t turned[IW_SIDES]) {
    bool rotor = true;
    bool wheel = true;
    for (unsigned side = 0; side < IW_SIDES; side++) {
        rotor = rotor && is_about(turned[side].share, 1.0);
        wheel = wheel && is_about(turned[side].share, 1.0 / turned[side].gear);
    }
    return (rotor == wheel) ? RPM_UNSEEN : rotor ? RPM_ROTOR : RPM_WHEEL;
}

static void note_gear(bringup_t *self, const turned_t turned[IW_SIDES], bool geared, rpm_of_t rpm) {
    const bool whole = !geared || rpm != RPM_UNSEEN;
    bringup_note(self, "wheels", "gear_ratio", whole ? "gear_ratio" : NULL, "%lld and %lld ticks in %d turns by hand%s",
                 turned[IW_LEFT].ticks, turned[IW_RIGHT].ticks, TURNS,
                 whole ? "" : "; whether rpm counts the wheel or the rotor was not measured");
    if (geared && rpm != RPM_UNSEEN) {
        bringup_note(self, "wheels", "rpm_of", NULL, "the sum of rpm over these turns is %.2f and %.2f of the rotor's",
                     turned[IW_LEFT].share, turned[IW_RIGHT].share);
    }
}

/// Judges the turns of both wheels. Stores the result if the operator agrees.
static void judge_gear(bringup_t *self, const turned_t turned[IW_SIDES]) {
    const double gear = (turned[IW_LEFT].gear + turned[IW_RIGHT].gear) / 2.0;
    iw_config_t core = self->config.core;
    if (fabs(turned[IW_LEFT].gear - turned[IW_RIGHT].gear) > gear * 2.0 * GEAR_PERCENT / 100.0) {
        talk_print(
            "  The left rotor makes %.2f turns per turn of its wheel, the right one %.2f: were both turned exactly "
            "%d times? The gear is unchanged.",
            turned[IW_LEFT].gear, turned[IW_RIGHT].gear, TURNS);
        return;
    }
    keep_gear(&core, gear);
    const bool geared = core.gear_turns > core.gear_per;
    const rpm_of_t rpm = judge_rpm(turned);
    // Without a gear the rpm of wheel and rotor are the same.
    core.rpm_of_rotor = geared && ((rpm == RPM_UNSEEN) ? core.rpm_of_rotor : rpm == RPM_ROTOR);
    talk_print("  %lld and %lld ticks in %d turns: %.2f turns of the rotor per turn of the wheel; %s.",
               turned[IW_LEFT].ticks, turned[IW_RIGHT].ticks, TURNS, gear,
               !geared               ? "no gear: rotor and wheel turn together"
               : (rpm == RPM_UNSEEN) ? "whether rpm counts the wheel or the rotor was not measured (turn faster)"
               : (rpm == RPM_ROTOR)  ? "rpm counts the rotor's turns"
                                     : "rpm counts the wheel's turns");
    if (talk_yes(self, "Use that?", true)) {
        self->config.core = core;
        bringup_fit_rest(&self->config.core);
        note_gear(self, turned, geared, rpm);
    }
}

void bringup_gear(bringup_t *self) {
    turned_t turned[IW_SIDES];
    talk_step(3, "the gear (nothing is sent; you turn)");
    talk_print("The wheels count %u ticks per turn of the rotor. The document does not state whether the rotor turns "
               "faster than the wheel. Mark each tyre, so that you see a full turn.",
               IW_TICKS_PER_TURN);
    if (!talk_yes(self, "Turn the wheels by hand?", true)) {
        return;
    }
    trial_start(self, &self->config);
    if (turn(self, IW_LEFT, &turned[IW_LEFT]) && turn(self, IW_RIGHT, &turned[IW_RIGHT])) {
        judge_gear(self, turned);
    } else {
        talk_print("  The gear is unchanged.");
    }
}
