// SPDX-License-Identifier: MIT
#include "iwheel_sim/world.h"

/// Capacity of a wheel's queue: a wheel never sends more frames at the same instant.
#define WHEEL_QUEUE 6U

void sim_world_init(sim_world_t *self, const sim_pair_config_t *config, iw_time_us_t now_us, uint64_t seed) {
    *self = (sim_world_t){.queue_depth = SIM_QUEUE_DEFAULT};
    sim_pair_init(&self->pair, config, now_us, seed);
    sim_bus_init(&self->bus, now_us);
    sim_bus_open(&self->bus, SIM_PORT_LEFT, WHEEL_QUEUE, false);
    sim_bus_open(&self->bus, SIM_PORT_RIGHT, WHEEL_QUEUE, false);
    sim_bus_open(&self->bus, SIM_PORT_FOREIGN, 2U, true);
    sim_bus_open(&self->bus, SIM_PORT_BABBLE, 2U, false);
    sim_bus_open(&self->bus, SIM_PORT_INJECT, SIM_BUS_QUEUE_MAX, false);
    self->foreign = (sim_foreign_t){IW_NEVER, {300, 1000, 1U}};
    self->babble.due_us = IW_NEVER;
}

uint8_t sim_world_connect(sim_world_t *self) {
    for (uint8_t client = 0U; client < SIM_WORLD_CLIENTS; client++) {
        if (!self->connected[client]) {
            uint8_t const port = (uint8_t)(SIM_PORT_CLIENT + client);
            self->connected[client] = true;
            sim_bus_open(&self->bus, port, self->queue_depth, true);
            return port;
        }
    }
    return SIM_BUS_NONE;
}

void sim_world_disconnect(sim_world_t *self, iw_time_us_t now_us, uint8_t port) {
    self->connected[port - SIM_PORT_CLIENT] = false;
    sim_bus_clear(&self->bus, now_us, port);
}

void sim_world_submit(sim_world_t *self, iw_time_us_t now_us, uint8_t port, const iw_can_frame_t *frame) {
    if (self->bus_off || !sim_bus_submit(&self->bus, now_us, port, frame)) {
        self->dropped += 1U;
    }
}

static void submit_pair(sim_world_t *self, iw_time_us_t now_us) {
    for (unsigned side = 0U; side < IW_SIDES; side++) {
        iw_can_frame_t frame;
        (void)iw_codec_encode_setpoint((iw_side_t)side, &self->foreign.setpoint, IW_DLC_SETPOINT, &frame);
        (void)sim_bus_submit(&self->bus, now_us, SIM_PORT_FOREIGN, &frame);
    }
}

void sim_world_foreign_once(sim_world_t *self, iw_time_us_t now_us) {
    submit_pair(self, now_us);
}

void sim_world_inject(sim_world_t *self, iw_time_us_t now_us, const iw_can_frame_t *frame) {
    (void)sim_bus_submit(&self->bus, now_us, SIM_PORT_INJECT, frame);
}

static iw_time_us_t earlier(iw_time_us_t one_us, iw_time_us_t other_us) {
    return (one_us < other_us) ? one_us : other_us;
}

static iw_time_us_t senders_us(const sim_world_t *self) {
    return earlier(sim_pair_next_us(&self->pair), earlier(self->foreign.due_us, self->babble.due_us));
}

iw_time_us_t sim_world_next_us(const sim_world_t *self) {
    return earlier(senders_us(self), sim_bus_next_us(&self->bus));
}

iw_time_us_t sim_world_wake_us(const sim_world_t *self) {
    iw_time_us_t const due_us = senders_us(self);
    iw_time_us_t const ended_us = (due_us == IW_NEVER) ? IW_NEVER : due_us + SIM_WORLD_FRAME_US;
    return earlier(ended_us, sim_bus_next_us(&self->bus));
}

static void update_ack(sim_world_t *self, iw_time_us_t now_us) {
    sim_bus_acknowledge(&self->bus, now_us, !self->ack_off && sim_pair_acknowledges(&self->pair));
}

static void step_nodes(sim_world_t *self, iw_time_us_t at_us) {
    if (self->foreign.due_us <= at_us) {
        submit_pair(self, at_us);
        self->foreign.due_us += SIM_FOREIGN_PERIOD_US;
    }
    if (self->babble.due_us <= at_us) {
        (void)sim_bus_submit(&self->bus, at_us, SIM_PORT_BABBLE, &self->babble.frame);
        self->babble.due_us += self->babble.period_us;
    }
}

/// Submits the frames that the wheels and other nodes send at this instant to their ports.
static void step_senders(sim_world_t *self, iw_time_us_t at_us) {
    sim_sent_t sent;
    while (sim_pair_step(&self->pair, at_us, &sent)) {
        (void)sim_bus_submit(&self->bus, sent.due_us, (uint8_t)sent.side, &sent.frame);
    }
    step_nodes(self, at_us);
    update_ack(self, at_us);
}

bool sim_world_step(sim_world_t *self, iw_time_us_t now_us, sim_delivery_t *out_delivery) {
    for (;;) {
        iw_time_us_t const at_us = sim_world_next_us(self);
        if (at_us > now_us || at_us == IW_NEVER) {
            return false;
        }
        step_senders(self, at_us);
        if (sim_bus_step(&self->bus, at_us, out_delivery)) {
            sim_pair_receive(&self->pair, at_us, &out_delivery->frame);
            return true;
        }
    }
}

void sim_world_power(sim_world_t *self, iw_time_us_t now_us, bool on) {
    sim_pair_power(&self->pair, now_us, on);
    for (uint8_t port = SIM_PORT_LEFT; !on && port <= SIM_PORT_RIGHT; port++) {
        sim_bus_clear(&self->bus, now_us, port);
    }
    update_ack(self, now_us);
}

void sim_world_reboot(sim_world_t *self, iw_time_us_t now_us, iw_side_t side) {
    sim_pair_reboot(&self->pair, now_us, side);
    sim_bus_clear(&self->bus, now_us, (uint8_t)side);
    update_ack(self, now_us);
}

void sim_world_bus_off(sim_world_t *self, iw_time_us_t now_us, bool bus_off) {
    self->bus_off = bus_off;
    for (uint8_t port = SIM_PORT_CLIENT; bus_off && port < SIM_BUS_PORTS; port++) {
        sim_bus_clear(&self->bus, now_us, port);
    }
}

void sim_world_ack(sim_world_t *self, iw_time_us_t now_us, bool on) {
    self->ack_off = !on;
    update_ack(self, now_us);
}

void sim_world_queue(sim_world_t *self, uint8_t depth) {
    self->queue_depth = depth;
    for (uint8_t port = SIM_PORT_CLIENT; port < SIM_BUS_PORTS; port++) {
        self->bus.port[port].depth = depth;
    }
}

static void heal_wheel(sim_wheel_t *wheel) {
    wheel->muted = false;
    wheel->loss_permille = 0U;
    wheel->force.load_mN = 0;
    wheel->force.forced_raw = SIM_FORCE_AUTO;
    wheel->force.zero_removed = false;
    wheel->motion.runaway_mm_s = 0;
    wheel->motion.blocked = false;
    wheel->motion.freewheels = false;
    wheel->motion.droop_permille = 0U;
    wheel->motion.kerb_permille = 0U;
    wheel->motion.slope_mm_s2 = 0;
    wheel->late_us = 0U;
    wheel->motion.swapped = false;
    sim_wheel_slow(wheel, 1000U);
}

void sim_world_heal(sim_world_t *self, iw_time_us_t now_us) {
    heal_wheel(&self->pair.wheel[IW_LEFT]);
    heal_wheel(&self->pair.wheel[IW_RIGHT]);
    self->pair.pose_reversed = false;
    self->pair.padded = false;
    self->pair.wheel[IW_LEFT].force.unit = IW_FORCE_CN;
    self->pair.wheel[IW_RIGHT].force.unit = IW_FORCE_DN;
    sim_world_power(self, now_us, true);
    self->foreign.due_us = IW_NEVER;
    self->babble.due_us = IW_NEVER;
    sim_bus_stall(&self->bus, now_us, false);
    sim_world_bus_off(self, now_us, false);
    sim_world_queue(self, SIM_QUEUE_DEFAULT);
    sim_world_ack(self, now_us, true);
}
