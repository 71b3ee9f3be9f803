// SPDX-License-Identifier: MIT
/// A whole gateway on a simulated bus with two obedient wheels, in virtual time, next to the judge of the invariants.
#ifndef TEST_GATEWAY_RIG_H
#define TEST_GATEWAY_RIG_H

#include "gateway_judge.h"

#define HOLDER ((iw_client_t)7)
#define OTHER  ((iw_client_t)8)

typedef struct {
    bool mute;      ///< Sends nothing.
    bool rpm_fixed; ///< Turns with `rpm`, whatever is commanded.
    int16_t rpm;    ///< As on the bus.
    int32_t ticks;
    iw_time_us_t speed_us;  ///< When its next speed frame is due.
    iw_time_us_t status_us; ///< When its next status frame is due.
} rig_wheel_t;

typedef struct {
    iw_config_t config;
    fake_bus_t bus;
    iw_gateway_t gateway;
    gateway_judge_t judge;
    rig_wheel_t wheel[IW_SIDES];
    iw_time_us_t speed_period_us; ///< Period of the wheels' speed frames: 4000 at first, as documented.
    iw_time_us_t now_us;
    iw_time_us_t wake_us; ///< Result of the last step.
    uint32_t steps;
} gateway_rig_t;

/// Begins with the configuration of the fixture.
void gateway_rig_init(gateway_rig_t *self);

/// Begins again with the rig's configuration. Makes no step.
void gateway_rig_begin(gateway_rig_t *self, bool restarted);

/// The same on a board that has just been powered: its clock begins at zero.
void gateway_rig_power_on(gateway_rig_t *self);

/// Begins again with the widest limits of the pair, so that only the rules of one wheel judge that wheel.
void gateway_rig_begin_apart(gateway_rig_t *self);

/// Makes one step; before it, the controller and the wheels do all that is due.
void gateway_rig_step(gateway_rig_t *self);

/// Lets time pass and steps whenever a frame comes or the gateway wants to be called. Makes no step after a violation.
void gateway_rig_run(gateway_rig_t *self, iw_time_us_t for_us);

/// Lets time pass without a step, then makes one step. Frames wait meanwhile.
void gateway_rig_stall(gateway_rig_t *self, iw_time_us_t for_us);

/// Runs until the wheels are known to be at standstill, arms HOLDER and runs until it is armed.
void gateway_rig_arm(gateway_rig_t *self);

/// HOLDER commands these speeds every 50 ms for that long. Returns the last refusal.
iw_refusal_t gateway_rig_cruise(gateway_rig_t *self, int32_t left_mm_s, int32_t right_mm_s, iw_time_us_t for_us);

/// Makes the request now, followed by a step, as an owner does.
iw_refusal_t gateway_rig_drive(gateway_rig_t *self, iw_client_t client, int32_t left_mm_s, int32_t right_mm_s);
iw_refusal_t gateway_rig_request_arm(gateway_rig_t *self, iw_client_t client, bool takeover);
iw_refusal_t gateway_rig_reset(gateway_rig_t *self);
void gateway_rig_stop(gateway_rig_t *self);

/// Presses (or releases) the button now, without a step.
void gateway_rig_press(gateway_rig_t *self, bool pressed);

/// Another sender sends a setpoint.
void gateway_rig_foreign(gateway_rig_t *self, uint32_t id);

/// True if the last setpoints accepted for both wheels are zero.
bool gateway_rig_commands_zero(const gateway_rig_t *self);

/// Returns a snapshot of the gateway.
iw_snapshot_t gateway_rig_snapshot(const gateway_rig_t *self);

#endif
