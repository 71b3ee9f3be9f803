// SPDX-License-Identifier: MIT
/// The real core and the simulated pair of wheels on one bus, in virtual time, together with the observation of motion.
#ifndef TEST_WORLD_RIG_H
#define TEST_WORLD_RIG_H

#include "fixture.h"
#include "iwheel/gateway.h"
#include "iwheel/observation.h"
#include "iwheel_sim/world.h"

#define WORLD_RX_MAX 256U
#define WORLD_CLIENT ((iw_client_t)1)

typedef struct {
    iw_config_t config;
    sim_world_t world;
    iw_gateway_t gateway;
    iw_observation_t observation;
    iw_time_us_t now_us;
    iw_can_frame_t rx[WORLD_RX_MAX]; ///< Frames received since the last step.
    unsigned rx_count;
    unsigned rx_next;
    uint8_t port;
} world_rig_t;

/// Begins with wheels that boot now (`uptime_us` 0) or have been running that long, and a gateway with the rig's
/// configuration; then runs for a second.
void world_rig_begin(world_rig_t *self, iw_time_us_t uptime_us);

/// Replaces the gateway by another one on the same wheels, as a restart does.
void world_rig_restart(world_rig_t *self);

/// Lets time pass with a step every millisecond.
void world_rig_run(world_rig_t *self, unsigned for_ms);

/// Arms and drives for that long, with a command every 50 ms.
void world_rig_drive(world_rig_t *self, int32_t left_mm_s, int32_t right_mm_s, unsigned for_ms);

#endif
