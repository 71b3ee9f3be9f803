// SPDX-License-Identifier: MIT
#include "evidence.h"

#include "iwheel/codec.h"

#include <stdlib.h>
#include <string.h>

void gw_evidence_init(gw_evidence_t *self) {
    (void)memset(self, 0, sizeof *self);
    self->pose_us = IW_NEVER;
    for (size_t side = 0; side < IW_SIDES; ++side) {
        self->wheel[side].speed_us = IW_NEVER;
        self->wheel[side].status_us = IW_NEVER;
        self->wheel[side].steady_us = IW_NEVER;
    }
}

static void close_window(gw_evidence_wheel_t *self) {
    self->open = false;
    self->turned = 0;
}

/// Adds what it turned since the last speed frame. A gap, a slow wheel or a new direction ends the window.
static void add_turn(gw_evidence_wheel_t *self, const iw_wheel_t *wheel) {
    const int16_t rpm = wheel->speed.speed_rpm;
    const bool gap = self->speed_us == IW_NEVER || wheel->speed_us - self->speed_us > GW_EVIDENCE_GAP_US ||
                     self->reboots != wheel->reboots;
    const bool steady =
        abs(rpm) >= GW_EVIDENCE_RPM && abs(self->rpm) >= GW_EVIDENCE_RPM && (rpm < 0) == (self->rpm < 0);
    if (gap || !steady) {
        close_window(self);
    } else if (self->open) {
        self->turned += ((int64_t)rpm + self->rpm) * (int64_t)(wheel->speed_us - self->speed_us) / 2;
    }
    self->speed_us = wheel->speed_us;
    self->rpm = rpm;
    self->reboots = wheel->reboots;
}

/// One rotor rpm is one tick per second, since 60 ticks are one turn.
static int64_t expected_ticks(const gw_evidence_wheel_t *self, const iw_config_t *config) {
    const int64_t turned = self->turned / 1000000;
    return config->rpm_of_rotor ? turned : turned * config->gear_turns / config->gear_per;
}

static void judge_ratio(gw_evidence_wheel_t *self, iw_gateway_t *gateway, int64_t moved, int64_t expected) {
    const int64_t permille = moved * 1000 / expected;
    const int64_t off = llabs(permille - 1000);
    const int32_t figure = (int32_t)(permille > INT32_MAX ? INT32_MAX : permille < INT32_MIN ? INT32_MIN : permille);
    if (off <= GW_EVIDENCE_FITS_PERMILLE) {
        self->misses = 0;
        if (iw_ledger_entry(&gateway->ledger, IW_LEDGER_GEAR_RATIO)->state == IW_LEDGER_ASSUMED) {
            iw_ledger_confirm(&gateway->ledger, IW_LEDGER_GEAR_RATIO, IW_EVIDENCE_BUS, figure);
        }
    } else if (off > GW_EVIDENCE_FAILS_PERMILLE) {
        ++self->misses;
        if (self->misses == GW_EVIDENCE_MISSES) {
            iw_ledger_contradict(&gateway->ledger, IW_LEDGER_GEAR_RATIO, IW_EVIDENCE_BUS, figure);
        }
    }
}

/// Windows begin and end with a status frame, which brings the ticks.
static void compare_ticks(gw_evidence_wheel_t *self, iw_gateway_t *gateway, const iw_wheel_t *wheel) {
    const int64_t moved = wheel->ticks - self->ticks;
    const int64_t expected = expected_ticks(self, &gateway->config);
    const bool enough = llabs(expected) >= GW_EVIDENCE_TICKS;
    if (self->open && !enough) {
        return;
    }
    if (self->open) {
        judge_ratio(self, gateway, moved, expected);
    }
    self->turned = 0;
    self->ticks = wheel->ticks;
    self->open = abs(wheel->speed.speed_rpm) >= GW_EVIDENCE_RPM;
}

static void look_at_type(gw_evidence_wheel_t *self, iw_gateway_t *gateway, iw_side_t side, iw_time_us_t now_us) {
    const int32_t applied = iw_setpoint_applied(&gateway->setpoint).wheel[side].speed_mm_s;
    const int32_t measured = iw_wheel_speed_mm_s(&gateway->wheel[side]);
    const int32_t one_rpm = (int32_t)gateway->wheel[side].um_s_per_rpm / 1000 + 1;
    const bool driving = iw_gateway_state(gateway) == IW_STATE_ARMED && abs(applied) >= GW_EVIDENCE_TYPE_MM_S;
    const bool follows =
        iw_wheel_heard(&gateway->wheel[side], now_us) && abs(measured - applied) <= abs(applied) * 15 / 100 + one_rpm;
    if (!driving || !follows || applied != self->applied_mm_s) {
        self->steady_us = IW_NEVER;
        self->applied_mm_s = (int16_t)applied;
    } else if (self->steady_us == IW_NEVER) {
        self->steady_us = now_us;
    } else if (now_us - self->steady_us >= GW_EVIDENCE_TYPE_US &&
               iw_ledger_entry(&gateway->ledger, IW_LEDGER_SETPOINT_TYPE)->state == IW_LEDGER_ASSUMED) {
        iw_ledger_confirm(&gateway->ledger, IW_LEDGER_SETPOINT_TYPE, IW_EVIDENCE_BUS, measured * 1000 / applied);
    }
}

static int16_t reversed(int16_t value) {
    const uint16_t bits = (uint16_t)value;
    return (int16_t)(uint16_t)((bits << 8) | (bits >> 8));
}

/// The shorter way round 16 bits: X, Y and PSI wrap.
static int64_t step_of(int16_t from, int16_t to) {
    return llabs((int16_t)(uint16_t)((uint16_t)to - (uint16_t)from));
}

static void look_at_pose(gw_evidence_t *self, iw_gateway_t *gateway) {
    const iw_codec_pose_t was = self->pose;
    const iw_codec_pose_t is = gateway->told[IW_RIGHT].pose;
    const bool gap =
        self->pose_us == IW_NEVER || gateway->pose_us - self->pose_us > (iw_time_us_t)2 * GW_EVIDENCE_GAP_US;
    if (gateway->pose_us == IW_NEVER || gateway->pose_us == self->pose_us) {
        return;
    }
    self->pose_us = gateway->pose_us;
    self->pose = is;
    const int64_t step = step_of(was.x_mm, is.x_mm) + step_of(was.y_mm, is.y_mm) + step_of(was.psi_mrad, is.psi_mrad);
    if (gap || step == 0) {
        return;
    }
    self->moved += step;
    self->reversed += step_of(reversed(was.x_mm), reversed(is.x_mm)) + step_of(reversed(was.y_mm), reversed(is.y_mm)) +
                      step_of(reversed(was.psi_mrad), reversed(is.psi_mrad));
    ++self->pose_steps;
    if (self->pose_steps < GW_EVIDENCE_POSE_STEPS) {
        return;
    }
    const int32_t figure = (int32_t)(self->reversed * 1000 / self->moved);
    if (self->reversed >= GW_EVIDENCE_POSE_FACTOR * self->moved) {
        if (iw_ledger_entry(&gateway->ledger, IW_LEDGER_POSE_BYTE_ORDER)->state == IW_LEDGER_ASSUMED) {
            iw_ledger_confirm(&gateway->ledger, IW_LEDGER_POSE_BYTE_ORDER, IW_EVIDENCE_BUS, figure);
        }
    } else if (self->moved >= GW_EVIDENCE_POSE_FACTOR * self->reversed) {
        iw_ledger_contradict(&gateway->ledger, IW_LEDGER_POSE_BYTE_ORDER, IW_EVIDENCE_BUS, figure);
    }
    self->pose_steps = 0;
    self->moved = 0;
    self->reversed = 0;
}

void gw_evidence_look(gw_evidence_t *self, iw_gateway_t *gateway, iw_time_us_t now_us) {
    for (unsigned i = 0; i < IW_SIDES; ++i) {
        gw_evidence_wheel_t *evidence = &self->wheel[i];
        const iw_wheel_t *wheel = &gateway->wheel[i];
        if (wheel->speed_us != IW_NEVER && wheel->speed_us != evidence->speed_us) {
            add_turn(evidence, wheel);
        }
        if (wheel->status_us != IW_NEVER && wheel->status_us != evidence->status_us) {
            evidence->status_us = wheel->status_us;
            compare_ticks(evidence, gateway, wheel);
        }
        look_at_type(evidence, gateway, (iw_side_t)i, now_us);
    }
    look_at_pose(self, gateway);
}
