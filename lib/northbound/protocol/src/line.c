// SPDX-License-Identifier: MIT
#include "iwheel_northbound/line.h"

#include "iwheel_northbound/text.h"

#include <string.h>

#define CRC_DIGITS 8U

const char *iwn_line_verdict_name(iwn_line_verdict_t verdict) {
    static const char *const names[IWN_LINE_VERDICTS] = {
        [IWN_LINE_NOTHING] = "nothing",     [IWN_LINE_GOOD] = "good",        [IWN_LINE_TOO_BIG] = "too_long",
        [IWN_LINE_LOST] = "lost",           [IWN_LINE_UNCHECKED] = "no_crc", [IWN_LINE_CORRUPT] = "crc",
        [IWN_LINE_MISFORMED] = "malformed",
    };
    return ((unsigned)verdict < IWN_LINE_VERDICTS) ? names[verdict] : "unknown";
}

/// Processes four bits per step: a table of 64 bytes suits a small flash.
uint32_t iwn_line_crc(uint32_t crc, const void *bytes, size_t length) {
    static const uint32_t table[16] = {
        0x00000000U, 0x1DB71064U, 0x3B6E20C8U, 0x26D930ACU, 0x76DC4190U, 0x6B6B51F4U, 0x4DB26158U, 0x5005713CU,
        0xEDB88320U, 0xF00F9344U, 0xD6D6A3E8U, 0xCB61B38CU, 0x9B64C2B0U, 0x86D3D2D4U, 0xA00AE278U, 0xBDBDF21CU,
    };
    const uint8_t *byte = (const uint8_t *)bytes;
    crc = ~crc;
    for (size_t i = 0; i < length; i++) {
        crc ^= byte[i];
        crc = (crc >> 4) ^ table[crc & 15U];
        crc = (crc >> 4) ^ table[crc & 15U];
    }
    return ~crc;
}

static bool is_digit(char c) {
    return c >= '0' && c <= '9';
}

/// Returns the value of a lower-case hexadecimal digit; 16 if it is none.
static unsigned hex_value(char c) {
    if (is_digit(c)) {
        return (unsigned)(c - '0');
    }
    return (c >= 'a' && c <= 'f') ? (unsigned)(c - 'a') + 10U : 16U;
}

/// Returns the number of bytes of a number in its only valid form; 0 if there is none, or it exceeds 64 bits.
static size_t read_number(const char *text, size_t length, uint64_t *out_number) {
    size_t digits = 0;
    uint64_t number = 0;
    while (digits < length && is_digit(text[digits])) {
        const unsigned digit = (unsigned)(text[digits] - '0');
        if (number > (UINT64_MAX - digit) / 10U) {
            return 0;
        }
        number = number * 10U + digit;
        digits++;
    }
    *out_number = number;
    return (digits > 1U && text[0] == '0') ? 0U : digits;
}

size_t iwn_line_begin(const iwn_line_t *line, char *out, size_t size) {
    char bytes[IWN_LINE_PREFIX + 1U];
    iwn_text_t prefix = iwn_text_begin(bytes, sizeof bytes);
    if (line->channel > IWN_LINE_CHANNELS) {
        return 0;
    }
    iwn_text_unsigned(&prefix, line->channel);
    iwn_text_add(&prefix, " ");
    if (line->stamped) {
        iwn_text_unsigned(&prefix, line->t_us);
        iwn_text_add(&prefix, " ");
    }
    if (prefix.length > size) {
        return 0;
    }
    memcpy(out, bytes, prefix.length);
    return prefix.length;
}

size_t iwn_line_end(char *out, size_t length, size_t size) {
    if (size < IWN_LINE_SUFFIX || length > size - IWN_LINE_SUFFIX) {
        return 0;
    }
    const uint32_t crc = iwn_line_crc(0, out, length);
    out[length++] = '*';
    for (unsigned i = 0; i < CRC_DIGITS; i++) {
        out[length++] = "0123456789abcdef"[crc >> (28U - 4U * i) & 15U];
    }
    out[length++] = '\n';
    return length;
}

size_t iwn_line_write(const iwn_line_t *line, char *out, size_t size) {
    const size_t prefix = iwn_line_begin(line, out, size);
    if (prefix == 0U || line->length > size - prefix) {
        return 0;
    }
    memcpy(&out[prefix], line->json, line->length);
    return iwn_line_end(out, prefix + line->length, size);
}

/// Reads the CRC at the end of a line. Returns false if there is none.
static bool read_crc(const char *bytes, size_t length, uint32_t *out_crc) {
    if (length < CRC_DIGITS + 1U || bytes[length - CRC_DIGITS - 1U] != '*') {
        return false;
    }
    *out_crc = 0;
    for (size_t i = length - CRC_DIGITS; i < length; i++) {
        const unsigned value = hex_value(bytes[i]);
        if (value > 15U) {
            return false;
        }
        *out_crc = *out_crc << 4 | value;
    }
    return true;
}

/// Reads the stamp and its space after the channel. Returns the number of bytes; 0 if there is none.
static size_t read_stamp(const char *text, size_t length, uint64_t *out_t_us) {
    const size_t digits = read_number(text, length, out_t_us);
    return (digits > 0U && digits < length && text[digits] == ' ') ? digits + 1U : 0U;
}

static bool is_braced(const char *json, size_t length) {
    return length >= 2U && json[0] == '{' && json[length - 1U] == '}';
}

/// Reads channel, stamp and braces of a line whose CRC matches.
static bool read_parts(const char *bytes, size_t length, bool stamped, iwn_line_t *out_line) {
    iwn_line_t line = {.stamped = stamped};
    if (length < 4U || bytes[0] < '0' || bytes[0] > (char)('0' + (char)IWN_LINE_CHANNELS) || bytes[1] != ' ') {
        return false;
    }
    line.channel = (uint8_t)(bytes[0] - '0');
    const size_t stamp = stamped ? read_stamp(&bytes[2], length - 2U, &line.t_us) : 0U;
    line.json = &bytes[2U + stamp];
    line.length = length - 2U - stamp;
    if ((stamped && stamp == 0U) || !is_braced(line.json, line.length)) {
        return false;
    }
    *out_line = line;
    return true;
}

iwn_line_verdict_t iwn_line_read(const char *bytes, size_t length, bool stamped, iwn_line_t *out_line) {
    uint32_t crc = 0;
    if (!read_crc(bytes, length, &crc)) {
        return IWN_LINE_UNCHECKED;
    }
    length -= CRC_DIGITS + 1U;
    if (iwn_line_crc(0, bytes, length) != crc) {
        return IWN_LINE_CORRUPT;
    }
    return read_parts(bytes, length, stamped, out_line) ? IWN_LINE_GOOD : IWN_LINE_MISFORMED;
}

void iwn_receiver_init(iwn_receiver_t *self, char *data, size_t size, bool stamped) {
    *self = (iwn_receiver_t){.data = data, .size = size, .stamped = stamped};
}

iwn_line_verdict_t iwn_receiver_put(iwn_receiver_t *self, char byte, iwn_line_t *out_line) {
    if (byte != '\n') {
        // The newline counts: a line that needs the whole buffer and has not ended is too long.
        if (self->length + 1U >= self->size) {
            if (self->fault == IWN_LINE_NOTHING) {
                self->fault = IWN_LINE_TOO_BIG;
            }
        } else {
            self->data[self->length++] = byte;
        }
        return IWN_LINE_NOTHING;
    }
    const size_t length = self->length;
    const iwn_line_verdict_t fault = self->fault;
    self->length = 0;
    self->fault = IWN_LINE_NOTHING;
    if (fault != IWN_LINE_NOTHING) {
        return fault;
    }
    return (length > 0U) ? iwn_line_read(self->data, length, self->stamped, out_line) : IWN_LINE_NOTHING;
}

void iwn_receiver_spoil(iwn_receiver_t *self) {
    self->fault = IWN_LINE_LOST;
}

size_t iwn_quote_write(const iwn_quote_t *quote, const char *json, size_t length, char *out, size_t size) {
    if (length < 2U || size < IWN_QUOTE_SIZE || length > size - IWN_QUOTE_SIZE) {
        return 0;
    }
    iwn_text_t text = iwn_text_begin(out, size);
    IWN_TEXT_JOIN(&text, "{\"boot\":\"", quote->boot, "\",\"seq\":");
    iwn_text_unsigned(&text, quote->seq);
    iwn_text_add(&text, ",\"t_us\":");
    iwn_text_unsigned(&text, quote->t_us);
    iwn_text_add(&text, ",");
    iwn_text_span(&text, &json[1], length - 1U);
    return text.length;
}

/// Unread part of the first fields of a request.
typedef struct {
    const char *at;
    size_t left;
} rest_t;

/// Skips a text if it is next.
static bool take_text(rest_t *rest, const char *text) {
    const size_t length = strlen(text);
    if (rest->left < length || memcmp(rest->at, text, length) != 0) {
        return false;
    }
    *rest = (rest_t){rest->at + length, rest->left - length};
    return true;
}

static bool take_number(rest_t *rest, uint64_t *out_number) {
    const size_t digits = read_number(rest->at, rest->left, out_number);
    *rest = (rest_t){rest->at + digits, rest->left - digits};
    return digits > 0U;
}

static bool take_boot(rest_t *rest, char out_boot[IWN_LINE_BOOT + 1U]) {
    if (rest->left < IWN_LINE_BOOT) {
        return false;
    }
    for (size_t i = 0; i < IWN_LINE_BOOT; i++) {
        if (hex_value(rest->at[i]) > 15U) {
            return false;
        }
        out_boot[i] = rest->at[i];
    }
    out_boot[IWN_LINE_BOOT] = '\0';
    *rest = (rest_t){rest->at + IWN_LINE_BOOT, rest->left - IWN_LINE_BOOT};
    return true;
}

bool iwn_quote_take(char **json, size_t *length, iwn_quote_t *out_quote) {
    rest_t rest = {*json, *length};
    iwn_quote_t quote = {.seq = 0};
    const bool there = take_text(&rest, "{\"boot\":\"") && take_boot(&rest, quote.boot) &&
                       take_text(&rest, "\",\"seq\":") && take_number(&rest, &quote.seq) &&
                       take_text(&rest, ",\"t_us\":") && take_number(&rest, &quote.t_us) && rest.left > 1U &&
                       rest.at[0] == ',';
    if (there) {
        *json += *length - rest.left;
        **json = '{';
        *length = rest.left;
        *out_quote = quote;
    }
    return there;
}
