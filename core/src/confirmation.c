// SPDX-License-Identifier: MIT
#include "iwheel/private/transmit.h"

#include "be.h"

void iw_confirmation_clear(iw_confirmation_t *self) {
    for (size_t side = 0; side < IW_SIDES; side++) {
        self->pending[side] = 0;
        self->waiting_us[side] = IW_NEVER;
        self->proven_us[side] = 0;
    }
}

/// R6: one setpoint without echo, and one zero after it. A longer queue would reach a wheel that gets power again.
/// Without the second place a stop would wait for an echo that may never arrive.
uint32_t iw_confirmation_may_send(const iw_confirmation_t *self, bool zero) {
    const uint32_t places = zero ? 2U : 1U;
    const uint32_t left = (self->pending[IW_LEFT] < places) ? IW_SIDES_LEFT : IW_SIDES_NONE;
    const uint32_t right = (self->pending[IW_RIGHT] < places) ? IW_SIDES_RIGHT : IW_SIDES_NONE;
    return left + right;
}

/// Speed and current as bytes of the frame: these four bytes identify a setpoint.
IW_BE_INLINE uint32_t value_of(const iw_can_frame_t *frame) {
    return (iw_be_word(frame, 0) << 8) | (iw_be_word(frame, 1) >> 24);
}

void iw_confirmation_sent(iw_confirmation_t *self, iw_side_t side, iw_time_us_t now_us, const iw_can_frame_t *frame,
                          bool accepted) {
    // A refused frame also starts the timer: a port that accepts nothing for `echo_ms` is a stalled send.
    if (self->waiting_us[side] == IW_NEVER) {
        self->waiting_us[side] = now_us;
    }
    if (accepted) {
        self->sent_us[side][self->pending[side]] = now_us;
        self->value[side][self->pending[side]] = value_of(frame);
        self->pending[side]++;
    }
}

void iw_confirmation_rest(iw_confirmation_t *self) {
    for (size_t side = 0; side < IW_SIDES; side++) {
        if (self->pending[side] == 0U) {
            self->waiting_us[side] = IW_NEVER;
        }
    }
}

void iw_confirmation_echo(iw_confirmation_t *self, iw_side_t side, const iw_can_frame_t *echo) {
    if (self->pending[side] == 0U || self->value[side][0] != value_of(echo)) {
        self->stray++;
        return;
    }
    self->proven_us[side] = self->sent_us[side][0];
    self->sent_us[side][0] = self->sent_us[side][1];
    self->value[side][0] = self->value[side][1];
    self->pending[side]--;
    self->waiting_us[side] = (self->pending[side] > 0U) ? self->sent_us[side][0] : IW_NEVER;
}

iw_time_us_t iw_confirmation_proven_us(const iw_confirmation_t *self) {
    const iw_time_us_t left = self->proven_us[IW_LEFT];
    const iw_time_us_t right = self->proven_us[IW_RIGHT];
    return (left < right) ? left : right;
}

iw_time_us_t iw_confirmation_waiting_us(const iw_confirmation_t *self) {
    const iw_time_us_t left = self->waiting_us[IW_LEFT];
    const iw_time_us_t right = self->waiting_us[IW_RIGHT];
    return (left < right) ? left : right;
}
