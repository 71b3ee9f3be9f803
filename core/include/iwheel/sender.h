// SPDX-License-Identifier: MIT
/// Hands a pair to the bus: whole, through the gate, and on account.
///
///     pair -> invert -> encode -> gate (both frames) -> port (left, then right) -> outbox
///
/// Both frames are judged before one of them leaves. If the port takes the left and not the right, the caller is told
/// and the next pair must be zero.
#ifndef IW_SENDER_H
#define IW_SENDER_H

#include "iwheel/gate.h"
#include "iwheel/hal.h"
#include "iwheel/outbox.h"

typedef enum {
    IW_SEND_DONE = 0, ///< Every frame that was due was taken by the port.
    IW_SEND_LATER,    ///< The port did not take every frame.
    IW_SEND_STOPPED,  ///< The gate stopped it: nothing was sent. `verdict` tells why.
} iw_send_result_t;

typedef struct {
    const iw_config_t *config;
    const iw_hal_t *hal;
    iw_outbox_t outbox;
    iw_gate_t gate;
    iw_time_us_t pair_us;           ///< When the last whole pair was taken by the port; IW_NEVER: none since silence.
    uint32_t gap_us;                ///< Between the last two pairs.
    uint32_t gap_max_us;            ///< The largest since the last silence ended.
    uint32_t pairs;                 ///< Whole pairs taken by the port.
    uint32_t later;                 ///< Setpoints that the port did not take.
    uint32_t clamped;               ///< Currents that the encoder had to clamp.
    iw_gate_verdict_t verdict;      ///< The last that was not IW_GATE_PASS.
    iw_can_frame_t frame[IW_SIDES]; ///< The pair that is being sent: kept here to spare the stack.
} iw_sender_t;

/// `config` must be checked; it and `hal` must outlive the sender.
void iw_sender_init(iw_sender_t *self, const iw_config_t *config, const iw_hal_t *hal);

/// True if the pair may leave now: both wheels, unless it is `zero`, which leaves to whichever wheel it can.
bool iw_sender_ready(const iw_sender_t *self, bool zero);

/// Sends the pair, given in the machine's frame, to the wheels that may have it.
iw_send_result_t iw_sender_send(iw_sender_t *self, iw_time_us_t now_us, const iw_pair_t *pair, bool zero);

/// Nothing is being sent: gaps are measured anew from the next pair, and what was refused is forgotten.
void iw_sender_rest(iw_sender_t *self);

/// Asks the port to take back what is not on the bus; if it surely could, the account is cleared. The port's answer: see
/// hal.h.
int iw_sender_purge(iw_sender_t *self);

#endif
