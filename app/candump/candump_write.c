// SPDX-License-Identifier: MIT
#include "candump.h"

#include <inttypes.h>
#include <stdio.h>

#define ERROR_FLAG 0x20000000U

/// cantools takes letters and digits only.
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
