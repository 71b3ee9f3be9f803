// SPDX-License-Identifier: MIT
#include "log_limit.h"

bool log_limit_pass(log_limit_t *self, uint64_t now_us, uint64_t *out_dropped) {
    *out_dropped = 0;
    if (self->since_us == 0U || now_us - self->since_us >= LOG_LIMIT_US) {
        *out_dropped = self->dropped;
        *self = (log_limit_t){.since_us = now_us};
    }
    if (self->lines >= LOG_LIMIT_LINES) {
        self->dropped++;
        return false;
    }
    self->lines++;
    return true;
}
