// SPDX-License-Identifier: MIT
// Sum of the wheels' counts, from answers of the gateway that may be late or missing.
#include "bringup.h"

#include <stdlib.h>

/// Backward motion of a hand that aims at a mark: a number of ticks, or one part in BACK_SHARE of the whole motion.
#define BACK_TICKS 6
#define BACK_SHARE 20

static void note_gap(hand_t *self, hand_gap_t gap) {
    if (self->gap == HAND_COMPLETE) {
        self->gap = gap;
    }
}

void hand_begin(hand_t *out_hand, const hand_sample_t *first, int64_t now_us) {
    *out_hand = (hand_t){
        .last = *first, .gap = first->heard ? HAND_COMPLETE : HAND_OFFLINE, .received_us = now_us, .polled_us = now_us};
}

/// Adds the step between two answers with both wheels. The wheels count during a stall, but their rpm in that time are
/// not known.
static void add_step(hand_t *self, const hand_sample_t *now, int64_t us) {
    for (unsigned side = 0; side < IW_SIDES; side++) {
        const long long step = now->ticks[side] - self->last.ticks[side];
        self->ticks[side] += step;
        self->way[side] += llabs(step);
        if (us <= HAND_STALL_US) {
            self->rpm_turns[side] += abs(now->rpm[side]) * (double)us / 60e6;
            self->rpm_way[side] += llabs(step);
        }
    }
}

void hand_add(hand_t *self, const hand_sample_t *now, int64_t now_us) {
    const int64_t us = now_us - self->polled_us;
    self->polled_us = now_us;
    if (us > HAND_UNSEEN_US) {
        note_gap(self, HAND_UNSEEN);
    }
    if (!now->heard) {
        self->offline_us += (us < HAND_STALL_US) ? us : HAND_STALL_US;
        if (self->offline_us > HAND_OFFLINE_US) {
            note_gap(self, HAND_OFFLINE);
        }
        return;
    }
    if (now->reboots != self->last.reboots) {
        note_gap(self, HAND_RESTARTED);
    }
    add_step(self, now, now_us - self->received_us);
    self->last = *now;
    self->received_us = now_us;
    self->offline_us = 0;
}

bool hand_is_complete(const hand_t *hand) {
    switch (hand->gap) {
    case HAND_OFFLINE:
        talk_print("  The wheels were offline for a while: check their power and cables, then try again.");
        break;
    case HAND_RESTARTED:
        talk_print("  A wheel restarted or left the bus: not all of its ticks were counted. Check its power and cable, "
                   "then try again.");
        break;
    case HAND_UNSEEN:
        talk_print("  This computer was too busy to follow the wheels for %d s: check what else runs on it, then try "
                   "again.",
                   HAND_UNSEEN_US / 1000000);
        break;
    case HAND_COMPLETE:
    default:
        return true;
    }
    return false;
}

double hand_rpm_share(const hand_t *hand, iw_side_t side) {
    const double rotor = (double)hand->rpm_way[side] / IW_TICKS_PER_TURN;
    const bool seen = rotor > 0.0 && 2 * hand->rpm_way[side] >= hand->way[side];
    return seen ? hand->rpm_turns[side] / rotor : 0.0;
}

bool hand_went_one_way(const hand_t *hand, iw_side_t side) {
    const long long back = hand->way[side] - llabs(hand->ticks[side]);
    return back <= BACK_TICKS || back <= hand->way[side] / BACK_SHARE;
}
