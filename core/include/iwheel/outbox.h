// SPDX-License-Identifier: MIT
/// Which setpoints are on their way? The account of sent and echoed frames.
///
/// Per wheel at most one setpoint is un-echoed, and behind it at most one zero: so a queue of old setpoints cannot
/// form, and a zero never waits for an echo. Echoes of one id come in the order sent. An echo that was on its way when
/// the account was cleared may come later than the next frame is sent: so an echo counts only if it bears the speed and
/// current of the oldest un-echoed frame.
///
///     FREE --sent--> ONE --zero sent--> TWO;  each echo goes one back;  clear: FREE
///     (a refused frame only waits; an echo or the end of sending ends that)
#ifndef IW_OUTBOX_H
#define IW_OUTBOX_H

#include "iwheel/can_frame.h"

typedef struct {
    iw_time_us_t waiting_us[IW_SIDES]; ///< Since when a setpoint waits to be proven; IW_NEVER: none does.
    iw_time_us_t sent_us[IW_SIDES][2]; ///< Of the un-echoed frames, oldest first.
    iw_time_us_t proven_us[IW_SIDES];  ///< When the last echoed frame had been sent; 0: none yet.
    uint32_t stray;                    ///< Echoes that nothing was waiting for.
    uint32_t value[IW_SIDES][2];       ///< What they bear: speed and current, as they stand in the frame.
    uint8_t pending[IW_SIDES];         ///< Un-echoed frames, 0..2.
} iw_outbox_t;

void iw_outbox_init(iw_outbox_t *self);

/// Forgets what is un-echoed and what was proven: it was purged, or the bus went away with it.
void iw_outbox_clear(iw_outbox_t *self);

/// True if this wheel may be sent a setpoint now; `zero` tells whether it is a zero.
bool iw_outbox_may_send(const iw_outbox_t *self, iw_side_t side, bool zero);

/// A frame was handed over (`accepted`; only where `iw_outbox_may_send`) or refused by the port. A refused one starts
/// the waiting too, so that a port that takes nothing is found out; the next echo of that wheel settles it, or `rest`.
void iw_outbox_sent(iw_outbox_t *self, iw_side_t side, iw_time_us_t now_us, const iw_can_frame_t *frame, bool accepted);

/// Nothing is being sent any more. What was only refused waits no longer: nobody would ever settle it. What was handed
/// over still does.
void iw_outbox_rest(iw_outbox_t *self);

/// The echo of a setpoint came.
void iw_outbox_echo(iw_outbox_t *self, iw_side_t side, const iw_can_frame_t *echo);

/// True if, for both wheels, a frame that was sent at `since_us` or later has been echoed. `since_us` > 0.
bool iw_outbox_proven_since(const iw_outbox_t *self, iw_time_us_t since_us);

/// Since when the longest-waiting setpoint waits; IW_NEVER if none does.
iw_time_us_t iw_outbox_waiting_us(const iw_outbox_t *self);

#endif
