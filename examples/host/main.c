// SPDX-License-Identifier: MIT
// The smallest complete program around the core, on a PC: no clock (time is a number that grows), no hardware.
#include "first_drive.h"
#include "pretend_wheels.h"

#include <stdio.h>

int main(void) {
    static const char *const names[] = {"listening", "armed", "stopping", "latched"};
    static iw_gateway_t gateway;
    static pretend_wheels_t wheels;
    const iw_hal_t hal = pretend_wheels_hal(&wheels);
    if (!first_drive_init(&gateway, &hal, 0, false)) {
        return 1;
    }
    iw_state_t before = iw_gateway_state(&gateway);
    iw_refusal_t refused = IW_REFUSE_NONE;
    for (iw_time_us_t now_us = 0; now_us < 5000000U; now_us += IW_US_PER_MS) {
        pretend_wheels_run(&wheels);
        const iw_refusal_t refusal = first_drive_command(&gateway, now_us);
        if (refusal != IW_REFUSE_NONE && refusal != refused) {
            (void)printf("%4u ms  refused: %s\n", (unsigned)(now_us / IW_US_PER_MS), iw_refusal_text(refusal));
        }
        refused = refusal;
        (void)iw_gateway_step(&gateway, now_us);
        const iw_state_t state = iw_gateway_state(&gateway);
        if (state != before) {
            (void)printf("%4u ms  %-9s  left wheel %d mm/s\n", (unsigned)(now_us / IW_US_PER_MS), names[state],
                         wheels.speed_mm_s[IW_LEFT]);
            before = state;
        }
    }
    (void)printf("fastest: %d mm/s, now: %d mm/s\n", wheels.fastest_mm_s, wheels.speed_mm_s[IW_LEFT]);
    return (wheels.fastest_mm_s == 200 && wheels.speed_mm_s[IW_LEFT] == 0 && before == IW_STATE_LISTENING) ? 0 : 1;
}
