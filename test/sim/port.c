// SPDX-License-Identifier: MIT
#include "rig_parts.h"

#include <string.h>

static void push_rx(rig_t *rig, const iw_can_frame_t *frame, uint8_t kind, uint32_t delay_us) {
    const iw_time_us_t at_us = rig->now_us + delay_us;
    if (rig->rx_count >= rig->scenario->rx_depth) {
        return;
    }
    held_t *const last = &rig->rx[(rig->rx_first + rig->rx_count + RIG_RX_MAX - 1U) % RIG_RX_MAX];
    held_t *const slot = &rig->rx[(rig->rx_first + rig->rx_count) % RIG_RX_MAX];
    const iw_time_us_t after_us = (rig->rx_count > 0U) ? last->at_us : 0U;
    slot->frame = *frame;
    slot->frame.kind = kind;
    slot->at_us = (at_us > after_us) ? at_us : after_us;
    rig->rx_count++;
    rig_wake(rig, slot->at_us);
}

static void submit(rig_t *rig, const iw_can_frame_t *frame, iw_time_us_t handed_us) {
    const uint32_t before = rig->world.dropped;
    sim_world_submit(&rig->world, rig->now_us, rig->port, frame);
    if (rig->world.dropped == before && rig->sent_count < RIG_TX_MAX) {
        rig->sent[(rig->sent_first + rig->sent_count++) % RIG_TX_MAX] = handed_us;
    }
}

static int hand(rig_t *rig, const iw_can_frame_t *frame) {
    const bool hold = rig_active(rig, EV_TX_HOLD) || rig->tx_count > 0U;
    if (rig_active(rig, EV_TX_FULL) || (rig_active(rig, EV_TX_RIGHT) && frame->id == IW_ID_RIGHT_SETPOINT)) {
        return 0;
    }
    if (rig->world.bus.port[rig->port].count + rig->tx_count >= rig->world.queue_depth) {
        return 0;
    }
    if (rig->tx_lost > 0U) {
        rig->tx_lost--;
        return 1;
    }
    if (rig->scenario->echo_early) {
        push_rx(rig, frame, IW_CAN_ECHO, 0U);
    }
    if (hold) {
        const iw_time_us_t delay_us = rig_active(rig, EV_TX_HOLD) ? (iw_time_us_t)rig->fault[EV_TX_HOLD].a : 0U;
        const held_t *const last = &rig->tx[(rig->tx_first + rig->tx_count + RIG_TX_MAX - 1U) % RIG_TX_MAX];
        const iw_time_us_t after_us = (rig->tx_count > 0U) ? last->at_us : 0U;
        const iw_time_us_t at_us = rig->now_us + delay_us;
        rig->tx[(rig->tx_first + rig->tx_count++) % RIG_TX_MAX] =
            (held_t){*frame, (at_us > after_us) ? at_us : after_us, rig->now_us};
    } else {
        submit(rig, frame, rig->now_us);
    }
    return 1;
}

static int send_one(rig_t *rig, const iw_can_frame_t *frame) {
    const int result = hand(rig, frame);
    uint64_t bytes = 0;
    for (unsigned i = 0; i < IW_CAN_DATA_MAX; i++) {
        bytes = bytes << 8 | frame->data[i];
    }
    rig_hash(rig, rig->now_us);
    rig_hash(rig, ((uint64_t)frame->id << 8) | (uint64_t)(result > 0));
    rig_hash(rig, bytes);
    rig->result->stats.frames++;
    rig->result->stats.nonzero += (frame->data[1] != 0U || frame->data[2] != 0U) ? 1U : 0U;
    if (rig_traces(rig)) {
        printf("  %11.6f s    sends %u (0x%X) %02X %6d mm/s %5d mA%s\n", (double)rig->now_us / 1e6, frame->id,
               frame->id, frame->data[0], (int16_t)(frame->data[1] << 8 | frame->data[2]),
               (int16_t)(frame->data[3] << 8 | frame->data[4]), (result > 0) ? "" : "   (not accepted)");
    }
    oracle_sent(&rig->oracle, rig->now_us, frame, result > 0);
    return result;
}

static int port_send(void *context, const iw_can_frame_t *frames, uint32_t count) {
    rig_t *const rig = context;
    oracle_call(&rig->oracle, rig->now_us, frames, count);
    for (uint32_t i = 0; i < count; i++) {
        const int result = send_one(rig, &frames[i]);
        if (result <= 0) {
            return (i > 0U) ? (int)i : result;
        }
    }
    return (int)count;
}

static int port_receive(void *context, iw_can_frame_t *out_frame) {
    rig_t *const rig = context;
    if (rig->rx_count == 0U || rig->rx[rig->rx_first].at_us > rig->now_us) {
        return 0;
    }
    *out_frame = rig->rx[rig->rx_first].frame;
    rig->rx_first = (rig->rx_first + 1U) % RIG_RX_MAX;
    rig->rx_count--;
    oracle_received(&rig->oracle, rig->now_us, out_frame);
    return 1;
}

static iw_bus_state_t find_bus_state(rig_t *rig) {
    const bool lost = rig->bus_lost;
    rig->bus_lost = false;
    if (rig_active(rig, EV_BUS_DOWN) || lost) {
        return IW_BUS_DOWN;
    }
    if (rig_active(rig, EV_BUS_OFF)) {
        return IW_BUS_OFF;
    }
    return rig_active(rig, EV_PASSIVE) ? IW_BUS_PASSIVE : IW_BUS_ACTIVE;
}

static iw_bus_state_t port_bus_state(void *context) {
    rig_t *const rig = context;
    const iw_bus_state_t state = find_bus_state(rig);
    oracle_bus(&rig->oracle, rig->now_us, state);
    return state;
}

static void forget_sent(rig_t *rig) {
    sim_bus_clear(&rig->world.bus, rig->now_us, rig->port);
    rig->tx_count = 0;
    rig->sent_count = 0;
}

static int port_purge(void *context) {
    rig_t *const rig = context;
    if (!rig->scenario->can_purge) {
        return 0;
    }
    forget_sent(rig);
    oracle_purged(&rig->oracle);
    return 1;
}

/// The second contact follows the first one after it has not changed for the lag.
static bool lag_behind(rig_t *rig, bool first) {
    if (first != rig->contact_was) {
        rig->contact_was = first;
        rig->contact_us = rig->now_us;
    }
    if (rig->now_us - rig->contact_us >= rig->scenario->contact_lag_us) {
        rig->second_contact = first;
    }
    return rig->second_contact;
}

/// After all faults have ended, the operator presses and releases the button if its contacts still disagree.
static bool press_to_clear(rig_t *rig) {
    const bool healed = rig->now_us >= SCENARIO_START_US + rig->scenario->chaos_us;
    rig->clearing = healed && rig->oracle.quarrel && !rig->clearing;
    return rig->clearing;
}

static int see_both(rig_t *rig, int first) {
    const bool second = lag_behind(rig, first > 0);
    const bool press = press_to_clear(rig);
    const int reading[2] = {(press && first == 0) ? 1 : first, (first < 0) ? -1 : (int)(press || second)};
    const int result = iw_estop_pair_see(&rig->pair, rig->now_us, reading[0], reading[1]);
    oracle_contacts(&rig->oracle, rig->now_us, reading, result);
    return result;
}

static int port_estop(void *context) {
    rig_t *const rig = context;
    const bool pressed = rig_active(rig, EV_ESTOP) || rig->edge;
    const int first = rig_active(rig, EV_ESTOP_GONE) ? -1 : (pressed ? 1 : 0);
    const int result = rig->scenario->two_contacts ? see_both(rig, first) : first;
    rig->edge = false;
    oracle_estop(&rig->oracle, rig->now_us, result);
    return result;
}

iw_hal_t port_hal(rig_t *rig) {
    return (iw_hal_t){port_send, port_receive, port_bus_state, port_purge, port_estop, rig};
}

void port_lose_bus(rig_t *rig) {
    forget_sent(rig);
    rig->rx_count = 0;
    rig->bus_lost = true;
}

/// Frames that the dead process passed to the port are still in the queue; a new process gets its own port.
void port_restart(rig_t *rig) {
    rig->rx_count = 0;
    rig->sent_count = 0;
    rig->tx_count = 0;
    if (rig->world.bus.port[rig->port].count == 0U) {
        sim_world_disconnect(&rig->world, rig->now_us, rig->port);
    }
    rig->port = sim_world_connect(&rig->world);
    for (uint8_t port = SIM_PORT_CLIENT; rig->port == SIM_BUS_NONE && port < SIM_BUS_PORTS; port++) {
        sim_world_disconnect(&rig->world, rig->now_us, port);
    }
    rig->port = (rig->port == SIM_BUS_NONE) ? sim_world_connect(&rig->world) : rig->port;
}

static void deliver_own(rig_t *rig, const sim_delivery_t *delivery) {
    if (rig->sent_count > 0U) {
        const iw_time_us_t handed_us = rig->sent[rig->sent_first];
        rig->sent_first = (rig->sent_first + 1U) % RIG_TX_MAX;
        rig->sent_count--;
        oracle_on_bus(&rig->oracle, rig->now_us, &delivery->frame, handed_us);
    }
}

void port_deliver(rig_t *rig, const sim_delivery_t *delivery) {
    const bool own = delivery->port == rig->port;
    const uint32_t delay_us = rig_active(rig, EV_RX_HOLD) ? (uint32_t)rig->fault[EV_RX_HOLD].a : 0U;
    if (own) {
        deliver_own(rig, delivery);
    }
    if (rig_active(rig, EV_BUS_DOWN) || rig_active(rig, EV_BUS_OFF) || !rig->alive) {
        return;
    }
    if (!own) {
        push_rx(rig, &delivery->frame, IW_CAN_RECEIVED, delay_us);
    } else if (rig->echo_lost > 0U) {
        rig->echo_lost--;
    } else if (!rig->scenario->echo_early) {
        push_rx(rig, &delivery->frame, IW_CAN_ECHO, delay_us);
    }
}

void port_release(rig_t *rig) {
    while (rig->tx_count > 0U && rig->tx[rig->tx_first].at_us <= rig->now_us) {
        const held_t *const held = &rig->tx[rig->tx_first];
        submit(rig, &held->frame, held->handed_us);
        rig->tx_first = (rig->tx_first + 1U) % RIG_TX_MAX;
        rig->tx_count--;
    }
}

iw_time_us_t port_next_us(const rig_t *rig) {
    return (rig->tx_count > 0U) ? rig->tx[rig->tx_first].at_us : IW_NEVER;
}
