// SPDX-License-Identifier: MIT
#include "commander.h"

/// Profile: both wheels slowly forward, standstill, back, standstill. It ends at the starting point.
typedef struct {
    uint32_t until_us;
    int32_t speed_mm_s;
} leg_t;

static const leg_t profile[] = {{2000000U, 100}, {3000000U, 0}, {5000000U, -100}, {6000000U, 0}};

#define LEGS (sizeof profile / sizeof profile[0])

bool brd_commander_sends(void) {
    return true;
}

const char *brd_commander_name(void) {
    return "holds both wheels at zero; the button starts a slow profile";
}

static int32_t profile_speed_mm_s(brd_commander_t *self, iw_time_us_t now_us) {
    for (size_t leg = 0; leg < LEGS && self->running; leg++) {
        if (now_us - self->profile_us < profile[leg].until_us) {
            return profile[leg].speed_mm_s;
        }
    }
    self->running = false;
    return 0;
}

/// The button resets a latch, starts the profile, or stops it. A press never does two of these.
void brd_commander_step(brd_commander_t *self, iw_gateway_t *gateway, iw_time_us_t now_us) {
    const bool press = brd_commander_pressed(self, now_us);
    if (!brd_commander_arm(self, gateway, now_us)) {
        self->running = false;
        if (press) {
            brd_commander_reset(gateway, now_us);
        }
        return;
    }
    if (press) {
        self->running = !self->running;
        self->profile_us = now_us;
    }
    (void)brd_commander_drive(gateway, now_us, profile_speed_mm_s(self, now_us));
}
