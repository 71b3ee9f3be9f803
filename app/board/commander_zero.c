// SPDX-License-Identifier: MIT
#include "commander.h"

bool brd_commander_sends(void) {
    return true;
}

const char *brd_commander_name(void) {
    return "holds both wheels at zero";
}

void brd_commander_step(brd_commander_t *self, iw_gateway_t *gateway, iw_time_us_t now_us) {
    if (brd_commander_pressed(self, now_us)) {
        brd_commander_reset(gateway, now_us);
    }
    if (brd_commander_arm(self, gateway, now_us)) {
        (void)brd_commander_drive(gateway, now_us, 0);
    }
}
