// SPDX-License-Identifier: MIT
// Findings about the wheels of the recording: signs, scale, ticks, units of force, byte order.
#include "learn_findings.h"
#include "text/ctl_text.h"

#include <inttypes.h>
#include <stdio.h>

/// Fewer turns show nothing about ticks.
#define TURNS_MIN  2
#define US_PER_MIN 60000000
/// As in the gateway: minimum offset, and samples of one second at standstill.
#define OFFSET_MIN_dN 20
#define REST_MIN      20U
/// If the force of a wheel at standstill sways more, a hand touches it: in counts, plus a tenth of the mean.
#define QUIET_COUNTS 6
/// Minimum number of movements of the pose, and minimum way.
#define POSE_MOVES_MIN 25U
#define POSE_WAY_MIN   1000U

static bool nearly_all(int64_t part, int64_t all) {
    return part * 10 >= all * 9;
}

static int64_t turned_us(const learn_answer_t *answer) {
    return answer->with_us + answer->against_us;
}

bool learn_turned(const learn_wheel_t *wheel) {
    const int64_t turned = turned_us(&wheel->forward) + turned_us(&wheel->backward);
    return turned >= LEARN_SHOWN_MIN_US &&
           nearly_all(turned, turned + wheel->forward.still_us + wheel->backward.still_us);
}

bool learn_stayed(const learn_wheel_t *wheel) {
    const int64_t still = wheel->forward.still_us + wheel->backward.still_us;
    return still >= LEARN_SHOWN_MIN_US &&
           nearly_all(still, still + turned_us(&wheel->forward) + turned_us(&wheel->backward));
}

/// Returns 1 for the commanded sign, -1 for the opposite sign, 0 for both. Valid only if the direction was seen.
static int sign_of(const learn_answer_t *answer) {
    const int64_t all = turned_us(answer);
    return (answer->against_us * 20 < all) ? 1 : (answer->with_us * 20 < all) ? -1 : 0;
}

static const char *no_sign(const learn_t *self, unsigned side) {
    const learn_wheel_t *wheel = &self->wheel[side];
    if (self->setpoint[side].count == 0U) {
        return "it received no setpoint";
    }
    if (wheel->speeds == 0U) {
        return "the recording has none of its speed frames";
    }
    return learn_stayed(wheel)
               ? "it was commanded steady speeds and did not turn"
               : "the recording does not show it turning for half a second at a steady command of 100 mm/s or more";
}

/// Writes "a positive setpoint is measured as a positive speed" for a commanded direction and its sign.
static void format_direction(bool forward, int sign, char *out_text, size_t size) {
    const char *measured = (sign > 0) ? (forward ? "positive" : "negative") : (forward ? "NEGATIVE" : "POSITIVE");
    (void)snprintf(out_text, size, "a %s setpoint is measured as a %s speed", forward ? "positive" : "negative",
                   measured);
}

static void weigh_sign(const learn_t *self, unsigned side, learn_findings_t *out) {
    const learn_wheel_t *wheel = &self->wheel[side];
    const bool forward = turned_us(&wheel->forward) >= LEARN_SHOWN_MIN_US;
    const bool backward = turned_us(&wheel->backward) >= LEARN_SHOWN_MIN_US;
    const int first = forward ? sign_of(&wheel->forward) : sign_of(&wheel->backward);
    const int second = backward ? sign_of(&wheel->backward) : first;
    char ahead[80];
    char back[80];
    if (!forward && !backward) {
        (void)learn_print(out, '?', "feedback_sign", side, "%s sign of the speed: %s", text_side(side),
                          no_sign(self, side));
        return;
    }
    if (first == 0 || first != second) {
        (void)learn_print(out, '-', "feedback_sign", side,
                          "%s: the measured speed has sometimes the sign of the setpoint, sometimes the opposite one",
                          text_side(side));
        return;
    }
    format_direction(forward, first, ahead, sizeof ahead);
    format_direction(false, first, back, sizeof back);
    learn_finding_t *finding = learn_print(out, (first > 0) ? '+' : '-', "feedback_sign", side, "%s: %s%s%s%s",
                                           text_side(side), ahead, (forward && backward) ? ", " : "",
                                           (forward && backward) ? back : " (the other direction: not recorded)",
                                           (first > 0) ? "" : "; the gateway would latch feedback_sign");
    (void)snprintf(finding->value, sizeof finding->value, "%s", (first > 0) ? "yes" : "no");
}

/// Compares the commanded speed with the measured rpm.
static void weigh_scale(const learn_wheel_t *wheel, unsigned side, learn_findings_t *out) {
    if (!learn_turned(wheel) || wheel->steady_rpm == 0) {
        (void)learn_print(
            out, '?', "speed_scale", side,
            "%s mm/s per rpm: the recording does not show it turning for half a second at a steady command "
            "of 100 mm/s or more",
            text_side(side));
        return;
    }
    const int64_t um_s = wheel->steady_mm_s * 1000 / wheel->steady_rpm;
    const int64_t off_us = wheel->steady_us - wheel->steady_fit_us;
    if (nearly_all(wheel->steady_fit_us, wheel->steady_us)) {
        (void)learn_print(out, '+', "speed_scale", side,
                          "%s: %" PRId64 ".%03" PRId64
                          " mm/s of setpoint per measured rpm; 20.106 is expected with 192 mm and rpm of the wheel",
                          text_side(side), um_s / 1000, um_s % 1000);
    } else if (nearly_all(off_us, wheel->steady_us)) {
        (void)learn_print(out, '-', "speed_scale", side,
                          "%s: %" PRId64 ".%03" PRId64
                          " mm/s of setpoint per measured rpm; 20.106 is expected with 192 mm and rpm of the wheel: "
                          "another gear (rpm_of, gear_ratio), another radius, or it did not follow",
                          text_side(side), um_s / 1000, um_s % 1000);
    } else {
        (void)learn_print(out, '?', "speed_scale", side,
                          "%s mm/s per rpm: the wheel had its commanded speed only part of the time", text_side(side));
    }
}

static void weigh_ticks(const learn_wheel_t *wheel, unsigned side, learn_findings_t *out) {
    if (wheel->turned_rpm_us < (int64_t)TURNS_MIN * US_PER_MIN) {
        (void)learn_print(out, '?', "ticks_per_turn", side, "%s ticks per turn: %s", text_side(side),
                          (wheel->statuses == 0U) ? "the recording has none of its status frames"
                          : (wheel->speeds == 0U)
                              ? "the recording has none of its speed frames"
                              : "the recording has fewer than two turns at 10 rpm or more without a gap");
        return;
    }
    const uint64_t tenths = wheel->ticks * 10U * US_PER_MIN / (uint64_t)wheel->turned_rpm_us;
    const bool same = tenths >= 540U && tenths <= 660U;
    (void)learn_print(out, same ? '+' : '-', "ticks_per_turn", side,
                      "%s: %" PRIu64 ".%" PRIu64 " ticks per turn by the rpm; %s", text_side(side), tenths / 10U,
                      tenths % 10U,
                      same              ? "a rotor has 60, so the rpm are the rotor's, or there is no gear"
                      : (tenths > 660U) ? "a rotor has 60, so there is a gear: gear_ratio"
                                        : "a rotor has 60, and no gear results in fewer: were frames lost?");
}

/// Returns what is missing for a ratio of force and offset; NULL: nothing.
static const char *no_force(const learn_wheel_t *wheel) {
    const learn_range_t *rest = &wheel->rest_force;
    const learn_range_t *offset = &wheel->offset_dN;
    if (wheel->forces == 0U) {
        return "needs its force frames";
    }
    if (wheel->offsets == 0U) {
        return "needs its offset frames; wheels send them in their first 60 s";
    }
    if (offset->low != offset->high) {
        return "its offset frames differ";
    }
    if (offset->low < OFFSET_MIN_dN && offset->low > -OFFSET_MIN_dN) {
        return "needs an offset of at least 2 N";
    }
    if (wheel->rest_force_count < REST_MIN) {
        return "needs a second at standstill, shown by its speed frames";
    }
    const int32_t mean = (int32_t)(wheel->rest_force_sum / (int64_t)wheel->rest_force_count);
    const int32_t slack = ((mean < 0) ? -mean : mean) / 10 + QUIET_COUNTS;
    return (rest->high - rest->low > slack) ? "the force sways while the wheel is at standstill: it was touched" : NULL;
}

/// Returns the unit that the ratio (1000 x raw / offset) shows: "cN", "dN", "removed", or NULL.
static const char *unit_of(int64_t permille) {
    return (permille >= 8000 && permille <= 12000) ? "cN"
           : (permille >= 800 && permille <= 1200) ? "dN"
           : (permille > -200 && permille < 200)   ? "removed"
                                                   : NULL;
}

static void weigh_force(const learn_wheel_t *wheel, unsigned side, learn_findings_t *out) {
    const char *documented = (side == IW_LEFT) ? "cN" : "dN";
    const char *missing = no_force(wheel);
    if (missing != NULL) {
        (void)learn_print(out, '?', "force_unit", side, "%s force unit: %s", text_side(side), missing);
        return;
    }
    const int64_t permille =
        wheel->rest_force_sum * 1000 / (int64_t)wheel->rest_force_count / (int64_t)wheel->offset_dN.low;
    const int64_t size = (permille < 0) ? -permille : permille;
    const char *unit = unit_of(permille);
    const bool is_unit = unit != NULL && unit[1] == 'N';
    const bool dead = wheel->force.low == wheel->force.high;
    learn_finding_t *finding =
        learn_print(out, (is_unit && unit[0] == documented[0]) ? '+' : '-', "force_unit", side,
                    "%s force at standstill / offset = %s%" PRId64 ".%02" PRId64 ": %s%s (document: %s)",
                    text_side(side), (permille < 0) ? "-" : "", size / 1000, size % 1000 / 10,
                    (unit == NULL) ? "neither cN (10) nor dN (1) nor offset removed (0): pressed at the start?"
                    : is_unit      ? unit
                    : dead         ? "the wheel subtracts the offset itself, or its force never changes"
                                   : "the wheel subtracts the offset itself",
                    is_unit ? " per count, if nothing pressed the handle" : "", documented);
    (void)snprintf(finding->value, sizeof finding->value, "%s", is_unit ? unit : "");
}

static void weigh_pose(const learn_pose_t *pose, learn_findings_t *out) {
    const bool enough = pose->moves >= POSE_MOVES_MIN && pose->way_big + pose->way_little >= POSE_WAY_MIN;
    if (!enough) {
        (void)learn_print(out, '?', "pose_byte_order", LEARN_BOTH, "byte order of the pose: %s",
                          (pose->count == 0U) ? "the recording has no pose frame (290 = 0x122)" : "it hardly changes");
    } else if (pose->way_big * 4U < pose->way_little) {
        learn_finding_t *finding = learn_print(out, '+', "pose_byte_order", LEARN_BOTH,
                                               "the pose is smooth with the most significant byte first");
        (void)snprintf(finding->value, sizeof finding->value, "yes");
    } else if (pose->way_little * 4U < pose->way_big) {
        learn_finding_t *finding = learn_print(
            out, '-', "pose_byte_order", LEARN_BOTH,
            "the pose is smooth with the LEAST significant byte first: the gateway reads it in the other order");
        (void)snprintf(finding->value, sizeof finding->value, "no");
    } else {
        (void)learn_print(out, '?', "pose_byte_order", LEARN_BOTH, "byte order of the pose: smooth in neither order");
    }
}

void learn_weigh_wheels(const learn_t *self, learn_findings_t *out_findings) {
    for (unsigned side = 0; side < IW_SIDES; side++) {
        weigh_sign(self, side, out_findings);
    }
    for (unsigned side = 0; side < IW_SIDES; side++) {
        weigh_scale(&self->wheel[side], side, out_findings);
        weigh_ticks(&self->wheel[side], side, out_findings);
    }
    for (unsigned side = 0; side < IW_SIDES; side++) {
        weigh_force(&self->wheel[side], side, out_findings);
    }
    weigh_pose(&self->pose, out_findings);
}
