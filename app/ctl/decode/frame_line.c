// SPDX-License-Identifier: MIT
#include "frame_line.h"

#include <inttypes.h>
#include <stdio.h>

const char *frame_direction(const candump_t *frame) {
    return (frame->mark == CANDUMP_SENT) ? "T" : (frame->mark == CANDUMP_RECEIVED) ? "R" : "";
}

void frame_print_bytes(const candump_t *frame, const char *gap) {
    for (size_t i = 0; i < frame->length && !frame->remote; i++) {
        (void)printf("%s%02X", (i > 0U) ? gap : "", frame->data[i]);
    }
}

void frame_print(const char *time_text, const candump_t *frame, const decoded_t *decoded) {
    (void)printf("%12s  %4" PRIu32 " (0x%0*" PRIX32 ")%-2s %-5s %-8s  ", time_text, frame->id, frame->extended ? 8 : 3,
                 frame->id, (frame->mark == CANDUMP_SENT) ? " T" : "", decoded->wheel, decoded->message);
    if (decoded->present != 0U) {
        field_print_all(decoded, stdout);
    } else {
        (void)printf("%s%s%u byte%s%s", frame->remote ? "remote, " : "", frame->fd ? "CAN FD, " : "", frame->length,
                     (frame->length == 1U) ? "" : "s", (frame->length > 0U && !frame->remote) ? ": " : "");
        frame_print_bytes(frame, " ");
    }
    (void)printf("%s%s%s\n", (decoded->note[0] != '\0') ? " (" : "", decoded->note,
                 (decoded->note[0] != '\0') ? ")" : "");
}
