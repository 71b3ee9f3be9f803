// SPDX-License-Identifier: MIT
#include "recorder.h"

#define FLUSH_US 1000000

bool recorder_put(recorder_t *self, const candump_t *frame, int64_t at_us) {
    char line[CANDUMP_LINE_SIZE];
    candump_t whole = *frame;
    whole.time_us = at_us + self->wall_minus_us;
    (void)snprintf(whole.interface, sizeof whole.interface, "%s", self->interface);
    const size_t length = candump_write(&whole, line);
    self->first_us = (self->frames == 0U) ? at_us : self->first_us;
    self->last_us = at_us;
    self->frames++;
    return fwrite(line, 1, length, self->file) == length;
}

bool recorder_tend(recorder_t *self) {
    const int64_t now_us = client_now_us();
    if (now_us - self->flushed_us < FLUSH_US) {
        return ferror(self->file) == 0;
    }
    self->flushed_us = now_us;
    return fflush(self->file) == 0;
}
