// SPDX-License-Identifier: MIT
#include "candump_data.h"

int candump_hex(char digit) {
    if (digit >= '0' && digit <= '9') {
        return digit - '0';
    }
    if (digit >= 'A' && digit <= 'F') {
        return digit - 'A' + 10;
    }
    return (digit >= 'a' && digit <= 'f') ? digit - 'a' + 10 : -1;
}

static int next_hex(const candump_cursor_t *cursor, size_t ahead) {
    return ((size_t)(cursor->end - cursor->at) > ahead) ? candump_hex(cursor->at[ahead]) : -1;
}

bool candump_take(candump_cursor_t *cursor, char wanted) {
    if (cursor->at == cursor->end || *cursor->at != wanted) {
        return false;
    }
    cursor->at++;
    return true;
}

static const char *parse_bytes(candump_cursor_t *cursor, size_t most, candump_t *frame) {
    while (next_hex(cursor, 0) >= 0) {
        const int low = next_hex(cursor, 1);
        if (low < 0) {
            return "an odd number of data digits; a byte has two: is the line cut?";
        }
        if (frame->length == most) {
            return "more data than a frame holds; CAN FD data stands behind ##";
        }
        frame->data[frame->length] = (uint8_t)(next_hex(cursor, 0) * 16 + low);
        frame->length++;
        cursor->at += 2;
        (void)candump_take(cursor, '.'); // cansend's way of writing it.
    }
    return NULL;
}

/// `_9`.. `_F` behind 8 bytes: the length code as it was on the bus. It means 8 all the same.
static const char *parse_raw_dlc(candump_cursor_t *cursor, const candump_t *frame) {
    if (!candump_take(cursor, '_')) {
        return NULL;
    }
    if (frame->length != IW_CAN_DATA_MAX || next_hex(cursor, 0) <= (int)IW_CAN_DATA_MAX) {
        return "a length code (_9 to _F) stands only behind 8 bytes; delete it";
    }
    cursor->at++;
    return NULL;
}

static const char *parse_remote(candump_cursor_t *cursor, candump_t *frame) {
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

static const char *parse_fd(candump_cursor_t *cursor, candump_t *frame) {
    const int flags = next_hex(cursor, 0);
    frame->fd = true;
    if (flags < 0) {
        return "a CAN FD frame has one digit of flags behind ##; is the line cut?";
    }
    frame->fd_flags = (uint8_t)flags;
    cursor->at++;
    return parse_bytes(cursor, CANDUMP_DATA_MAX, frame);
}

const char *candump_parse_data(candump_cursor_t *cursor, candump_t *frame) {
    if (candump_take(cursor, '#')) {
        return parse_fd(cursor, frame);
    }
    if (candump_take(cursor, 'R') || candump_take(cursor, 'r')) {
        return parse_remote(cursor, frame);
    }
    const char *why = parse_bytes(cursor, IW_CAN_DATA_MAX, frame);
    return (why != NULL) ? why : parse_raw_dlc(cursor, frame);
}
