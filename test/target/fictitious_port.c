// SPDX-License-Identifier: MIT
// Compiles the files of docs/developer/porting.md unchanged, for an invented controller with two transmit slots. The
// time is virtual. The program ends with 0 if the wheels receive the requested speeds, are at standstill after the loop was
// held up while the switch stays on, and drive again when the switch was off and is on again. It ends with 1 if they do
// not receive them in time, and with 3 if they drive again on their own.
#include "my_port.h"

#include "iwheel/codec.h"

#include <stdlib.h>
#include <string.h>

#define SLOTS     2
#define QUEUE_MAX 64U
/// Rounds of telemetry while the loop is held up: 120 ms, which stops the wheels and does not latch.
#define HELD_UP_ROUNDS 30U

static struct {
    iw_can_frame_t slot[SLOTS];
    bool is_full[SLOTS];
    iw_can_frame_t queue[QUEUE_MAX];
    uint32_t first, count;
} my_can;

static iw_time_us_t time_us = 1000;
static iw_time_us_t telemetry_us = 1000;
static int16_t commanded_mm_s[IW_SIDES];
static uint32_t feeds;

static enum { FIRST_DRIVE, HELD_UP, SECOND_DRIVE } phase;
static iw_time_us_t phase_us; // Start of the phase.

static void put(const iw_can_frame_t *frame) {
    if (my_can.count < QUEUE_MAX) {
        my_can.queue[(my_can.first + my_can.count++) % QUEUE_MAX] = *frame;
    }
}

int my_send(void *context, const iw_can_frame_t *frames, uint32_t count) {
    (void)context;
    uint32_t filled = 0;
    for (size_t i = 0; i < SLOTS && filled < count; i++) {
        if (!my_can.is_full[i]) {
            my_can.slot[i] = frames[filled++];
            my_can.is_full[i] = true;
        }
    }
    return (int)filled;
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

int32_t my_speed_left(void) {
    return 120;
}

int32_t my_speed_right(void) {
    return -80;
}

/// The switch: on when both wheels are known, on for another 5 s after the loop was held up, off for half a second, and
/// on again.
bool my_arm_request(void) {
    const iw_time_us_t for_us = time_us - phase_us;
    return (phase == FIRST_DRIVE) ? for_us > 1000000U : (phase == HELD_UP || for_us > 500000U);
}

/// Sends and acknowledges every frame in the slots.
static void send_slots(void) {
    for (size_t i = 0; i < SLOTS; i++) {
        if (my_can.is_full[i]) {
            iw_can_frame_t *const frame = &my_can.slot[i];
            const iw_side_t side = (frame->id == IW_ID_LEFT_SETPOINT) ? IW_LEFT : IW_RIGHT;
            commanded_mm_s[side] = (int16_t)(((uint32_t)frame->data[1] << 8) | frame->data[2]);
            frame->kind = IW_CAN_ECHO;
            put(frame);
            my_can.is_full[i] = false;
        }
    }
}

/// Both wheels follow their commands.
static void send_telemetry(void) {
    for (size_t side = 0; side < IW_SIDES; side++) {
        const iw_codec_wheel_t values = {.speed = {.speed_rpm = (int16_t)(commanded_mm_s[side] / 20)}};
        iw_can_frame_t frame;
        (void)iw_codec_encode(IW_CODEC_SPEED, (iw_side_t)side, &values, &frame);
        put(&frame);
    }
    telemetry_us += 4000U;
}

static bool is_commanded(void) {
    return commanded_mm_s[IW_LEFT] == 120 && commanded_mm_s[IW_RIGHT] == -80;
}

static void enter(int next) {
    phase = next;
    phase_us = time_us;
}

/// Returns true if the loop is to be held up now.
static bool follow_phases(void) {
    const iw_time_us_t for_us = time_us - phase_us;
    if (phase == HELD_UP) {
        if (for_us > 1000000U && (commanded_mm_s[IW_LEFT] != 0 || commanded_mm_s[IW_RIGHT] != 0)) {
            exit(3);
        }
        if (for_us > 5000000U) {
            enter(SECOND_DRIVE);
        }
        return false;
    }
    if (is_commanded() && feeds > 100U) {
        if (phase == SECOND_DRIVE) {
            exit(0);
        }
        enter(HELD_UP);
        return true;
    }
    if (for_us > 5000000U) {
        exit(1);
    }
    return false;
}

void my_sleep_until(iw_time_us_t until_us) {
    send_slots();
    if (follow_phases()) {
        for (uint32_t i = 0; i < HELD_UP_ROUNDS; i++) { // Meanwhile the wheels continue to send.
            send_telemetry();
        }
        time_us = telemetry_us;
        return;
    }
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
