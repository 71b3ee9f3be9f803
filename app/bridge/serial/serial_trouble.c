// SPDX-License-Identifier: MIT
#include "serial_trouble.h"

#include <stdio.h>

/// If more than one byte of this number is not text, the bit rate is another.
#define ODD_SHARE 8U

void serial_trouble_begin(serial_trouble_t *self, uint64_t now_us) {
    self->kind = SERIAL_TROUBLE_NONE;
    self->logged = SERIAL_TROUBLE_NONE;
    self->judge_us = now_us + SERIAL_TROUBLE_US;
}

static serial_trouble_kind_t kind_of(const serial_noise_t *noise) {
    if (noise->bytes == 0U) {
        return SERIAL_TROUBLE_NO_BYTES;
    }
    if (noise->odd * ODD_SHARE > noise->bytes) {
        return SERIAL_TROUBLE_BAUD;
    }
    if (noise->lines[IWN_LINE_CORRUPT] + noise->lines[IWN_LINE_LOST] > 0U) {
        return SERIAL_TROUBLE_DAMAGED;
    }
    return (noise->lines[IWN_LINE_UNCHECKED] + noise->lines[IWN_LINE_MISFORMED] > 0U) ? SERIAL_TROUBLE_PROTOCOL
                                                                                      : SERIAL_TROUBLE_NO_LINE;
}

/// Counts a change. Returns false if no more changes may be logged.
static bool spend(serial_trouble_t *self, uint64_t now_us) {
    const uint64_t from_us = (self->spent_us > now_us) ? self->spent_us : now_us;
    if (from_us > now_us + (uint64_t)(SERIAL_TROUBLE_BURST - 1U) * SERIAL_TROUBLE_REFILL_US) {
        return false;
    }
    self->spent_us = from_us + SERIAL_TROUBLE_REFILL_US;
    return true;
}

serial_report_t serial_trouble_judge(serial_trouble_t *self, const serial_noise_t *noise, uint64_t now_us) {
    const serial_trouble_kind_t kind = kind_of(noise);
    self->judge_us = now_us + SERIAL_TROUBLE_US;
    if (kind != SERIAL_TROUBLE_NO_BYTES) {
        self->received_us = now_us;
    } else if (self->kind > SERIAL_TROUBLE_NO_BYTES && now_us < self->received_us + SERIAL_TROUBLE_PAUSE_US) {
        return SERIAL_REPORT_KEEP;
    }
    self->kind = kind;
    const bool again = kind != SERIAL_TROUBLE_NO_BYTES && now_us >= self->logged_us + SERIAL_TROUBLE_AGAIN_US;
    if ((kind == self->logged) ? !again : !spend(self, now_us)) {
        return SERIAL_REPORT_CLIENTS;
    }
    self->logged = kind;
    self->logged_us = now_us;
    return SERIAL_REPORT_LOG;
}

void serial_trouble_write(const serial_noise_t *noise, const serial_place_t *place, char *out, size_t size) {
    const unsigned long long bytes = noise->bytes;
    switch (kind_of(noise)) {
    case SERIAL_TROUBLE_BAUD:
        (void)snprintf(out, size,
                       "%llu bytes came from %s that are not text: the baud rate is not %u (set baud to that of the "
                       "image), or the lines are disturbed",
                       bytes, place->port, place->baud);
        break;
    case SERIAL_TROUBLE_DAMAGED:
        (void)snprintf(out, size,
                       "lines come damaged from %s (%llu with a wrong CRC): a bad cable, ground, or two programs "
                       "reading the port",
                       place->port, (unsigned long long)noise->lines[IWN_LINE_CORRUPT]);
        break;
    case SERIAL_TROUBLE_PROTOCOL:
        (void)snprintf(out, size,
                       "%s uses another protocol (such as \"%s\"): it is another device, or the board runs "
                       "another image than `gateway`",
                       place->port, noise->sample);
        break;
    case SERIAL_TROUBLE_NO_LINE:
        (void)snprintf(out, size,
                       "%llu bytes came from %s and no whole line: another protocol or baud rate, or a board that "
                       "hangs",
                       bytes, place->port);
        break;
    case SERIAL_TROUBLE_NO_BYTES:
    case SERIAL_TROUBLE_NONE:
    default:
        (void)snprintf(out, size,
                       "nothing comes from %s: is the board powered, is it running the image `gateway`, and are "
                       "both lines (TX, RX) and ground connected?",
                       place->port);
        break;
    }
}
