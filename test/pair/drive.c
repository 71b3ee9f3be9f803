// SPDX-License-Identifier: MIT
#include "drive.h"

#include <string.h>

#define START_US        ((iw_time_us_t)(1000U * S))
#define AGE_US          (200U * (uint64_t)S)
#define DRIVE_PERIOD_US (50U * MS)

static int send_frames(void *context, const iw_can_frame_t *frames, uint32_t count) {
    machine_t *const self = context;
    for (uint32_t i = 0; i < count; i++) {
        if (self->count >= WAITING_MAX) {
            return (int)i;
        }
        iw_can_frame_t *const echo = &self->waiting[(self->first + self->count++) % WAITING_MAX];
        *echo = frames[i];
        echo->kind = IW_CAN_ECHO;
        sim_pair_receive(&self->pair, self->now_us, &frames[i]);
    }
    return (int)count;
}

static int receive_frame(void *context, iw_can_frame_t *out_frame) {
    machine_t *const self = context;
    if (self->count == 0U) {
        return 0;
    }
    *out_frame = self->waiting[self->first];
    self->first = (self->first + 1U) % WAITING_MAX;
    self->count--;
    return 1;
}

static iw_bus_state_t bus_state(void *context) {
    (void)context;
    return IW_BUS_ACTIVE;
}

static int purge(void *context) {
    (void)context;
    return 1;
}

static int estop_pressed(void *context) {
    (void)context;
    return 0;
}

void machine_config(iw_config_t *out_config, uint16_t pair_mm) {
    iw_config_default(out_config);
    out_config->setpoint_type = 1;
    out_config->setpoint_type_set = true;
    out_config->current_role = IW_ROLE_LIMIT;
    out_config->track_mm = 540;
    out_config->pair_mm = (pair_mm != 0U) ? pair_mm : out_config->pair_mm;
}

void machine_init(machine_t *self, const sim_pair_config_t *pair, const iw_config_t *config, uint64_t seed) {
    sim_pair_config_t aged = *pair;
    memset(self, 0, sizeof *self);
    const iw_hal_t hal = {send_frames, receive_frame, bus_state, purge, estop_pressed, self};
    const iw_bus_facts_t facts = {false, true};
    aged.age_us = AGE_US;
    self->now_us = self->wake_us = START_US;
    self->kerb_us = self->drive_us = IW_NEVER;
    sim_pair_init(&self->pair, &aged, START_US, seed);
    (void)iw_gateway_init(&self->gateway, config, &hal, START_US, false);
    iw_gateway_bus_facts(&self->gateway, &facts);
}

static iw_time_us_t sooner(iw_time_us_t a, iw_time_us_t b) {
    return (a < b) ? a : b;
}

static void send_drive(machine_t *self) {
    const iw_drive_t request = {{self->left_mm_s, self->right_mm_s}, {0, 0}, false};
    iw_applied_t applied;
    (void)iw_gateway_drive(&self->gateway, self->now_us, DRIVER, &request, &applied);
    self->drive_us = self->now_us + DRIVE_PERIOD_US;
}

static void step(machine_t *self) {
    sim_sent_t sent;
    bool news = self->wake_us <= self->now_us;
    if (self->kerb_us <= self->now_us) {
        sim_ranges_kerb_ends(&self->pair, self->now_us);
        self->kerb_us = IW_NEVER;
        self->even_us = self->now_us;
    }
    while (sim_pair_step(&self->pair, self->now_us, &sent)) {
        if (self->count < WAITING_MAX) {
            self->waiting[(self->first + self->count++) % WAITING_MAX] = sent.frame;
        }
        news = true;
    }
    if (self->drive_us <= self->now_us) {
        send_drive(self);
        news = true;
    }
    if (news) {
        self->wake_us = iw_gateway_step(&self->gateway, self->now_us);
    }
}

void machine_run(machine_t *self, uint32_t for_ms) {
    const iw_time_us_t until_us = self->now_us + (iw_time_us_t)for_ms * MS;
    while (self->now_us < until_us) {
        const iw_time_us_t outside_us = sooner(sim_pair_next_us(&self->pair), sooner(self->kerb_us, self->drive_us));
        const iw_time_us_t next_us = sooner(outside_us, self->wake_us);
        self->now_us = sooner((next_us > self->now_us) ? next_us : self->now_us, until_us);
        step(self);
    }
}

bool machine_arm(machine_t *self) {
    self->drive_us = IW_NEVER;
    for (uint32_t i = 0; i < 200U && iw_gateway_state(&self->gateway) != IW_STATE_ARMED; i++) {
        (void)iw_gateway_reset(&self->gateway, self->now_us);
        (void)iw_gateway_arm(&self->gateway, self->now_us, DRIVER, false);
        machine_run(self, 50U);
    }
    return iw_gateway_state(&self->gateway) == IW_STATE_ARMED;
}

void machine_command(machine_t *self, int32_t left_mm_s, int32_t right_mm_s) {
    self->left_mm_s = left_mm_s;
    self->right_mm_s = right_mm_s;
    send_drive(self);
}

machine_way_t machine_way(const machine_t *self) {
    machine_way_t way;
    for (size_t side = 0; side < IW_SIDES; side++) {
        sim_motion_t motion = self->pair.wheel[side].motion;
        sim_motion_advance(&motion, self->now_us);
        way.way_nm[side] = motion.position_nm / SIM_FIRMWARE_RADIUS_MM * motion.config.radius_mm;
    }
    return way;
}

int64_t machine_heading_mdeg(const machine_t *self) {
    const machine_way_t way = machine_way(self);
    const int64_t apart_nm = way.way_nm[IW_RIGHT] - way.way_nm[IW_LEFT];
    // 57296 thousandths of a degree are a radian.
    return apart_nm / self->pair.pose.track_mm * 57296 / 1000000;
}
