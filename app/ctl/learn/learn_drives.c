// SPDX-License-Identifier: MIT
#include "learn_drives.h"

#include <inttypes.h>
#include <string.h>

/// A wheel without a speed frame for a longer time is not compared, as in the gateway (`wheel_silent_ms`).
#define RECEIVED_US 50000
/// A drive has ended if no speed was commanded for this time. It has also ended without setpoints, because the wheels
/// stop on their own then.
#define ENDED_US ((int64_t)IW_WHEEL_WATCHDOG_US)

void learn_drives_init(learn_drives_t *self, const iw_config_t *config) {
    memset(self, 0, sizeof *self);
    self->config = config;
    iw_diverge_init(&self->pair, config);
    for (size_t side = 0; side < IW_SIDES; side++) {
        self->received_us[side] = self->setpoint_us[side] = -1;
        learn_lag_init(&self->lag[side]);
    }
}

uint32_t learn_drives_printed(const learn_drives_t *self) {
    return (self->count < LEARN_DRIVES_MAX) ? self->count : LEARN_DRIVES_MAX;
}

static learn_drive_t *last_drive(learn_drives_t *self) {
    return &self->drive[learn_drives_printed(self) - ((self->count > LEARN_DRIVES_MAX) ? 0U : 1U)];
}

static bool is_recent(int64_t then_us, int64_t now_us, int64_t span_us) {
    return then_us >= 0 && now_us >= then_us && now_us - then_us <= span_us;
}

static bool has_ended(const learn_drives_t *self, int64_t now_us) {
    const bool values = is_recent(self->setpoint_us[IW_LEFT], now_us, ENDED_US) ||
                        is_recent(self->setpoint_us[IW_RIGHT], now_us, ENDED_US);
    return !values || !is_recent(self->moved_us, now_us, ENDED_US);
}

/// Compares up to `now_us` if both wheels had setpoints and speed frames all the time since the last frame.
static void compare(learn_drives_t *self, int64_t now_us) {
    bool known = true;
    for (size_t side = 0; side < IW_SIDES; side++) {
        known = known && is_recent(self->received_us[side], now_us, RECEIVED_US) &&
                is_recent(self->setpoint_us[side], now_us, ENDED_US);
    }
    if (!known || !self->compared) {
        iw_diverge_restart(&self->pair, (iw_time_us_t)now_us);
        self->compared = known;
        return;
    }
    learn_drive_t *drive = last_drive(self);
    (void)iw_diverge_step(&self->pair, (iw_time_us_t)now_us);
    drive->judged_us += now_us - self->last_us;
    self->judged_us += now_us - self->last_us;
    drive->deviation_mm = (uint32_t)self->pair.largest_um / 1000U;
    if (drive->deviation_mm > self->largest_mm) {
        self->largest_mm = drive->deviation_mm;
    }
}

/// Notes a setpoint. `applied_mm_s` is in the machine's sense of direction, as measured speeds are.
static void note_setpoint(learn_drives_t *self, size_t side, int32_t speed_mm_s, int64_t now_us) {
    self->pair.applied_mm_s[side] = self->config->invert[side] ? -speed_mm_s : speed_mm_s;
    self->setpoint_us[side] = now_us;
    learn_lag_command(&self->lag[side], now_us, speed_mm_s);
    if (speed_mm_s == 0) {
        return;
    }
    if (!self->driving) {
        self->driving = true;
        self->compared = false;
        self->count++;
        *last_drive(self) = (learn_drive_t){.begin_us = now_us};
        iw_diverge_begin(&self->pair, (iw_time_us_t)now_us);
    }
    self->moved_us = now_us;
    last_drive(self)->end_us = now_us;
}

static void note_speed(learn_drives_t *self, size_t side, int32_t rpm, int64_t now_us) {
    const int32_t speed_um_s = rpm * self->pair.um_s_per_rpm;
    learn_lag_receive(&self->lag[side], now_us, speed_um_s / 1e3);
    iw_diverge_receive(&self->pair, side, (self->config->invert[side] ? -speed_um_s : speed_um_s) / 1000);
    self->received_us[side] = now_us;
}

void learn_drives_frame(learn_drives_t *self, const candump_t *frame) {
    iw_codec_wheel_t values[IW_SIDES];
    const iw_can_frame_t core = candump_to_core(frame);
    const iw_codec_kind_t kind = frame->error ? IW_CODEC_UNKNOWN : iw_codec_decode(&core, values);
    if (kind != IW_CODEC_SETPOINT && kind != IW_CODEC_SPEED) {
        return;
    }
    const size_t side = iw_codec_side(frame->id);
    if (self->driving && has_ended(self, frame->time_us)) {
        self->driving = false;
    }
    if (self->driving) {
        compare(self, frame->time_us);
    }
    if (kind == IW_CODEC_SETPOINT) {
        note_setpoint(self, side, values[side].setpoint.speed_mm_s, frame->time_us);
    } else {
        note_speed(self, side, values[side].speed.speed_rpm, frame->time_us);
    }
    self->last_us = frame->time_us;
}

void learn_drives_weigh(const learn_drives_t *self, learn_findings_t *out_findings) {
    const uint32_t limit_mm = self->config->pair_mm;
    if (self->judged_us < LEARN_SHOWN_MIN_US) {
        (void)learn_print(
            out_findings, '?', "pair", LEARN_BOTH,
            "deviation from the path: the recording lacks half a second with setpoints and speed frames of "
            "both wheels");
    } else if (self->largest_mm < limit_mm) {
        (void)learn_print(out_findings, '+', "pair", LEARN_BOTH,
                          "the machine left its path by %" PRIu32 " mm at most; the gateway stops at %" PRIu32
                          " (pair_mm)",
                          self->largest_mm, limit_mm);
    } else {
        (void)learn_print(out_findings, '-', "pair", LEARN_BOTH,
                          "the machine left its path by %" PRIu32 " mm; the gateway stops at %" PRIu32
                          " (pair_mm): was a wheel blocked or slow? is one mounted mirrored (--config)?",
                          self->largest_mm, limit_mm);
    }
    learn_lag_weigh(self->lag, self->config->wheel_lag_ms, out_findings);
}
