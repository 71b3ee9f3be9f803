// SPDX-License-Identifier: MIT
#include "iwheel/observation.h"

#include "arithmetic.h"
#include "iwheel/gateway.h"

#include <string.h>

/// Largest |permille - 1000| that is stored as it is. A larger value would not fit 32 bits.
#define FIGURE_OFF_MAX (INT32_MAX / 2)
/// Largest step of a pose: half of 16 bits in X, Y and PSI.
#define POSE_STEP_MAX (3 * 32768)

IW_STATIC_ASSERT((int64_t)(IW_OBSERVATION_POSE_FAR + 2 * POSE_STEP_MAX) * 1000 <= INT32_MAX, figure_of_the_pose_fits);

void iw_observation_init(iw_observation_t *self) {
    memset(self, 0, sizeof *self);
    self->pose_us = IW_NEVER;
}

/// Only an assumption with the state ASSUMED needs observations.
static void confirm(iw_gateway_t *gateway, const iw_snapshot_t *seen, iw_assumption_item_t item, int32_t figure) {
    const iw_assumption_entry_t entry = {IW_CONFIRMED, IW_SOURCE_BUS, figure};
    if (seen->assumed[item].state == IW_ASSUMED) {
        iw_gateway_set_assumption(gateway, item, &entry);
    }
}

static void contradict(iw_gateway_t *gateway, iw_assumption_item_t item, int32_t figure) {
    const iw_assumption_entry_t entry = {IW_CONTRADICTED, IW_SOURCE_BUS, figure};
    iw_gateway_set_assumption(gateway, item, &entry);
}

/// Adds the turn since the last speed message. A gap, a slow wheel or a new direction ends the stretch.
static void add_turn(iw_observation_wheel_t *self, const iw_snapshot_wheel_t *wheel) {
    const iw_time_us_t elapsed_us = wheel->speed_us - self->speed_us;
    const int16_t rpm = wheel->telemetry->speed.speed_rpm;
    const bool steady = rpm * self->rpm >= IW_OBSERVATION_RPM * IW_OBSERVATION_RPM;
    if (elapsed_us > IW_OBSERVATION_GAP_US || !steady || self->turned > IW_OBSERVATION_TURNED_MAX) {
        self->open = false;
    } else {
        const int64_t both = iw_abs(rpm) + iw_abs(self->rpm);
        self->turned += both * (int64_t)elapsed_us / 2;
    }
    self->speed_us = wheel->speed_us;
    self->rpm = rpm;
}

/// One rotor rpm is one tick per second, because 60 ticks are one turn.
static int64_t expected_ticks(const iw_observation_wheel_t *self, const iw_config_t *config) {
    const int64_t turned = self->turned / 1000000;
    return config->rpm_of_rotor ? turned : turned * config->gear_turns / config->gear_per;
}

static int64_t absolute(int64_t value) {
    return (value < 0) ? -value : value;
}

/// `moved`: ticks that the rpm predict.
static void judge_ratio(iw_observation_wheel_t *self, iw_gateway_t *gateway, const iw_snapshot_t *seen, int64_t moved,
                        int64_t expected) {
    const int64_t permille = moved * 1000 / expected;
    const int64_t off = absolute(permille - 1000);
    const int32_t figure = (off <= FIGURE_OFF_MAX) ? (int32_t)permille : INT32_MAX;
    if (off <= IW_OBSERVATION_FITS_PERMILLE) {
        self->misses = 0;
        confirm(gateway, seen, IW_ASSUMPTION_GEAR_RATIO, figure);
    } else if (off > IW_OBSERVATION_FAILS_PERMILLE) {
        self->misses++;
        if (self->misses == IW_OBSERVATION_MISSES) {
            contradict(gateway, IW_ASSUMPTION_GEAR_RATIO, figure);
        }
    }
}

/// A stretch begins and ends with a status message, which has the ticks.
static void compare_ticks(iw_observation_wheel_t *self, iw_gateway_t *gateway, const iw_snapshot_t *seen,
                          int64_t ticks) {
    if (self->open) {
        const int64_t expected = expected_ticks(self, seen->config);
        const int64_t moved = ticks - self->ticks;
        if (expected < IW_OBSERVATION_TICKS) {
            return;
        }
        judge_ratio(self, gateway, seen, (self->rpm < 0) ? -moved : moved, expected);
    }
    self->turned = 0;
    self->ticks = ticks;
    self->open = true;
}

static void check_ratio(iw_observation_wheel_t *self, iw_gateway_t *gateway, const iw_snapshot_t *seen,
                        const iw_snapshot_wheel_t *wheel) {
    if (wheel->reboots != self->reboots) {
        self->reboots = wheel->reboots;
        self->open = false;
    }
    if (wheel->speed_us != self->speed_us) {
        add_turn(self, wheel);
    }
    if (wheel->status_us != IW_NEVER && wheel->status_us != self->status_us) {
        self->status_us = wheel->status_us;
        compare_ticks(self, gateway, seen, wheel->ticks);
    }
}

static void check_type(iw_observation_wheel_t *self, iw_gateway_t *gateway, const iw_snapshot_t *seen,
                       const iw_snapshot_wheel_t *wheel, int16_t applied) {
    const int32_t measured = wheel->speed_mm_s;
    const int32_t expected = applied * (int32_t)seen->config->radius_mm / IW_SETPOINT_RADIUS_MM;
    const int32_t slack = iw_abs(expected) * 15 / 100 + (int32_t)wheel->um_s_per_rpm / 1000 + 1;
    const bool follows = seen->state == IW_STATE_ARMED && wheel->heard && iw_abs(measured - expected) <= slack;
    if (iw_abs(applied) < IW_OBSERVATION_TYPE_MM_S || !follows || applied != self->applied_mm_s) {
        self->steady_us = seen->at_us;
        self->applied_mm_s = applied;
    } else if (seen->at_us - self->steady_us >= IW_OBSERVATION_TYPE_US) {
        confirm(gateway, seen, IW_ASSUMPTION_SETPOINT_TYPE, measured * 1000 / expected);
    }
}

static int16_t reversed(int16_t value) {
    const uint16_t bits = (uint16_t)value;
    return (int16_t)(uint16_t)((bits << 8) | (bits >> 8));
}

static iw_codec_pose_t reversed_pose(const iw_codec_pose_t *pose) {
    const iw_codec_pose_t other = {reversed(pose->x_mm), reversed(pose->y_mm), reversed(pose->z_mm),
                                   reversed(pose->psi_mrad)};
    return other;
}

/// Returns the shorter distance modulo 16 bits, because X, Y and PSI wrap.
static int32_t way(int16_t from, int16_t to) {
    return iw_abs((int16_t)(uint16_t)((uint16_t)to - (uint16_t)from));
}

static int32_t pose_step(const iw_codec_pose_t *from, const iw_codec_pose_t *to) {
    return way(from->x_mm, to->x_mm) + way(from->y_mm, to->y_mm) + way(from->psi_mrad, to->psi_mrad);
}

/// `moved` is not 0, because every counted step moved.
static void judge_pose(iw_observation_t *self, iw_gateway_t *gateway, const iw_snapshot_t *seen) {
    const int32_t figure = self->reversed * 1000 / self->moved;
    if (self->reversed >= IW_OBSERVATION_POSE_FACTOR * self->moved) {
        confirm(gateway, seen, IW_ASSUMPTION_POSE_BYTE_ORDER, figure);
    } else if (self->moved >= IW_OBSERVATION_POSE_FACTOR * self->reversed) {
        contradict(gateway, IW_ASSUMPTION_POSE_BYTE_ORDER, figure);
    }
    self->pose_steps = 0;
    self->moved = 0;
    self->reversed = 0;
}

static void check_pose(iw_observation_t *self, iw_gateway_t *gateway, const iw_snapshot_t *seen) {
    const iw_codec_pose_t was = self->pose;
    const iw_codec_pose_t is = seen->wheel[IW_RIGHT].telemetry->pose;
    const iw_codec_pose_t was_reversed = reversed_pose(&was);
    const iw_codec_pose_t is_reversed = reversed_pose(&is);
    const int32_t step = pose_step(&was, &is);
    const bool gap =
        self->pose_us == IW_NEVER || seen->pose_us - self->pose_us > (iw_time_us_t)2 * IW_OBSERVATION_GAP_US;
    self->pose_us = seen->pose_us;
    self->pose = is;
    if (gap || step == 0) {
        return;
    }
    self->moved += step;
    self->reversed += pose_step(&was_reversed, &is_reversed);
    self->pose_steps++;
    if (self->pose_steps >= IW_OBSERVATION_POSE_STEPS || self->moved + self->reversed > IW_OBSERVATION_POSE_FAR) {
        judge_pose(self, gateway, seen);
    }
}

void iw_observation_step(iw_observation_t *self, iw_gateway_t *gateway, const iw_snapshot_t *seen) {
    for (size_t side = 0; side < IW_SIDES; side++) {
        const iw_snapshot_wheel_t *const wheel = &seen->wheel[side];
        check_ratio(&self->wheel[side], gateway, seen, wheel);
        check_type(&self->wheel[side], gateway, seen, wheel, seen->applied.wheel[side].speed_mm_s);
    }
    check_pose(self, gateway, seen);
}
