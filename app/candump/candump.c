// SPDX-License-Identifier: MIT
#include "candump.h"

#include "candump_data.h"

#include "iwheel_northbound/text.h"

#include <string.h>

#define ERROR_FLAG 0x20000000U
/// Beyond the year 30000; and the sum in microseconds stays far inside 64 bits.
#define SECONDS_DIGITS  12U
#define FRACTION_DIGITS 9U
#define STANDARD_DIGITS 3U
#define EXTENDED_DIGITS 8U

static bool is_blank(char c) {
    return c == ' ' || c == '\t';
}

static bool skip_blanks(candump_cursor_t *cursor) {
    const char *begin = cursor->at;
    while (cursor->at < cursor->end && is_blank(*cursor->at)) {
        cursor->at++;
    }
    return cursor->at > begin;
}

/// How many decimal digits were taken into `*value`, of which no more than `counted` count.
static unsigned take_digits(candump_cursor_t *cursor, unsigned counted, int64_t *value) {
    unsigned digits = 0;
    for (; cursor->at < cursor->end && *cursor->at >= '0' && *cursor->at <= '9'; cursor->at++) {
        *value = (digits < counted) ? *value * 10 + (*cursor->at - '0') : *value;
        digits++;
    }
    return digits;
}

static const char *parse_time(candump_cursor_t *cursor, candump_t *frame) {
    static const int64_t scale[] = {1000000, 100000, 10000, 1000, 100, 10, 1};
    int64_t seconds = 0;
    int64_t fraction = 0;
    if (!candump_take(cursor, '(')) {
        return "does not begin with a time in parentheses; record with candump -L or iwheelctl record";
    }
    const unsigned digits = take_digits(cursor, SECONDS_DIGITS, &seconds);
    const bool dot = candump_take(cursor, '.');
    const unsigned decimals = dot ? take_digits(cursor, 6U, &fraction) : 0U;
    if (digits == 0U || digits > SECONDS_DIGITS || (dot && decimals == 0U) || decimals > FRACTION_DIGITS ||
        !candump_take(cursor, ')')) {
        return "the time is not (SECONDS.MICROSECONDS); record with candump -L or iwheelctl record";
    }
    frame->time_us = seconds * 1000000 + fraction * scale[(decimals < 6U) ? decimals : 6U];
    return NULL;
}

static const char *parse_interface(candump_cursor_t *cursor, candump_t *frame) {
    size_t length = 0;
    (void)skip_blanks(cursor);
    for (; cursor->at < cursor->end && !is_blank(*cursor->at); cursor->at++) {
        const unsigned char c = (unsigned char)*cursor->at;
        if (length + 1U >= CANDUMP_INTERFACE_SIZE || c < 0x21U || c == 0x7FU) {
            return "no interface name (at most 31 characters) behind the time; is the line damaged?";
        }
        frame->interface[length] = *cursor->at;
        length++;
    }
    if (!iwn_plain_text(frame->interface)) {
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

static const char *parse_id(candump_cursor_t *cursor, candump_t *frame) {
    uint32_t number = 0;
    unsigned digits = 0;
    for (; cursor->at < cursor->end && digits <= EXTENDED_DIGITS && candump_hex(*cursor->at) >= 0; cursor->at++) {
        number = number << 4U | (uint32_t)candump_hex(*cursor->at);
        digits++;
    }
    if (!candump_take(cursor, '#')) {
        return (digits > 0U && (cursor->at == cursor->end || is_blank(*cursor->at)))
                   ? "no # behind the id: this is candump's screen form; record with candump -L or iwheelctl record"
                   : "no hexadecimal id with a # behind it; is the line damaged?";
    }
    return take_id(frame, number, digits);
}

static const char *parse_mark(candump_cursor_t *cursor, candump_t *frame) {
    const bool apart = skip_blanks(cursor);
    if (cursor->at == cursor->end) {
        return NULL;
    }
    if (apart && (candump_take(cursor, 'R') || candump_take(cursor, 'r'))) {
        frame->mark = CANDUMP_RECEIVED;
    } else if (apart && (candump_take(cursor, 'T') || candump_take(cursor, 't'))) {
        frame->mark = CANDUMP_SENT;
    }
    (void)skip_blanks(cursor);
    return (cursor->at == cursor->end)
               ? NULL
               : "something follows the data that is neither R nor T nor a hexadecimal digit; delete it";
}

candump_result_t candump_parse(const char *line, size_t length, candump_t *out_frame, const char **out_why) {
    candump_t frame = {0};
    candump_cursor_t cursor = {line, line + length};
    while (cursor.end > cursor.at && (cursor.end[-1] == '\n' || cursor.end[-1] == '\r' || is_blank(cursor.end[-1]))) {
        cursor.end--;
    }
    (void)skip_blanks(&cursor);
    if (cursor.at == cursor.end || *cursor.at == '#' || *cursor.at == ';') {
        return CANDUMP_EMPTY;
    }
    const char *why = parse_time(&cursor, &frame);
    why = (why != NULL) ? why : parse_interface(&cursor, &frame);
    why = (why != NULL) ? why : parse_id(&cursor, &frame);
    why = (why != NULL) ? why : candump_parse_data(&cursor, &frame);
    why = (why != NULL) ? why : parse_mark(&cursor, &frame);
    if (why != NULL) {
        *out_why = why;
        return CANDUMP_BAD;
    }
    *out_frame = frame;
    return CANDUMP_FRAME;
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
