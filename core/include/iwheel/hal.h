// SPDX-License-Identifier: MIT
/// @file
/// What a port provides: five functions and a context.
///
/// None may block, and none may call back into the core. All are called from `iw_gateway_step` only, so from one
/// thread of execution and never from an interrupt. Unless said otherwise a result > 0 means done, 0 means later or
/// none, < 0 means broken.
#ifndef IW_HAL_H
#define IW_HAL_H

#include "iwheel/can_frame.h"
#include "iwheel/types.h"

/// What the controller says of the bus.
typedef enum {
    IW_BUS_DOWN = 0, ///< Interface absent, down, or not opened.
    IW_BUS_OFF,      ///< Bus-off: nothing is sent or received.
    IW_BUS_PASSIVE,  ///< Error passive: takes frames, but something is wrong.
    IW_BUS_ACTIVE,   ///< Error active: the normal state.
} iw_bus_state_t;

/// An answer of `estop_pressed`: two contacts of one button said different for too long, and have not both been seen
/// pressed and then both released since. A port without a second contact never answers this.
#define IW_ESTOP_DISAGREES 2

/// Where the core gets frames from and gives them to.
typedef struct {
    /// Accepts `count` frames (1..IW_SIDES) of different ids, as a whole: the setpoints of both wheels arrive in one
    /// call, the left one first, and one must not leave long before the other. A port with one call of its system for
    /// several frames uses it; a driver fills every mailbox before it requests the first.
    ///
    ///     > 0  So many frames were accepted, from the first on; the rest was refused. That proves nothing: only the
    ///          echo does.
    ///     0    None was accepted; there is no room for the first one now.
    ///     < 0  None was accepted; the bus is lost.
    ///
    /// The port never retries what it refused, and stores none of it. One of two counts as a refused pair: the core
    /// collapses the ramp, so that the next pair is zero, and the echo that is missing ends in IW_CAUSE_SEND_STALLED.
    /// Of a zero pair the core passes what stands behind a refused frame again, alone: a zero never waits for the other
    /// wheel.
    int (*send)(void *context, const iw_can_frame_t *frames, uint32_t count);

    /// Takes the oldest frame received, or the echo of one of ours with its bytes, in the order of the bus. Frames that
    /// are not for us may be left out, but the eleven ids come in every format (remote, extended, FD), so that they are
    /// counted. Lost frames may be reported by one frame with the id IW_CAN_ERROR: it is counted as unknown.
    int (*receive)(void *context, iw_can_frame_t *out_frame);

    /// The state of the bus. A loss of the bus, however short, is reported by at least one call after it. When that
    /// call returns, no frame sent before the loss is queued any more.
    iw_bus_state_t (*bus_state)(void *context);

    /// Purges every setpoint that was handed over and is not on the bus yet, from every queue and mailbox that may hold
    /// one: without acknowledgement a controller repeats it for ever, and sends it when wheels get power again.
    ///
    ///     > 0  Surely none is left. None of them reaches the bus after the call, and `receive` brings no echo of any:
    ///          not of one that was sent during the purge, nor one that was received already.
    ///     0    Begun, or not done within the call (an abort that does not end in bounded time is left alone). A purged
    ///          frame gives no echo, one that was not purged still does. A loss of the bus, or the next call that
    ///          returns > 0, reports that the rest is gone.
    ///     < 0  Cannot be done here.
    ///
    /// Called once in the zeros of a stop, if a setpoint is not echoed in time; once when the zeros have ended and it
    /// still is not; then every IW_GATEWAY_LOST_ECHO_US. Whether a wheel is heard does not matter.
    int (*purge)(void *context);

    /// 0: released, and was so without interruption since the last call. > 0: pressed, or any edge since the last
    /// call; IW_ESTOP_DISAGREES is one of these. < 0: unreadable or gone, which counts as pressed.
    int (*estop_pressed)(void *context);

    void *context; ///< Passed to each of them.
} iw_hal_t;

/// What is known of two contacts of one e-stop button, for a port that has them: pressed if either says so, released
/// only if both do.
///
///     AGREES --they differ for longer than the limit--> DISAGREES --both pressed, then both released--> AGREES
///
/// A contact that is shorted reads released for ever: the other one still stops the wheels, and the difference tells.
typedef struct {
    iw_time_us_t differ_us; ///< Since when they differ; IW_NEVER: they do not.
    uint32_t limit_us;      ///< They may differ for so long.
    bool disagrees;         ///< They differed for longer ...
    bool proven;            ///< ... and both have been seen pressed since.
} iw_estop_pair_t;

/// Begins with contacts that agree.
void iw_estop_pair_init(iw_estop_pair_t *self, uint32_t limit_us);

/// One answer out of two, each as of `estop_pressed` of iw_hal_t, and so is the result. A contact that cannot be read
/// says nothing: it makes the button unreadable, but it neither begins nor ends a disagreement.
int iw_estop_pair_see(iw_estop_pair_t *self, iw_time_us_t now_us, int first, int second);

/// When the answer will change by time alone; IW_NEVER if it will not.
iw_time_us_t iw_estop_pair_next_us(const iw_estop_pair_t *self);

#endif
