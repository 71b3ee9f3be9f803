// SPDX-License-Identifier: MIT
/// The simulated wheels as a node on a CAN interface of this machine.
///
/// What the wheels and the other simulated nodes send goes out on the interface; what others send there takes part in
/// the simulated bus as if one more adapter had sent it, and so reaches the wheels a frame's length later. Faults of
/// adapters and of the medium are the interface's own here: commands for them are refused.
#ifndef SIM_SOCKETCAN_H
#define SIM_SOCKETCAN_H

#include "iwheel_linux/backend.h"
#include "iwheel_sim/world.h"
#include "sim_loop.h"

typedef struct {
    sim_watch_t watch;
    sim_world_t *world;
    iwl_backend_store_t bus;
    bool is_open;  ///< In use.
    uint32_t lost; ///< Frames that the interface did not take.
    uint8_t port;  ///< Of the world, for all that comes from the interface.
    iw_bus_state_t state;
} sim_socketcan_t;

/// `loop` and `world` are used until close. False, with cause and cure, if this build or kernel cannot do it. An
/// interface that is absent or down is waited for.
bool sim_socketcan_open(sim_socketcan_t *self, const char *interface, const sim_loop_t *loop, sim_world_t *world,
                        sim_reason_t *out_reason);
void sim_socketcan_close(sim_socketcan_t *self);

/// Reopens what is gone, and puts what came in on the simulated bus. True if the interface came up, went down, or
/// changed its state otherwise: see `state`.
bool sim_socketcan_step(sim_socketcan_t *self, iw_time_us_t now_us);

/// When `step` has something to do without a frame; IW_NEVER if it has not.
iw_time_us_t sim_socketcan_next_us(const sim_socketcan_t *self);

/// Sends what was on the simulated bus, unless it came from the interface.
void sim_socketcan_deliver(sim_socketcan_t *self, const sim_delivery_t *delivery);

/// True if this command plants a fault that only the hub of a local bus can have.
bool sim_socketcan_refuses(const char *command);

#endif
