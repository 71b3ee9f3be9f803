// SPDX-License-Identifier: MIT
#include "commander.h"

#include "pins.h"
#include "report.h"

#define CLIENT    1U
#define RETRY_US  100000U
#define STABLE_US 20000U

/// This source stores nothing over power-off.
void brd_commander_open(bool power_on, bool in_motion) {
    (void)power_on;
    (void)in_motion;
}

/// The build options are the whole configuration.
void brd_commander_configure(iw_config_t *config) {
    (void)config;
}

/// Debounces both edges. A button that is stuck, or that is pressed since before power-on, never counts as a press (R3:
/// motion never begins on its own).
bool brd_commander_pressed(brd_commander_t *self, iw_time_us_t now_us) {
    const bool level = brd_pins_button_low();
    if (level != self->level) {
        self->level = level;
        self->change_us = now_us;
    }
    if (now_us - self->change_us < STABLE_US) {
        return false;
    }
    const bool press = level && self->released;
    self->released = !level;
    return press;
}

void brd_commander_reset(iw_gateway_t *gateway, iw_time_us_t now_us) {
    if (iw_gateway_state(gateway) == IW_STATE_LATCHED) {
        brd_report_reset(iw_gateway_reset(gateway, now_us));
    }
}

bool brd_commander_arm(brd_commander_t *self, iw_gateway_t *gateway, iw_time_us_t now_us) {
    const iw_state_t state = iw_gateway_state(gateway);
    if (state == IW_STATE_ARMED) {
        return true;
    }
    if (state != IW_STATE_LATCHED && !iw_gateway_arming(gateway) && now_us - self->tried_us >= RETRY_US) {
        self->tried_us = now_us;
        (void)iw_gateway_arm(gateway, now_us, CLIENT, false);
    }
    return false;
}

iw_refusal_t brd_commander_drive(iw_gateway_t *gateway, iw_time_us_t now_us, int32_t speed_mm_s) {
    // With the role setpoint the current is 0, because this source does not know which current moves the machine.
    const iw_drive_t drive = {
        .speed_mm_s = {speed_mm_s, speed_mm_s},
        .current_mA = {0, 0},
        .has_current = IWHEEL_CURRENT_ROLE_VALUE == IW_ROLE_SETPOINT,
    };
    iw_applied_t applied;
    return iw_gateway_drive(gateway, now_us, CLIENT, &drive, &applied);
}
