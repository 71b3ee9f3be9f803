// SPDX-License-Identifier: MIT
/// The hub of the local bus: clients connect to a unix SOCK_SEQPACKET socket and exchange `struct can_frame`, 16 bytes
/// each.
///
/// Every client hears every frame that was on the simulated bus; the sender gets its own as echo, with `__res0` = 1. A
/// client that does not read loses frames, the others none. A closed connection is a bus that went down with all that
/// its adapter had queued.
/// Error frames that a client sends go to the other clients at once, as on SocketCAN: any local user can forge them. As
/// there, they are marked: with `__res0` = 2.
#ifndef SIM_HUB_H
#define SIM_HUB_H

#include "iwheel_sim/world.h"
#include "sim_loop.h"

typedef struct {
    sim_watch_t watch;
    struct sim_hub *hub;
    uint32_t lost; ///< Frames that found its queue full.
    uint8_t port;
} sim_client_t;

typedef struct sim_hub {
    sim_listener_t listener;
    sim_client_t client[SIM_WORLD_CLIENTS];
    const sim_loop_t *loop;
    sim_world_t *world;
    const iw_time_us_t *now_us; ///< The simulated time that the loop last woke up at.
    uint32_t lost;              ///< By all clients so far.
    uint32_t malformed;         ///< Messages that were no classic CAN frame.
    uint32_t clients;
    bool down; ///< Fault: nobody can connect.
} sim_hub_t;

/// `loop`, `world` and `now_us` must outlive it. False, with the reason, if the socket cannot be made.
bool sim_hub_open(sim_hub_t *self, const char *path, sim_reason_t *out_reason);
void sim_hub_close(sim_hub_t *self);

/// Passes on a frame that was on the bus; not to be called while the clients are bus-off.
void sim_hub_deliver(sim_hub_t *self, const sim_delivery_t *delivery);

/// Tells all clients' controllers' state by an error frame.
void sim_hub_tell(sim_hub_t *self, const iw_can_frame_t *error_frame);

/// The interface goes down (all connections close, none is taken) or comes up.
void sim_hub_down(sim_hub_t *self, bool down);

/// The error frames that tell bus-off, its end, error passive and its end, as <linux/can/error.h> defines them.
typedef enum { SIM_ERROR_BUS_OFF, SIM_ERROR_RESTARTED, SIM_ERROR_PASSIVE, SIM_ERROR_ACTIVE } sim_error_t;
iw_can_frame_t sim_hub_error_frame(sim_error_t error);

#endif
