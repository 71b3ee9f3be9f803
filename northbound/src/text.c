// SPDX-License-Identifier: MIT
#include "iwheel_northbound/text.h"

#include <stdio.h>
#include <string.h>

/// As long as a number can make it; every character that moves a terminal takes four digits.
#define ESCAPE_SIZE 12U

static const struct {
    uint32_t first;
    uint32_t last;
} moving[] = {
    {0x0000U, 0x001FU}, {0x007FU, 0x009FU}, {0x061CU, 0x061CU},
    {0x200EU, 0x200FU}, {0x2028U, 0x202EU}, {0x2066U, 0x2069U},
};

bool iwn_plain_is(uint32_t code_point) {
    for (size_t i = 0; i < sizeof moving / sizeof moving[0]; ++i) {
        if (code_point >= moving[i].first && code_point <= moving[i].last) {
            return false;
        }
    }
    return code_point != IWN_PLAIN_BROKEN;
}

/// How many bytes a character has that begins so; 0: none does.
static size_t length_of(unsigned char first) {
    if (first < 0x80U) {
        return 1;
    }
    if (first >= 0xC2U && first <= 0xDFU) {
        return 2;
    }
    if (first >= 0xE0U && first <= 0xEFU) {
        return 3;
    }
    return first >= 0xF0U && first <= 0xF4U ? 4U : 0U;
}

uint32_t iwn_plain_read(const char *text, size_t *out_bytes) {
    static const uint32_t least[] = {0, 0, 0x80U, 0x800U, 0x10000U};
    const unsigned char first = (unsigned char)*text;
    const size_t length = length_of(first);
    uint32_t code_point = length > 1U ? first & (0x7FU >> length) : first;
    *out_bytes = 1;
    for (size_t i = 1; i < length; ++i) {
        const unsigned char next = (unsigned char)text[i];
        if ((next & 0xC0U) != 0x80U) {
            return IWN_PLAIN_BROKEN;
        }
        code_point = (code_point << 6) | (next & 0x3FU);
    }
    if (length == 0U || code_point < least[length] || code_point > 0x10FFFFU ||
        (code_point >= 0xD800U && code_point <= 0xDFFFU)) {
        return IWN_PLAIN_BROKEN;
    }
    *out_bytes = length;
    return code_point;
}

bool iwn_plain_text(const char *text) {
    size_t bytes;
    for (; *text != '\0'; text += bytes) {
        if (!iwn_plain_is(iwn_plain_read(text, &bytes))) {
            return false;
        }
    }
    return true;
}

void iwn_plain_copy(const char *text, char *out, size_t size) {
    size_t bytes;
    size_t used = 0;
    for (; *text != '\0'; text += bytes) {
        const bool plain = iwn_plain_is(iwn_plain_read(text, &bytes));
        const size_t length = plain ? bytes : 1U;
        if (used + length >= size) {
            break;
        }
        (void)memcpy(&out[used], plain ? text : "?", length);
        used += length;
    }
    out[used] = '\0';
}

/// As it stands in JSON.
static size_t escape(uint32_t code_point, char out_escape[ESCAPE_SIZE]) {
    if (code_point < 0x20U) { // Such a one stands between values only.
        out_escape[0] = ' ';
        return 1;
    }
    const uint32_t shown = code_point == IWN_PLAIN_BROKEN ? 0xFFFDU : code_point;
    return (size_t)snprintf(out_escape, ESCAPE_SIZE, "\\u%04X", (unsigned)shown);
}

const char *iwn_plain_json(const char *line, char *out, size_t size, size_t *out_length) {
    char escaped[ESCAPE_SIZE];
    size_t bytes;
    size_t used = 0;
    for (; *line != '\0'; line += bytes) {
        const uint32_t code_point = iwn_plain_read(line, &bytes);
        const bool plain = iwn_plain_is(code_point);
        const size_t length = plain ? bytes : escape(code_point, escaped);
        if (used + length > size) {
            break;
        }
        (void)memcpy(&out[used], plain ? line : escaped, length);
        used += length;
    }
    *out_length = used;
    return line;
}
