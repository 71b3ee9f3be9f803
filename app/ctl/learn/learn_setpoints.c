// SPDX-License-Identifier: MIT
// Findings about the setpoints of the recording: type, role of the current, length. If a finding claims a behaviour of
// the wheels, the recording shows it.
#include "learn_findings.h"
#include "text/ctl_text.h"

#include "iwheel_northbound/text.h"

#include <inttypes.h>
#include <stdio.h>

/// Returns the only type that commanded a speed of the wheel; -1: none or several.
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

static uint64_t moving(const learn_setpoint_t *setpoint) {
    return setpoint->forward + setpoint->backward;
}

/// Returns NULL if both wheels have what a sentence about both needs; otherwise the wheel or wheels without it.
static const char *lacking(bool left, bool right) {
    return (left && right) ? NULL : left ? "the right wheel" : right ? "the left wheel" : "both wheels";
}

/// Returns the wheels that did not turn by their setpoints as far as recorded; NULL if both turned.
static const char *unseen_motion(const learn_t *self) {
    return lacking(learn_turned(&self->wheel[IW_LEFT]), learn_turned(&self->wheel[IW_RIGHT]));
}

static void weigh_common_type(const learn_t *self, int type, learn_findings_t *out) {
    const char *unseen = unseen_motion(self);
    const char *stayed = lacking(!learn_stayed(&self->wheel[IW_LEFT]), !learn_stayed(&self->wheel[IW_RIGHT]));
    if (stayed != NULL) {
        (void)learn_print(out, '-', "setpoint_type", LEARN_BOTH,
                          "setpoint type: every setpoint with a speed has type %d, but %s did not follow it", type,
                          stayed);
    } else if (unseen != NULL) {
        (void)learn_print(
            out, '?', "setpoint_type", LEARN_BOTH,
            "setpoint type: every setpoint with a speed has type %d, but the recording does not show that "
            "%s followed it; "
            "record the speed frames too (256 = 0x100, 288 = 0x120), while a steady speed of 100 mm/s or "
            "more is commanded for seconds",
            type, unseen);
    } else {
        learn_finding_t *finding =
            learn_print(out, '+', "setpoint_type", LEARN_BOTH,
                        "setpoint type %d moves the wheels: every setpoint with a speed has it, and "
                        "both wheels followed",
                        type);
        (void)snprintf(finding->value, sizeof finding->value, "%d", type);
        for (unsigned side = 0; side < IW_SIDES; side++) {
            const learn_setpoint_t *setpoint = &self->setpoint[side];
            if (setpoint->type[type] == setpoint->type_moving[type]) {
                (void)learn_print(
                    out, '?', "setpoint_type", side,
                    "%s: no setpoint of type %d has speed 0, so the recording does not show whether a zero "
                    "stops the wheel",
                    text_side(side), type);
            }
        }
    }
}

static void weigh_type(const learn_t *self, learn_findings_t *out) {
    const learn_setpoint_t *left = &self->setpoint[IW_LEFT];
    const learn_setpoint_t *right = &self->setpoint[IW_RIGHT];
    const char *idle = lacking(moving(left) > 0U, moving(right) > 0U);
    const char *few = lacking(moving(left) >= LEARN_FRAMES_MIN, moving(right) >= LEARN_FRAMES_MIN);
    if (idle != NULL) {
        (void)learn_print(
            out, '?', "setpoint_type", LEARN_BOTH,
            "setpoint type: %s was never commanded to move; record while the other controller drives both", idle);
    } else if (moving_type(left) < 0 || moving_type(left) != moving_type(right)) {
        (void)learn_print(
            out, '-', "setpoint_type", LEARN_BOTH,
            "setpoint type: setpoints with a speed have several types, or different ones left and right; find "
            "out which type means speed");
    } else if (few != NULL) {
        (void)learn_print(out, '?', "setpoint_type", LEARN_BOTH,
                          "setpoint type: %s received a speed fewer than %u times; record a longer drive", few,
                          LEARN_FRAMES_MIN);
    } else {
        weigh_common_type(self, moving_type(left), out);
    }
    for (unsigned side = 0; side < IW_SIDES; side++) {
        const learn_setpoint_t *setpoint = &self->setpoint[side];
        if (setpoint->changes_of_type >= LEARN_FRAMES_MIN && setpoint->changes_of_type > setpoint->count / 4U) {
            (void)learn_print(out, '-', "sender", side,
                              "%s: the type changes %" PRIu64 " times in %" PRIu64
                              " setpoints: two controllers on this bus?",
                              text_side(side), setpoint->changes_of_type, setpoint->count);
        }
    }
}

/// Reports whether all or some setpoints were sent by the program that recorded them.
static void weigh_sender(uint64_t count, uint64_t sent, learn_findings_t *out) {
    if (sent == count) {
        (void)learn_print(
            out, '-', "sender", LEARN_BOTH,
            "all setpoints are marked as sent by the program that recorded them: if that was this gateway, "
            "they only repeat its configuration and prove nothing");
    } else if (sent > 0U) {
        (void)learn_print(out, '-', "sender", LEARN_BOTH,
                          "%" PRIu64 " of %" PRIu64
                          " setpoints are marked as sent by the recording program: two controllers?",
                          sent, count);
    }
}

/// Returns true if the positive current is the same at standstill, forwards and backwards.
static bool is_constant(const learn_setpoint_t *setpoint) {
    return setpoint->current_mA.low == setpoint->current_mA.high && setpoint->current_mA.low > 0;
}

static bool is_only(const learn_range_t *range, int sign) {
    return learn_is_empty(range) || ((sign > 0)   ? range->low > 0
                                     : (sign < 0) ? range->high < 0
                                                  : range->low == 0 && range->high == 0);
}

/// Returns true if there is no current with speed 0, and otherwise the sign of each current is that of the speed.
static bool is_signed(const learn_setpoint_t *setpoint) {
    return is_only(&setpoint->current_at_rest_mA, 0) && is_only(&setpoint->current_forward_mA, 1) &&
           is_only(&setpoint->current_backward_mA, -1);
}

static bool both(const learn_t *self, bool (*judge)(const learn_setpoint_t *setpoint)) {
    return judge(&self->setpoint[IW_LEFT]) && judge(&self->setpoint[IW_RIGHT]);
}

/// Lists the speeds that both wheels did not receive often enough for "every speed": "0", "forwards", "backwards". Empty
/// if none is missing.
static void list_rare(const learn_t *self, char *out_list, size_t size) {
    static const char *const words[] = {"0", "forwards", "backwards"};
    iwn_text_t list = iwn_text_begin(out_list, size);
    for (unsigned kind = 0; kind < 3U; kind++) {
        bool seen_often = true;
        for (unsigned side = 0; side < IW_SIDES; side++) {
            const learn_setpoint_t *each = &self->setpoint[side];
            const uint64_t count[] = {each->at_rest, each->forward, each->backward};
            seen_often = seen_often && count[kind] >= LEARN_FRAMES_MIN;
        }
        if (!seen_often) {
            IWN_TEXT_JOIN(&list, (list.length > 0U) ? ", " : "", words[kind]);
        }
    }
}

static void doubt_role(learn_findings_t *out, const char *why, const char *fix) {
    (void)learn_print(out, '?', "current_role", LEARN_BOTH, "current role: %s%s", why, fix);
}

/// Judges the role limit: with it, both wheels are at standstill with speed 0 and a current.
static void weigh_limit(const learn_t *self, learn_findings_t *out) {
    const learn_wheel_t *left = &self->wheel[IW_LEFT];
    const learn_wheel_t *right = &self->wheel[IW_RIGHT];
    const char *ran = lacking(left->ran_us < LEARN_SHOWN_MIN_US, right->ran_us < LEARN_SHOWN_MIN_US);
    const bool stood_left = left->stood_us >= LEARN_SHOWN_MIN_US && left->ran_us * 10 < left->stood_us;
    const bool stood_right = right->stood_us >= LEARN_SHOWN_MIN_US && right->ran_us * 10 < right->stood_us;
    if (ran != NULL) {
        (void)learn_print(
            out, '-', "current_role", LEARN_BOTH,
            "current role: every speed has the same positive current, but with speed 0 %s turned for longer "
            "than a second: no limit?",
            ran);
    } else if (!stood_left || !stood_right) {
        doubt_role(
            out,
            "every speed has the same positive current, but the recording does not show both wheels at standstill with "
            "speed 0 and this current; ",
            "record their speed frames, and leave them at standstill for seconds");
    } else {
        learn_finding_t *finding =
            learn_print(out, '+', "current_role", LEARN_BOTH,
                        "current_role = limit: every speed has the same positive current, also 0 and backwards, and "
                        "with 0 the wheels are at standstill");
        (void)snprintf(finding->value, sizeof finding->value, "limit");
    }
}

static void weigh_role(const learn_t *self, bool own, learn_findings_t *out) {
    char rare[32];
    char text[120];
    const char *unseen = unseen_motion(self);
    list_rare(self, rare, sizeof rare);
    if (!both(self, is_constant) && !both(self, is_signed)) {
        doubt_role(out,
                   "the currents fit neither limit (always one positive current) nor setpoint (sign of the speed, "
                   "0 at speed 0) on both wheels",
                   "");
    } else if (rare[0] != '\0') {
        (void)snprintf(text, sizeof text, "not commanded to both wheels often enough: speed %s; ", rare);
        doubt_role(out, text, "record while the other controller holds, drives forwards and drives backwards");
    } else if (own) {
        doubt_role(
            out,
            "setpoints are marked as sent by the program that recorded them, so they may be its own configuration; ",
            "record the setpoints of another controller");
    } else if (unseen != NULL) {
        (void)snprintf(text, sizeof text, "the recording does not show that %s turned; ", unseen);
        doubt_role(out, text, "record the speed frames too, while steady speeds are commanded for seconds");
    } else if (both(self, is_constant)) {
        weigh_limit(self, out);
    } else {
        learn_finding_t *finding =
            learn_print(out, '+', "current_role", LEARN_BOTH,
                        "current_role = setpoint: the current has the sign of the speed, and is 0 with speed 0");
        (void)snprintf(finding->value, sizeof finding->value, "setpoint");
    }
}

static void weigh_length(const learn_t *self, learn_findings_t *out) {
    const learn_range_t *left = &self->known[IW_LEFT].length;
    const learn_range_t *right = &self->known[IW_RIGHT].length;
    const bool enough =
        self->setpoint[IW_LEFT].count >= LEARN_FRAMES_MIN && self->setpoint[IW_RIGHT].count >= LEARN_FRAMES_MIN;
    const bool one = left->low == left->high && right->low == left->low && right->high == left->low;
    if (!enough) {
        (void)learn_print(out, '?', "setpoint_dlc", LEARN_BOTH,
                          "length of setpoints: fewer than %u for each wheel; record a longer drive of both",
                          LEARN_FRAMES_MIN);
    } else if (!one || left->low < (int32_t)IW_DLC_SETPOINT || left->low > (int32_t)IW_CAN_DATA_MAX) {
        (void)learn_print(out, '?', "setpoint_dlc", LEARN_BOTH,
                          "length of setpoints: they differ or are not valid, so the right length is not known");
    } else {
        learn_finding_t *finding =
            learn_print(out, (left->low == (int32_t)IW_DLC_SETPOINT) ? '+' : '-', "setpoint_dlc", LEARN_BOTH,
                        "every setpoint has %" PRId32 " bytes (document: %u)", left->low, (unsigned)IW_DLC_SETPOINT);
        (void)snprintf(finding->value, sizeof finding->value, "%" PRId32, left->low);
    }
}

void learn_weigh_setpoints(const learn_t *self, learn_findings_t *out_findings) {
    const uint64_t count = self->setpoint[IW_LEFT].count + self->setpoint[IW_RIGHT].count;
    const uint64_t sent = self->setpoint[IW_LEFT].sent + self->setpoint[IW_RIGHT].sent;
    if (count == 0U) {
        (void)learn_print(
            out_findings, '?', "setpoint_type", LEARN_BOTH,
            "setpoint type and current role: the recording has no setpoint (266 = 0x10A, 298 = 0x12A); record while "
            "the other controller drives");
        return;
    }
    weigh_sender(count, sent, out_findings);
    weigh_type(self, out_findings);
    weigh_role(self, sent > 0U, out_findings);
    weigh_length(self, out_findings);
}
