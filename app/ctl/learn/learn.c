// SPDX-License-Identifier: MIT
#include "learn.h"

#include <string.h>

/// A wheel has reached a speed that was commanded for this time.
#define STEADY_US 1000000
/// mm/s of one rpm with a radius of 192 mm, in um/s.
#define UM_S_PER_RPM 20106
/// Slower commands show too little: 1 rpm is 20 mm/s.
#define STEADY_MM_S 100
/// A wheel is at standstill if it turns no faster for this time.
#define REST_RPM 2
#define REST_US  500000
/// Maximum odometry step between two status frames; a larger one is a reboot.
#define TICKS_MAX 10000U
/// Maximum time between speed frames, and between pose frames; a longer time is a gap of the recording.
#define RPM_GAP_US  100000
#define POSE_GAP_US 200000
/// At a lower speed, the resolution of 1 rpm is too coarse.
#define EXACT_RPM 10
/// Tolerated time without speed frames between two status frames.
#define UNCOVERED_US 10000

static const uint32_t ids[LEARN_IDS] = {IW_ID_LEFT_SETPOINT, IW_ID_RIGHT_SETPOINT, IW_ID_LEFT_SPEED,  IW_ID_RIGHT_SPEED,
                                        IW_ID_LEFT_STATUS,   IW_ID_RIGHT_STATUS,   IW_ID_RIGHT_POSE,  IW_ID_LEFT_FORCE,
                                        IW_ID_RIGHT_FORCE,   IW_ID_LEFT_OFFSET,    IW_ID_RIGHT_OFFSET};

static const learn_range_t nothing = {INT32_MAX, INT32_MIN};

static void widen(learn_range_t *range, int32_t value) {
    if (value < range->low) {
        range->low = value;
    }
    if (value > range->high) {
        range->high = value;
    }
}

static int32_t size_of(int32_t value) {
    return (value < 0) ? -value : value;
}

void learn_init(learn_t *self) {
    memset(self, 0, sizeof *self);
    for (size_t i = 0; i < LEARN_IDS; i++) {
        self->known[i] = (learn_id_t){.id = ids[i], .length = nothing, .period = {.last_us = -1}};
    }
    for (size_t side = 0; side < IW_SIDES; side++) {
        learn_setpoint_t *setpoint = &self->setpoint[side];
        learn_wheel_t *wheel = &self->wheel[side];
        setpoint->speed_mm_s = nothing;
        setpoint->current_mA = nothing;
        setpoint->current_at_rest_mA = nothing;
        setpoint->current_forward_mA = nothing;
        setpoint->current_backward_mA = nothing;
        wheel->rpm_us = -1;
        wheel->rest_since_us = -1;
        wheel->offset_dN = nothing;
        wheel->rest_force = nothing;
        wheel->force = nothing;
    }
}

static void note_period(learn_period_t *period, int64_t at_us) {
    const int64_t gap_us = at_us - period->last_us;
    if (period->last_us >= 0 && gap_us >= 0) {
        const int64_t ms = (gap_us + 500) / 1000;
        period->histogram[(ms < (int64_t)LEARN_PERIOD_MAX_MS) ? (size_t)ms : LEARN_PERIOD_MAX_MS]++;
        period->counted++;
        if (gap_us > period->longest_us) {
            period->longest_us = gap_us;
        }
    }
    period->last_us = at_us;
}

uint32_t learn_period_ms(const learn_period_t *period) {
    uint64_t below = 0;
    if (period->counted < 2U) {
        return 0;
    }
    for (uint32_t ms = 0; ms <= LEARN_PERIOD_MAX_MS; ms++) {
        below += period->histogram[ms];
        if (2U * below > period->counted) {
            return ms;
        }
    }
    return LEARN_PERIOD_MAX_MS;
}

/// Returns the index of the id; LEARN_IDS if it is not an id of the wheels.
static size_t index_of(uint32_t id) {
    size_t i = 0;
    while (i < LEARN_IDS && ids[i] != id) {
        i++;
    }
    return i;
}

const learn_id_t *learn_known(const learn_t *self, uint32_t id) {
    const size_t i = index_of(id);
    return (i < LEARN_IDS) ? &self->known[i] : NULL;
}

static learn_id_t *find_other(learn_t *self, const candump_t *frame) {
    for (uint32_t i = 0; i < self->others; i++) {
        if (self->other[i].id == frame->id && self->other[i].extended == frame->extended) {
            return &self->other[i];
        }
    }
    if (self->others == LEARN_OTHERS_MAX) {
        self->more_others++;
        return NULL;
    }
    learn_id_t *other = &self->other[self->others++];
    *other = (learn_id_t){.id = frame->id, .extended = frame->extended, .length = nothing, .period = {.last_us = -1}};
    return other;
}

static void note_id(learn_id_t *id, const candump_t *frame) {
    id->count++;
    widen(&id->length, frame->length);
    note_period(&id->period, frame->time_us);
}

/// Notes the commanded direction and its current.
static void note_direction(learn_setpoint_t *self, const iw_codec_setpoint_t *now) {
    if (now->speed_mm_s == 0) {
        self->at_rest++;
        widen(&self->current_at_rest_mA, now->current_mA);
        return;
    }
    learn_range_t *current = (now->speed_mm_s > 0) ? &self->current_forward_mA : &self->current_backward_mA;
    *((now->speed_mm_s > 0) ? &self->forward : &self->backward) += 1U;
    self->type_moving[now->type]++;
    widen(current, now->current_mA);
}

static bool is_padded(const candump_t *frame) {
    for (size_t i = IW_DLC_SETPOINT; i < frame->length && i < IW_CAN_DATA_MAX; i++) {
        if (frame->data[i] != 0U) {
            return true;
        }
    }
    return false;
}

static void note_setpoint(learn_setpoint_t *self, const candump_t *frame, const iw_codec_setpoint_t *now) {
    const bool first = self->count == 0U;
    const bool same = now->speed_mm_s == self->last.speed_mm_s && now->current_mA == self->last.current_mA;
    const int64_t gap_us = frame->time_us - self->last_us;
    self->count++;
    self->sent += (frame->mark == CANDUMP_SENT) ? 1U : 0U;
    self->type[now->type]++;
    self->changes_of_type += (!first && now->type != self->last.type) ? 1U : 0U;
    self->over_limit += (size_of(now->current_mA) > IW_CURRENT_LIMIT_mA) ? 1U : 0U;
    self->padding += is_padded(frame) ? 1U : 0U;
    widen(&self->speed_mm_s, now->speed_mm_s);
    widen(&self->current_mA, now->current_mA);
    note_direction(self, now);
    if (first || !same || gap_us < 0 || gap_us > (int64_t)IW_WHEEL_WATCHDOG_US) {
        self->steady_since_us = frame->time_us;
    }
    self->last = *now;
    self->last_us = frame->time_us;
}

/// Notes the answer of the wheel to a speed that was commanded for long enough.
static void note_answer(learn_wheel_t *self, const iw_codec_setpoint_t *setpoint, int32_t rpm, int64_t for_us) {
    const int32_t commanded_mm_s = setpoint->speed_mm_s;
    learn_answer_t *answer = (commanded_mm_s > 0) ? &self->forward : &self->backward;
    const bool turns = size_of(rpm) > REST_RPM;
    if (commanded_mm_s == 0 && setpoint->current_mA != 0) {
        self->stood_us += turns ? 0 : for_us;
        self->ran_us += turns ? for_us : 0;
    }
    if (size_of(commanded_mm_s) < STEADY_MM_S) {
        return;
    }
    if (!turns) {
        answer->still_us += for_us;
        return;
    }
    const int64_t commanded_um_s = (int64_t)size_of(commanded_mm_s) * 1000;
    const int64_t off_um_s = commanded_um_s - (int64_t)size_of(rpm) * UM_S_PER_RPM;
    const int64_t slack_um_s = (commanded_um_s / 10 > UM_S_PER_RPM) ? commanded_um_s / 10 : UM_S_PER_RPM;
    answer->with_us += ((commanded_mm_s > 0) == (rpm > 0)) ? for_us : 0;
    answer->against_us += ((commanded_mm_s > 0) == (rpm > 0)) ? 0 : for_us;
    self->steady_us += for_us;
    self->steady_fit_us += (off_um_s <= slack_um_s && off_um_s >= -slack_um_s) ? for_us : 0;
    self->steady_mm_s += size_of(commanded_mm_s);
    self->steady_rpm += size_of(rpm);
}

static void note_speed(learn_wheel_t *self, const learn_setpoint_t *setpoint, int64_t at_us, int32_t rpm) {
    const int64_t gap_us = (self->rpm_us >= 0) ? at_us - self->rpm_us : 0;
    const bool gap = gap_us <= 0 || gap_us >= RPM_GAP_US;
    const bool commanded = setpoint->count > 0U && at_us - setpoint->last_us <= (int64_t)IW_WHEEL_WATCHDOG_US;
    self->speeds++;
    if (commanded && at_us - setpoint->steady_since_us >= STEADY_US) {
        note_answer(self, &setpoint->last, rpm, gap ? 0 : gap_us);
    }
    if (!gap) {
        self->pending_rpm_us += size_of(self->rpm) * gap_us;
        self->pending_us += gap_us;
    }
    self->pending_slow = self->pending_slow || size_of(rpm) < EXACT_RPM || (rpm < 0) != (self->rpm < 0);
    self->rpm = rpm;
    if (size_of(rpm) > REST_RPM) {
        self->rest_since_us = -1;
    } else if (self->rest_since_us < 0 || gap) {
        self->rest_since_us = at_us;
    }
    self->rpm_us = at_us;
}

/// Compares ticks and rpm only between two status frames with speed frames all the time between them.
static void note_ticks(learn_wheel_t *self, int64_t at_us, int32_t ticks) {
    const uint32_t forward = (uint32_t)ticks - (uint32_t)self->last_ticks;
    const uint32_t step = (forward > INT32_MAX) ? 0U - forward : forward;
    const int64_t between_us = at_us - self->last_ticks_us;
    const bool covered = !self->pending_slow && between_us > 0 && self->pending_us + UNCOVERED_US >= between_us;
    if (self->statuses > 0U && covered && step < TICKS_MAX) {
        self->ticks += step;
        self->turned_rpm_us += self->pending_rpm_us;
    }
    self->statuses++;
    self->pending_rpm_us = 0;
    self->pending_us = 0;
    self->pending_slow = size_of(self->rpm) < EXACT_RPM;
    self->last_ticks = ticks;
    self->last_ticks_us = at_us;
}

/// Notes the force. A wheel is at standstill if its speed frames show it, now and for the time REST_US.
static void note_force(learn_wheel_t *self, int64_t at_us, int16_t raw) {
    const bool known = self->rpm_us >= 0 && at_us - self->rpm_us < RPM_GAP_US;
    widen(&self->force, raw);
    self->forces++;
    if (known && self->rest_since_us >= 0 && at_us - self->rest_since_us >= REST_US) {
        self->rest_force_count++;
        self->rest_force_sum += raw;
        widen(&self->rest_force, raw);
    }
}

static uint64_t way(const uint8_t *now, const uint8_t *before, size_t high, size_t low) {
    uint64_t sum = 0;
    for (size_t i = 0; i < IW_DLC_POSE; i += 2U) {
        const uint16_t a = (uint16_t)((unsigned)now[i + high] << 8U | now[i + low]);
        const uint16_t b = (uint16_t)((unsigned)before[i + high] << 8U | before[i + low]);
        const uint16_t step = (uint16_t)(a - b);
        sum += (step > INT16_MAX) ? 65536U - step : step; // The value may wrap.
    }
    return sum;
}

static void note_pose(learn_pose_t *self, int64_t at_us, const uint8_t *data) {
    const int64_t gap_us = at_us - self->last_us;
    if (self->count > 0U && gap_us >= 0 && gap_us <= POSE_GAP_US) {
        const uint64_t big = way(data, self->last, 0, 1);
        self->moves += (big > 0U) ? 1U : 0U;
        self->way_big += big;
        self->way_little += way(data, self->last, 1, 0);
    }
    self->count++;
    self->last_us = at_us;
    memcpy(self->last, data, sizeof self->last);
}

static void note_message(learn_t *self, const candump_t *frame, iw_codec_kind_t kind, const iw_codec_wheel_t *values) {
    const iw_side_t side = iw_codec_side(frame->id);
    learn_wheel_t *wheel = &self->wheel[side];
    learn_setpoint_t *setpoint = &self->setpoint[side];
    switch (kind) {
    case IW_CODEC_SETPOINT:
        note_setpoint(setpoint, frame, &values->setpoint);
        break;
    case IW_CODEC_SPEED:
        note_speed(wheel, setpoint, frame->time_us, values->speed.speed_rpm);
        break;
    case IW_CODEC_STATUS:
        note_ticks(wheel, frame->time_us, values->status.odometry_ticks);
        break;
    case IW_CODEC_POSE:
        note_pose(&self->pose, frame->time_us, frame->data);
        break;
    case IW_CODEC_FORCE:
        note_force(wheel, frame->time_us, values->force.force_raw);
        break;
    case IW_CODEC_OFFSET:
    default:
        wheel->offsets++;
        widen(&wheel->offset_dN, values->offset.offset_dN);
        break;
    }
}

void learn_frame(learn_t *self, const candump_t *frame) {
    iw_codec_wheel_t values[IW_SIDES];
    const iw_can_frame_t core = candump_to_core(frame);
    if (self->frames == 0U) {
        self->first_us = frame->time_us;
    }
    self->backwards += (self->frames > 0U && frame->time_us < self->last_us) ? 1U : 0U;
    self->last_us = frame->time_us;
    self->frames++;
    if (frame->error) {
        self->errors++;
        return;
    }
    const iw_codec_kind_t kind = iw_codec_decode(&core, values);
    const bool ours = kind < IW_CODEC_KINDS;
    const size_t known = (ours || kind == IW_CODEC_BAD_LENGTH) ? index_of(frame->id) : LEARN_IDS;
    learn_id_t *id = (known < LEARN_IDS) ? &self->known[known] : NULL;
    self->strange += (kind == IW_CODEC_BAD_FORMAT) ? 1U : 0U;
    self->too_short += (kind == IW_CODEC_BAD_LENGTH) ? 1U : 0U;
    if (kind == IW_CODEC_UNKNOWN) {
        id = find_other(self, frame);
    }
    if (id != NULL) {
        note_id(id, frame);
    }
    if (ours) {
        note_message(self, frame, kind, &values[iw_codec_side(frame->id)]);
    }
}
