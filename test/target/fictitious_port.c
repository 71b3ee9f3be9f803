// SPDX-License-Identifier: MIT
// Somebody follows docs/porting.md: its files are compiled as they stand there, on a controller with two transmit slots that exists
// nowhere. The time is virtual. Ends with 0 if the wheels are told what was wished, and 1 if they are not within 3 s.
#include "my_port.h"

#include "iwheel/codec.h"

#include <stdlib.h>
#include <string.h>

#define SLOTS     2
#define QUEUE_MAX 64U

static struct {
    iw_can_frame_t slot[SLOTS];
    bool is_full[SLOTS];
    iw_can_frame_t queue[QUEUE_MAX];
    uint32_t first, count;
} my_can;

static iw_time_us_t time_us = 1000;
static iw_time_us_t telemetry_us = 1000;
static int16_t told_mm_s[IW_SIDES];
static uint32_t feeds;

static void put(const iw_can_frame_t *frame) {
    if (my_can.count < QUEUE_MAX) {
        my_can.queue[(my_can.first + my_can.count++) % QUEUE_MAX] = *frame;
    }
}

int my_send(void *context, const iw_can_frame_t *frame) {
    (void)context;
    for (size_t i = 0; i < SLOTS; i++) {
        if (!my_can.is_full[i]) {
            my_can.slot[i] = *frame;
            my_can.is_full[i] = true;
            return 1;
        }
    }
    return 0;
}

int my_receive(void *context, iw_can_frame_t *out_frame) {
    (void)context;
    if (my_can.count == 0U) {
        return 0;
    }
    *out_frame = my_can.queue[my_can.first];
    my_can.first = (my_can.first + 1U) % QUEUE_MAX;
    my_can.count--;
    return 1;
}

iw_bus_state_t my_bus_state(void *context) {
    (void)context;
    return IW_BUS_ACTIVE;
}

int my_purge(void *context) {
    (void)context;
    memset(my_can.is_full, 0, sizeof my_can.is_full);
    return 1;
}

int my_estop_pressed(void *context) {
    (void)context;
    return 0;
}

iw_time_us_t my_time_us(void) {
    return time_us;
}

void my_watchdog_feed(void) {
    feeds++;
}

int32_t my_wish_left(void) {
    return 120;
}

int32_t my_wish_right(void) {
    return -80;
}

bool my_wish_to_arm(void) {
    return true;
}

/// Everything in the slots is sent and acknowledged.
static void send_slots(void) {
    for (size_t i = 0; i < SLOTS; i++) {
        if (my_can.is_full[i]) {
            iw_can_frame_t *const frame = &my_can.slot[i];
            const iw_side_t side = (frame->id == IW_ID_LEFT_SETPOINT) ? IW_LEFT : IW_RIGHT;
            told_mm_s[side] = (int16_t)(((uint32_t)frame->data[1] << 8) | frame->data[2]);
            frame->kind = IW_CAN_ECHO;
            put(frame);
            my_can.is_full[i] = false;
        }
    }
}

/// Both wheels do as told.
static void send_telemetry(void) {
    for (size_t side = 0; side < IW_SIDES; side++) {
        const iw_codec_wheel_t told = {.speed = {.speed_rpm = (int16_t)(told_mm_s[side] / 20)}};
        iw_can_frame_t frame;
        (void)iw_codec_encode(IW_CODEC_SPEED, (iw_side_t)side, &told, &frame);
        put(&frame);
    }
    telemetry_us += 4000U;
}

void my_sleep_until(iw_time_us_t until_us) {
    if (told_mm_s[IW_LEFT] == 120 && told_mm_s[IW_RIGHT] == -80 && feeds > 100U) {
        exit(0);
    }
    if (time_us > 3000000U) {
        exit(1);
    }
    send_slots();
    time_us = (until_us < telemetry_us) ? until_us : telemetry_us;
    if (time_us >= telemetry_us) {
        send_telemetry();
    }
}

int main(void) {
    if (!my_clock_can(40000000U) || my_clock_can(42000000U) || !start(false)) {
        return 2;
    }
    run();
}
