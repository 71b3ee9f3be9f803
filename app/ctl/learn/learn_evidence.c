// SPDX-License-Identifier: MIT
#include "learn_report.h"

#include <inttypes.h>
#include <stdio.h>

/// mm/s of one rpm with a radius of 192 mm, in um/s.
#define UM_S_PER_RPM 20106
/// Fewer steady speed frames than this (half a second) say nothing.
#define STEADY_MIN 125U
/// Less than this many turns says nothing of ticks.
#define TURNS_MIN  2
#define MS_PER_MIN 60000
/// As in the gateway: an offset of at least this, and samples of a second at rest.
#define OFFSET_MIN_dN 20
#define REST_MIN      20U

static const char *const sides[] = {"left", "right"};

/// The only type with which that wheel was moved; -1: none or several.
static int moving_type(const learn_setpoint_t *setpoint) {
    int found = -1;
    for (int type = 0; type < 256; type++) {
        if (setpoint->type_moving[type] > 0U) {
            if (found >= 0) {
                return -1;
            }
            found = type;
        }
    }
    return found;
}

static bool moved(const learn_setpoint_t *setpoint) {
    return setpoint->count > 0U && (setpoint->speed_mm_s.low != 0 || setpoint->speed_mm_s.high != 0);
}

/// The type that moved both wheels and no other did; -1: there is none.
static int common_type(const learn_t *self) {
    const int left = moving_type(&self->setpoint[IW_LEFT]);
    const int right = moving_type(&self->setpoint[IW_RIGHT]);
    return left == right ? left : -1;
}

static void say_sender(const learn_t *self) {
    const uint64_t count = self->setpoint[IW_LEFT].count + self->setpoint[IW_RIGHT].count;
    const uint64_t sent = self->setpoint[IW_LEFT].sent + self->setpoint[IW_RIGHT].sent;
    if (sent > 0U && sent == count) {
        learn_say('-',
                  "all setpoints are marked as sent by the program that recorded them: if that was this gateway, they "
                  "repeat its configuration and prove nothing");
    } else if (sent > 0U) {
        learn_say('-', "some setpoints are marked as sent by the recording program, others not: two controllers?");
    }
}

void learn_say_type(const learn_t *self) {
    const int type = common_type(self);
    if (self->setpoint[IW_LEFT].count + self->setpoint[IW_RIGHT].count == 0U) {
        learn_say('?',
                  "setpoint type and current role: no setpoint (266 = 0x10A, 298 = 0x12A) is in it; record while the "
                  "other controller drives");
        return;
    }
    say_sender(self);
    if (!moved(&self->setpoint[IW_LEFT]) || !moved(&self->setpoint[IW_RIGHT])) {
        learn_say('?', "setpoint type: %s never told to move; record while the other controller drives both",
                  moved(&self->setpoint[IW_LEFT])    ? "the right wheel was"
                  : moved(&self->setpoint[IW_RIGHT]) ? "the left wheel was"
                                                     : "the wheels were");
    } else if (type >= 0) {
        learn_say('+', "setpoint type %d moves the wheels: every setpoint with a speed has it", type);
    } else {
        learn_say('-',
                  "setpoint type: several, or different ones left and right, come with a speed; find out which of them "
                  "means speed");
    }
    for (unsigned side = 0; side < IW_SIDES; side++) {
        const learn_setpoint_t *setpoint = &self->setpoint[side];
        if (setpoint->changes_of_type > setpoint->count / 4U) {
            learn_say('-', "%s: the type changes with every other setpoint: two controllers on this bus?", sides[side]);
        }
    }
}

static bool is_empty(const learn_range_t *range) {
    return range->low > range->high;
}

/// One current, not 0, whatever the speed.
static bool looks_like_limit(const learn_setpoint_t *setpoint) {
    return moved(setpoint) && setpoint->current_mA.low == setpoint->current_mA.high && setpoint->current_mA.low > 0;
}

/// No current at rest, and otherwise of the sign of the speed.
static bool looks_like_setpoint(const learn_setpoint_t *setpoint) {
    const learn_range_t *rest = &setpoint->current_at_rest_mA;
    const learn_range_t *forward = &setpoint->current_forward_mA;
    const learn_range_t *backward = &setpoint->current_backward_mA;
    return moved(setpoint) && (is_empty(rest) || (rest->low == 0 && rest->high == 0)) && !is_empty(backward) &&
           backward->high < 0 && (is_empty(forward) || forward->low > 0);
}

static bool both(const learn_t *self, bool (*judge)(const learn_setpoint_t *setpoint)) {
    return judge(&self->setpoint[IW_LEFT]) && judge(&self->setpoint[IW_RIGHT]);
}

void learn_say_role(const learn_t *self) {
    if (self->setpoint[IW_LEFT].count + self->setpoint[IW_RIGHT].count == 0U) {
        return;
    }
    if (both(self, looks_like_limit)) {
        learn_say('+',
                  "current_role = limit: the same positive current comes with every speed, also with 0 and backwards");
    } else if (both(self, looks_like_setpoint)) {
        learn_say('+', "current_role = setpoint: the current has the sign of the speed, and is 0 with speed 0");
    } else {
        learn_say('?',
                  "current role: the currents fit neither limit (one positive current always) nor setpoint (sign of "
                  "the speed, 0 at rest) on both wheels");
    }
}

void learn_say_signs(const learn_t *self) {
    for (unsigned side = 0; side < IW_SIDES; side++) {
        const learn_wheel_t *wheel = &self->wheel[side];
        const uint64_t count = wheel->with_sign + wheel->against_sign;
        if (count < STEADY_MIN) {
            learn_say('?', "%s sign of the speed: never told a steady speed of 100 mm/s or more for a second",
                      sides[side]);
        } else if (wheel->against_sign * 20U < count) {
            learn_say('+', "%s: a positive setpoint is measured as a positive speed", sides[side]);
        } else if (wheel->with_sign * 20U < count) {
            learn_say('-',
                      "%s: a positive setpoint is measured as a NEGATIVE speed: the gateway would latch feedback_sign",
                      sides[side]);
        } else {
            learn_say('-', "%s: the measured speed has now the sign of the setpoint, now the other", sides[side]);
        }
    }
}

static void say_rpm(const learn_wheel_t *wheel, const char *side) {
    if (wheel->steady < STEADY_MIN || wheel->steady_rpm == 0) {
        return;
    }
    const int64_t um_s = wheel->steady_mm_s * 1000 / wheel->steady_rpm;
    const int64_t percent = um_s * 100 / UM_S_PER_RPM;
    if (percent >= 90 && percent <= 110) {
        learn_say('+',
                  "%s: %" PRId64 ".%03" PRId64
                  " mm/s of setpoint per measured rpm; 20.106 is expected of 192 mm and rpm of "
                  "the wheel",
                  side, um_s / 1000, um_s % 1000);
    } else {
        learn_say('-',
                  "%s: %" PRId64 ".%03" PRId64
                  " mm/s of setpoint per measured rpm, where 20.106 is expected of 192 mm and rpm "
                  "of the wheel: another gear (rpm_of, gear_ratio), another radius, or it did not follow",
                  side, um_s / 1000, um_s % 1000);
    }
}

static void say_ticks(const learn_wheel_t *wheel, const char *side) {
    if (wheel->rpm_ms < (int64_t)TURNS_MIN * MS_PER_MIN) {
        learn_say('?', "%s ticks per turn: fewer than %d turns are in it", side, TURNS_MIN);
        return;
    }
    const uint64_t tenths = wheel->ticks * 10U * MS_PER_MIN / (uint64_t)wheel->rpm_ms;
    const bool same = tenths >= 540U && tenths <= 660U;
    learn_say(same ? '+' : '-', "%s: %" PRIu64 ".%" PRIu64 " ticks per turn of what the rpm count; %s", side,
              tenths / 10U, tenths % 10U,
              same ? "the rotor makes 60, so the rpm are the rotor's, or there is no gear"
                   : "the rotor makes 60, so there is a gear between: gear_ratio");
}

void learn_say_scale(const learn_t *self) {
    for (unsigned side = 0; side < IW_SIDES; side++) {
        say_rpm(&self->wheel[side], sides[side]);
        say_ticks(&self->wheel[side], sides[side]);
    }
}

/// 1000 x raw / offset at rest.
static bool force_ratio(const learn_wheel_t *wheel, int64_t *out_permille) {
    if (wheel->offsets == 0U || wheel->rest_force_count < REST_MIN ||
        (wheel->offset_dN < OFFSET_MIN_dN && wheel->offset_dN > -OFFSET_MIN_dN)) {
        return false;
    }
    *out_permille = wheel->rest_force_sum * 1000 / (int64_t)wheel->rest_force_count / wheel->offset_dN;
    return true;
}

/// What the ratio speaks for: "cN", "dN", "removed", or NULL.
static const char *unit_of(int64_t permille) {
    return permille >= 8000 && permille <= 12000 ? "cN"
           : permille >= 800 && permille <= 1200 ? "dN"
           : permille > -200 && permille < 200   ? "removed"
                                                 : NULL;
}

void learn_say_force(const learn_t *self) {
    for (unsigned side = 0; side < IW_SIDES; side++) {
        int64_t permille = 0;
        const char *documented = side == IW_LEFT ? "cN" : "dN";
        if (!force_ratio(&self->wheel[side], &permille)) {
            learn_say(
                '?',
                "%s force unit: needs a second at rest and an offset frame (%u) of at least 2 N; wheels send them in "
                "their first 60 s",
                sides[side], side == IW_LEFT ? IW_ID_LEFT_OFFSET : IW_ID_RIGHT_OFFSET);
            continue;
        }
        const char *unit = unit_of(permille);
        const int64_t size = permille < 0 ? -permille : permille;
        const bool as_documented = unit != NULL && unit[0] == documented[0];
        learn_say(as_documented ? '+' : '-',
                  "%s force at rest / offset = %s%" PRId64 ".%02" PRId64 ": %s%s (the document says %s)", sides[side],
                  permille < 0 ? "-" : "", size / 1000, size % 1000 / 10,
                  unit == NULL     ? "neither cN (10) nor dN (1) nor offset removed (0): pressed at the start?"
                  : unit[0] == 'r' ? "the wheel subtracts the offset itself"
                                   : unit,
                  unit == NULL || unit[0] == 'r' ? "" : " per count", documented);
    }
}

void learn_say_pose(const learn_t *self) {
    const learn_pose_t *pose = &self->pose;
    if (pose->way_big + pose->way_little < 1000U) {
        learn_say('?', "byte order of the pose: it hardly changes");
    } else if (pose->way_big * 4U < pose->way_little) {
        learn_say('+', "the pose is smooth with the most significant byte first");
    } else if (pose->way_little * 4U < pose->way_big) {
        learn_say('-', "the pose is smooth with the LEAST significant byte first: the gateway reads it the other way");
    } else {
        learn_say('?', "byte order of the pose: smooth neither way");
    }
}

static void suggest_forces(const learn_t *self) {
    for (unsigned side = 0; side < IW_SIDES; side++) {
        int64_t permille = 0;
        const char *unit = force_ratio(&self->wheel[side], &permille) ? unit_of(permille) : NULL;
        if (unit != NULL && unit[1] == 'N') {
            (void)printf("[%s]\nforce_unit = %s\n", sides[side], unit);
        }
    }
}

void learn_suggest(const learn_t *self) {
    const int type = common_type(self);
    const learn_range_t *left = &self->known[IW_LEFT].length;
    const learn_range_t *right = &self->known[IW_RIGHT].length;
    const bool one_length = left->low == left->high && right->low == left->low && right->high == left->low;
    if (type < 0 && self->wheel[IW_LEFT].offsets + self->wheel[IW_RIGHT].offsets == 0U) {
        return;
    }
    (void)puts("\nFor the configuration, as far as it goes (evidence, no proof; then: iwheelctl bringup)\n");
    if (type >= 0) {
        (void)printf("[wheels]\nsetpoint_type = %d\n", type);
        if (both(self, looks_like_limit) || both(self, looks_like_setpoint)) {
            (void)printf("current_role = %s\n", both(self, looks_like_limit) ? "limit" : "setpoint");
        }
        if (one_length && left->low >= (int32_t)IW_DLC_SETPOINT && left->low <= (int32_t)IW_CAN_DATA_MAX) {
            (void)printf("setpoint_dlc = %" PRId32 "\n", left->low);
        }
    }
    suggest_forces(self);
}
