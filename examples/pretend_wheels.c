// SPDX-License-Identifier: MIT
#include "pretend_wheels.h"

#include "iwheel/codec.h"

#define UM_PER_TURN 1206372 // A wheel of 192 mm radius.

static void put(pretend_wheels_t *self, const iw_can_frame_t *frame) {
    if (self->count < sizeof self->queue / sizeof self->queue[0]) {
        self->queue[self->count++] = *frame;
    }
}

void pretend_wheels_run(pretend_wheels_t *self) {
    for (unsigned side = 0; side < IW_SIDES; side++) {
        const int16_t rpm = (int16_t)(self->speed_mm_s[side] * 60 * 1000 / UM_PER_TURN);
        const iw_codec_wheel_t values = {.speed = {.speed_rpm = rpm}};
        iw_can_frame_t frame;
        if (iw_codec_encode(IW_CODEC_SPEED, (iw_side_t)side, &values, &frame) == IW_OK) {
            put(self, &frame);
        }
    }
}

static void follow(pretend_wheels_t *self, const iw_can_frame_t *frame) {
    iw_can_frame_t echo = *frame;
    iw_codec_wheel_t values[IW_SIDES];
    if (iw_codec_decode(frame, values) == IW_CODEC_SETPOINT) {
        const iw_side_t side = iw_codec_side(frame->id);
        self->speed_mm_s[side] = values[side].setpoint.speed_mm_s;
        if (values[side].setpoint.speed_mm_s > self->fastest_mm_s) {
            self->fastest_mm_s = values[side].setpoint.speed_mm_s;
        }
    }
    echo.kind = IW_CAN_ECHO;
    put(self, &echo);
}

static int send(void *context, const iw_can_frame_t *frames, uint32_t count) {
    pretend_wheels_t *self = (pretend_wheels_t *)context;
    for (uint32_t i = 0; i < count; i++) {
        follow(self, &frames[i]);
    }
    return (int)count;
}

static int receive(void *context, iw_can_frame_t *out_frame) {
    pretend_wheels_t *self = (pretend_wheels_t *)context;
    if (self->count == 0U) {
        return 0;
    }
    *out_frame = self->queue[0];
    self->count--;
    for (unsigned i = 0; i < self->count; i++) {
        self->queue[i] = self->queue[i + 1U];
    }
    return 1;
}

static iw_bus_state_t bus_state(void *context) {
    (void)context;
    return IW_BUS_ACTIVE;
}

static int purge(void *context) {
    (void)context; // Every sent frame is already on the bus.
    return 1;
}

static int estop_pressed(void *context) {
    (void)context;
    return 0;
}

iw_hal_t pretend_wheels_hal(pretend_wheels_t *self) {
    return (iw_hal_t){.send = send,
                      .receive = receive,
                      .bus_state = bus_state,
                      .purge = purge,
                      .estop_pressed = estop_pressed,
                      .context = self};
}
