// SPDX-License-Identifier: MIT
#include "inspect.h"

#include "iwheel_linux/clock.h"

#include <poll.h>
#include <stdarg.h>
#include <stdio.h>
#include <string.h>

void inspect_begin(inspect_findings_t *self) {
    memset(self, 0, sizeof *self);
    self->absent = INSPECT_FAIL;
}

void inspect_add(inspect_findings_t *self, const char *check, inspect_verdict_t verdict, const char *format, ...) {
    self->total[verdict]++;
    if (self->count == INSPECT_FINDINGS_MAX) {
        self->lost++;
        return;
    }
    inspect_finding_t *finding = &self->finding[self->count++];
    finding->check = check;
    finding->verdict = verdict;
    va_list arguments;
    va_start(arguments, format);
    (void)vsnprintf(finding->text, sizeof finding->text, format, arguments);
    va_end(arguments);
}

void inspect_fix(inspect_findings_t *self, const char *format, ...) {
    if (self->count == 0U || self->lost > 0U) {
        return;
    }
    inspect_finding_t *finding = &self->finding[self->count - 1U];
    va_list arguments;
    va_start(arguments, format);
    (void)vsnprintf(finding->fix, sizeof finding->fix, format, arguments);
    va_end(arguments);
}

const char *inspect_verdict_word(inspect_verdict_t verdict) {
    static const char *const words[INSPECT_VERDICTS] = {
        [INSPECT_OK] = "ok", [INSPECT_WARN] = "warn", [INSPECT_FAIL] = "fail", [INSPECT_SKIP] = "skip"};
    return words[verdict];
}

void inspect_sentence(const inspect_finding_t *finding, char *out_text, size_t size) {
    (void)snprintf(out_text, size, "%s%s%s", finding->text, (finding->fix[0] != '\0') ? "; " : "", finding->fix);
}

/// Interval of reading the bus without a wake-up: unknown ids arrive through a socket that is not watched.
#define POLL_MS 10

uint32_t inspect_nominal_mHz(const iw_codec_row_t *row) {
    return (row->kind == IW_CODEC_SETPOINT) ? 0U : 1000000U / row->period_ms;
}

bool inspect_always(const iw_codec_row_t *row) {
    return row->kind != IW_CODEC_SETPOINT && row->kind != IW_CODEC_OFFSET;
}

unsigned inspect_message_of(uint32_t id) {
    const iw_codec_row_t *row = iw_codec_find(id);
    return (row != NULL) ? (unsigned)(row - iw_codec_rows) : IW_CODEC_ROWS;
}

void inspect_traffic_begin(inspect_traffic_t *self) {
    *self = (inspect_traffic_t){.estop = -1, .worst = IW_BUS_ACTIVE, .last = IW_BUS_ACTIVE};
}

static void note_stranger(inspect_traffic_t *self, uint32_t id) {
    self->strange++;
    for (uint32_t i = 0; i < self->strange_ids; i++) {
        if (self->strange_id[i] == id) {
            return;
        }
    }
    if (self->strange_ids < INSPECT_STRANGERS) {
        self->strange_id[self->strange_ids++] = id;
    }
}

void inspect_traffic_count(inspect_traffic_t *self, const iw_can_frame_t *frame) {
    iw_codec_wheel_t values[IW_SIDES];
    self->bits += iwl_bus_frame_bits(frame);
    if (frame->kind == (uint8_t)IW_CAN_ECHO) {
        return;
    }
    switch (iw_codec_decode(frame, values)) {
    case IW_CODEC_BAD_LENGTH:
        self->bad_length++;
        break;
    case IW_CODEC_BAD_FORMAT:
        self->bad_format++;
        break;
    case IW_CODEC_UNKNOWN:
        note_stranger(self, frame->id);
        break;
    default:
        self->count[inspect_message_of(frame->id)]++;
        break;
    }
}

static void poll_bus(iwl_hal_t *hal, iw_time_us_t now_us, bool counting, inspect_traffic_t *traffic) {
    iw_can_frame_t frame;
    iwl_hal_poll(hal, now_us);
    const iw_bus_state_t state = iwl_bus_state(&hal->bus);
    traffic->was_up = traffic->was_up || state >= IW_BUS_PASSIVE;
    if (state < traffic->worst) {
        traffic->worst = state;
    }
    traffic->last = state;
    traffic->estop = iwl_hal_pressed(hal);
    while (iwl_bus_receive(&hal->bus, &frame) > 0) {
        if (counting) {
            inspect_traffic_count(traffic, &frame);
        }
    }
}

void inspect_listen(iwl_hal_t *hal, iw_time_us_t for_us, inspect_traffic_t *out_traffic) {
    inspect_traffic_begin(out_traffic);
    struct pollfd wait = {.fd = iwl_hal_bus_fd(hal), .events = POLLIN};
    poll_bus(hal, iwl_clock_now_us(), false, out_traffic); // Frames from before the first reading have no time.
    const iw_time_us_t begin_us = iwl_clock_now_us();
    for (iw_time_us_t now_us = begin_us; now_us < begin_us + for_us; now_us = iwl_clock_now_us()) {
        poll_bus(hal, now_us, true, out_traffic);
        (void)poll(&wait, 1, POLL_MS);
    }
    out_traffic->span_us = iwl_clock_now_us() - begin_us;
}

uint32_t inspect_rate_mHz(const inspect_traffic_t *self, unsigned message) {
    return (self->span_us == 0U) ? 0U : (uint32_t)((uint64_t)self->count[message] * 1000U * 1000000U / self->span_us);
}

uint32_t inspect_load_permille(const inspect_traffic_t *self, uint32_t bitrate_hz) {
    if (self->span_us == 0U || bitrate_hz == 0U) {
        return 0U;
    }
    return (uint32_t)(self->bits * 1000000U / bitrate_hz * 1000U / self->span_us);
}
