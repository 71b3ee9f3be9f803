// SPDX-License-Identifier: MIT
#include "world_rig.h"

#include "unity.h"

#include <string.h>

static int port_send(void *context, const iw_can_frame_t *frames, uint32_t count) {
    world_rig_t *rig = (world_rig_t *)context;
    for (uint32_t i = 0; i < count; i++) {
        sim_world_submit(&rig->world, rig->now_us, rig->port, &frames[i]);
    }
    return (int)count;
}

static int port_receive(void *context, iw_can_frame_t *out_frame) {
    world_rig_t *rig = (world_rig_t *)context;
    if (rig->rx_next == rig->rx_count) {
        return 0;
    }
    *out_frame = rig->rx[rig->rx_next++];
    return 1;
}

static iw_bus_state_t port_bus_state(void *context) {
    (void)context;
    return IW_BUS_ACTIVE;
}

static int port_nothing(void *context) {
    (void)context;
    return 0;
}

static void step(world_rig_t *rig) {
    sim_delivery_t delivery;
    rig->rx_count = 0;
    rig->rx_next = 0;
    while (sim_world_step(&rig->world, rig->now_us, &delivery)) {
        TEST_ASSERT_LESS_THAN_UINT(WORLD_RX_MAX, rig->rx_count);
        rig->rx[rig->rx_count] = delivery.frame;
        rig->rx[rig->rx_count++].kind = (delivery.port == rig->port) ? IW_CAN_ECHO : IW_CAN_RECEIVED;
    }
    (void)iw_gateway_step(&rig->gateway, rig->now_us);
    iw_snapshot_t seen;
    iw_gateway_snapshot(&rig->gateway, rig->now_us, &seen);
    iw_observation_step(&rig->observation, &rig->gateway, &seen);
}

void world_rig_run(world_rig_t *self, unsigned for_ms) {
    for (unsigned ms = 0; ms < for_ms; ms++) {
        self->now_us += 1000U;
        step(self);
    }
}

void world_rig_restart(world_rig_t *self) {
    const iw_hal_t hal = {.send = port_send,
                          .receive = port_receive,
                          .bus_state = port_bus_state,
                          .purge = port_nothing,
                          .estop_pressed = port_nothing,
                          .context = self};
    memset(&self->observation, FIXTURE_POISON, sizeof self->observation);
    iw_observation_init(&self->observation);
    TEST_ASSERT_EQUAL_INT(IW_CONFIG_OK, iw_gateway_init(&self->gateway, &self->config, &hal, self->now_us, false));
}

void world_rig_begin(world_rig_t *self, iw_time_us_t uptime_us) {
    sim_pair_config_t pair;
    sim_pair_default(&pair);
    pair.age_us = uptime_us;
    self->now_us = FIXTURE_START_US;
    sim_world_init(&self->world, &pair, self->now_us, 1);
    self->port = sim_world_connect(&self->world);
    world_rig_restart(self);
    world_rig_run(self, 1000);
}

void world_rig_drive(world_rig_t *self, int32_t left_mm_s, int32_t right_mm_s, unsigned for_ms) {
    const iw_drive_t wanted = {.speed_mm_s = {left_mm_s, right_mm_s}};
    iw_applied_t applied;
    TEST_ASSERT_EQUAL_INT(IW_REFUSE_NONE, iw_gateway_arm(&self->gateway, self->now_us, WORLD_CLIENT, false));
    world_rig_run(self, 10);
    for (unsigned ms = 0; ms < for_ms; ms += 50U) {
        (void)iw_gateway_drive(&self->gateway, self->now_us, WORLD_CLIENT, &wanted, &applied);
        world_rig_run(self, 50);
    }
}
