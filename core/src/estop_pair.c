// SPDX-License-Identifier: MIT
#include "iwheel/hal.h"

#include "arithmetic.h"

void iw_estop_pair_init(iw_estop_pair_t *self, uint32_t limit_us) {
    const iw_estop_pair_t pair = {.differ_us = IW_NEVER, .limit_us = limit_us};
    *self = pair;
}

static bool has_differed(const iw_estop_pair_t *self, iw_time_us_t now_us) {
    return self->differ_us != IW_NEVER && iw_age_us(self->differ_us, now_us) > self->limit_us;
}

/// Only a press of both contacts and its end show that both contacts work again.
static void follow(iw_estop_pair_t *self, bool one, bool both) {
    if (both) {
        self->proven = true;
    } else if (self->proven && !one) {
        self->disagrees = false;
    }
}

int iw_estop_pair_see(iw_estop_pair_t *self, iw_time_us_t now_us, int first, int second) {
    if (first < 0 || second < 0) {
        self->differ_us = IW_NEVER;
        self->proven = false;
        return -1;
    }
    const bool one = first > 0 || second > 0;
    const bool both = first > 0 && second > 0;
    if (one == both) {
        self->differ_us = IW_NEVER;
    } else if (self->differ_us == IW_NEVER) {
        self->differ_us = now_us;
    }
    // A press that shows the fault again proves nothing.
    if (has_differed(self, now_us)) {
        self->disagrees = true;
        self->proven = false;
    }
    follow(self, one, both);
    if (self->disagrees) {
        return IW_ESTOP_DISAGREES;
    }
    return one ? 1 : 0;
}

iw_time_us_t iw_estop_pair_next_us(const iw_estop_pair_t *self) {
    return (self->disagrees || self->differ_us == IW_NEVER) ? IW_NEVER : self->differ_us + self->limit_us + 1U;
}
