// SPDX-License-Identifier: MIT
/// A simulated bus with a virtual clock, behind the HAL: it passes what is sent to a listener and returns it as an echo after a delay.
///
/// Nothing happens on its own: `fake_bus_advance` puts the frames that the controller holds on the bus. A frame in `flight` is held
/// by a controller or its queue; unacknowledged frames stay there forever, as in a real controller.
#ifndef TEST_FAKE_BUS_H
#define TEST_FAKE_BUS_H

#include "fixture.h"
#include "iwheel/codec.h"
#include "iwheel/hal.h"

/// Frames that can wait to be received; any further frame is lost and counted.
#define FAKE_BUS_RX_MAX 400U
/// The right setpoint's echo comes this much later than the left one's: the duration of a frame.
#define FAKE_BUS_FRAME_US 130U
/// More setpoints than a correct gateway can ever have in flight.
#define FAKE_BUS_FLIGHT_MAX 8U

typedef struct {
    iw_can_frame_t frame;
    iw_time_us_t at_us; ///< When `send` accepted it.
} fake_flight_t;

/// Called for every frame passed to `send`, before the bus handles it.
typedef void (*fake_bus_listener_t)(void *context, const iw_can_frame_t *frame, bool accepted);

typedef struct {
    /// Set by a test.
    int send_result[IW_SIDES];  ///< Result of `send` for each wheel's setpoint; 1 at first.
    iw_time_us_t echo_delay_us; ///< From `send` to the left one's echo; 300 at first.
    bool acknowledged;          ///< False: no node acknowledges, so no frame gets onto the bus.
    bool loss_unreported;       ///< The bus broke and `bus_state` has not reported it yet.
    iw_bus_state_t state;
    int purge_result;
    int estop_level; ///< Result of `estop_pressed`.
    bool estop_edge; ///< An edge since the last call, reported once.
    uint32_t flood;  ///< Number of frames with an unknown id that come before the others.
    uint32_t boast;  ///< `send` reports that it accepted this many frames more than it was passed.
    fake_bus_listener_t listener;
    void *listener_context;

    /// Recorded by the bus.
    iw_time_us_t now_us;
    uint32_t sent;                       ///< Frames accepted.
    uint32_t refused;                    ///< Frames not accepted.
    uint32_t calls;                      ///< Calls of `send`.
    uint32_t call_frame;                 ///< Position of the frame in its call, for the listener ...
    uint32_t call_frames;                ///< ... and how many frames the call has.
    uint32_t purges;                     ///< Calls of `purge`.
    uint32_t lost;                       ///< Frames that found the receive queue full.
    iw_can_frame_t last[IW_SIDES];       ///< Last setpoint accepted for each wheel.
    iw_time_us_t last_us[IW_SIDES];      ///< Time of that setpoint.
    int16_t commanded_mm_s[IW_SIDES];    ///< Speed that reached each wheel, as on the bus.
    iw_time_us_t commanded_us[IW_SIDES]; ///< Time of that; IW_NEVER: no setpoint yet.
    uint8_t unechoed[IW_SIDES];          ///< Accepted, and the gateway has not received the echo yet.
    fake_flight_t flight[FAKE_BUS_FLIGHT_MAX];
    iw_can_frame_t rx[FAKE_BUS_RX_MAX];
    uint32_t flights;
    uint32_t rx_first;
    uint32_t rx_count;
} fake_bus_t;

void fake_bus_init(fake_bus_t *self, iw_time_us_t now_us);

/// Returns the HAL of this bus.
iw_hal_t fake_bus_hal(fake_bus_t *self);

/// Adds a frame that waits to be received.
void fake_bus_put(fake_bus_t *self, const iw_can_frame_t *frame);

/// The same for a frame of these parts, with data bytes of zero.
void fake_bus_put_empty(fake_bus_t *self, uint32_t id, uint8_t dlc);

/// Advances the time to `now_us`: the frames that the controller holds get onto the bus if they can.
void fake_bus_advance(fake_bus_t *self, iw_time_us_t now_us);

/// When the next frame gets onto the bus; IW_NEVER if none will.
iw_time_us_t fake_bus_next_us(const fake_bus_t *self);

/// Sets the interface down or switches the controller off: the frames that it held are lost.
void fake_bus_break(fake_bus_t *self, iw_bus_state_t state);

/// Speed and current of a setpoint frame, as on the bus.
iw_command_t fake_bus_command(const iw_can_frame_t *frame);

#endif
