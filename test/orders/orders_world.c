// SPDX-License-Identifier: MIT
#include "orders_world.h"
#include "../support/message.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#define MS           1000U
#define START_US     (1000U * MS)
#define TELEMETRY_US (40U * MS)
#define STREAM_US    (50U * MS)
#define FRAME_US     120U
#define RESTART_US   100U ///< Faster than any real restart: frames of the dead process are still in flight.
#define RULE_CUT     911U ///< The simpler rule.
#define RULE_FULL    912U ///< The world has no space left.
#define PERIOD_MS    40U
#define SILENT_MS    200U
#define LEASE_MS     200U
#define LEFT_mm_s    400
#define RIGHT_mm_s   300
/// Slopes of the wheels: they follow a command at the first, and coast at the second after a second without a command.
#define FOLLOW_UM_S_PER_MS 4000
#define COAST_UM_S_PER_MS  700
#define UM_S_PER_RPM       20106

static void wake(world_t *self) {
    self->wake_us = self->now_us;
}

// ---- the port ----------------------------------------------------------------------------------------------------

static int32_t speed_of(const iw_can_frame_t *frame) {
    return (int16_t)(frame->data[1] << 8 | frame->data[2]);
}

static bool send_one(world_t *self, const iw_can_frame_t *frame) {
    const bool accepted = self->flights < WORLD_FLIGHT && !self->down;
    self->stats->frames++;
    self->stats->nonzero += (speed_of(frame) != 0) ? 1U : 0U;
    if (self->traces) {
        printf("  %9.3f ms    sends %u (0x%X) %d mm/s\n", (double)self->now_us / 1e3, frame->id, frame->id,
               speed_of(frame));
    }
    if (self->cut && speed_of(frame) != 0) {
        oracle_fail(&self->oracle, self->now_us, RULE_CUT, "motion without a new request after a cut");
    }
    if (accepted) {
        world_flight_t *const flight = &self->flight[self->flights];
        const iw_time_us_t free_us = (self->flights > 0U) ? flight[-1].done_us : self->now_us;
        *flight = (world_flight_t){*frame, self->now_us, free_us + FRAME_US, true};
        self->flights++;
    }
    oracle_sent(&self->oracle, self->now_us, frame, accepted);
    return accepted;
}

static int world_send(void *context, const iw_can_frame_t *frames, uint32_t count) {
    world_t *const self = context;
    uint32_t accepted = 0;
    oracle_call(&self->oracle, self->now_us, frames, count);
    while (accepted < count && send_one(self, &frames[accepted])) {
        accepted++;
    }
    return (int)accepted;
}

static int world_receive(void *context, iw_can_frame_t *out_frame) {
    world_t *const self = context;
    if (self->received == 0U) {
        return 0;
    }
    *out_frame = self->rx[0];
    self->received--;
    memmove(&self->rx[0], &self->rx[1], self->received * sizeof self->rx[0]);
    oracle_received(&self->oracle, self->now_us, out_frame);
    return 1;
}

static iw_bus_state_t world_bus_state(void *context) {
    world_t *const self = context;
    const iw_bus_state_t state = (self->down || self->lost) ? IW_BUS_DOWN : IW_BUS_ACTIVE;
    self->lost = false;
    oracle_bus(&self->oracle, self->now_us, state);
    return state;
}

static int world_purge(void *context) {
    (void)context;
    return 0;
}

static int world_estop(void *context) {
    world_t *const self = context;
    const int result = (self->pressed || self->edge) ? 1 : 0;
    self->edge = false;
    oracle_estop(&self->oracle, self->now_us, result);
    return result;
}

// ---- the gateway -------------------------------------------------------------------------------------------------

static void note_state(world_t *self) {
    static const char *const names[] = {"LISTENING", "ARMED", "STOPPING", "LATCHED"};
    const iw_state_t state = iw_gateway_state(&self->gateway);
    if (state == self->state) {
        return;
    }
    self->stats->armed += (state == IW_STATE_ARMED) ? 1U : 0U;
    self->stats->latched += (state == IW_STATE_LATCHED) ? 1U : 0U;
    self->stats->stops += (state == IW_STATE_STOPPING) ? 1U : 0U;
    self->state = state;
    if (self->traces) {
        printf("  %9.3f ms    %s\n", (double)self->now_us / 1e3, names[state]);
    }
}

static void step_gateway(world_t *self) {
    oracle_step_begin(&self->oracle, self->now_us, self->promised_us);
    self->promised_us = iw_gateway_step(&self->gateway, self->now_us);
    self->wake_us = self->promised_us;
    oracle_step_end(&self->oracle, self->now_us);
    self->stats->steps++;
    note_state(self);
}

static void start_gateway(world_t *self, bool restarted) {
    const iw_hal_t hal = {world_send, world_receive, world_bus_state, world_purge, world_estop, self};
    iw_config_t config;
    iw_config_default(&config);
    config.setpoint_type = 1;
    config.setpoint_type_set = true;
    config.current_role = IW_ROLE_LIMIT;
    config.track_mm = 540;
    config.period_ms = PERIOD_MS;
    config.wheel_silent_ms = SILENT_MS;
    config.lease_ms = LEASE_MS;
    config.invert[IW_RIGHT] = true;
    config.hold = self->hold;
    if (iw_gateway_init(&self->gateway, &config, &hal, self->now_us, restarted) != IW_CONFIG_OK) {
        abort();
    }
    self->oracle.proven = true;
    oracle_start(&self->oracle, &self->gateway, self->now_us, restarted);
    self->promised_us = self->now_us;
    self->state = iw_gateway_state(&self->gateway);
    wake(self);
}

void world_init(world_t *self, world_mode_t mode, bool hold, world_stats_t *stats) {
    memset(self, 0, sizeof *self);
    self->hold = hold;
    self->stats = stats;
    self->mode = mode;
    self->now_us = START_US;
    self->telemetry_us = START_US;
    self->drive_us = IW_NEVER;
    self->client = 1;
    self->cut = true;
    for (size_t side = 0; side < IW_SIDES; side++) {
        self->wheel[side].received_us = IW_NEVER;
        self->wheel[side].moved_us = START_US;
    }
    start_gateway(self, false);
}

// ---- requests ----------------------------------------------------------------------------------------------------

static void trace(const world_t *self, const char *what, int result) {
    if (self->traces) {
        printf("  %9.3f ms    %s: %s\n", (double)self->now_us / 1e3, what, (result == 0) ? "accepted" : "refused");
    }
}

/// Returns when the current drive was sent: a time that depends only on the current time, so every replay is the same.
static iw_time_us_t sent_us(const world_t *self) {
    static const uint32_t ages_us[] = {0, 1 * MS, LEASE_MS * MS / 2U, LEASE_MS * MS - 1U, LEASE_MS * MS, 520 * MS};
    const iw_time_us_t armed_us = self->gateway.permit.armed_us;
    const uint32_t choice = ((uint32_t)(self->now_us / 10U) * 0x9E3779B1U) >> 29;
    if (!self->late) {
        return self->now_us;
    }
    if (choice < sizeof ages_us / sizeof ages_us[0]) {
        return self->now_us - ages_us[choice];
    }
    // The first time that may count, and the last one that must not.
    return (armed_us > START_US && armed_us <= self->now_us) ? armed_us - (choice & 1U) : self->now_us;
}

static bool drive(world_t *self) {
    // The left limit is too low, and both are lower than the maximum.
    const iw_drive_t request = {{LEFT_mm_s, RIGHT_mm_s}, {0, 1200}, true};
    const oracle_asked_t asked = {self->now_us, sent_us(self), self->client};
    const bool aged = asked.sent_us < self->now_us;
    iw_applied_t applied = {0};
    const iw_refusal_t result = iw_gateway_drive(&self->gateway, asked.sent_us, self->client, &request, &applied);
    if (self->traces && aged) {
        printf("  %9.3f ms    sent at %.3f ms\n", (double)self->now_us / 1e3, (double)asked.sent_us / 1e3);
    }
    trace(self, "drive", (int)result);
    oracle_drive(&self->oracle, &asked, &request, result, &applied);
    if (result == IW_REFUSE_NONE) {
        self->stats->drives++;
        self->stats->aged += aged ? 1U : 0U;
        self->cut = self->cut && !(self->arm_after_cut && asked.sent_us >= self->arm_us);
    }
    self->stats->stale += (aged && result == IW_REFUSE_STALE_COMMAND) ? 1U : 0U;
    wake(self);
    return result == IW_REFUSE_NONE;
}

static void command(world_t *self) {
    const bool accepted = drive(self);
    const bool goes_on = self->mode == MODE_BLIND || (self->mode == MODE_STREAM && accepted);
    self->drive_us = goes_on ? self->now_us + STREAM_US : IW_NEVER;
}

static void arm(world_t *self) {
    const iw_refusal_t result = iw_gateway_arm(&self->gateway, self->now_us, self->client, false);
    trace(self, "arm", (int)result);
    oracle_arm(&self->oracle, self->now_us, self->client, false, result);
    if (result == IW_REFUSE_NONE && !self->arm_after_cut) {
        self->arm_after_cut = true;
        self->arm_us = self->now_us;
    }
    wake(self);
}

static void reset(world_t *self) {
    const iw_state_t before = iw_gateway_state(&self->gateway);
    const iw_stop_t stop = self->gateway.permit.stop;
    const iw_refusal_t result = iw_gateway_reset(&self->gateway, self->now_us);
    trace(self, "reset", (int)result);
    oracle_reset(&self->oracle, self->now_us, before, &stop);
    if (before == IW_STATE_LATCHED && result == IW_REFUSE_NONE) {
        self->stats->resets++;
        self->arm_after_cut = false;
    }
    wake(self);
}

/// If the button is already released, this letter is the request that ends a hold.
static void release_hold(world_t *self) {
    const iw_refusal_t result = iw_gateway_release(&self->gateway);
    trace(self, "release of the hold", (int)result);
    oracle_release(&self->oracle, self->now_us, result);
    wake(self);
}

static void cut(world_t *self) {
    self->cut = true;
    self->arm_after_cut = false;
}

static void press(world_t *self, bool pressed) {
    if (pressed != self->pressed) {
        self->pressed = pressed;
        self->edge = true;
        oracle_edge(&self->oracle, self->now_us);
        cut(self);
        wake(self);
    }
}

static void kill_client(world_t *self) {
    const bool matters = self->client == self->oracle.holder || self->client == self->oracle.pending_arm;
    iw_gateway_disconnect(&self->gateway, self->now_us, self->client);
    oracle_stop(&self->oracle, self->now_us, matters);
    self->client++;
    self->drive_us = IW_NEVER;
    wake(self);
}

/// Frames of the killed process are still in transit, and are foreign frames for the new process.
static void restart(world_t *self) {
    const bool idle = !iw_gateway_is_sending(&self->gateway);
    for (uint32_t i = 0; i < self->flights; i++) {
        self->flight[i].own = false;
    }
    self->client++;
    self->drive_us = IW_NEVER;
    self->received = 0;
    self->wake_us = IW_NEVER;
    world_run(self, RESTART_US);
    self->received = 0;
    self->stats->restarts++;
    cut(self);
    start_gateway(self, !idle);
}

static void toggle_bus(world_t *self) {
    self->down = !self->down;
    self->lost = true;
    self->flights = 0;
    self->received = 0;
    cut(self);
    wake(self);
}

void world_do(world_t *self, world_step_t step) {
    if (self->traces) {
        printf("  %9.3f ms  %s\n", (double)self->now_us / 1e3, world_step_name(step));
    }
    switch (step) {
    case STEP_PRESS:
        press(self, true);
        break;
    case STEP_RELEASE:
        if (self->pressed) {
            press(self, false);
        } else {
            release_hold(self);
        }
        break;
    case STEP_RESET:
        reset(self);
        break;
    case STEP_ARM:
        arm(self);
        break;
    case STEP_COMMAND:
        command(self);
        break;
    case STEP_KILL:
        kill_client(self);
        break;
    case STEP_RESTART:
        restart(self);
        break;
    case STEP_BUS:
    default:
        toggle_bus(self);
        break;
    }
    note_state(self);
}

// ---- bus and wheels ----------------------------------------------------------------------------------------------

static void put(world_t *self, const iw_can_frame_t *frame, uint8_t kind) {
    if (self->down) {
        return;
    }
    if (self->received >= WORLD_RX) {
        oracle_fail(&self->oracle, self->now_us, RULE_FULL, "the gateway does not read");
        return;
    }
    self->rx[self->received] = *frame;
    self->rx[self->received++].kind = kind;
    if (self->wake_us != IW_NEVER) {
        wake(self);
    }
}

static void move_wheel(world_wheel_t *wheel, iw_time_us_t now_us) {
    const int64_t span_us = (int64_t)(now_us - wheel->moved_us);
    const bool commanded = wheel->received_us != IW_NEVER && now_us - wheel->received_us < IW_WHEEL_WATCHDOG_US;
    const int64_t pace = (commanded ? FOLLOW_UM_S_PER_MS : COAST_UM_S_PER_MS) * span_us / MS;
    const int64_t way = (commanded ? (int64_t)wheel->commanded_mm_s * 1000 : 0) - wheel->speed_um_s;
    const int64_t capped = (way > pace) ? pace : ((way < -pace) ? -pace : way);
    wheel->speed_um_s += (int32_t)capped;
    wheel->moved_us = now_us;
}

static void land(world_t *self) {
    const world_flight_t flight = self->flight[0];
    world_wheel_t *const wheel = &self->wheel[(flight.frame.id == IW_ID_RIGHT_SETPOINT) ? IW_RIGHT : IW_LEFT];
    self->flights--;
    memmove(&self->flight[0], &self->flight[1], self->flights * sizeof self->flight[0]);
    move_wheel(wheel, self->now_us);
    wheel->commanded_mm_s = speed_of(&flight.frame);
    wheel->received_us = self->now_us;
    if (flight.own) {
        oracle_on_bus(&self->oracle, self->now_us, &flight.frame, flight.handed_us);
    }
    put(self, &flight.frame, flight.own ? IW_CAN_ECHO : IW_CAN_RECEIVED);
}

static void send_telemetry(world_t *self) {
    for (size_t side = 0; side < IW_SIDES; side++) {
        message_t message = {.kind = IW_CODEC_SPEED, .side = (iw_side_t)side};
        iw_can_frame_t frame;
        move_wheel(&self->wheel[side], self->now_us);
        message.as.speed.speed_rpm = (int16_t)(self->wheel[side].speed_um_s / UM_S_PER_RPM);
        (void)message_encode(&message, &frame);
        put(self, &frame, IW_CAN_RECEIVED);
    }
    self->telemetry_us += TELEMETRY_US;
}

static iw_time_us_t sooner(iw_time_us_t a, iw_time_us_t b) {
    return (a < b) ? a : b;
}

void world_run(world_t *self, iw_time_us_t for_us) {
    const iw_time_us_t until_us = self->now_us + for_us;
    while (!world_broken(self)) {
        const iw_time_us_t landed_us = (self->flights > 0U) ? self->flight[0].done_us : IW_NEVER;
        const iw_time_us_t next_us =
            sooner(sooner(landed_us, self->telemetry_us), sooner(self->drive_us, self->wake_us));
        if (next_us > until_us) {
            break;
        }
        self->now_us = (next_us > self->now_us) ? next_us : self->now_us;
        if (landed_us <= self->now_us) {
            land(self);
        } else if (self->telemetry_us <= self->now_us) {
            send_telemetry(self);
        } else if (self->drive_us <= self->now_us) {
            command(self);
        } else {
            step_gateway(self);
        }
    }
    self->now_us = until_us;
}

bool world_broken(const world_t *self) {
    return self->oracle.rule != ORACLE_NO_RULE;
}

const char *world_step_name(unsigned step) {
    static const char *const names[STEP_KINDS] = {"press",   "release", "reset",   "arm",
                                                  "command", "kill",    "restart", "bus"};
    return names[step];
}
