// SPDX-License-Identifier: MIT
#include "iwheel_northbound/text.h"

#include <string.h>

/// Every character that controls a terminal needs four digits.
#define ESCAPE_SIZE sizeof "\\uFFFD"
/// A machine word in which every byte has this value.
#define IN_EACH(byte) ((size_t)-1 / 255U * (byte))

static const struct {
    uint32_t first;
    uint32_t last;
} moving[] = {
    {0x0000U, 0x001FU}, {0x007FU, 0x009FU}, {0x061CU, 0x061CU},
    {0x200EU, 0x200FU}, {0x2028U, 0x202EU}, {0x2066U, 0x2069U},
};

bool iwn_plain_is(uint32_t code_point) {
    for (size_t i = 0; i < sizeof moving / sizeof moving[0]; i++) {
        if (code_point >= moving[i].first && code_point <= moving[i].last) {
            return false;
        }
    }
    return code_point != IWN_PLAIN_BROKEN;
}

/// Returns the number of bytes of a character that begins with this byte; 0 if none does.
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
    return (first >= 0xF0U && first <= 0xF4U) ? 4U : 0U;
}

uint32_t iwn_plain_read(const char *text, size_t *out_bytes) {
    static const uint32_t least[] = {0, 0, 0x80U, 0x800U, 0x10000U};
    const unsigned char first = (unsigned char)*text;
    const size_t length = length_of(first);
    uint32_t code_point = (length > 1U) ? first & (0x7FU >> length) : first;
    *out_bytes = 1;
    for (size_t i = 1; i < length; i++) {
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

void iwn_plain_blank(char *text) {
    size_t bytes;
    for (; *text != '\0'; text += bytes) {
        if (!iwn_plain_is(iwn_plain_read(text, &bytes))) {
            memset(text, ' ', bytes);
        }
    }
}

/// Returns true if JSON shows the byte unchanged.
static bool is_plain(char c) {
    return c >= 0x20 && c < 0x7F && c != '"' && c != '\\';
}

/// Reads a machine word at a time. If all bytes are below 0x80, a subtraction borrows only after a byte that is not
/// plain either. With bit 1 inverted, a quote and the control characters are the bytes below 0x21.
size_t iwn_plain_length(const char *text, size_t length) {
    size_t plain = 0;
    size_t word;
    for (; plain + sizeof word <= length; plain += sizeof word) {
        memcpy(&word, &text[plain], sizeof word);
        const size_t control_or_quote = (word ^ IN_EACH(0x02U)) - IN_EACH(0x21U);
        const size_t backslash = (word ^ IN_EACH(0x5CU)) - IN_EACH(1U);
        const size_t erase = word + IN_EACH(1U);
        const size_t odd = (word | control_or_quote | backslash | erase) & IN_EACH(0x80U);
        if (odd != 0U) {
#if !defined(__OPTIMIZE_SIZE__) && __BYTE_ORDER__ == __ORDER_LITTLE_ENDIAN__
            return plain + (size_t)__builtin_ctzll(odd) / 8U; // The lowest bit belongs to the first such byte.
#else
            break;
#endif
        }
    }
    while (plain < length && is_plain(text[plain])) {
        plain++;
    }
    return plain;
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
        memcpy(&out[used], plain ? text : "?", length);
        used += length;
    }
    out[used] = '\0';
}

/// Writes the form in JSON.
static size_t escape(uint32_t code_point, char out_escape[ESCAPE_SIZE]) {
    if (code_point < 0x20U) { // Such a character occurs between values only.
        out_escape[0] = ' ';
        return 1;
    }
    iwn_text_t text = iwn_text_begin(out_escape, ESCAPE_SIZE);
    iwn_text_add(&text, "\\u");
    iwn_text_hex(&text, (code_point == IWN_PLAIN_BROKEN) ? 0xFFFDU : code_point, 4U);
    return text.length;
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
        memcpy(&out[used], plain ? line : escaped, length);
        used += length;
    }
    *out_length = used;
    return line;
}

size_t iwn_utf8(uint32_t code_point, char out_bytes[4]) {
    if (code_point < 0x80U) {
        out_bytes[0] = (char)code_point;
        return 1;
    }
    const size_t length = (code_point < 0x800U) ? 2U : (code_point < 0x10000U) ? 3U : 4U;
    for (size_t i = length - 1U; i > 0U; i--) {
        out_bytes[i] = (char)(0x80U | (code_point & 0x3FU));
        code_point >>= 6;
    }
    out_bytes[0] = (char)((0xF00U >> length & 0xFFU) | code_point);
    return length;
}

/// Divides 32-bit numbers, because a controller divides 64 bits by a function of a hundred instructions. It uses a
/// table of two digits, or one digit at a time in a program compiled for size.
static char *digits_32(uint32_t number, char *end) {
#ifndef __OPTIMIZE_SIZE__
    static const char pairs[] =
        "00010203040506070809101112131415161718192021222324252627282930313233343536373839404142434445464748495051525354"
        "555657585960616263646566676869707172737475767778798081828384858687888990919293949596979899";
    while (number >= 100U) {
        const uint32_t rest = number / 100U;
        const size_t pair = number - rest * 100U;
        end -= 2;
        memcpy(end, &pairs[2U * pair], 2U);
        number = rest;
    }
#endif
    do {
        *--end = (char)('0' + number % 10U);
        number /= 10U;
    } while (number > 0U);
    return end;
}

static uint64_t without_sign(int64_t number) {
    return (number < 0) ? 0U - (uint64_t)number : (uint64_t)number;
}

size_t iwn_digits_length(int64_t number) {
    const uint64_t rest = without_sign(number);
    size_t length = (number < 0) ? 2U : 1U;
    for (uint64_t limit = 10U; rest >= limit; limit *= 10U) { // The largest limit has 20 digits and fits.
        length++;
    }
    return length;
}

char *iwn_digits_unsigned(uint64_t number, char *end) {
    bool last = false;
    while (!last) {
        last = number <= UINT32_MAX;
        const uint64_t high = last ? 0U : number / 1000000000U;
        char *const at = digits_32((uint32_t)(number - high * 1000000000U), end);
        end = last ? at : end - 9;
        memset(end, '0', (size_t)(at - end)); // Leading zeros of the lower nine digits.
        number = high;
    }
    return end;
}

char *iwn_digits(int64_t number, char *end) {
    end = iwn_digits_unsigned(without_sign(number), end);
    if (number < 0) {
        *--end = '-';
    }
    return end;
}

iwn_text_t iwn_text_begin(char *data, size_t size) {
    data[0] = '\0';
    return (iwn_text_t){data, size, 0};
}

void iwn_text_span(iwn_text_t *self, const char *text, size_t length) {
    const size_t space = self->size - self->length - 1U;
    const size_t fits = (length < space) ? length : space;
    memcpy(&self->data[self->length], text, fits);
    self->length += fits;
    self->data[self->length] = '\0';
}

void iwn_text_add(iwn_text_t *self, const char *text) {
    iwn_text_span(self, text, strlen(text));
}

void iwn_text_unsigned(iwn_text_t *self, uint64_t number) {
    char digits[IWN_DIGITS_MAX];
    const char *const end = digits + sizeof digits;
    const char *const begin = iwn_digits_unsigned(number, digits + sizeof digits);
    iwn_text_span(self, begin, (size_t)(end - begin));
}

void iwn_text_int(iwn_text_t *self, int64_t number) {
    if (number < 0) {
        iwn_text_add(self, "-");
    }
    iwn_text_unsigned(self, without_sign(number));
}

void iwn_text_hex(iwn_text_t *self, uint32_t number, unsigned digits) {
    while (digits > 0U && self->length + 1U < self->size) {
        digits--;
        self->data[self->length] = "0123456789ABCDEF"[number >> 4U * digits & 15U];
        self->length++;
    }
    self->data[self->length] = '\0';
}

void iwn_text_join(iwn_text_t *self, const char *const *texts) {
    for (; *texts != NULL; texts++) {
        iwn_text_add(self, *texts);
    }
}
