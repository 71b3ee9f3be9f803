// SPDX-License-Identifier: MIT
/// @file
/// Hands a pair to the bus: whole, within the envelope, each frame tracked until its TX confirmation.
///
///     pair -> invert -> encode -> envelope (both frames) -> port (both in one call) -> TX confirmation
///
/// Both frames are judged before one of them leaves. If the port accepts the left and not the right, the caller is told
/// and the next pair must be zero.
#ifndef IW_TRANSMIT_H
#define IW_TRANSMIT_H

#include "iwheel/can_frame.h"
#include "iwheel/config.h"
#include "iwheel/hal.h"

// ---- Envelope ----
//
// The last check (R8) of every outgoing frame, right before it is handed to the port: does it lie within the envelope
// of what is configured?
//
// It does not know why a frame is sent. It looks at the bytes, as the wheel would, and lets through only a setpoint
// of one of the two ids, with the configured type and length, current and speed within the configured maxima, and a
// speed no further from the last one that passed than the configured slopes allow for the time between; a change of
// sign must pass through a zero that was sent. A zero of the right type and current passes whatever its slew. Both
// frames of a pair are first judged together: they turn the machine no faster than configured, and its turning grows
// no faster; a pair that turns it no more than the last one passes, so no stop is held up. A current limit below
// `min_current_mA` is refused; while setpoint type or current role are unset nothing passes.
//
// Written independently of the scheduler, so that an error in one is caught by the other.

/// Time between two frames counts up to this. Longer silence is no permission to jump: after it comes a zero.
#define IW_ENVELOPE_ELAPSED_MAX_US 300000U

/// Whether a frame may leave, and if not, what is wrong with it.
typedef enum {
    IW_ENVELOPE_PASS = 0,
    IW_ENVELOPE_NOT_A_SETPOINT, ///< Wrong id, format or length.
    IW_ENVELOPE_TYPE,           ///< Not the configured setpoint type, or none is configured.
    IW_ENVELOPE_CURRENT,
    IW_ENVELOPE_SPEED,
    IW_ENVELOPE_SLEW,
    IW_ENVELOPE_YAW, ///< Of the pair: it would turn the machine too fast, or faster too soon.
} iw_envelope_verdict_t;

/// What passed last, against which the next one is judged. It begins all zero but for `config`.
typedef struct {
    const iw_config_t *config;      ///< The owner's: checked.
    iw_time_us_t last_us[IW_SIDES]; ///< When the last frame passed.
    int32_t last_mm_s[IW_SIDES];    ///< Its speed, as on the bus; 0 at first.
    uint32_t stopped;               ///< Frames that did not pass.
} iw_envelope_t;

/// Judges one frame; what does not pass is counted and must not be sent.
iw_envelope_verdict_t iw_envelope_check(iw_envelope_t *self, const iw_can_frame_t *frame, iw_time_us_t now_us);

/// Judges both frames of a pair together, left and right, before each of them is judged alone: against what passed
/// last. A pair that does not pass is counted and must not be sent.
iw_envelope_verdict_t iw_envelope_check_pair(iw_envelope_t *self, const iw_can_frame_t frame[IW_SIDES],
                                             iw_time_us_t now_us);

// ---- TX confirmation ----
//
// Which setpoints were handed to the port and are not confirmed yet? The controller confirms a frame by its echo: our
// own frame, handed back once another node has acknowledged it.
//
// Per wheel at most one setpoint is unconfirmed, and behind it at most one zero (R6): so a queue of old
// setpoints cannot form, and a zero never waits for an echo. Echoes of one id come in the order sent. After a purge or
// a loss of the bus all is forgotten, but an echo may still be on its way through a receive queue and arrive behind the
// next frame: so an echo confirms the oldest unconfirmed frame only if it has that frame's speed and current; otherwise
// it is stray.
//
//     FREE --sent--> ONE --zero sent--> TWO;  each matching echo goes one back;  clear: FREE
//     (a frame that the port refused only starts the clock; an echo or the end of sending stops it)

/// Frames handed over and not confirmed. It begins all zero, and is then cleared.
typedef struct {
    uint8_t pending[IW_SIDES];         ///< Unconfirmed frames, 0..2.
    uint32_t stray;                    ///< Echoes that no unconfirmed frame matched.
    iw_time_us_t waiting_us[IW_SIDES]; ///< Since when a setpoint waits for its echo; IW_NEVER: none does.
    iw_time_us_t sent_us[IW_SIDES][2]; ///< Of the unconfirmed frames, oldest first.
    iw_time_us_t proven_us[IW_SIDES];  ///< When the last confirmed frame had been sent; 0: none yet.
    uint32_t value[IW_SIDES][2];       ///< Of the unconfirmed frames: speed and current, as they stand in the frame.
} iw_confirmation_t;

/// Forgets what is unconfirmed and what was confirmed: after a purge or a loss of the bus no echo is owed any more.
void iw_confirmation_clear(iw_confirmation_t *self);

/// The wheels (bits IW_SIDES_LEFT, IW_SIDES_RIGHT) that may be sent a setpoint now; `zero` tells whether it is a zero.
uint32_t iw_confirmation_may_send(const iw_confirmation_t *self, bool zero);

/// A frame was handed over (`accepted`; only where `iw_confirmation_may_send`) or refused by the port. A refused one
/// starts the clock too, so that a port that takes nothing is found out; the next echo of that wheel stops it, or
/// `iw_confirmation_rest`.
void iw_confirmation_sent(iw_confirmation_t *self, iw_side_t side, iw_time_us_t now_us, const iw_can_frame_t *frame,
                          bool accepted);

/// Nothing is being sent any more. The clock of a refused frame stops: no echo of it will ever come. A frame that was
/// handed over still waits for its echo.
void iw_confirmation_rest(iw_confirmation_t *self);

/// The echo of a setpoint came.
void iw_confirmation_echo(iw_confirmation_t *self, iw_side_t side, const iw_can_frame_t *echo);

/// Of each wheel's last confirmed frame: when the older of the two was sent. 0: not both wheels have one yet.
iw_time_us_t iw_confirmation_proven_us(const iw_confirmation_t *self);

/// Since when the setpoint that has waited longest waits; IW_NEVER if none does.
iw_time_us_t iw_confirmation_waiting_us(const iw_confirmation_t *self);

// ---- Sender ----

/// What became of a pair.
typedef enum {
    IW_SEND_DONE = 0, ///< Every frame that was due was taken by the port.
    IW_SEND_LATER,    ///< The port did not take every frame.
    IW_SEND_STOPPED,  ///< The envelope stopped it: nothing was sent. `verdict` tells why.
} iw_send_result_t;

/// The way of a pair to the port.
typedef struct {
    const iw_config_t *config;      ///< The owner's.
    const iw_hal_t *hal;            ///< The owner's.
    iw_sent_t sent;                 ///< Counted since init.
    iw_envelope_verdict_t verdict;  ///< The last that was not IW_ENVELOPE_PASS.
    iw_time_us_t pair_us;           ///< When the last whole pair was taken by the port; IW_NEVER: none since silence.
    iw_confirmation_t confirmation; ///< What is unconfirmed.
    iw_envelope_t envelope;         ///< The last check.
    iw_can_frame_t frame[IW_SIDES]; ///< The pair that is being sent: kept here to spare the stack.
} iw_sender_t;

/// `config` must be checked; it and `hal` must outlive the sender.
void iw_sender_init(iw_sender_t *self, const iw_config_t *config, const iw_hal_t *hal);

/// True if the pair may leave now: both wheels, unless it is `zero`, which leaves to whichever wheel it can.
bool iw_sender_ready(const iw_sender_t *self, bool zero);

/// Sends the pair, given in the machine's frame, to the wheels that may have it.
iw_send_result_t iw_sender_send(iw_sender_t *self, const iw_pair_t *pair, iw_time_us_t now_us, bool zero);

/// Nothing is being sent: gaps are measured anew from the next pair, and what was refused is forgotten.
void iw_sender_rest(iw_sender_t *self);

/// Asks the port to purge what is not on the bus yet. If it surely did (> 0), nothing is unconfirmed any more. The
/// answer is the port's: see hal.h.
int iw_sender_purge(iw_sender_t *self);

#endif
