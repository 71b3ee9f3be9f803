// SPDX-License-Identifier: MIT
/// Hub of the local bus: clients connect to a unix SOCK_SEQPACKET socket and exchange `struct can_frame`, 16 bytes
/// each.
///
/// Every client receives every frame that was on the simulated bus; the sender receives its own frame as echo, with
/// `__res0` = 1. A client that does not read loses frames; the other clients lose none. A closed connection is a bus
/// that went down: the frames queued in its adapter are lost. Error frames that a client sends go directly to the other
/// clients. As on SocketCAN, any local user can forge them, and they are marked: with `__res0` = 2.
#ifndef SIM_HUB_H
#define SIM_HUB_H

#include "iwheel_sim/world.h"
#include "sim_loop.h"

typedef struct {
    sim_watch_t watch;
    struct sim_hub *hub;
    uint32_t lost; ///< Frames that were lost because the queue of its socket was full.
    uint8_t port;
} sim_client_t;

typedef struct sim_hub {
    sim_listener_t listener;
    sim_client_t client[SIM_WORLD_CLIENTS];
    const sim_loop_t *loop;
    sim_world_t *world;
    const iw_time_us_t *now_us; ///< Simulated time of the last wake-up of the loop.
    uint32_t lost;              ///< Frames that all clients have lost so far.
    uint32_t malformed;         ///< Messages that are not a classic CAN frame.
    uint32_t clients;
    bool down; ///< Fault: no client can connect.
} sim_hub_t;

/// Opens the hub. `loop`, `world` and `now_us` must exist as long as the hub. Returns false, with the reason, if the
/// socket cannot be created.
bool sim_hub_open(sim_hub_t *self, const char *path, sim_reason_t *out_reason);
void sim_hub_close(sim_hub_t *self);

/// Passes a frame that was on the bus to all clients. It must not be called while the clients are bus-off.
void sim_hub_deliver(sim_hub_t *self, const sim_delivery_t *delivery);

/// Sends all clients an error frame that reports the state of their controllers.
void sim_hub_report(sim_hub_t *self, const iw_can_frame_t *error_frame);

/// Sets the interface down (all connections are closed, new ones are rejected) or up.
void sim_hub_down(sim_hub_t *self, bool down);

/// Returns the error frame that reports bus-off, its end, error passive or its end, as <linux/can/error.h> defines it.
typedef enum { SIM_ERROR_BUS_OFF, SIM_ERROR_RESTARTED, SIM_ERROR_PASSIVE, SIM_ERROR_ACTIVE } sim_error_t;
iw_can_frame_t sim_hub_error_frame(sim_error_t error);

#endif
