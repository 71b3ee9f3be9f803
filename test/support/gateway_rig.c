// SPDX-License-Identifier: MIT
#include "gateway_rig.h"
#include "message.h"

#include <string.h>

#define SPEED_PERIOD_US  4000U
#define STATUS_PERIOD_US 40000U
/// After a longer stall, earlier frames of the wheels are left out: they would not fit into the queue.
#define STALL_SENDING_US 1000000U
/// Speed of 1 rpm for a wheel with a radius of 192 mm.
#define UM_S_PER_RPM 20106
/// More steps at one time than the processing of a full queue needs.
#define STEPS_AT_ONCE_MAX 1000U

void gateway_rig_init(gateway_rig_t *self) {
    memset(self, 0, sizeof *self);
    fixture_config(&self->config);
    gateway_rig_begin(self, false);
}

static void begin_at(gateway_rig_t *self, iw_time_us_t now_us, bool restarted) {
    const iw_config_t config = self->config;
    memset(self, 0, sizeof *self);
    self->config = config;
    self->now_us = now_us;
    self->wake_us = self->now_us;
    self->speed_period_us = SPEED_PERIOD_US;
    fake_bus_init(&self->bus, self->now_us);
    const iw_hal_t hal = fake_bus_hal(&self->bus);
    memset(&self->gateway, FIXTURE_POISON, sizeof self->gateway);
    (void)iw_gateway_init(&self->gateway, &self->config, &hal, self->now_us, restarted);
    gateway_judge_init(&self->judge, &self->gateway, &self->bus);
    for (size_t side = 0; side < IW_SIDES; side++) {
        self->wheel[side].speed_us = self->now_us + 1000U * side;
        self->wheel[side].status_us = self->now_us + 2000U;
    }
}

void gateway_rig_begin(gateway_rig_t *self, bool restarted) {
    begin_at(self, FIXTURE_START_US, restarted);
}

void gateway_rig_power_on(gateway_rig_t *self) {
    begin_at(self, 0, false);
}

/// Moves the wheel as last commanded, until its own watchdog stops it.
static int16_t rpm_of(const gateway_rig_t *self, size_t side) {
    const fake_bus_t *const bus = &self->bus;
    if (self->wheel[side].rpm_fixed) {
        return self->wheel[side].rpm;
    }
    if (bus->commanded_us[side] == IW_NEVER || self->now_us - bus->commanded_us[side] > IW_WHEEL_WATCHDOG_US) {
        return 0;
    }
    return (int16_t)(bus->commanded_mm_s[side] * 1000 / UM_S_PER_RPM);
}

static void wheel_send(gateway_rig_t *self, size_t side) {
    rig_wheel_t *const wheel = &self->wheel[side];
    message_t message = {IW_CODEC_SPEED, (iw_side_t)side, {.speed = {.speed_rpm = rpm_of(self, side)}}};
    iw_can_frame_t frame;
    while (wheel->speed_us <= self->now_us) {
        wheel->speed_us += self->speed_period_us;
        if (!wheel->mute && self->bus.state >= IW_BUS_PASSIVE) {
            (void)message_encode(&message, &frame);
            fake_bus_put(&self->bus, &frame);
        }
    }
    while (wheel->status_us <= self->now_us) {
        wheel->status_us += STATUS_PERIOD_US;
        message.kind = IW_CODEC_STATUS;
        message.as.status = (iw_codec_status_t){wheel->ticks, 240, 30, 20};
        if (!wheel->mute && self->bus.state >= IW_BUS_PASSIVE) {
            (void)message_encode(&message, &frame);
            fake_bus_put(&self->bus, &frame);
        }
    }
}

static void advance(gateway_rig_t *self) {
    fake_bus_advance(&self->bus, self->now_us);
    wheel_send(self, IW_LEFT);
    wheel_send(self, IW_RIGHT);
}

void gateway_rig_begin_apart(gateway_rig_t *self) {
    self->config.pair_mm = 150;
    self->config.pair_leak_ms = 500;
    gateway_rig_begin(self, false);
}

void gateway_rig_step(gateway_rig_t *self) {
    const iw_time_us_t late_us = (self->now_us > self->wake_us) ? self->now_us - self->wake_us : 0;
    advance(self);
    gateway_judge_before(&self->judge, self->bus.estop_level != 0 || self->bus.estop_edge, late_us);
    self->wake_us = iw_gateway_step(&self->gateway, self->now_us);
    gateway_judge_after(&self->judge, self->wake_us);
    self->steps++;
}

static iw_time_us_t sooner(iw_time_us_t a, iw_time_us_t b) {
    return (a < b) ? a : b;
}

void gateway_rig_run(gateway_rig_t *self, iw_time_us_t for_us) {
    const iw_time_us_t until_us = self->now_us + for_us;
    uint32_t steps_now = 0;
    while (true) {
        iw_time_us_t next_us = sooner(self->wake_us, fake_bus_next_us(&self->bus));
        next_us = sooner(next_us, sooner(self->wheel[IW_LEFT].speed_us, self->wheel[IW_RIGHT].speed_us));
        if (next_us > until_us || self->judge.violation != NULL) {
            break;
        }
        steps_now = (next_us > self->now_us) ? 0U : steps_now + 1U;
        if (steps_now > STEPS_AT_ONCE_MAX) {
            self->judge.violation = "asks forever to be called again immediately";
            break;
        }
        self->now_us = (next_us > self->now_us) ? next_us : self->now_us;
        gateway_rig_step(self);
    }
    self->now_us = until_us;
    fake_bus_advance(&self->bus, until_us);
}

void gateway_rig_stall(gateway_rig_t *self, iw_time_us_t for_us) {
    const iw_time_us_t until_us = self->now_us + for_us;
    if (for_us > STALL_SENDING_US) {
        self->now_us = until_us - STALL_SENDING_US;
        self->wheel[IW_LEFT].speed_us = self->wheel[IW_RIGHT].speed_us = self->now_us;
        self->wheel[IW_LEFT].status_us = self->wheel[IW_RIGHT].status_us = self->now_us;
    }
    while (self->now_us < until_us) {
        self->now_us = sooner(self->now_us + 1000U, until_us);
        advance(self);
    }
    gateway_rig_step(self);
}

void gateway_rig_arm(gateway_rig_t *self) {
    gateway_rig_run(self, MS(1100));
    (void)gateway_rig_request_arm(self, HOLDER, false);
    gateway_rig_run(self, MS(10));
}

iw_refusal_t gateway_rig_cruise(gateway_rig_t *self, int32_t left_mm_s, int32_t right_mm_s, iw_time_us_t for_us) {
    const iw_time_us_t until_us = self->now_us + for_us;
    iw_refusal_t refusal = IW_REFUSE_NONE;
    while (self->now_us < until_us) {
        refusal = gateway_rig_drive(self, HOLDER, left_mm_s, right_mm_s);
        gateway_rig_run(self, sooner(MS(50), until_us - self->now_us));
    }
    return refusal;
}

iw_refusal_t gateway_rig_drive(gateway_rig_t *self, iw_client_t client, int32_t left_mm_s, int32_t right_mm_s) {
    const bool with_current = self->config.current_role == IW_ROLE_SETPOINT;
    const iw_drive_t request = {{left_mm_s, right_mm_s}, {left_mm_s / 2, right_mm_s / 2}, with_current};
    iw_applied_t applied;
    fake_bus_advance(&self->bus, self->now_us);
    gateway_judge_asked(&self->judge, left_mm_s != 0 || right_mm_s != 0);
    const iw_refusal_t refusal = iw_gateway_drive(&self->gateway, self->now_us, client, &request, &applied);
    if (refusal == IW_REFUSE_NONE) {
        gateway_judge_drive(&self->judge, left_mm_s != 0 || right_mm_s != 0);
    }
    gateway_rig_step(self);
    return refusal;
}

iw_refusal_t gateway_rig_request_arm(gateway_rig_t *self, iw_client_t client, bool takeover) {
    const iw_client_t before = self->gateway.permit.holder;
    fake_bus_advance(&self->bus, self->now_us);
    const iw_refusal_t refusal = iw_gateway_arm(&self->gateway, self->now_us, client, takeover);
    if (refusal == IW_REFUSE_NONE && client != before) {
        gateway_judge_renew(&self->judge);
    }
    gateway_rig_step(self);
    return refusal;
}

iw_refusal_t gateway_rig_reset(gateway_rig_t *self) {
    const bool latched = iw_gateway_state(&self->gateway) == IW_STATE_LATCHED;
    fake_bus_advance(&self->bus, self->now_us);
    const iw_refusal_t refusal = iw_gateway_reset(&self->gateway, self->now_us);
    if (refusal == IW_REFUSE_NONE && latched) {
        gateway_judge_renew(&self->judge);
    }
    gateway_rig_step(self);
    return refusal;
}

void gateway_rig_stop(gateway_rig_t *self) {
    iw_gateway_stop(&self->gateway, self->now_us, HOLDER, IW_CAUSE_CLIENT_STOP);
    gateway_rig_step(self);
}

void gateway_rig_press(gateway_rig_t *self, bool pressed) {
    self->bus.estop_level = pressed ? 1 : 0;
    self->bus.estop_edge = true;
}

void gateway_rig_foreign(gateway_rig_t *self, uint32_t id) {
    fake_bus_put_empty(&self->bus, id, 5);
}

bool gateway_rig_commands_zero(const gateway_rig_t *self) {
    for (size_t side = 0; side < IW_SIDES; side++) {
        const iw_command_t command = fake_bus_command(&self->bus.last[side]);
        const bool current_zero = self->config.current_role == IW_ROLE_LIMIT || command.current_mA == 0;
        if (command.speed_mm_s != 0 || !current_zero) {
            return false;
        }
    }
    return true;
}

iw_snapshot_t gateway_rig_snapshot(const gateway_rig_t *self) {
    iw_snapshot_t seen;
    iw_gateway_snapshot(&self->gateway, self->now_us, &seen);
    return seen;
}
