// SPDX-License-Identifier: MIT
#include "serial_link.h"

#include <string.h>

/// The stamps are void.
static void fall_silent(serial_link_t *self) {
    self->state = SERIAL_SILENT;
    self->stamps = 0;
}

void serial_link_init(serial_link_t *self, uint64_t now_us) {
    fall_silent(self);
    self->boot[0] = '\0';
    self->version[0] = '\0';
    self->received_us = now_us;
    serial_link_forget_noise(self);
    iwn_receiver_init(&self->receiver, self->buffer, sizeof self->buffer, true);
}

static serial_stamp_t *newest(serial_link_t *self) {
    return &self->stamp[(self->stamps - 1U) % SERIAL_STAMPS];
}

/// Stores the newest of the stamps that arrive close together only when another is far enough away, so that the ring
/// covers more time.
static void note_stamp(serial_link_t *self, uint64_t t_us, uint64_t now_us) {
    const bool close =
        self->stamps > 1U && now_us - self->stamp[(self->stamps - 2U) % SERIAL_STAMPS].received_us < SERIAL_STAMP_US;
    self->stamps += close ? 0U : 1U;
    *newest(self) = (serial_stamp_t){now_us, t_us};
}

bool serial_link_stamp(const serial_link_t *self, uint64_t then_us, uint64_t *out_t_us) {
    for (unsigned back = 1; back <= self->stamps && back <= SERIAL_STAMPS; back++) {
        const serial_stamp_t *stamp = &self->stamp[(self->stamps - back) % SERIAL_STAMPS];
        if (stamp->received_us <= then_us) {
            *out_t_us = stamp->t_us;
            return true;
        }
    }
    return false;
}

uint64_t serial_link_time(const serial_link_t *self, uint64_t then_us) {
    if (self->stamps == 0U) {
        return 0;
    }
    const serial_stamp_t *stamp = &self->stamp[(self->stamps - 1U) % SERIAL_STAMPS];
    const uint64_t ago_us = (stamp->received_us > then_us) ? stamp->received_us - then_us : 0U;
    return (stamp->t_us > ago_us) ? stamp->t_us - ago_us : 0U;
}

static bool is_boot(const char *text) {
    return strlen(text) == IWN_LINE_BOOT && strspn(text, "0123456789abcdef") == IWN_LINE_BOOT;
}

/// Returns 0 if there is no such integer.
static int64_t whole(iwn_json_t event, const char *name) {
    iwn_json_t value;
    return (iwn_json_find(event, name, &value) && iwn_json_kind(value) == IWN_JSON_INTEGER) ? iwn_json_integer(value)
                                                                                            : 0;
}

/// Handles the event `link`. Another boot id is another board, or the same after a reset.
static serial_news_t take_link(serial_link_t *self, iwn_json_t event) {
    char boot[IWN_LINE_BOOT + 1U];
    iwn_json_t value;
    if (!iwn_json_find(event, "boot", &value) || !iwn_json_text(value, boot, sizeof boot) || !is_boot(boot)) {
        return SERIAL_NEWS_NONE;
    }
    if (!iwn_json_find(event, "version", &value) || !iwn_json_text(value, self->version, sizeof self->version)) {
        self->version[0] = '\0';
    }
    self->fault_cause = whole(event, "fault_cause");
    self->fault_pc = whole(event, "fault_pc");
    if (self->state == SERIAL_LINKED && strcmp(boot, self->boot) == 0) {
        return SERIAL_NEWS_NONE;
    }
    memcpy(self->boot, boot, sizeof boot);
    self->state = SERIAL_LINKED;
    self->stamps = 0;
    return SERIAL_NEWS_LINKED;
}

static void take_complaint(serial_link_t *self, iwn_json_t event) {
    iwn_json_t value;
    if (iwn_json_find(event, "count", &value) && iwn_json_kind(value) == IWN_JSON_INTEGER &&
        iwn_json_integer(value) > 0) {
        self->complaints += (uint64_t)iwn_json_integer(value);
    }
}

/// Handles channel 0.
static serial_news_t take_event(serial_link_t *self, iwn_json_t event) {
    iwn_json_t name;
    if (!iwn_json_find(event, "event", &name)) {
        return SERIAL_NEWS_NONE;
    }
    if (iwn_json_is(name, "link")) {
        return take_link(self, event);
    }
    if (iwn_json_is(name, "line_error")) {
        take_complaint(self, event);
    }
    return SERIAL_NEWS_NONE;
}

static serial_news_t take_line(serial_link_t *self, iwn_line_t *line, uint64_t now_us) {
    char words[64];
    iwn_text_t fault = iwn_text_begin(words, sizeof words);
    iwn_json_t root;
    const bool right =
        line->length <= UINT16_MAX && iwn_json_check(line->json, line->length, &self->work, &root, &fault);
    if (!right) {
        self->noise.lines[IWN_LINE_MISFORMED]++;
        self->refused++;
        return SERIAL_NEWS_NONE;
    }
    self->received_us = now_us;
    serial_link_forget_noise(self);
    // The time of a board decreases when it restarts, whatever it reports.
    const bool fell = self->state == SERIAL_LINKED && self->stamps > 0U && line->t_us < newest(self)->t_us;
    if (fell) {
        fall_silent(self);
    }
    serial_news_t news = (self->state == SERIAL_LINKED) ? SERIAL_NEWS_LINE : SERIAL_NEWS_NONE;
    if (line->channel == 0U) {
        news = take_event(self, root);
    }
    if (self->state == SERIAL_LINKED) {
        note_stamp(self, line->t_us, now_us);
    }
    return (fell && news != SERIAL_NEWS_LINKED) ? SERIAL_NEWS_LOST : news;
}

static void sample(serial_noise_t *noise, const char *bytes, size_t length) {
    noise->sampled = (length < SERIAL_SAMPLE) ? length : SERIAL_SAMPLE;
    for (size_t i = 0; i < noise->sampled; i++) {
        noise->sample[i] = (char)((bytes[i] >= ' ' && bytes[i] <= '~') ? bytes[i] : '.');
    }
    noise->sample[noise->sampled] = '\0';
}

serial_news_t serial_link_put(serial_link_t *self, char byte, uint64_t now_us, iwn_line_t *out_line) {
    const size_t length = self->receiver.length;
    self->noise.bytes++;
    self->noise.odd += ((byte < ' ' || byte > '~') && byte != '\n' && byte != '\r') ? 1U : 0U;
    const iwn_line_verdict_t verdict = iwn_receiver_put(&self->receiver, byte, out_line);
    if (verdict == IWN_LINE_GOOD) {
        return take_line(self, out_line, now_us);
    }
    if (verdict != IWN_LINE_NOTHING) {
        self->noise.lines[verdict]++;
        self->refused++;
        sample(&self->noise, self->buffer, length);
    }
    return SERIAL_NEWS_NONE;
}

bool serial_link_fell_silent(serial_link_t *self, uint64_t now_us) {
    if (self->state == SERIAL_SILENT || now_us < self->received_us + SERIAL_SILENT_US) {
        return false;
    }
    fall_silent(self);
    return true;
}

void serial_link_forget_noise(serial_link_t *self) {
    self->noise = (serial_noise_t){.bytes = 0};
}
