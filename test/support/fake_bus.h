// SPDX-License-Identifier: MIT
/// A simulated bus with a virtual clock, seen through the HAL: what is sent is judged and comes back as an echo after a delay.
///
/// Nothing happens by itself: `fake_bus_advance` lets the controller put on the bus what it was handed. One frame in `flight` is what
/// a controller or its queue holds; unacknowledged frames stay there for ever, as in a real one.
#ifndef TEST_FAKE_BUS_H
#define TEST_FAKE_BUS_H

#include "fixture.h"
#include "iwheel/codec.h"
#include "iwheel/hal.h"

/// Frames that can wait to be received; what comes beyond is lost and counted.
#define FAKE_BUS_RX_MAX 400U
/// The right setpoint's echo comes this much later than the left one's: a frame takes its time.
#define FAKE_BUS_FRAME_US 130U
/// More setpoints than a correct gateway can ever have under way.
#define FAKE_BUS_FLIGHT_MAX 8U

typedef struct {
    iw_can_frame_t frame;
    iw_time_us_t at_us; ///< When it was handed over.
} fake_flight_t;

/// Told of every frame handed to the bus, before anything else happens with it.
typedef void (*fake_bus_listener_t)(void *context, const iw_can_frame_t *frame, bool accepted);

typedef struct {
    /// What a test sets.
    int send_result[IW_SIDES];  ///< What `send` answers for each wheel's setpoint; 1 at first.
    iw_time_us_t echo_delay_us; ///< From `send` to the left one's echo; 300 at first.
    bool acknowledged;          ///< False: nobody acknowledges, nothing gets onto the bus.
    bool loss_untold;           ///< It broke and `bus_state` has not told yet.
    iw_bus_state_t state;
    int purge_result;
    int estop_level; ///< What `estop_pressed` answers.
    bool estop_edge; ///< An edge since the last call: told once.
    uint32_t flood;  ///< So many frames of an unknown id come before the others.
    uint32_t boast;  ///< `send` answers that it accepted so many more frames than it was passed.
    fake_bus_listener_t listener;
    void *listener_context;

    /// What happened.
    iw_time_us_t now_us;
    uint32_t sent;                    ///< Frames accepted.
    uint32_t refused;                 ///< Frames not accepted.
    uint32_t calls;                   ///< Of `send`.
    uint32_t call_frame;              ///< Position of the frame in its call, for the listener ...
    uint32_t call_frames;             ///< ... and how many frames the call has.
    uint32_t purges;                  ///< Calls of `purge`.
    uint32_t lost;                    ///< Frames that found the receive queue full.
    iw_can_frame_t last[IW_SIDES];    ///< Last setpoint accepted for each wheel.
    iw_time_us_t last_us[IW_SIDES];   ///< When.
    int16_t commanded_mm_s[IW_SIDES]; ///< What reached each wheel, as on the bus.
    iw_time_us_t told_us[IW_SIDES];   ///< When; IW_NEVER: nothing yet.
    uint8_t unechoed[IW_SIDES];       ///< Accepted, and echo not yet taken by the gateway.
    fake_flight_t flight[FAKE_BUS_FLIGHT_MAX];
    iw_can_frame_t rx[FAKE_BUS_RX_MAX];
    uint32_t flights;
    uint32_t rx_first;
    uint32_t rx_count;
} fake_bus_t;

void fake_bus_init(fake_bus_t *self, iw_time_us_t now_us);

/// The HAL of this bus.
iw_hal_t fake_bus_hal(fake_bus_t *self);

/// Lets a frame wait to be received.
void fake_bus_put(fake_bus_t *self, const iw_can_frame_t *frame);

/// The same for a frame made of its parts, with data bytes of zero.
void fake_bus_put_empty(fake_bus_t *self, uint32_t id, uint8_t dlc);

/// Time goes on to `now_us`: what the controller holds gets onto the bus if it can.
void fake_bus_advance(fake_bus_t *self, iw_time_us_t now_us);

/// When the next frame gets onto the bus; IW_NEVER if none will.
iw_time_us_t fake_bus_next_us(const fake_bus_t *self);

/// The interface goes down or the controller off: what it held is gone.
void fake_bus_break(fake_bus_t *self, iw_bus_state_t state);

/// Speed and current of a setpoint frame, as on the bus.
iw_command_t fake_bus_command(const iw_can_frame_t *frame);

#endif
