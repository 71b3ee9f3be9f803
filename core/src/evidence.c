// SPDX-License-Identifier: MIT
#include "iwheel/evidence.h"

#include "iwheel/gateway.h"
#include "magnitude.h"

#include <string.h>

void iw_motion_evidence_init(iw_motion_evidence_t *self) {
    memset(self, 0, sizeof *self);
    self->pose_us = IW_NEVER;
    for (size_t side = 0; side < IW_SIDES; side++) {
        self->wheel[side].speed_us = IW_NEVER;
        self->wheel[side].status_us = IW_NEVER;
        self->wheel[side].steady_us = IW_NEVER;
    }
}

/// What is no longer only assumed needs no more evidence for it.
static void confirm(iw_gateway_t *gateway, const iw_snapshot_t *seen, iw_ledger_item_t item, int32_t figure) {
    const iw_ledger_entry_t entry = {IW_LEDGER_CONFIRMED, IW_EVIDENCE_BUS, figure};
    if (seen->assumed[item].state == IW_LEDGER_ASSUMED) {
        iw_gateway_know(gateway, item, &entry);
    }
}

static void contradict(iw_gateway_t *gateway, iw_ledger_item_t item, int32_t figure) {
    const iw_ledger_entry_t entry = {IW_LEDGER_CONTRADICTED, IW_EVIDENCE_BUS, figure};
    iw_gateway_know(gateway, item, &entry);
}

static bool turns(int16_t rpm) {
    return iw_magnitude(rpm) >= IW_EVIDENCE_RPM;
}

/// Of 64 bits.
static int64_t magnitude(int64_t value) {
    return (value < 0) ? -value : value;
}

static void close_window(iw_motion_evidence_wheel_t *self) {
    self->open = false;
    self->turned = 0;
}

/// Adds what it turned since the last speed frame. A gap, a slow wheel or a new direction ends the window.
static void add_turn(iw_motion_evidence_wheel_t *self, const iw_snapshot_wheel_t *wheel) {
    const int16_t rpm = wheel->told->speed.speed_rpm;
    const bool gap = self->speed_us == IW_NEVER || wheel->speed_us - self->speed_us > IW_EVIDENCE_GAP_US ||
                     self->reboots != wheel->reboots;
    const bool steady = turns(rpm) && turns(self->rpm) && (rpm < 0) == (self->rpm < 0);
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
static int64_t expected_ticks(const iw_motion_evidence_wheel_t *self, const iw_config_t *config) {
    const int64_t turned = self->turned / 1000000;
    return config->rpm_of_rotor ? turned : turned * config->gear_turns / config->gear_per;
}

static void judge_ratio(iw_motion_evidence_wheel_t *self, iw_gateway_t *gateway, const iw_snapshot_t *seen,
                        int64_t moved, int64_t expected) {
    const int64_t permille = moved * 1000 / expected;
    const int64_t off = magnitude(permille - 1000);
    const int32_t figure = (int32_t)(permille > INT32_MAX ? INT32_MAX : permille < INT32_MIN ? INT32_MIN : permille);
    if (off <= IW_EVIDENCE_FITS_PERMILLE) {
        self->misses = 0;
        confirm(gateway, seen, IW_LEDGER_GEAR_RATIO, figure);
    } else if (off > IW_EVIDENCE_FAILS_PERMILLE) {
        self->misses++;
        if (self->misses == IW_EVIDENCE_MISSES) {
            contradict(gateway, IW_LEDGER_GEAR_RATIO, figure);
        }
    }
}

/// Windows begin and end with a status frame, which brings the ticks.
static void compare_ticks(iw_motion_evidence_wheel_t *self, iw_gateway_t *gateway, const iw_snapshot_t *seen,
                          const iw_snapshot_wheel_t *wheel) {
    const int64_t moved = wheel->ticks - self->ticks;
    const int64_t expected = expected_ticks(self, seen->config);
    const bool enough = magnitude(expected) >= IW_EVIDENCE_TICKS;
    if (self->open && !enough) {
        return;
    }
    if (self->open) {
        judge_ratio(self, gateway, seen, moved, expected);
    }
    self->turned = 0;
    self->ticks = wheel->ticks;
    self->open = turns(wheel->told->speed.speed_rpm);
}

static void look_at_type(iw_motion_evidence_wheel_t *self, iw_gateway_t *gateway, const iw_snapshot_t *seen,
                         size_t side) {
    const int32_t applied = seen->applied.wheel[side].speed_mm_s;
    const int32_t measured = seen->wheel[side].speed_mm_s;
    const int32_t one_rpm = (int32_t)seen->wheel[side].um_s_per_rpm / 1000 + 1;
    const bool driving = seen->state == IW_STATE_ARMED && iw_magnitude(applied) >= IW_EVIDENCE_TYPE_MM_S;
    const bool follows =
        seen->wheel[side].heard && iw_magnitude(measured - applied) <= iw_magnitude(applied) * 15 / 100 + one_rpm;
    if (!driving || !follows || applied != self->applied_mm_s) {
        self->steady_us = IW_NEVER;
        self->applied_mm_s = (int16_t)applied;
    } else if (self->steady_us == IW_NEVER) {
        self->steady_us = seen->at_us;
    } else if (seen->at_us - self->steady_us >= IW_EVIDENCE_TYPE_US) {
        confirm(gateway, seen, IW_LEDGER_SETPOINT_TYPE, measured * 1000 / applied);
    }
}

static int16_t reversed(int16_t value) {
    const uint16_t bits = (uint16_t)value;
    return (int16_t)(uint16_t)((bits << 8) | (bits >> 8));
}

/// The shorter way round 16 bits: X, Y and PSI wrap.
static int64_t step_of(int16_t from, int16_t to) {
    return magnitude((int16_t)(uint16_t)((uint16_t)to - (uint16_t)from));
}

static void look_at_pose(iw_motion_evidence_t *self, iw_gateway_t *gateway, const iw_snapshot_t *seen) {
    const iw_codec_pose_t was = self->pose;
    const iw_codec_pose_t is = seen->wheel[IW_RIGHT].told->pose;
    const bool gap = self->pose_us == IW_NEVER || seen->pose_us - self->pose_us > (iw_time_us_t)2 * IW_EVIDENCE_GAP_US;
    if (seen->pose_us == IW_NEVER || seen->pose_us == self->pose_us) {
        return;
    }
    self->pose_us = seen->pose_us;
    self->pose = is;
    const int64_t step = step_of(was.x_mm, is.x_mm) + step_of(was.y_mm, is.y_mm) + step_of(was.psi_mrad, is.psi_mrad);
    if (gap || step == 0) {
        return;
    }
    self->moved += step;
    self->reversed += step_of(reversed(was.x_mm), reversed(is.x_mm)) + step_of(reversed(was.y_mm), reversed(is.y_mm)) +
                      step_of(reversed(was.psi_mrad), reversed(is.psi_mrad));
    self->pose_steps++;
    if (self->pose_steps < IW_EVIDENCE_POSE_STEPS) {
        return;
    }
    const int32_t figure = (int32_t)(self->reversed * 1000 / self->moved);
    if (self->reversed >= IW_EVIDENCE_POSE_FACTOR * self->moved) {
        confirm(gateway, seen, IW_LEDGER_POSE_BYTE_ORDER, figure);
    } else if (self->moved >= IW_EVIDENCE_POSE_FACTOR * self->reversed) {
        contradict(gateway, IW_LEDGER_POSE_BYTE_ORDER, figure);
    }
    self->pose_steps = 0;
    self->moved = 0;
    self->reversed = 0;
}

void iw_motion_evidence_look(iw_motion_evidence_t *self, iw_gateway_t *gateway, const iw_snapshot_t *seen) {
    for (size_t side = 0; side < IW_SIDES; side++) {
        iw_motion_evidence_wheel_t *const evidence = &self->wheel[side];
        const iw_snapshot_wheel_t *const wheel = &seen->wheel[side];
        if (wheel->speed_us != IW_NEVER && wheel->speed_us != evidence->speed_us) {
            add_turn(evidence, wheel);
        }
        if (wheel->status_us != IW_NEVER && wheel->status_us != evidence->status_us) {
            evidence->status_us = wheel->status_us;
            compare_ticks(evidence, gateway, seen, wheel);
        }
        look_at_type(evidence, gateway, seen, side);
    }
    look_at_pose(self, gateway, seen);
}
