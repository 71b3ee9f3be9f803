// SPDX-License-Identifier: MIT
#include "iwheel_sim/sim_bus.h"

IW_STATIC_ASSERT(SIM_BUS_PORTS < 32U, ports_fit_the_mask);

void sim_bus_init(sim_bus_t *self, iw_time_us_t now_us) {
    *self = (sim_bus_t){.free_us = now_us, .done_us = IW_NEVER, .sending = SIM_BUS_NONE};
}

static void mark_waiting(sim_bus_t *self, uint8_t port) {
    uint32_t const bit = UINT32_C(1) << port;
    self->waiting = (self->port[port].count > 0U) ? (self->waiting | bit) : (self->waiting & ~bit);
}

void sim_bus_open(sim_bus_t *self, uint8_t port, uint8_t depth, bool needs_ack) {
    self->port[port] = (sim_port_t){.depth = depth, .needs_ack = needs_ack};
    mark_waiting(self, port);
}

static void abort_frame(sim_bus_t *self, iw_time_us_t now_us) {
    self->sending = SIM_BUS_NONE;
    if (now_us > self->free_us) {
        self->free_us = now_us;
    }
    self->done_us = IW_NEVER;
}

void sim_bus_clear(sim_bus_t *self, iw_time_us_t now_us, uint8_t port) {
    self->port[port].count = 0U;
    mark_waiting(self, port);
    if (self->sending == port) {
        abort_frame(self, now_us);
    }
}

bool sim_bus_submit(sim_bus_t *self, iw_time_us_t now_us, uint8_t port, const iw_can_frame_t *frame) {
    sim_port_t *const to = &self->port[port];
    if (to->count >= to->depth) {
        to->overflows += 1U;
        return false;
    }
    to->queue[(to->first + to->count) % SIM_BUS_QUEUE_MAX] = (sim_queued_t){*frame, now_us};
    to->count++;
    mark_waiting(self, port);
    return true;
}

static void reopen(sim_bus_t *self, iw_time_us_t now_us) {
    if (now_us > self->free_us) {
        self->free_us = now_us;
    }
}

void sim_bus_acknowledge(sim_bus_t *self, iw_time_us_t now_us, bool acknowledged) {
    if (acknowledged && !self->acknowledged) {
        reopen(self, now_us);
    }
    self->acknowledged = acknowledged;
}

void sim_bus_stall(sim_bus_t *self, iw_time_us_t now_us, bool stalled) {
    if (stalled && self->sending != SIM_BUS_NONE) {
        abort_frame(self, now_us);
    }
    if (!stalled && self->stalled) {
        reopen(self, now_us);
    }
    self->stalled = stalled;
}

uint32_t sim_bus_frame_bits(const iw_can_frame_t *frame) {
    bool const extended = (frame->id & IW_CAN_EXTENDED) != 0U;
    uint32_t const data = ((frame->id & IW_CAN_REMOTE) != 0U) ? 0U : 8U * frame->dlc;
    uint32_t const stuffed = data + (extended ? 54U : 34U);
    return data + (extended ? 67U : 47U) + stuffed / 10U;
}

/// Returns the bits that arbitrate as a number; the lower number wins.
static uint64_t priority(const iw_can_frame_t *frame) {
    uint64_t const remote = (frame->id & IW_CAN_REMOTE) != 0U;
    if ((frame->id & IW_CAN_EXTENDED) == 0U) {
        return ((uint64_t)(frame->id & IW_CAN_ID_MASK) << 21) | (remote << 20);
    }
    uint64_t const id = frame->id & 0x1FFFFFFFU;
    return ((id >> 18) << 21) | (UINT64_C(3) << 19) | ((id & 0x3FFFFU) << 1) | remote;
}

static const sim_queued_t *head(const sim_bus_t *self, uint8_t port) {
    sim_port_t const *const from = &self->port[port];
    if (self->stalled || from->count == 0U || (from->needs_ack && !self->acknowledged)) {
        return NULL;
    }
    return &from->queue[from->first];
}

static iw_time_us_t start_us(const sim_bus_t *self) {
    iw_time_us_t earliest_us = IW_NEVER;
    for (uint8_t port = 0U; (self->waiting >> port) != 0U; port++) {
        sim_queued_t const *const first = head(self, port);
        if (first != NULL && first->submitted_us < earliest_us) {
            earliest_us = first->submitted_us;
        }
    }
    return (earliest_us != IW_NEVER && earliest_us < self->free_us) ? self->free_us : earliest_us;
}

/// Returns the port whose first frame wins, among the frames submitted by `at_us`.
static uint8_t winner_at(const sim_bus_t *self, iw_time_us_t at_us) {
    uint8_t winner = SIM_BUS_NONE;
    uint64_t best = UINT64_MAX;
    for (uint8_t port = 0U; (self->waiting >> port) != 0U; port++) {
        sim_queued_t const *const first = head(self, port);
        if (first != NULL && first->submitted_us <= at_us && priority(&first->frame) < best) {
            best = priority(&first->frame);
            winner = port;
        }
    }
    return winner;
}

static bool begin(sim_bus_t *self, iw_time_us_t now_us) {
    iw_time_us_t const at_us = start_us(self);
    uint8_t const winner = (at_us <= now_us) ? winner_at(self, at_us) : SIM_BUS_NONE;
    if (winner == SIM_BUS_NONE) {
        return false;
    }
    const sim_port_t *const from = &self->port[winner];
    self->sending = winner;
    self->done_us = at_us + sim_bus_frame_bits(&from->queue[from->first].frame);
    return true;
}

static void end(sim_bus_t *self, sim_delivery_t *out_delivery) {
    sim_port_t *const from = &self->port[self->sending];
    *out_delivery = (sim_delivery_t){from->queue[from->first].frame, self->done_us, self->sending};
    self->busy_us += sim_bus_frame_bits(&out_delivery->frame);
    from->first = (uint8_t)((from->first + 1U) % SIM_BUS_QUEUE_MAX);
    from->count--;
    from->sent += 1U;
    mark_waiting(self, self->sending);
}

bool sim_bus_step(sim_bus_t *self, iw_time_us_t now_us, sim_delivery_t *out_delivery) {
    for (;;) {
        if (self->sending == SIM_BUS_NONE && !begin(self, now_us)) {
            return false;
        }
        if (self->done_us > now_us) {
            return false;
        }
        bool const arbitrated = head(self, self->sending) != NULL;
        if (arbitrated) {
            end(self, out_delivery);
        }
        self->free_us = self->done_us;
        self->done_us = IW_NEVER;
        self->sending = SIM_BUS_NONE;
        if (arbitrated) {
            return true;
        }
    }
}

iw_time_us_t sim_bus_next_us(const sim_bus_t *self) {
    return (self->sending != SIM_BUS_NONE) ? self->done_us : start_us(self);
}
