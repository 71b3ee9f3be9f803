// SPDX-License-Identifier: MIT
#include "commander.h"

bool iw_commander_sends(void) {
    return true;
}

const char *iw_commander_words(void) {
    return "holds both wheels at zero";
}

void iw_commander_step(iw_commander_t *self, iw_gateway_t *gateway, iw_time_us_t now_us) {
    if (iw_commander_pressed(self, now_us)) {
        iw_commander_reset(gateway, now_us);
    }
    if (iw_commander_arm(self, gateway, now_us)) {
        (void)iw_commander_drive(gateway, now_us, 0);
    }
}
