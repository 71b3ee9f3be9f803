// SPDX-License-Identifier: MIT
#include "commander.h"

bool brd_commander_sends(void) {
    return false;
}

const char *brd_commander_name(void) {
    return "listens and sends nothing";
}

void brd_commander_step(brd_commander_t *self, iw_gateway_t *gateway, iw_time_us_t now_us) {
    if (brd_commander_pressed(self, now_us)) {
        brd_commander_reset(gateway, now_us);
    }
}
