// SPDX-License-Identifier: MIT
#include "iwheel/private/transmit.h"

#include "iwheel/codec.h"

#include <string.h>

void iw_sender_init(iw_sender_t *self, const iw_config_t *config, const iw_hal_t *hal) {
    memset(self, 0, sizeof *self);
    self->config = config;
    self->hal = hal;
    self->pair_us = IW_NEVER;
    self->envelope.config = config;
    iw_confirmation_clear(&self->confirmation);
}

/// A nonzero pair is sent as a whole or not at all (R5). A zero must not wait for the echo of the other wheel (R6).
bool iw_sender_ready(const iw_sender_t *self, bool zero) {
    const uint32_t sides = iw_confirmation_may_send(&self->confirmation, zero);
    return zero ? sides != IW_SIDES_NONE : sides == IW_SIDES_BOTH;
}

/// Encodes the frame for one wheel, in the wheel's own direction.
static void prepare(iw_sender_t *self, iw_side_t side, const iw_command_t *command) {
    iw_can_frame_t *const frame = &self->frame[side];
    const iw_config_t *const config = self->config;
    const bool invert = config->invert[side];
    iw_codec_setpoint_t setpoint = {command->speed_mm_s, command->current_mA, config->setpoint_type};
    if (invert) {
        setpoint.speed_mm_s = (int16_t)-setpoint.speed_mm_s;
    }
    // A limit has no direction, and the document does not define a negative one.
    if (invert && config->current_role == IW_ROLE_SETPOINT) {
        setpoint.current_mA = (int16_t)-setpoint.current_mA;
    }
    self->sent.clamped += iw_codec_encode_setpoint(side, &setpoint, (uint8_t)config->setpoint_dlc, frame) ? 1U : 0U;
}

/// Checks the pair, then each frame. Returns false and sets `verdict` if the envelope stops one of them.
static bool is_within(iw_sender_t *self, iw_time_us_t now_us) {
    iw_envelope_verdict_t verdict = iw_envelope_check_pair(&self->envelope, self->frame, now_us);
    if (verdict == IW_ENVELOPE_PASS) {
        verdict = iw_envelope_check(&self->envelope, &self->frame[IW_LEFT], now_us);
    }
    if (verdict == IW_ENVELOPE_PASS) {
        verdict = iw_envelope_check(&self->envelope, &self->frame[IW_RIGHT], now_us);
    }
    if (verdict != IW_ENVELOPE_PASS) {
        self->verdict = verdict;
    }
    return verdict == IW_ENVELOPE_PASS;
}

static bool account(iw_sender_t *self, iw_side_t side, iw_time_us_t now_us, bool accepted) {
    self->sent.later += accepted ? 0U : 1U;
    iw_confirmation_sent(&self->confirmation, side, now_us, &self->frame[side], accepted);
    return accepted;
}

/// Sends to one wheel alone, which only a zero may do.
static bool hand_over(iw_sender_t *self, iw_side_t side, iw_time_us_t now_us) {
    const iw_can_frame_t *const frame = &self->frame[side];
    return account(self, side, now_us, self->hal->send(self->hal->context, frame, 1U) > 0);
}

/// Sends both frames in one call, so that the process cannot be stopped or killed between them. If the port refuses the
/// left frame, the right one is not sent either, unless it is a zero.
static bool hand_over_as_one(iw_sender_t *self, iw_time_us_t now_us, bool zero) {
    const int accepted = self->hal->send(self->hal->context, self->frame, IW_SIDES);
    if (account(self, IW_LEFT, now_us, accepted > 0)) {
        return account(self, IW_RIGHT, now_us, accepted > 1);
    }
    if (zero) {
        (void)hand_over(self, IW_RIGHT, now_us);
    }
    return false;
}

static void measure_gap(iw_sender_t *self, iw_time_us_t now_us) {
    const bool first = self->pair_us == IW_NEVER;
    self->sent.gap_us = first ? 0U : (uint32_t)(now_us - self->pair_us);
    if (first || self->sent.gap_us > self->sent.gap_max_us) {
        self->sent.gap_max_us = self->sent.gap_us;
    }
    self->pair_us = now_us;
    self->sent.pairs++;
}

/// Sends to both wheels, or a zero pair to the wheel that may receive it (`iw_sender_ready`).
static bool hand_over_both(iw_sender_t *self, iw_time_us_t now_us, bool zero) {
    const uint32_t sides = iw_confirmation_may_send(&self->confirmation, zero);
    bool accepted = true;
    if (sides == IW_SIDES_BOTH) {
        accepted = hand_over_as_one(self, now_us, zero);
        if (accepted) {
            measure_gap(self, now_us);
        }
    } else if (sides == IW_SIDES_LEFT) {
        accepted = hand_over(self, IW_LEFT, now_us);
    } else if (sides == IW_SIDES_RIGHT) {
        accepted = hand_over(self, IW_RIGHT, now_us);
    }
    return accepted;
}

/// Checks both frames before it sends the first one. Otherwise a stopped right frame would leave the left one alone.
iw_send_result_t iw_sender_send(iw_sender_t *self, const iw_pair_t *pair, iw_time_us_t now_us, bool zero) {
    for (size_t side = 0; side < IW_SIDES; side++) {
        prepare(self, (iw_side_t)side, &pair->wheel[side]);
    }
    if (!is_within(self, now_us)) {
        return IW_SEND_STOPPED;
    }
    return hand_over_both(self, now_us, zero) ? IW_SEND_DONE : IW_SEND_LATER;
}

void iw_sender_rest(iw_sender_t *self) {
    self->pair_us = IW_NEVER;
    iw_confirmation_rest(&self->confirmation);
}

/// Clears the list only if the port is certain: no second frame may be queued after one that may still be sent (R6).
int iw_sender_purge(iw_sender_t *self) {
    const int answer = self->hal->purge(self->hal->context);
    if (answer > 0) {
        iw_confirmation_clear(&self->confirmation);
    }
    return answer;
}
