// SPDX-License-Identifier: MIT
#include "fake_bus.h"

#include <string.h>

#define UNKNOWN_ID 0x7FFU

static iw_side_t side_of(const iw_can_frame_t *frame) {
    return (frame->id == IW_ID_LEFT_SETPOINT) ? IW_LEFT : IW_RIGHT;
}

iw_command_t fake_bus_command(const iw_can_frame_t *frame) {
    const iw_command_t command = {(int16_t)(frame->data[1] << 8 | frame->data[2]),
                                  (int16_t)(frame->data[3] << 8 | frame->data[4])};
    return command;
}

void fake_bus_init(fake_bus_t *self, iw_time_us_t now_us) {
    memset(self, 0, sizeof *self);
    self->now_us = now_us;
    self->state = IW_BUS_ACTIVE;
    self->acknowledged = true;
    self->echo_delay_us = 300;
    for (size_t side = 0; side < IW_SIDES; side++) {
        self->send_result[side] = 1;
        self->commanded_us[side] = IW_NEVER;
    }
}

static int send_one(fake_bus_t *self, const iw_can_frame_t *frame) {
    const iw_side_t side = side_of(frame);
    const int result = (self->flights < FAKE_BUS_FLIGHT_MAX) ? self->send_result[side] : 0;
    if (self->listener != NULL) {
        self->listener(self->listener_context, frame, result > 0);
    }
    if (result <= 0) {
        self->refused++;
        return result;
    }
    self->sent++;
    self->last[side] = *frame;
    self->last_us[side] = self->now_us;
    self->unechoed[side]++;
    self->flight[self->flights].frame = *frame;
    self->flight[self->flights].at_us = self->now_us;
    self->flights++;
    return result;
}

static int fake_send(void *context, const iw_can_frame_t *frames, uint32_t count) {
    fake_bus_t *const self = context;
    self->calls++;
    for (uint32_t i = 0; i < count; i++) {
        self->call_frame = i;
        self->call_frames = count;
        const int result = send_one(self, &frames[i]);
        if (result <= 0) {
            return (i > 0U) ? (int)i : result;
        }
    }
    return (int)(count + self->boast);
}

static int fake_receive(void *context, iw_can_frame_t *out_frame) {
    fake_bus_t *const self = context;
    if (self->flood > 0) {
        self->flood--;
        memset(out_frame, 0, sizeof *out_frame);
        out_frame->id = UNKNOWN_ID;
        return 1;
    }
    if (self->rx_count == 0) {
        return 0;
    }
    *out_frame = self->rx[self->rx_first];
    self->rx_first = (self->rx_first + 1U) % FAKE_BUS_RX_MAX;
    self->rx_count--;
    if (out_frame->kind == IW_CAN_ECHO && self->unechoed[side_of(out_frame)] > 0) {
        self->unechoed[side_of(out_frame)]--;
    }
    return 1;
}

/// Reports a loss that has already ended exactly once.
static iw_bus_state_t fake_state(void *context) {
    fake_bus_t *const self = context;
    const iw_bus_state_t reported =
        (self->loss_unreported && self->state >= IW_BUS_PASSIVE) ? IW_BUS_DOWN : self->state;
    self->loss_unreported = false;
    return reported;
}

static void forget_flights(fake_bus_t *self) {
    self->flights = 0;
    self->unechoed[IW_LEFT] = 0;
    self->unechoed[IW_RIGHT] = 0;
}

static int fake_purge(void *context) {
    fake_bus_t *const self = context;
    self->purges++;
    if (self->purge_result > 0) {
        forget_flights(self);
    }
    return self->purge_result;
}

static int fake_estop(void *context) {
    fake_bus_t *const self = context;
    const bool edge = self->estop_edge;
    self->estop_edge = false;
    return (self->estop_level != 0) ? self->estop_level : edge;
}

iw_hal_t fake_bus_hal(fake_bus_t *self) {
    const iw_hal_t hal = {fake_send, fake_receive, fake_state, fake_purge, fake_estop, self};
    return hal;
}

void fake_bus_put(fake_bus_t *self, const iw_can_frame_t *frame) {
    if (self->rx_count == FAKE_BUS_RX_MAX) {
        self->lost++;
        return;
    }
    self->rx[(self->rx_first + self->rx_count) % FAKE_BUS_RX_MAX] = *frame;
    self->rx_count++;
}

void fake_bus_put_empty(fake_bus_t *self, uint32_t id, uint8_t dlc) {
    iw_can_frame_t frame;
    memset(&frame, 0, sizeof frame);
    frame.id = id;
    frame.dlc = dlc;
    fake_bus_put(self, &frame);
}

iw_time_us_t fake_bus_next_us(const fake_bus_t *self) {
    const bool moves = self->flights > 0 && self->acknowledged && self->state >= IW_BUS_PASSIVE;
    if (!moves) {
        return IW_NEVER;
    }
    const bool right = side_of(&self->flight[0].frame) == IW_RIGHT;
    return self->flight[0].at_us + self->echo_delay_us + (right ? FAKE_BUS_FRAME_US : 0U);
}

void fake_bus_advance(fake_bus_t *self, iw_time_us_t now_us) {
    self->now_us = now_us;
    while (fake_bus_next_us(self) <= now_us) {
        iw_can_frame_t echo = self->flight[0].frame;
        self->commanded_mm_s[side_of(&echo)] = fake_bus_command(&echo).speed_mm_s;
        self->commanded_us[side_of(&echo)] = now_us;
        echo.kind = IW_CAN_ECHO;
        fake_bus_put(self, &echo);
        self->flights--;
        memmove(&self->flight[0], &self->flight[1], self->flights * sizeof self->flight[0]);
    }
}

void fake_bus_break(fake_bus_t *self, iw_bus_state_t state) {
    self->state = state;
    self->loss_unreported = true;
    forget_flights(self);
}
