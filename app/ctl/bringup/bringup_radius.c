// SPDX-License-Identifier: MIT
// Gear and radius, by hand: turns that are counted, a distance that is measured. Nothing is sent.
#include "bringup.h"
#include "talk/signals.h"

#include <math.h>
#include <poll.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#define LOOK_MS      20
#define TURNS        3
#define TICKS_MIN    60
#define DISTANCE_MIN 1.0
#define DISTANCE_MAX 100.0
#define RADIUS_MIN   20
#define RADIUS_MAX   500
/// Both wheels went equally far, if the machine went straight.
#define ALIKE_PERCENT 3.0
#define GEAR_PERCENT  4.0

static const char *const names[IW_SIDES] = {[IW_LEFT] = "left", [IW_RIGHT] = "right"};

/// What the wheels counted between two presses of Enter, in their own sense.
typedef struct {
    long long ticks[IW_SIDES];
    double rpm_turns[IW_SIDES]; ///< The rpm they told, summed up over time.
    bool heard;
} way_t;

typedef struct {
    long long ticks[IW_SIDES];
    int rpm[IW_SIDES];
    bool heard;
} look_t;

static look_t look(bringup_t *self) {
    look_t seen = {.heard = true};
    json_t *status = trial_status(self);
    for (unsigned side = 0; side < IW_SIDES; side++) {
        const json_t *wheel = json_object_get(status, names[side]);
        const json_t *ticks = json_object_get(wheel, "ticks");
        seen.heard = seen.heard && json_is_integer(ticks);
        seen.ticks[side] = json_integer_value(ticks);
        seen.rpm[side] = (int)json_integer_value(json_object_get(wheel, "speed_rpm"));
    }
    json_decref(status);
    return seen;
}

/// Waits for Enter while it adds up what turns. False if the operator wants to quit.
static bool follow(bringup_t *self, const char *prompt, way_t *out_way) {
    char line[16];
    const unsigned signals = signals_count();
    const look_t first = look(self);
    look_t last;
    int64_t last_us = client_now_us();
    struct pollfd input = {.fd = STDIN_FILENO, .events = POLLIN};
    memset(out_way, 0, sizeof(*out_way));
    (void)printf("%s ", prompt);
    (void)fflush(stdout);
    while (poll(&input, 1, LOOK_MS) == 0 && signals_count() == signals) {
        const int64_t now_us = client_now_us();
        last = look(self);
        for (unsigned side = 0; side < IW_SIDES; side++) {
            out_way->rpm_turns[side] += abs(last.rpm[side]) * (double)(now_us - last_us) / 60e6;
        }
        last_us = now_us;
    }
    last = look(self);
    out_way->heard = first.heard && last.heard;
    for (unsigned side = 0; side < IW_SIDES; side++) {
        out_way->ticks[side] = last.ticks[side] - first.ticks[side];
    }
    return read(STDIN_FILENO, line, sizeof(line)) > 0 && line[0] != 'q' && signals_count() == signals;
}

/// Rounds to a whole number if it is nearly one; else to a fraction of hundredths that the configuration can hold.
static void keep_gear(bringup_t *self, double gear) {
    const double whole = round(gear);
    iw_config_t *core = &self->config.core;
    if (fabs(gear - whole) <= gear * GEAR_PERCENT / 100.0) {
        core->gear_turns = (uint16_t)whole;
        core->gear_per = 1;
    } else {
        core->gear_turns = (uint16_t)round(gear * 10.0);
        core->gear_per = 10;
    }
}

static bringup_result_t judge_gear(bringup_t *self, const way_t *way) {
    const double rotor = (double)llabs(way->ticks[IW_LEFT]) / IW_TICKS_PER_TURN;
    const double gear = rotor / TURNS;
    const double share = rotor > 0.0 ? way->rpm_turns[IW_LEFT] / rotor : 0.0;
    bool yes = false;
    if (!way->heard || gear < 1.0 - GEAR_PERCENT / 100.0 || gear > 100.0) {
        talk_say("  %lld ticks of the left wheel in %d turns make no gear between 1 and 100: it stays as it was.",
                 way->ticks[IW_LEFT], TURNS);
        return BRINGUP_ON;
    }
    keep_gear(self, gear);
    iw_config_t *core = &self->config.core;
    // Without a gear the wheel's rpm and the rotor's are the same.
    core->rpm_of_rotor = core->gear_turns > core->gear_per && share > (1.0 + 1.0 / gear) / 2.0;
    talk_say("  %lld ticks in %d turns: %.2f turns of the rotor per turn of the wheel; the rpm count the %s's turns.",
             llabs(way->ticks[IW_LEFT]), TURNS, gear, core->rpm_of_rotor ? "rotor" : "wheel");
    if (!talk_yes("Take that?", true, &yes)) {
        return BRINGUP_QUIT;
    }
    if (yes) {
        bringup_note(self, "wheels", "gear_ratio", "gear_ratio", "%lld ticks in %d turns of the left wheel by hand",
                     llabs(way->ticks[IW_LEFT]), TURNS);
        bringup_note(self, "wheels", "rpm_of", NULL, "rpm summed up over these turns make %.2f of the rotor's", share);
    }
    return BRINGUP_ON;
}

bringup_result_t bringup_gear(bringup_t *self) {
    const iw_config_t before = self->config.core;
    bool wanted = false;
    way_t way;
    char prompt[80];
    talk_step(3, "the gear (nothing is sent; you turn)");
    talk_say("The wheels count %u ticks per turn of the rotor. Whether the rotor turns faster than the wheel, the "
             "document does not say.",
             IW_TICKS_PER_TURN);
    if (!talk_yes("Turn the left wheel by hand?", true, &wanted)) {
        return BRINGUP_QUIT;
    }
    if (!wanted) {
        return BRINGUP_ON;
    }
    if (!trial_start(self, &self->config, false) || !trial_wait_ready(self)) {
        return BRINGUP_FAILED;
    }
    (void)snprintf(prompt, sizeof(prompt), "Turn it exactly %d times in one direction, then press Enter ...", TURNS);
    if (!follow(self, prompt, &way)) {
        return BRINGUP_QUIT;
    }
    const unsigned notes = self->notes;
    const bringup_result_t result = judge_gear(self, &way);
    if (self->notes == notes) {
        self->config.core = before;
    }
    return result;
}

/// Radius in mm by a distance and the ticks of a wheel.
static double radius_of(const bringup_t *self, double distance_m, long long ticks) {
    const iw_config_t *core = &self->config.core;
    const double turns = (double)llabs(ticks) / IW_TICKS_PER_TURN * core->gear_per / core->gear_turns;
    return turns > 0.0 ? distance_m * 1000.0 / (2.0 * M_PI * turns) : 0.0;
}

/// The odometry of a machine that was pushed forwards must have counted forwards, by the signs found before.
static bool counts_forwards(const bringup_t *self, const way_t *way) {
    for (unsigned side = 0; side < IW_SIDES; side++) {
        const bool forwards = (way->ticks[side] > 0) != self->config.core.invert[side];
        if (!forwards) {
            talk_say(
                "  The %s wheel counted backwards while the machine went forwards. Either it was pushed backwards, "
                "or the sign of step 6 is wrong: begin again if you are not sure.",
                names[side]);
            return false;
        }
    }
    return true;
}

static bringup_result_t judge_radius(bringup_t *self, const way_t *way, double distance_m, bool *out_done) {
    const double left = radius_of(self, distance_m, way->ticks[IW_LEFT]);
    const double right = radius_of(self, distance_m, way->ticks[IW_RIGHT]);
    const double mean = (left + right) / 2.0;
    bool yes = false;
    *out_done = false;
    if (!way->heard || llabs(way->ticks[IW_LEFT]) < TICKS_MIN || llabs(way->ticks[IW_RIGHT]) < TICKS_MIN) {
        talk_say("  Too few ticks (left %lld, right %lld): push further, both wheels on the ground.",
                 way->ticks[IW_LEFT], way->ticks[IW_RIGHT]);
        return BRINGUP_ON;
    }
    if (!counts_forwards(self, way)) {
        return BRINGUP_ON;
    }
    talk_say("  Left %.1f mm, right %.1f mm; mean %.0f mm.", left, right, mean);
    if (fabs(left - right) > mean * ALIKE_PERCENT / 100.0) {
        talk_say("  They differ by more than %.0f %%: it was a curve, or the tyres differ. Better once more, straight.",
                 ALIKE_PERCENT);
    }
    if (mean < RADIUS_MIN || mean > RADIUS_MAX) {
        talk_say("  That is no radius between %d and %d mm: was the distance in metres?", RADIUS_MIN, RADIUS_MAX);
        return BRINGUP_ON;
    }
    if (!talk_yes("Take the mean?", true, &yes)) {
        return BRINGUP_QUIT;
    }
    *out_done = yes;
    if (yes) {
        self->config.core.radius_mm = (uint16_t)lround(mean);
        bringup_note(self, "wheels", "radius_mm", "wheel_radius", "%.2f m pushed: left %lld, right %lld ticks",
                     distance_m, way->ticks[IW_LEFT], way->ticks[IW_RIGHT]);
    }
    return BRINGUP_ON;
}

bringup_result_t bringup_radius(bringup_t *self) {
    char answer[BRINGUP_ANSWER_SIZE];
    talk_step(8, "the radius (nothing is sent; you push)");
    talk_say("The document says approximately 192 mm. Put the machine on the ground, mark a straight distance of 3 m "
             "or more, and push the machine along it with its wheels rolling.");
    if (!trial_start(self, &self->config, false) || !trial_wait_ready(self)) {
        return BRINGUP_FAILED;
    }
    for (bool done = false; !done;) {
        double distance_m = 0.0;
        way_t way;
        if (!talk_number("Distance in m", DISTANCE_MIN, DISTANCE_MAX, &distance_m, &done)) {
            return BRINGUP_QUIT;
        }
        done = !done;
        if (done) {
            break;
        }
        if (!talk_ask("Stand at the start, then Enter", "go", answer) ||
            !follow(self, "Push it forwards to the end mark, let it stand, then press Enter ...", &way)) {
            return BRINGUP_QUIT;
        }
        const bringup_result_t result = judge_radius(self, &way, distance_m, &done);
        if (result != BRINGUP_ON) {
            return result;
        }
    }
    return BRINGUP_ON;
}
