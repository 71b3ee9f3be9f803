// SPDX-License-Identifier: MIT
#include "iwheel/private/wheel.h"

#include "arithmetic.h"

#include <string.h>

/// 2 pi / 60 in millionths: nanometres of circumference per tick (or of speed per rpm) and millimetre of radius.
#define NM_PER_TICK_AND_MM 104720U
#define FASTEST_NM_PER_US  (IW_WHEEL_FASTEST_MM_S)

/// mm/s are nm/us.
IW_STATIC_ASSERT(FASTEST_NM_PER_US == 10000U, one_mm_per_s_is_one_nm_per_us);
IW_STATIC_ASSERT(IW_WHEEL_OFFSET_BACK_US > IW_WHEEL_OFFSET_LEARN_US + 2U * IW_WHEEL_OFFSET_PERIOD_US,
                 a_start_is_no_reboot);
IW_STATIC_ASSERT(IW_WHEEL_OFFSET_BACK_US >= 5U * IW_WHEEL_OFFSET_PERIOD_US, four_frames_may_be_lost);

static uint32_t silent_us(const iw_wheel_t *self) {
    return (uint32_t)self->config->wheel_silent_ms * IW_US_PER_MS;
}

void iw_wheel_init(iw_wheel_t *self, const iw_config_t *config, iw_side_t side, iw_time_us_t now_us) {
    const uint32_t nm_per_rpm = NM_PER_TICK_AND_MM * config->radius_mm;
    memset(self, 0, sizeof *self);
    self->config = config;
    self->side = side;
    self->first_us = IW_NEVER;
    self->received_us = IW_NEVER;
    self->speed_us = IW_NEVER;
    self->status_us = IW_NEVER;
    self->rest_since_us = IW_NEVER;
    self->any_us = now_us;
    const uint32_t nm_per_tick = nm_per_rpm / config->gear_turns * config->gear_per +
                                 nm_per_rpm % config->gear_turns * config->gear_per / config->gear_turns;
    self->nm_per_tick = config->invert[side] ? -(int32_t)nm_per_tick : (int32_t)nm_per_tick;
    self->um_s_per_rpm = (config->rpm_of_rotor ? nm_per_tick : nm_per_rpm) / 1000U;
    self->us_per_tick_min = nm_per_tick / FASTEST_NM_PER_US;
}

/// Resets `status_us` because the wheel's odometry restarts: the next status message is a start, not a step.
static IW_APART void rebooted(iw_wheel_t *self, iw_reboot_t source, iw_time_us_t now_us) {
    self->pending_reboot = source;
    self->reboots++;
    self->offset_us = now_us;
    self->boot_seen = true;
    self->status_us = IW_NEVER;
}

/// Handles any frame: detects a wheel that has sent nothing for so long that it may have had no power.
static void note_presence(iw_wheel_t *self, iw_time_us_t now_us) {
    const bool was_away = iw_age_us(self->any_us, now_us) >= IW_WHEEL_REBOOT_SILENCE_US;
    self->any_us = now_us;
    if (self->first_us == IW_NEVER) {
        self->first_us = now_us;
        self->offset_us = now_us;
        self->boot_seen = was_away;
    } else if (was_away) {
        rebooted(self, IW_REBOOT_SILENCE, now_us);
    }
}

/// Standstill needs a run of messages without a gap: one message after a gap does not show that the wheel did not move
/// in between.
static void receive_speed(iw_wheel_t *self, iw_time_us_t now_us, const iw_codec_speed_t *speed, bool fresh) {
    const int32_t rest_rpm = self->config->rest_rpm;
    const int32_t speed_um_s = speed->speed_rpm * (int32_t)self->um_s_per_rpm;
    const bool gap = !iw_wheel_online(self, now_us);
    self->speed_mm_s = (self->config->invert[self->side] ? -speed_um_s : speed_um_s) / 1000;
    self->speed_us = now_us;
    if (iw_abs(speed->speed_rpm) > rest_rpm) {
        self->rest_since_us = IW_NEVER;
    } else if (fresh && (gap || self->rest_since_us == IW_NEVER)) {
        self->rest_since_us = now_us;
    }
    if (fresh) {
        self->received_us = now_us;
        self->received_until_us = now_us + silent_us(self);
    }
}

/// Returns true if no wheel can turn so far in that time. `delta` is modulo 2^32, because odometry wraps; the shorter
/// direction counts.
static bool tick_jump(const iw_wheel_t *self, uint32_t delta, uint32_t elapsed_us) {
    const uint32_t limit = elapsed_us / self->us_per_tick_min;
    const uint32_t moved = (delta > INT32_MAX) ? 0U - delta : delta;
    return moved > IW_WHEEL_TICK_SLACK && moved - IW_WHEEL_TICK_SLACK > limit;
}

static void receive_status(iw_wheel_t *self, iw_time_us_t now_us, const iw_codec_status_t *status) {
    if (self->status_us != IW_NEVER) {
        const uint32_t delta = (uint32_t)status->odometry_ticks - (uint32_t)self->odometry_ticks;
        if (tick_jump(self, delta, iw_age_us(self->status_us, now_us))) {
            rebooted(self, IW_REBOOT_ODOMETRY, now_us);
        } else if (self->ticks >= -IW_WHEEL_TICKS_MAX && self->ticks <= IW_WHEEL_TICKS_MAX) {
            self->ticks += (int32_t)delta;
        }
    }
    self->odometry_ticks = status->odometry_ticks;
    self->status_us = now_us;
}

/// Judged after a stall of the gateway too: for a wheel that rebooted in the meantime there is no other sign.
static void receive_offset(iw_wheel_t *self, iw_time_us_t now_us) {
    if (iw_age_us(self->offset_us, now_us) >= IW_WHEEL_OFFSET_BACK_US) {
        rebooted(self, IW_REBOOT_OFFSET_FRAMES, now_us);
    }
    self->offset_us = now_us;
}

void iw_wheel_receive(iw_wheel_t *self, iw_time_us_t now_us, iw_codec_kind_t kind, const iw_codec_wheel_t *values,
                      bool fresh) {
    note_presence(self, now_us);
    if (kind == IW_CODEC_SPEED) {
        receive_speed(self, now_us, &values->speed, fresh);
    } else if (kind == IW_CODEC_STATUS) {
        receive_status(self, now_us, &values->status);
    } else if (kind == IW_CODEC_OFFSET) {
        receive_offset(self, now_us);
    }
}

void iw_wheel_excuse(iw_wheel_t *self, iw_time_us_t now_us) {
    // One excuse per fresh message: a run of late steps must not make a dead wheel appear online.
    if (self->received_us >= self->excused_us) {
        self->excused_us = now_us;
        self->any_us = now_us;
    }
}

bool iw_wheel_lost(const iw_wheel_t *self, iw_time_us_t now_us) {
    return iw_age_us(iw_later(self->received_us, self->excused_us), now_us) >= silent_us(self);
}

uint32_t iw_wheel_rest_us(const iw_wheel_t *self, iw_time_us_t now_us) {
    if (self->rest_since_us == IW_NEVER || !iw_wheel_online(self, now_us)) {
        return 0;
    }
    return iw_age_us(self->rest_since_us, now_us);
}
