// SPDX-License-Identifier: MIT
/// Simulated world: a pair of wheels, the bus, other nodes, and ports for clients such as the gateway.
///
/// The world executes all events in the order of their times, so it is a pure function of seed, configuration, times,
/// submitted frames and faults. No I/O, no clock, no heap. It needs about 40 KiB, may be static and may be copied.
///
///     sim_world_init(&world, NULL, now_us, seed);
///     port = sim_world_connect(&world);
///     sim_world_submit(&world, now_us, port, &frame);
///     while (sim_world_step(&world, now_us, &delivery)) {
///         every client receives delivery.frame; delivery.port receives it as echo
///     }
///     sleep until sim_world_wake_us(&world)
///
/// Before a fault is set or a frame is submitted at `now_us`, `sim_world_step` must have returned all frames that are
/// due by then.
#ifndef IWHEEL_SIM_WORLD_H
#define IWHEEL_SIM_WORLD_H

#include "iwheel_sim/pair.h"
#include "iwheel_sim/sim_bus.h"

/// Ports of the bus. The other ports belong to clients.
#define SIM_PORT_LEFT     0U
#define SIM_PORT_RIGHT    1U
#define SIM_PORT_FOREIGN  2U
#define SIM_PORT_BABBLE   3U
#define SIM_PORT_INJECT   4U
#define SIM_PORT_CLIENT   5U
#define SIM_WORLD_CLIENTS (SIM_BUS_PORTS - SIM_PORT_CLIENT)
/// Default number of frames in a client's adapter: one in the controller and three behind it.
#define SIM_QUEUE_DEFAULT 4U
/// Duration of a wheel's speed frame at 1 Mbit/s. Most frames have this duration or a longer one.
#define SIM_WORLD_FRAME_US 85U
/// Period of the setpoint pairs of another master.
#define SIM_FOREIGN_PERIOD_US 20000U

/// Another node that sends setpoints.
typedef struct {
    iw_time_us_t due_us; ///< IW_NEVER: off.
    iw_codec_setpoint_t setpoint;
} sim_foreign_t;

/// A node that sends one frame again and again.
typedef struct {
    iw_time_us_t due_us; ///< IW_NEVER: off.
    uint32_t period_us;
    iw_can_frame_t frame;
} sim_babble_t;

typedef struct {
    sim_pair_t pair;
    sim_bus_t bus;
    sim_foreign_t foreign;
    sim_babble_t babble;
    uint32_t dropped;    ///< Clients' frames that were lost because of a full queue or bus-off.
    uint8_t queue_depth; ///< Queue depth of the clients' adapters.
    bool ack_off;        ///< Fault: clients' frames are not acknowledged although the wheels are online.
    bool bus_off;        ///< Fault: clients' controllers are bus-off.
    bool connected[SIM_WORLD_CLIENTS];
} sim_world_t;

/// Initialises the world. `config` may be NULL for a healthy pair.
void sim_world_init(sim_world_t *self, const sim_pair_config_t *config, iw_time_us_t now_us, uint64_t seed);

/// Returns a free client port, or SIM_BUS_NONE.
uint8_t sim_world_connect(sim_world_t *self);

/// Unplugs the adapter. Its queued frames are lost.
void sim_world_disconnect(sim_world_t *self, iw_time_us_t now_us, uint8_t port);

/// Sends a frame of a client. A frame that the adapter cannot accept is lost and counted. The sender receives no error,
/// but no echo either.
void sim_world_submit(sim_world_t *self, iw_time_us_t now_us, uint8_t port, const iw_can_frame_t *frame);

/// Returns true and writes the next frame that was on the bus to `*out_delivery`; returns false if there is none by
/// `now_us`. While clients are bus-off, they must not receive it.
bool sim_world_step(sim_world_t *self, iw_time_us_t now_us, sim_delivery_t *out_delivery);

iw_time_us_t sim_world_next_us(const sim_world_t *self);

/// Returns the time at which to wake up: as `sim_world_next_us`, but without a wake-up for a frame that only begins. A
/// frame shorter than SIM_WORLD_FRAME_US is then returned later than its end by the difference; its contents and times
/// are the same.
iw_time_us_t sim_world_wake_us(const sim_world_t *self);

/// Switch the power of both wheels, and start the firmware of one wheel again. The queued frames of a wheel are lost
/// when its power goes or its firmware starts again.
void sim_world_power(sim_world_t *self, iw_time_us_t now_us, bool on);
void sim_world_reboot(sim_world_t *self, iw_time_us_t now_us, iw_side_t side);

/// Sets or ends bus-off of all clients' controllers. At bus-off their queues are lost.
void sim_world_bus_off(sim_world_t *self, iw_time_us_t now_us, bool bus_off);

/// Sets whether clients' frames are acknowledged. Without a running wheel they are not acknowledged in any case.
void sim_world_ack(sim_world_t *self, iw_time_us_t now_us, bool on);

/// Sets the queue depth of the clients' adapters, 1..SIM_BUS_QUEUE_MAX. Queued frames stay.
void sim_world_queue(sim_world_t *self, uint8_t depth);

/// Sends one pair of setpoints from another node.
void sim_world_foreign_once(sim_world_t *self, iw_time_us_t now_us);

/// Sends one frame from another node.
void sim_world_inject(sim_world_t *self, iw_time_us_t now_us, const iw_can_frame_t *frame);

/// Clears every fault of the world, the bus and the wheels. Wheels without power boot; running wheels continue without a
/// reboot.
void sim_world_heal(sim_world_t *self, iw_time_us_t now_us);

#endif
