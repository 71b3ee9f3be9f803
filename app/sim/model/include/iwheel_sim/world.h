// SPDX-License-Identifier: MIT
/// The whole simulated world: a pair of wheels, the bus, other nodes, and ports for clients such as the gateway.
///
/// Owner of the order of events: whatever happens first is done first, so the world is a pure function of seed,
/// configuration, times, submitted frames and faults. No I/O, no clock, no heap; about 40 KiB, may be static and may be
/// copied.
///
///     sim_world_init(&world, NULL, now_us, seed);
///     port = sim_world_connect(&world);
///     sim_world_submit(&world, now_us, port, &frame);
///     while (sim_world_step(&world, now_us, &delivery)) {
///         every client hears delivery.frame; delivery.port gets it as echo
///     }
///     sleep until sim_world_wake_us(&world)
///
/// Before a fault is planted or a frame submitted at `now_us`, all that is due by then must have been taken with
/// `step`.
#ifndef IWHEEL_SIM_WORLD_H
#define IWHEEL_SIM_WORLD_H

#include "iwheel_sim/pair.h"
#include "iwheel_sim/sim_bus.h"

/// Ports of the bus. Clients have the rest.
#define SIM_PORT_LEFT     0U
#define SIM_PORT_RIGHT    1U
#define SIM_PORT_FOREIGN  2U
#define SIM_PORT_BABBLE   3U
#define SIM_PORT_INJECT   4U
#define SIM_PORT_CLIENT   5U
#define SIM_WORLD_CLIENTS (SIM_BUS_PORTS - SIM_PORT_CLIENT)
/// A client's adapter holds this many frames unless told otherwise: the controller's one and three behind it.
#define SIM_QUEUE_DEFAULT 4U
/// Most frames are of this length or longer: a wheel's speed, at 1 Mbit/s.
#define SIM_WORLD_FRAME_US 85U
/// Another master sends a pair this often.
#define SIM_FOREIGN_PERIOD_US 20000U

/// Another node that sends setpoints.
typedef struct {
    iw_time_us_t due_us; ///< IW_NEVER: off.
    iw_codec_setpoint_t setpoint;
} sim_foreign_t;

/// A node that sends one frame over and over.
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
    uint32_t dropped;    ///< Clients' frames lost to a full queue or to bus-off.
    uint8_t queue_depth; ///< Of clients' adapters.
    bool ack_off;        ///< Fault: clients' frames are not acknowledged although the wheels are there.
    bool bus_off;        ///< Fault: clients' controllers are bus-off.
    bool connected[SIM_WORLD_CLIENTS];
} sim_world_t;

/// `config` may be NULL for a healthy pair.
void sim_world_init(sim_world_t *self, const sim_pair_config_t *config, iw_time_us_t now_us, uint64_t seed);

/// A free client port, or SIM_BUS_NONE.
uint8_t sim_world_connect(sim_world_t *self);

/// The adapter is unplugged: what it had queued is gone.
void sim_world_disconnect(sim_world_t *self, iw_time_us_t now_us, uint8_t port);

/// A client sends. Frames that its adapter cannot take are lost and counted: nobody tells the sender, but no echo
/// comes.
void sim_world_submit(sim_world_t *self, iw_time_us_t now_us, uint8_t port, const iw_can_frame_t *frame);

/// True with the next frame that was on the bus. While clients are bus-off they must not hear it.
bool sim_world_step(sim_world_t *self, iw_time_us_t now_us, sim_delivery_t *out_delivery);

iw_time_us_t sim_world_next_us(const sim_world_t *self);

/// When to wake up to take it: as `next_us`, but not for a frame that only begins. One shorter than SIM_WORLD_FRAME_US is then taken
/// that much later than it ended; what `step` tells of it is the same.
iw_time_us_t sim_world_wake_us(const sim_world_t *self);

/// Power of both wheels; what they had queued is lost. One wheel's firmware starts anew.
void sim_world_power(sim_world_t *self, iw_time_us_t now_us, bool on);
void sim_world_reboot(sim_world_t *self, iw_time_us_t now_us, iw_side_t side);

/// Bus-off of all clients' controllers: their queues are lost.
void sim_world_bus_off(sim_world_t *self, iw_time_us_t now_us, bool bus_off);

/// Clients' frames are acknowledged, if a wheel is there, or not.
void sim_world_ack(sim_world_t *self, iw_time_us_t now_us, bool on);

/// Depth of clients' adapters, 1..SIM_BUS_QUEUE_MAX; what is queued stays.
void sim_world_queue(sim_world_t *self, uint8_t depth);

/// Sends one pair of setpoints from another node.
void sim_world_foreign_once(sim_world_t *self, iw_time_us_t now_us);

/// One frame from another node.
void sim_world_inject(sim_world_t *self, iw_time_us_t now_us, const iw_can_frame_t *frame);

/// Undoes every fault that the world, the bus or the wheels have; wheels without power get it back. Wheels keep
/// running.
void sim_world_heal(sim_world_t *self, iw_time_us_t now_us);

#endif
