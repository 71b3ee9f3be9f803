// SPDX-License-Identifier: MIT
/// @file
/// Sends pairs: both frames or neither, within the envelope, each frame tracked until its TX confirmation.
///
///     pair -> invert -> encode -> envelope (both frames) -> port (both in one call) -> TX confirmation
///
/// The envelope checks both frames before the port receives one. If the port accepts only one frame of a pair, the
/// result reports it, and the next pair must be zero.
#ifndef IW_TRANSMIT_H
#define IW_TRANSMIT_H

#include "iwheel/can_frame.h"
#include "iwheel/config.h"
#include "iwheel/hal.h"

#ifdef __cplusplus
extern "C" {
#endif

// ---- Envelope ----
//
// The envelope is the last check (R8) of every outgoing frame, directly before the port receives it. It does not know
// why a frame is sent; it reads the bytes, as the wheel would.
//
// A frame passes if it is a setpoint with one of the two ids, the configured type and length, and current and speed
// within the configured limits. Its speed may differ from the last one only as far as the configured slopes allow in
// the time between them, and a change of sign must pass through a zero that was sent. A zero with the right type and
// current passes without a limit of its slope. Before that, the frames of a pair are checked together: the pair must
// not turn the machine faster than configured, and its yaw rate must not grow faster. A pair with no larger yaw rate
// than the last one passes, so the envelope never delays a stop. A current limit below `min_current_mA` does not pass.
// While setpoint type or current role are not configured, nothing passes.
//
// The envelope was written independently of the scheduler, so that it detects an error of the scheduler.

/// Longest time between two frames that the slopes count. After a longer pause the first pair is zero.
#define IW_ENVELOPE_ELAPSED_MAX_US 300000U

/// Result of the envelope.
typedef enum {
    IW_ENVELOPE_PASS = 0,
    IW_ENVELOPE_NOT_A_SETPOINT, ///< The id, the format or the length is wrong.
    IW_ENVELOPE_TYPE,           ///< The setpoint type is not the configured one, or none is configured.
    IW_ENVELOPE_CURRENT,
    IW_ENVELOPE_SPEED,
    IW_ENVELOPE_SLEW,
    IW_ENVELOPE_YAW, ///< The yaw rate of the pair is too large, or grows too fast.
} iw_envelope_verdict_t;

/// Last frames that passed. The caller initializes it with zeros, and sets `config`.
typedef struct {
    const iw_config_t *config;      ///< Checked configuration of the owner.
    iw_time_us_t last_us[IW_SIDES]; ///< Time of the last frame that passed.
    int32_t last_mm_s[IW_SIDES];    ///< Speed of that frame, as on the bus; 0 if there is none.
    uint32_t stopped;               ///< Number of frames that did not pass.
} iw_envelope_t;

/// Checks one frame. If it does not pass, it is counted and must not be sent.
iw_envelope_verdict_t iw_envelope_check(iw_envelope_t *self, const iw_can_frame_t *frame, iw_time_us_t now_us);

/// Checks both frames of a pair together, left and right, before each is checked alone. If the pair does not pass, it
/// is counted and must not be sent.
iw_envelope_verdict_t iw_envelope_check_pair(iw_envelope_t *self, const iw_can_frame_t frame[IW_SIDES],
                                             iw_time_us_t now_us);

// ---- TX confirmation ----
//
// This part tracks the setpoints that the port has accepted and the bus has not confirmed. The controller confirms a
// frame by its echo: it returns the frame after another node has acknowledged it.
//
// Per wheel at most one setpoint is unconfirmed, followed by at most one zero (R6). A queue of old setpoints therefore
// cannot form, and a zero never waits for an echo. Echoes of one id arrive in the order of sending. A purge or a loss
// of the bus clears the list, but an echo may still be in a receive queue and arrive after the next frame. An echo
// therefore confirms the oldest unconfirmed frame only if it has the speed and current of that frame; otherwise it is
// stray.
//
//     FREE --sent--> ONE --zero sent--> TWO;  each matching echo goes one back;  clear: FREE
//     (a frame that the port refused only starts the timer; an echo or the end of sending stops it)

/// Unconfirmed frames. The caller initializes it with zeros and calls `iw_confirmation_clear`.
typedef struct {
    uint8_t pending[IW_SIDES];         ///< Number of unconfirmed frames, 0..2.
    uint32_t stray;                    ///< Number of echoes that matched no unconfirmed frame.
    iw_time_us_t waiting_us[IW_SIDES]; ///< Time since which a setpoint waits for its echo; IW_NEVER if none waits.
    iw_time_us_t sent_us[IW_SIDES][2]; ///< Send times of the unconfirmed frames, oldest first.
    iw_time_us_t proven_us[IW_SIDES];  ///< Send time of the last confirmed frame; 0 if there is none.
    uint32_t value[IW_SIDES][2];       ///< Speed and current of the unconfirmed frames, as bytes of the frame.
} iw_confirmation_t;

/// Clears all unconfirmed and confirmed frames: after a purge or a loss of the bus, no echo is expected.
void iw_confirmation_clear(iw_confirmation_t *self);

/// Returns the wheels (bits IW_SIDES_LEFT, IW_SIDES_RIGHT) to which a setpoint may be sent now. `zero`: it is a zero.
uint32_t iw_confirmation_may_send(const iw_confirmation_t *self, bool zero);

/// Records a frame that the port has accepted (`accepted`, only if `iw_confirmation_may_send` allows it) or refused. A
/// refused frame also starts the timer, so that a port that accepts nothing is detected. The next echo of the wheel or
/// `iw_confirmation_rest` stops that timer.
void iw_confirmation_sent(iw_confirmation_t *self, iw_side_t side, iw_time_us_t now_us, const iw_can_frame_t *frame,
                          bool accepted);

/// Reports that nothing is sent any more. Stops the timer of a refused frame, which will have no echo. An accepted
/// frame still waits for its echo.
void iw_confirmation_rest(iw_confirmation_t *self);

/// Records the echo of a setpoint.
void iw_confirmation_echo(iw_confirmation_t *self, iw_side_t side, const iw_can_frame_t *echo);

/// Returns the send time of the last confirmed frame: the older one of the two wheels; 0 until both wheels have one.
iw_time_us_t iw_confirmation_proven_us(const iw_confirmation_t *self);

/// Returns the time since which the oldest setpoint waits for its echo; IW_NEVER if none waits.
iw_time_us_t iw_confirmation_waiting_us(const iw_confirmation_t *self);

// ---- Sender ----

/// Result of sending a pair.
typedef enum {
    IW_SEND_DONE = 0, ///< The port accepted every frame that was due.
    IW_SEND_LATER,    ///< The port did not accept every frame.
    IW_SEND_STOPPED,  ///< The envelope stopped the pair, and nothing was sent. `verdict` is the reason.
} iw_send_result_t;

/// State of the sender.
typedef struct {
    const iw_config_t *config;     ///< Configuration of the owner.
    const iw_hal_t *hal;           ///< HAL of the owner.
    iw_sent_t sent;                ///< Counters since init.
    iw_envelope_verdict_t verdict; ///< Last verdict other than IW_ENVELOPE_PASS.
    iw_time_us_t pair_us; ///< Time of the last pair that the port accepted; IW_NEVER if none since the last pause.
    iw_confirmation_t confirmation; ///< Unconfirmed frames.
    iw_envelope_t envelope;         ///< Last check.
    iw_can_frame_t frame[IW_SIDES]; ///< Frames of the pair that is sent; here and not on the stack, to save stack.
} iw_sender_t;

/// Initializes `self`. `config` must be checked. `config` and `hal` must exist as long as `self`.
void iw_sender_init(iw_sender_t *self, const iw_config_t *config, const iw_hal_t *hal);

/// Returns true if the pair may be sent now: to both wheels, or if it is `zero`, to at least one wheel.
bool iw_sender_ready(const iw_sender_t *self, bool zero);

/// Sends the pair to the wheels that may receive it. `pair` is in the machine's frame.
iw_send_result_t iw_sender_send(iw_sender_t *self, const iw_pair_t *pair, iw_time_us_t now_us, bool zero);

/// Reports that nothing is sent any more: the next pair starts the measurement of gaps, and refused frames are cleared.
void iw_sender_rest(iw_sender_t *self);

/// Calls `purge` of the port and returns its result: see hal.h. If the port has purged (> 0), no frame is unconfirmed.
int iw_sender_purge(iw_sender_t *self);

#ifdef __cplusplus
}
#endif
#endif
