// SPDX-License-Identifier: MIT
/// A gateway that drives two obedient wheels, for a counter of instructions: `bench_prepare` brings it to a steady drive, then
/// `bench_idle` is one step with nothing due, `bench_pair` one in which a pair is due (of a ramp after `bench_faster`), `bench_frame_in` one that receives a speed; `bench_snapshot` takes a snapshot.
#include "iwheel/gateway.h"

#define CLIENT 7U
#define QUEUE  16U

static struct {
    iw_can_frame_t frame[QUEUE];
    uint32_t first;
    uint32_t count;
    uint32_t sent;
} bus;
static iw_gateway_t gateway;
static iw_time_us_t now_us = 1000000;
static int16_t rpm;

static int bus_send(void *context, const iw_can_frame_t *frames, uint32_t count) {
    (void)context;
    for (uint32_t i = 0; i < count; i++) {
        bus.frame[(bus.first + bus.count) % QUEUE] = frames[i];
        bus.frame[(bus.first + bus.count) % QUEUE].kind = IW_CAN_ECHO;
        bus.count++;
        bus.sent++;
    }
    return (int)count;
}

static int bus_receive(void *context, iw_can_frame_t *out_frame) {
    (void)context;
    if (bus.count == 0U) {
        return 0;
    }
    *out_frame = bus.frame[bus.first];
    bus.first = (bus.first + 1U) % QUEUE;
    bus.count--;
    return 1;
}

static iw_bus_state_t bus_state(void *context) {
    (void)context;
    return IW_BUS_ACTIVE;
}

static int nothing(void *context) {
    (void)context;
    return 0;
}

static void wheel_speaks(iw_side_t side) {
    const iw_codec_wheel_t message = {.speed = {.speed_rpm = rpm}};
    iw_can_frame_t *const frame = &bus.frame[(bus.first + bus.count) % QUEUE];
    (void)iw_codec_encode(IW_CODEC_SPEED, side, &message, frame);
    bus.count++;
}

/// Runs one millisecond: every fourth brings both speeds, and the client drives in every fiftieth.
static void run_ms(uint32_t ms, int32_t speed_mm_s) {
    const iw_drive_t drive = {{speed_mm_s, speed_mm_s}, {0, 0}, false};
    iw_applied_t applied;
    for (uint32_t i = 0; i < ms; i++) {
        now_us += IW_US_PER_MS;
        if (i % 4U == 0U) {
            wheel_speaks(IW_LEFT);
            wheel_speaks(IW_RIGHT);
        }
        if (speed_mm_s != 0 && i % 50U == 0U) {
            (void)iw_gateway_drive(&gateway, now_us, CLIENT, &drive, &applied);
        }
        (void)iw_gateway_step(&gateway, now_us);
    }
}

/// Returns true if the wheels are driven steadily and nothing is due.
int bench_prepare(void) {
    const iw_hal_t hal = {
        .send = bus_send, .receive = bus_receive, .bus_state = bus_state, .purge = nothing, .estop_pressed = nothing};
    iw_config_t config;
    iw_config_default(&config);
    config.setpoint_type_set = true;
    config.current_role = IW_ROLE_LIMIT;
    config.track_mm = 540;
    if (iw_gateway_init(&gateway, &config, &hal, now_us, false) != IW_CONFIG_OK) {
        return 0;
    }
    run_ms(1000, 0);
    (void)iw_gateway_arm(&gateway, now_us, CLIENT, false);
    run_ms(20, 0);
    run_ms(60, 20);
    rpm = 1;
    run_ms(200, 20);
    while (bus.count > 0U) { // Echoes.
        now_us++;
        (void)iw_gateway_step(&gateway, now_us);
    }
    return iw_gateway_state(&gateway) == IW_STATE_ARMED && bus.count == 0U;
}

/// Returns 1 if a pair was sent.
int bench_idle(void) {
    const uint32_t sent = bus.sent;
    (void)iw_gateway_step(&gateway, now_us + 1U);
    return bus.sent != sent;
}

int bench_pair(void) {
    const uint32_t sent = bus.sent;
    (void)iw_gateway_step(&gateway, iw_setpoint_next_us(&gateway.setpoint));
    return bus.sent != sent;
}

/// The client commands another speed, so the next pair belongs to a ramp. Returns 1 if the gateway accepts it.
int bench_faster(void) {
    const iw_drive_t drive = {{300, 280}, {0, 0}, false};
    iw_applied_t applied;
    now_us = gateway.setpoint.last_us + 1U;
    (void)iw_gateway_step(&gateway, now_us); // Echoes.
    return iw_gateway_drive(&gateway, now_us, CLIENT, &drive, &applied) == IW_REFUSE_NONE;
}

int bench_frame_in(void) {
    const uint32_t received = gateway.counters.received;
    wheel_speaks(IW_LEFT);
    (void)iw_gateway_step(&gateway, gateway.promised_us - 1U);
    return gateway.counters.received != received;
}

static iw_snapshot_t seen;

/// Reads one snapshot.
void bench_snapshot(void) {
    iw_gateway_snapshot(&gateway, gateway.promised_us, &seen);
}

/// Returns 1 if the snapshot has the expected state.
int bench_seen(void) {
    return seen.state == IW_STATE_ARMED && seen.wheel[IW_LEFT].heard && seen.wheel[IW_RIGHT].heard;
}
