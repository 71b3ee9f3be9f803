// SPDX-License-Identifier: MIT
#include "iwheel/private/rolling.h"

#include "arithmetic.h"

void iw_rolling_init(iw_rolling_t *self) {
    self->rolling = false;
    self->is_fault = false;
    self->since_us = IW_NEVER;
    self->setpoint_us = IW_NEVER;
}

void iw_rolling_step(iw_rolling_t *self, iw_time_us_t now_us, bool turns) {
    if (turns == self->rolling) {
        self->since_us = IW_NEVER;
        return;
    }
    if (self->since_us == IW_NEVER) {
        self->since_us = now_us;
    }
    if (iw_age_us(self->since_us, now_us) >= IW_ROLLING_US) {
        self->rolling = turns;
        self->is_fault = turns && iw_age_us(self->setpoint_us, self->since_us) < IW_ROLLING_AFTER_US;
        self->since_us = IW_NEVER;
    }
}
