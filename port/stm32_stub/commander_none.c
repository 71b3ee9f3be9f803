// SPDX-License-Identifier: MIT
#include "commander.h"

bool iw_commander_sends(void) {
    return false;
}

void iw_commander_step(iw_commander_t *self, iw_gateway_t *gateway, iw_time_us_t now_us) {
    (void)self;
    (void)gateway;
    (void)now_us;
}
