// SPDX-License-Identifier: MIT
#include "candump.h"

#include "iwheel_northbound/text.h"

#include <inttypes.h>
#include <stdio.h>
#include <string.h>

#define ERROR_FLAG 0x20000000U
/// Seconds beyond the year 30000; the sum in microseconds still fits 64 bits.
#define SECONDS_DIGITS  12U
#define FRACTION_DIGITS 9U
#define STANDARD_DIGITS 3U
#define EXTENDED_DIGITS 8U

/// The unread part of a line.
typedef struct {
    const char *at;
    const char *end;
} cursor_t;

/// Returns the value 0..15 of a hexadecimal digit, or -1.
static int hex(char digit) {
    if (digit >= '0' && digit <= '9') {
        return digit - '0';
    }
    if (digit >= 'A' && digit <= 'F') {
        return digit - 'A' + 10;
    }
    return (digit >= 'a' && digit <= 'f') ? digit - 'a' + 10 : -1;
}

static int next_hex(const cursor_t *cursor, size_t ahead) {
    return ((size_t)(cursor->end - cursor->at) > ahead) ? hex(cursor->at[ahead]) : -1;
}

/// Returns true and advances if the next character is `wanted`.
static bool take(cursor_t *cursor, char wanted) {
    if (cursor->at == cursor->end || *cursor->at != wanted) {
        return false;
    }
    cursor->at++;
    return true;
}

static const char *parse_bytes(cursor_t *cursor, size_t most, candump_t *frame) {
    while (next_hex(cursor, 0) >= 0) {
        const int low = next_hex(cursor, 1);
        if (low < 0) {
            return "an odd number of data digits; a byte has two: is the line cut?";
        }
        if (frame->length == most) {
            return "more data than a frame holds; write CAN FD data behind ##";
        }
        frame->data[frame->length] = (uint8_t)(next_hex(cursor, 0) * 16 + low);
        frame->length++;
        cursor->at += 2;
        (void)take(cursor, '.'); // The form of cansend.
    }
    return NULL;
}

/// Parses `_9`.. `_F` after 8 bytes: the length code on the bus. The length is 8.
static const char *parse_raw_dlc(cursor_t *cursor, const candump_t *frame) {
    if (!take(cursor, '_')) {
        return NULL;
    }
    if (frame->length != IW_CAN_DATA_MAX || next_hex(cursor, 0) <= (int)IW_CAN_DATA_MAX) {
        return "a length code (_9 to _F) is valid only behind 8 bytes; delete it";
    }
    cursor->at++;
    return NULL;
}

static const char *parse_remote(cursor_t *cursor, candump_t *frame) {
    const int length = next_hex(cursor, 0);
    frame->remote = true;
    if (length > (int)IW_CAN_DATA_MAX) {
        return "a remote frame asks for 8 bytes at the most; correct the digit behind #R";
    }
    if (length >= 0) {
        frame->length = (uint8_t)length;
        cursor->at++;
    }
    return parse_raw_dlc(cursor, frame);
}

static const char *parse_fd(cursor_t *cursor, candump_t *frame) {
    const int flags = next_hex(cursor, 0);
    frame->fd = true;
    if (flags < 0) {
        return "a CAN FD frame has one digit of flags behind ##; is the line cut?";
    }
    frame->fd_flags = (uint8_t)flags;
    cursor->at++;
    return parse_bytes(cursor, CANDUMP_DATA_MAX, frame);
}

/// Parses the part after the first `#`. Returns NULL, or what is wrong.
static const char *parse_data(cursor_t *cursor, candump_t *frame) {
    if (take(cursor, '#')) {
        return parse_fd(cursor, frame);
    }
    if (take(cursor, 'R') || take(cursor, 'r')) {
        return parse_remote(cursor, frame);
    }
    const char *why = parse_bytes(cursor, IW_CAN_DATA_MAX, frame);
    return (why != NULL) ? why : parse_raw_dlc(cursor, frame);
}

static bool is_blank(char c) {
    return c == ' ' || c == '\t';
}

static bool skip_blanks(cursor_t *cursor) {
    const char *begin = cursor->at;
    while (cursor->at < cursor->end && is_blank(*cursor->at)) {
        cursor->at++;
    }
    return cursor->at > begin;
}

/// Reads decimal digits into `*value` and returns their number. Only the first `counted` digits count.
static unsigned take_digits(cursor_t *cursor, unsigned counted, int64_t *value) {
    unsigned digits = 0;
    for (; cursor->at < cursor->end && *cursor->at >= '0' && *cursor->at <= '9'; cursor->at++) {
        if (digits < counted) {
            *value = *value * 10 + (*cursor->at - '0');
        }
        digits++;
    }
    return digits;
}

static const char *parse_time(cursor_t *cursor, candump_t *frame) {
    static const int64_t scale[] = {1000000, 100000, 10000, 1000, 100, 10, 1};
    int64_t seconds = 0;
    int64_t fraction = 0;
    if (!take(cursor, '(')) {
        return "does not begin with a time in parentheses; record with candump -L or iwheelctl record";
    }
    const unsigned digits = take_digits(cursor, SECONDS_DIGITS, &seconds);
    const bool dot = take(cursor, '.');
    const unsigned decimals = dot ? take_digits(cursor, 6U, &fraction) : 0U;
    if (digits == 0U || digits > SECONDS_DIGITS || (dot && decimals == 0U) || decimals > FRACTION_DIGITS ||
        !take(cursor, ')')) {
        return "the time is not (SECONDS.MICROSECONDS); record with candump -L or iwheelctl record";
    }
    frame->time_us = seconds * 1000000 + fraction * scale[(decimals < 6U) ? decimals : 6U];
    return NULL;
}

static const char *parse_interface(cursor_t *cursor, candump_t *frame) {
    size_t length = 0;
    bool ascii = true;
    (void)skip_blanks(cursor);
    for (; cursor->at < cursor->end && !is_blank(*cursor->at); cursor->at++) {
        const unsigned char c = (unsigned char)*cursor->at;
        if (length + 1U >= CANDUMP_INTERFACE_SIZE || c < 0x21U || c == 0x7FU) {
            return "no interface name (at most 31 characters) behind the time; is the line damaged?";
        }
        frame->interface[length] = *cursor->at;
        length++;
        ascii = ascii && c < 0x80U;
    }
    if (!ascii && !iwn_plain_text(frame->interface)) {
        return "the interface name holds characters that move a terminal; is the line damaged?";
    }
    return (length == 0U || !skip_blanks(cursor)) ? "ends behind the time or the interface; is the line cut?" : NULL;
}

static const char *take_id(candump_t *frame, uint32_t number, unsigned digits) {
    frame->error = digits == EXTENDED_DIGITS && (number & ERROR_FLAG) != 0U;
    frame->extended = digits == EXTENDED_DIGITS && !frame->error;
    frame->id = frame->error ? number & ~ERROR_FLAG : number;
    if (digits != STANDARD_DIGITS && digits != EXTENDED_DIGITS) {
        return "the id has neither 3 hexadecimal digits (standard) nor 8 (extended); is the line damaged?";
    }
    if (digits == STANDARD_DIGITS && number > IW_CAN_ID_MASK) {
        return "a 3-digit id goes up to 7FF; write an extended id with 8 digits";
    }
    return (frame->id > CANDUMP_ID_MASK) ? "an extended id goes up to 1FFFFFFF; is the line damaged?" : NULL;
}

static const char *parse_id(cursor_t *cursor, candump_t *frame) {
    uint32_t number = 0;
    unsigned digits = 0;
    for (; cursor->at < cursor->end && digits <= EXTENDED_DIGITS && hex(*cursor->at) >= 0; cursor->at++) {
        number = number << 4U | (uint32_t)hex(*cursor->at);
        digits++;
    }
    if (!take(cursor, '#')) {
        return (digits > 0U && (cursor->at == cursor->end || is_blank(*cursor->at)))
                   ? "no # behind the id: this is candump's screen form; record with candump -L or iwheelctl record"
                   : "no hexadecimal id with a # behind it; is the line damaged?";
    }
    return take_id(frame, number, digits);
}

static const char *parse_mark(cursor_t *cursor, candump_t *frame) {
    const bool apart = skip_blanks(cursor);
    if (cursor->at == cursor->end) {
        return NULL;
    }
    if (apart && (take(cursor, 'R') || take(cursor, 'r'))) {
        frame->mark = CANDUMP_RECEIVED;
    } else if (apart && (take(cursor, 'T') || take(cursor, 't'))) {
        frame->mark = CANDUMP_SENT;
    }
    (void)skip_blanks(cursor);
    return (cursor->at == cursor->end)
               ? NULL
               : "something follows the data that is neither R nor T nor a hexadecimal digit; delete it";
}

candump_result_t candump_parse(const char *line, size_t length, candump_t *out_frame, const char **out_why) {
    candump_t frame = {0};
    cursor_t cursor = {line, line + length};
    while (cursor.end > cursor.at && (cursor.end[-1] == '\n' || cursor.end[-1] == '\r' || is_blank(cursor.end[-1]))) {
        cursor.end--;
    }
    (void)skip_blanks(&cursor);
    if (cursor.at == cursor.end || *cursor.at == '#' || *cursor.at == ';') {
        return CANDUMP_EMPTY;
    }
    static const char *(*const parts[])(cursor_t *, candump_t *) = {parse_time, parse_interface, parse_id, parse_data,
                                                                    parse_mark};
    const char *why = NULL;
    for (size_t i = 0; why == NULL && i < sizeof parts / sizeof parts[0]; i++) {
        why = parts[i](&cursor, &frame);
    }
    if (why != NULL) {
        *out_why = why;
        return CANDUMP_BAD;
    }
    *out_frame = frame;
    return CANDUMP_FRAME;
}

/// cantools accepts letters and digits only.
static void plain_name(const char *name, char out[CANDUMP_INTERFACE_SIZE]) {
    size_t length = 0;
    for (size_t i = 0; name[i] != '\0' && length + 1U < CANDUMP_INTERFACE_SIZE; i++) {
        const char c = name[i];
        if ((c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z') || (c >= '0' && c <= '9')) {
            out[length] = c;
            length++;
        }
    }
    out[length] = '\0';
    if (length == 0U) {
        (void)snprintf(out, CANDUMP_INTERFACE_SIZE, "can");
    }
}

static size_t write_id(const candump_t *frame, char *out, size_t size) {
    const int length = frame->error      ? snprintf(out, size, "%08" PRIX32 "#", frame->id | ERROR_FLAG)
                       : frame->extended ? snprintf(out, size, "%08" PRIX32 "#", frame->id)
                                         : snprintf(out, size, "%03" PRIX32 "#", frame->id);
    return (size_t)length;
}

size_t candump_write(const candump_t *frame, char out_line[CANDUMP_LINE_SIZE]) {
    static const char digits[] = "0123456789ABCDEF";
    char name[CANDUMP_INTERFACE_SIZE];
    plain_name(frame->interface, name);
    size_t length = (size_t)snprintf(out_line, CANDUMP_LINE_SIZE, "(%" PRId64 ".%06" PRId64 ") %s ",
                                     frame->time_us / 1000000, frame->time_us % 1000000, name);
    length += write_id(frame, &out_line[length], CANDUMP_LINE_SIZE - length);
    if (frame->remote) {
        out_line[length++] = 'R';
        if (frame->length > 0U) {
            out_line[length++] = digits[frame->length & 15U];
        }
    } else if (frame->fd) {
        out_line[length++] = '#';
        out_line[length++] = digits[frame->fd_flags & 15U];
    }
    for (size_t i = 0; i < frame->length && i < CANDUMP_DATA_MAX && !frame->remote; i++) {
        out_line[length++] = digits[frame->data[i] >> 4U];
        out_line[length++] = digits[frame->data[i] & 15U];
    }
    if (frame->mark != CANDUMP_UNMARKED) {
        out_line[length++] = ' ';
        out_line[length++] = (frame->mark == CANDUMP_SENT) ? 'T' : 'R';
    }
    out_line[length++] = '\n';
    out_line[length] = '\0';
    return length;
}

iw_can_frame_t candump_to_core(const candump_t *frame) {
    iw_can_frame_t core = {.id = frame->id,
                           .dlc = (frame->length < IW_CAN_DATA_MAX) ? frame->length : (uint8_t)IW_CAN_DATA_MAX,
                           .kind = (frame->mark == CANDUMP_SENT) ? (uint8_t)IW_CAN_ECHO : (uint8_t)IW_CAN_RECEIVED};
    core.id |= frame->extended ? IW_CAN_EXTENDED : 0U;
    core.id |= frame->remote ? IW_CAN_REMOTE : 0U;
    core.id |= frame->error ? IW_CAN_ERROR : 0U;
    core.id |= (frame->fd && !frame->extended) ? IW_CAN_FD : 0U;
    if (!frame->remote) {
        memcpy(core.data, frame->data, core.dlc);
    }
    return core;
}

candump_t candump_from_core(const iw_can_frame_t *frame, int64_t time_us, const char *interface) {
    const bool extended = (frame->id & IW_CAN_EXTENDED) != 0U;
    candump_t out = {.time_us = time_us,
                     .id = frame->id & (extended ? CANDUMP_ID_MASK : IW_CAN_ID_MASK),
                     .mark = (frame->kind == (uint8_t)IW_CAN_ECHO) ? CANDUMP_SENT : CANDUMP_RECEIVED,
                     .length = (frame->dlc < IW_CAN_DATA_MAX) ? frame->dlc : (uint8_t)IW_CAN_DATA_MAX,
                     .extended = extended,
                     .remote = (frame->id & IW_CAN_REMOTE) != 0U,
                     .fd = !extended && (frame->id & IW_CAN_FD) != 0U};
    const size_t length = strlen(interface);
    memcpy(out.data, frame->data, out.length);
    memcpy(out.interface, interface,
           (length < CANDUMP_INTERFACE_SIZE) ? length : CANDUMP_INTERFACE_SIZE - 1U); // The rest is zero.
    return out;
}
