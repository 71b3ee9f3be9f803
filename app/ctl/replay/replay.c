// SPDX-License-Identifier: MIT
#include "replay.h"

#include "iwheel/codec.h"

#include <string.h>

// Period of the simulated wheels for a replay that begins within a recording.
#define PERIOD_US 4000U
/// Time for the first frames, and until arming is proven.
#define SLACK_US 500000U
/// Delay of arm after rest_ms at standstill.
#define ARM_LATER_US 32000U

static int side_of(const iw_can_frame_t *frame) {
    return (frame->id == IW_ID_LEFT_SETPOINT) ? IW_LEFT : (frame->id == IW_ID_RIGHT_SETPOINT) ? IW_RIGHT : -1;
}

/// Returns the next recorded answer of that kind; `otherwise` if there is none.
static int take_answer(replay_t *self, blackbox_kind_t kind, uint32_t number, int otherwise) {
    if (self->answered < self->answers) {
        const blackbox_entry_t *answer = &self->answer[self->answered];
        if (answer->kind == (uint8_t)kind && answer->number == number) {
            self->answered++;
            return (int)answer->as.value;
        }
    }
    return otherwise;
}

static int send_one(replay_t *self, const iw_can_frame_t *frame) {
    const int answer = take_answer(self, BLACKBOX_NOT_SENT, frame->id, 1);
    const int side = side_of(frame);
    if (answer <= 0 || side < 0) {
        return answer;
    }
    self->total_sent++;
    if (self->sent_count[side] == REPLAY_SENT) { // The oldest will have no echo.
        memmove(&self->sent[side][0], &self->sent[side][1], sizeof self->sent[side] - sizeof self->sent[side][0]);
        self->sent_count[side]--;
    }
    self->sent[side][self->sent_count[side]++] = *frame;
    return answer;
}

/// Sends as the recorded port did: from the first frame on, up to the one that the port refused.
static int port_send(void *context, const iw_can_frame_t *frames, uint32_t count) {
    replay_t *self = (replay_t *)context;
    for (uint32_t i = 0; i < count; i++) {
        const int answer = send_one(self, &frames[i]);
        if (answer <= 0) {
            return (i > 0U) ? (int)i : answer;
        }
    }
    return (int)count;
}

/// Compares a recorded echo with the setpoint that the core sent.
static void compare_echo(replay_t *self, const iw_can_frame_t *frame) {
    const int side = side_of(frame);
    if (side < 0 || frame->kind != (uint8_t)IW_CAN_ECHO || !self->compares) {
        return;
    }
    const iw_can_frame_t *sent = &self->sent[side][0];
    const bool same = self->sent_count[side] > 0U && sent->dlc == frame->dlc &&
                      memcmp(sent->data, frame->data, sizeof frame->data) == 0;
    self->setpoints.same += same ? 1U : 0U;
    self->setpoints.different += same ? 0U : 1U;
    if (self->sent_count[side] > 0U) {
        self->sent_count[side]--;
        memmove(&self->sent[side][0], &self->sent[side][1], self->sent_count[side] * sizeof self->sent[side][0]);
    }
}

static int port_receive(void *context, iw_can_frame_t *out_frame) {
    replay_t *self = (replay_t *)context;
    if (self->received == self->frames) {
        return 0;
    }
    *out_frame = self->frame[self->received++];
    compare_echo(self, out_frame);
    replay_samples_frame(self, out_frame);
    return 1;
}

static iw_bus_state_t port_bus_state(void *context) {
    return ((const replay_t *)context)->bus;
}

static int port_purge(void *context) {
    return take_answer((replay_t *)context, BLACKBOX_PURGE, 0, 0);
}

static int port_estop(void *context) {
    return ((const replay_t *)context)->estop;
}

iw_snapshot_t replay_snapshot(const replay_t *self) {
    iw_snapshot_t seen;
    iw_gateway_snapshot(&self->gateway, self->now_us, &seen);
    return seen;
}

static void begin_core(replay_t *self, const iw_config_t *config, iw_time_us_t at_us, bool restarted) {
    const iw_hal_t hal = {.send = port_send,
                          .receive = port_receive,
                          .bus_state = port_bus_state,
                          .purge = port_purge,
                          .estop_pressed = port_estop,
                          .context = self};
    (void)iw_gateway_init(&self->gateway, config, &hal, at_us, restarted);
    self->now_us = at_us;
    self->next_us = at_us;
    const iw_snapshot_t seen = replay_snapshot(self);
    self->state = seen.state;
    memcpy(self->assumptions, seen.assumed, sizeof self->assumptions);
    for (size_t side = 0; side < IW_SIDES; side++) {
        self->force[side] = iw_snapshot_force_validity(&seen, (iw_side_t)side);
    }
}

void replay_init(replay_t *self, const iw_config_t *config, iw_time_us_t at_us, replay_out_t out) {
    memset(self, 0, sizeof *self);
    self->out = out;
    self->zero_us = at_us;
    self->bus = IW_BUS_ACTIVE;
    self->estop_name = "line";
    self->bus_name = "";
    begin_core(self, config, at_us, false);
}

void replay_start(replay_t *self, const iw_config_t *config, const blackbox_entry_t *entry) {
    iw_config_t begun = *config;
    begun.listen_only = entry->b != 0U;
    begin_core(self, &begun, entry->at_us, entry->a != 0U);
}

bool replay_frame(replay_t *self, const iw_can_frame_t *frame) {
    if (self->frames == IW_GATEWAY_DRAIN_MAX) {
        return false;
    }
    self->frame[self->frames++] = *frame;
    self->total_frames++;
    return true;
}

/// Acknowledges immediately where the recording has no echoes.
static void echo_what_was_sent(replay_t *self) {
    for (size_t side = 0; side < IW_SIDES; side++) {
        for (uint32_t i = 0; i < self->sent_count[side] && self->frames < IW_GATEWAY_DRAIN_MAX; i++) {
            self->frame[self->frames] = self->sent[side][i];
            self->frame[self->frames++].kind = IW_CAN_ECHO;
        }
        self->sent_count[side] = 0;
    }
}

void replay_step(replay_t *self, iw_time_us_t at_us) {
    if (at_us > self->now_us) {
        self->now_us = at_us;
    }
    self->next_us = iw_gateway_step(&self->gateway, self->now_us);
    self->frames = 0;
    self->received = 0;
    self->answers = 0;
    self->answered = 0;
    if (self->echoes) {
        echo_what_was_sent(self);
    }
    replay_report_step(self);
    replay_samples_step(self);
}

static void count(replay_score_t *score, bool same) {
    score->same += same ? 1U : 0U;
    score->different += same ? 0U : 1U;
}

static void request(replay_t *self, const blackbox_entry_t *entry, iw_refusal_t refusal) {
    count(&self->requests, (uint8_t)refusal == entry->b);
    replay_report_request(self, entry, refusal);
}

static iw_refusal_t drive(replay_t *self, const blackbox_entry_t *entry) {
    const blackbox_drive_t *recorded = &entry->as.drive;
    iw_drive_t wanted = {.has_current = entry->a != 0U};
    iw_applied_t applied;
    for (size_t side = 0; side < IW_SIDES; side++) {
        wanted.speed_mm_s[side] = recorded->speed_mm_s[side];
        wanted.current_mA[side] = recorded->current_mA[side];
    }
    const iw_time_us_t sent_us = (entry->at_us > recorded->age_us) ? entry->at_us - recorded->age_us : 0U;
    return iw_gateway_drive(&self->gateway, sent_us, entry->number, &wanted, &applied);
}

static void tare(replay_t *self, const blackbox_entry_t *entry) {
    const uint8_t sides = (entry->a == (uint8_t)IW_RIGHT) ? IW_SIDES_RIGHT : IW_SIDES_LEFT;
    iw_side_t refused;
    (void)iw_gateway_tare(&self->gateway, entry->at_us, sides, &refused);
}

/// Compares a recorded decision with the present one.
static void compare(replay_t *self, const blackbox_entry_t *entry) {
    const iw_stop_t *stop = replay_snapshot(self).stop;
    const bool is_state = entry->kind == (uint8_t)BLACKBOX_STATE;
    const bool same = is_state ? (uint8_t)iw_gateway_state(&self->gateway) == entry->a
                               : (uint8_t)stop->cause == entry->a && stop->sides == entry->b &&
                                     (int64_t)stop->detail == entry->as.value;
    if (is_state && entry->a == entry->b && same) {
        return; // The state is only recorded again.
    }
    count(is_state ? &self->states : &self->stops, same);
    if (!same) {
        replay_report_difference(self, entry);
    }
}

static void answer(replay_t *self, const blackbox_entry_t *entry) {
    const iw_bus_facts_t facts = {.timing_contradicted = entry->a != 0U, .echo_proven = entry->b != 0U};
    switch (entry->kind) {
    case BLACKBOX_ESTOP:
        replay_report_answer(self, entry);
        self->estop = (int)entry->as.value;
        break;
    case BLACKBOX_BUS:
        replay_report_answer(self, entry);
        self->bus = (iw_bus_state_t)entry->a;
        break;
    case BLACKBOX_FACTS:
        iw_gateway_bus_facts(&self->gateway, &facts);
        break;
    case BLACKBOX_SUSPENDED:
        iw_gateway_suspended(&self->gateway, (entry->as.value > 0) ? (iw_time_us_t)entry->as.value : 0U);
        replay_report_answer(self, entry);
        break;
    default:
        if (self->answers < REPLAY_ANSWERS) {
            self->answer[self->answers++] = *entry;
        }
        break;
    }
}

static void know(replay_t *self, const blackbox_entry_t *entry) {
    const iw_assumption_entry_t known = {(iw_assumption_state_t)entry->b, (iw_source_t)entry->number,
                                         (int32_t)entry->as.value};
    iw_gateway_set_assumption(&self->gateway, (iw_assumption_item_t)entry->a,
                              &known); // The next step reports the changes.
}

void replay_event(replay_t *self, const blackbox_entry_t *entry) {
    iw_gateway_t *gateway = &self->gateway;
    switch (entry->kind) {
    case BLACKBOX_ARM:
        request(self, entry, iw_gateway_arm(gateway, entry->at_us, entry->number, entry->a != 0U));
        break;
    case BLACKBOX_DRIVE:
        request(self, entry, drive(self, entry));
        break;
    case BLACKBOX_RESET:
        request(self, entry, iw_gateway_reset(gateway, entry->at_us));
        break;
    case BLACKBOX_RELEASE:
        request(self, entry, iw_gateway_release(gateway));
        break;
    case BLACKBOX_STOP:
        replay_report_request(self, entry, IW_REFUSE_NONE);
        iw_gateway_stop(gateway, entry->at_us, entry->number, (iw_cause_t)entry->a);
        break;
    case BLACKBOX_ESTOPPED:
        replay_report_request(self, entry, IW_REFUSE_NONE);
        iw_gateway_estop(gateway, entry->at_us, entry->number);
        break;
    case BLACKBOX_GONE:
        iw_gateway_disconnect(gateway, entry->at_us, entry->number);
        break;
    case BLACKBOX_TARE:
        tare(self, entry);
        replay_report_request(self, entry, IW_REFUSE_NONE);
        break;
    case BLACKBOX_ASSUMPTION:
        know(self, entry);
        break;
    case BLACKBOX_STATE:
    case BLACKBOX_STOPPED:
        compare(self, entry);
        break;
    default:
        answer(self, entry);
        break;
    }
}

/// Returns the rpm of a wheel that follows the setpoint.
static int16_t obedient_rpm(const replay_t *self, size_t side, const iw_can_frame_t *setpoint) {
    iw_codec_wheel_t values[IW_SIDES];
    if (setpoint == NULL || iw_codec_decode(setpoint, values) != IW_CODEC_SETPOINT) {
        return 0;
    }
    return (int16_t)(values[side].setpoint.speed_mm_s * 1000 / (int32_t)replay_snapshot(self).wheel[side].um_s_per_rpm);
}

/// Runs a cycle of the simulated bus: both wheels show the speed of their last setpoint.
static void turn_wheels(replay_t *self, iw_time_us_t at_us, iw_can_frame_t last[IW_SIDES]) {
    for (uint32_t i = 0; i < self->frames; i++) { // Echoes of the last step.
        last[iw_codec_side(self->frame[i].id)] = self->frame[i];
    }
    for (size_t side = 0; side < IW_SIDES; side++) {
        iw_can_frame_t frame;
        const iw_codec_wheel_t values = {
            .speed = {.speed_rpm = obedient_rpm(self, side, (last[side].id != 0U) ? &last[side] : NULL)}};
        if (iw_codec_encode(IW_CODEC_SPEED, (iw_side_t)side, &values, &frame) == IW_OK) {
            (void)replay_frame(self, &frame);
        }
    }
    replay_step(self, at_us);
}

static iw_time_us_t ramp_us(const iw_config_t *config, const blackbox_drive_t *drive) {
    int64_t fastest = 0;
    for (size_t side = 0; side < IW_SIDES; side++) {
        const int64_t speed =
            (drive->speed_mm_s[side] < 0) ? -(int64_t)drive->speed_mm_s[side] : drive->speed_mm_s[side];
        if (speed > fastest) {
            fastest = speed;
        }
    }
    const int64_t commanded = (fastest > config->max_speed_mm_s) ? config->max_speed_mm_s : fastest;
    return (iw_time_us_t)commanded * 1000000U / config->accel_mm_s2;
}

static void continue_driving(replay_t *self, const blackbox_entry_t *state, iw_time_us_t at_us) {
    const iw_config_t *config = replay_snapshot(self).config;
    iw_drive_t wanted = {.has_current = config->current_role == IW_ROLE_SETPOINT};
    iw_applied_t applied;
    for (size_t side = 0; side < IW_SIDES; side++) {
        wanted.speed_mm_s[side] = state->as.drive.speed_mm_s[side];
        wanted.current_mA[side] = wanted.has_current ? (int32_t)config->max_current_mA : 0;
    }
    (void)iw_gateway_drive(&self->gateway, at_us, state->number, &wanted, &applied);
}

/// Arms for the recorded holder, and drives up to the time of `state`, so that the ramp is complete.
static void drive_up(replay_t *self, const blackbox_entry_t *state, iw_time_us_t from_us) {
    iw_can_frame_t last[IW_SIDES] = {0};
    const iw_time_us_t rest_us = (iw_time_us_t)replay_snapshot(self).config->rest_ms * IW_US_PER_MS;
    const bool moves = state->a != (uint8_t)IW_STATE_LISTENING;
    bool asked = false;
    for (iw_time_us_t at_us = from_us; at_us < state->at_us; at_us += PERIOD_US) {
        turn_wheels(self, at_us, last);
        if (moves && !asked && at_us - from_us > rest_us + ARM_LATER_US) {
            asked = true;
            (void)iw_gateway_arm(&self->gateway, at_us, state->number, false);
        }
        if (iw_gateway_state(&self->gateway) == IW_STATE_ARMED) {
            continue_driving(self, state, at_us);
        }
    }
}

bool replay_warm(replay_t *self, const iw_config_t *config, const blackbox_entry_t *state) {
    const int estop = self->estop;
    const iw_bus_state_t bus = self->bus;
    const iw_time_us_t needed_us =
        (iw_time_us_t)config->rest_ms * IW_US_PER_MS + ramp_us(config, &state->as.drive) + SLACK_US;
    const iw_time_us_t from_us = (state->at_us > needed_us) ? state->at_us - needed_us : 0U;
    const char *names[] = {self->estop_name, self->bus_name};
    replay_init(self, config, from_us, self->out);
    self->estop_name = names[0];
    self->bus_name = names[1];
    self->quiet = true;
    self->echoes = true;
    drive_up(self, state, from_us);
    if (state->a == (uint8_t)IW_STATE_STOPPING) {
        iw_gateway_stop(&self->gateway, state->at_us, state->number, IW_CAUSE_CLIENT_STOP);
    } else if (state->a == (uint8_t)IW_STATE_LATCHED) {
        iw_gateway_estop(&self->gateway, state->at_us, state->number);
    }
    self->estop = estop;
    self->bus = bus;
    self->echoes = false;
    replay_step(self, state->at_us);
    self->quiet = false;
    self->zero_us = state->at_us;
    self->total_frames = 0;
    self->total_sent = 0;
    self->sent_count[IW_LEFT] = 0;
    self->sent_count[IW_RIGHT] = 0;
    self->compares = true;
    return (uint8_t)iw_gateway_state(&self->gateway) == state->a;
}
