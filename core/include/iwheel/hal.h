// SPDX-License-Identifier: MIT
/// @file
/// Interface that a port implements: five functions and a context.
///
/// The functions must not block and must not call the core. Only `iw_gateway_step` calls them, so they run in one
/// thread of execution and never in an interrupt. Results, if a function does not define its own: > 0 is done, 0 is
/// later or none, < 0 is broken.
#ifndef IW_HAL_H
#define IW_HAL_H

#include "iwheel/can_frame.h"
#include "iwheel/types.h"

#ifdef __cplusplus
extern "C" {
#endif

/// State of the bus as the controller reports it.
typedef enum {
    IW_BUS_DOWN = 0, ///< The interface is absent, down, or not open.
    IW_BUS_OFF,      ///< Bus-off: the controller neither sends nor receives.
    IW_BUS_PASSIVE,  ///< Error passive: the controller accepts frames, but it has seen many errors.
    IW_BUS_ACTIVE,   ///< Error active: the normal state.
} iw_bus_state_t;

/// Result of `estop_pressed`: the two contacts of one button differed for longer than the limit, and since then they
/// have not both been pressed and then both been released. A port without a second contact never returns it.
#define IW_ESTOP_DISAGREES 2

/// The functions through which the core receives and sends frames and reads the e-stop.
typedef struct {
    /// Sends `count` frames (1..IW_SIDES) with different ids. The core passes the setpoints of both wheels in one call,
    /// the left one first. The port must send them close together: it uses one system call for both if there is one,
    /// and a driver fills every mailbox before it requests the first transmission.
    ///
    ///     > 0  Number of accepted frames, counted from the first; the port refused the rest. Only the echo proves that
    ///          a frame was sent.
    ///     0    The port accepted none: it has no free buffer for the first frame now.
    ///     < 0  The port accepted none: the bus is lost.
    ///
    /// The port neither retries nor stores a refused frame. If it accepts one frame of two, the core treats the pair as
    /// refused: it sets the ramp to zero, so that the next pair is zero, and the missing echo ends in
    /// IW_CAUSE_SEND_STALLED. If it refuses the first frame of a zero pair, the core passes the second one again alone:
    /// a zero for one wheel never waits for the other wheel.
    int (*send)(void *context, const iw_can_frame_t *frames, uint32_t count);

    /// Returns the oldest received frame, or the echo of a sent frame with its bytes, in the order of the bus. The port
    /// may filter out other ids, but it must pass the eleven ids in every format (remote, extended, FD), because the
    /// core counts them. The port may report lost frames by one frame with the id IW_CAN_ERROR, which counts as
    /// unknown.
    int (*receive)(void *context, iw_can_frame_t *out_frame);

    /// Returns the state of the bus. At least one call must report each loss of the bus, however short. When that call
    /// returns, no frame from before the loss may be queued.
    iw_bus_state_t (*bus_state)(void *context);

    /// Removes every setpoint that is not on the bus yet from every queue and mailbox. Without acknowledgement a
    /// controller repeats a frame without end, and the frame reaches the wheels when they get power again.
    ///
    ///     > 0  Done. None of these setpoints reaches the bus after the call, and `receive` returns no echo of them:
    ///          neither of a frame that was sent during the purge, nor one that was received before it.
    ///     0    Not finished within the call (the port does not wait for an abort without a time limit). A purged frame
    ///          has no echo; a frame that was not purged has one. The rest is gone after a loss of the bus, or after
    ///          the next call that returns > 0.
    ///     < 0  The port cannot purge.
    ///
    /// The core calls it once during the zeros of a stop if a setpoint is not echoed in time, once after these zeros if
    /// the echo is still missing, and then every IW_GATEWAY_LOST_ECHO_US, with or without telemetry from the wheels.
    int (*purge)(void *context);

    /// Reads the e-stop. 0: released since the last call, without interruption. > 0: pressed, or an edge since the last
    /// call, or IW_ESTOP_DISAGREES. < 0: unreadable or absent, which counts as pressed.
    int (*estop_pressed)(void *context);

    void *context; ///< Passed to each function.
} iw_hal_t;

/// State of an e-stop button with two contacts. The button is pressed if either contact is pressed, and released only
/// if both are released.
///
///     AGREES --they differ for longer than the limit--> DISAGREES --both pressed, then both released--> AGREES
///
/// A shorted contact always reads released. The other contact still stops the wheels, and the difference reveals the
/// fault.
typedef struct {
    iw_time_us_t differ_us; ///< Time at which the difference began; IW_NEVER if the contacts agree.
    uint32_t limit_us;      ///< Longest difference that is not a fault.
    bool disagrees;         ///< A difference was longer than that.
    bool proven;            ///< Both contacts have been pressed since `disagrees` became true.
} iw_estop_pair_t;

/// Initializes `self` with contacts that agree. `limit_us`: longest difference that is not a fault.
void iw_estop_pair_init(iw_estop_pair_t *self, uint32_t limit_us);

/// Combines the readings of two contacts. Arguments and result have the values of `iw_hal_t::estop_pressed`. An
/// unreadable contact makes the button unreadable, but it neither begins nor ends a disagreement.
int iw_estop_pair_see(iw_estop_pair_t *self, iw_time_us_t now_us, int first, int second);

/// Returns the time at which the result changes without a new reading, or IW_NEVER.
iw_time_us_t iw_estop_pair_next_us(const iw_estop_pair_t *self);

#ifdef __cplusplus
}
#endif
#endif
