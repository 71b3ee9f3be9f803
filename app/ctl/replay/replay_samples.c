// SPDX-License-Identifier: MIT
#include "replay.h"

#include "text/ctl_text.h"

#include "iwheel/codec.h"
#include "iwheel_northbound/contents.h"
#include "iwheel_northbound/words.h"

#include <inttypes.h>
#include <string.h>

/// A setpoint is valid for this time: the gateway sends one at least every 50 ms.
#define SETPOINT_US 500000U
/// Size of the longest text of an event, cleaned.
#define TEXT_SIZE 1024U

void replay_samples_begin(const replay_out_t *out) {
    (void)fputs("time_s,state", out->file);
    for (unsigned side = 0; side < IW_SIDES; side++) {
        const char *name = text_side(side);
        (void)fprintf(out->file, ",%s_commanded_m_s,%s_applied_m_s,%s_measured_m_s,%s_net_force_N", name, name, name,
                      name);
    }
    (void)fputs(",event,text\n", out->file);
}

void replay_samples_frame(replay_t *self, const iw_can_frame_t *frame) {
    iw_codec_wheel_t values[IW_SIDES];
    if (self->out.samples_us == 0U || self->quiet || iw_codec_decode(frame, values) != IW_CODEC_SETPOINT) {
        return;
    }
    const iw_side_t side = iw_codec_side(frame->id);
    const int16_t speed_mm_s = values[side].setpoint.speed_mm_s;
    const bool mirrored = replay_snapshot(self).config->invert[side];
    self->samples.speed_mm_s[side] = (mirrored && speed_mm_s != INT16_MIN) ? (int16_t)-speed_mm_s : speed_mm_s;
    self->samples.at_us[side] = self->now_us;
    self->samples.known[side] = true;
}

/// Writes a thousandth as a decimal, or an empty cell.
static void put(const replay_t *self, bool known, int32_t thousandths) {
    char number[TEXT_CELL] = "";
    if (known) {
        text_number(thousandths, 3U, "", number);
    }
    (void)fprintf(self->out.file, ",%s", number);
}

static void put_begin(const replay_t *self, iw_time_us_t at_us) {
    const int64_t time_us = (int64_t)at_us + self->out.wall_less_us;
    const bool known = !self->out.frames_only;
    (void)fprintf(self->out.file, "%" PRId64 ".%06" PRId64 ",%s", time_us / 1000000, time_us % 1000000,
                  known ? iwn_state_name(iw_gateway_state(&self->gateway)) : "");
}

static void put_wheel(const replay_t *self, const iw_snapshot_t *seen, iw_side_t side) {
    const iw_snapshot_wheel_t *wheel = &seen->wheel[side];
    const bool following = seen->demand == IW_DEMAND_FOLLOW && !self->out.frames_only;
    const bool speed = wheel->heard && iwn_is_speed_known(seen);
    const bool force = iw_snapshot_force_validity(seen, side) == IW_FORCE_VALID;
    const bool applied = self->samples.known[side] && self->now_us - self->samples.at_us[side] <= SETPOINT_US;
    put(self, following, seen->target.wheel[side].speed_mm_s);
    put(self, applied, self->samples.speed_mm_s[side]);
    put(self, speed, wheel->speed_mm_s);
    put(self, force, iw_force_net_mN(wheel->force));
}

void replay_samples_step(replay_t *self) {
    if (self->out.samples_us == 0U || self->quiet || self->now_us < self->samples.due_us) {
        return;
    }
    const iw_snapshot_t seen = replay_snapshot(self);
    self->samples.due_us = self->now_us - self->now_us % self->out.samples_us + self->out.samples_us;
    put_begin(self, self->now_us);
    put_wheel(self, &seen, IW_LEFT);
    put_wheel(self, &seen, IW_RIGHT);
    (void)fputs(",,\n", self->out.file);
}

void replay_samples_event(const replay_t *self, iw_time_us_t at_us, const char *event, const char *text) {
    char clean[TEXT_SIZE];
    text_clean(text, clean, sizeof clean); // Names in it come from the recording.
    put_begin(self, at_us);
    (void)fprintf(self->out.file, ",,,,,,,,,%s,\"", event);
    for (const char *c = clean; *c != '\0'; c++) {
        (void)fputs((*c == '"') ? "\"" : "", self->out.file);
        (void)fputc(*c, self->out.file);
    }
    (void)fputs("\"\n", self->out.file);
}
