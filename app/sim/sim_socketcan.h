// SPDX-License-Identifier: MIT
/// The simulated wheels as a node on a CAN interface of this machine.
///
/// Frames of the wheels and of the other simulated nodes are sent on the interface. Frames of other nodes there pass
/// through the simulated bus like frames of one more adapter, so they reach the wheels later by the duration of a frame.
/// Faults of adapters and of the medium are those of the interface: commands for them are refused.
#ifndef SIM_SOCKETCAN_H
#define SIM_SOCKETCAN_H

#include "iwheel_linux/backend.h"
#include "iwheel_sim/world.h"
#include "sim_loop.h"

typedef struct {
    sim_watch_t watch;
    sim_world_t *world;
    iwl_backend_store_t bus;
    bool is_open;  ///< The interface is in use.
    uint32_t lost; ///< Frames that the interface did not accept.
    uint8_t port;  ///< Port of the world for all frames from the interface.
    iw_bus_state_t state;
} sim_socketcan_t;

/// Opens the interface. `loop` and `world` are used until sim_socketcan_close. Returns false, with cause and fix, if
/// this build or kernel does not support it. If the interface is absent or down, the simulator waits for it.
bool sim_socketcan_open(sim_socketcan_t *self, const char *interface, const sim_loop_t *loop, sim_world_t *world,
                        sim_reason_t *out_reason);
void sim_socketcan_close(sim_socketcan_t *self);

/// Reopens an interface that was absent, and submits its frames to the simulated bus. Returns true if the state of the
/// interface has changed: see `state`.
bool sim_socketcan_step(sim_socketcan_t *self, iw_time_us_t now_us);

/// Returns the time at which sim_socketcan_step must run even without a frame; IW_NEVER if it need not.
iw_time_us_t sim_socketcan_next_us(const sim_socketcan_t *self);

/// Sends a frame of the simulated bus on the interface, unless it came from the interface.
void sim_socketcan_deliver(sim_socketcan_t *self, const sim_delivery_t *delivery);

/// Returns true if the command sets a fault that only the hub of a local bus supports.
bool sim_socketcan_refuses(const char *command);

#endif
