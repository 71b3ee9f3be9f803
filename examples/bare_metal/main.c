// SPDX-License-Identifier: MIT
// The smallest complete program with the core and without an operating system.
#include "board.h"
#include "first_drive.h"

int main(void) {
    static iw_gateway_t gateway; // 1.3 KiB: not on the stack.
    board_start();
    const iw_hal_t hal = board_hal();
    if (!first_drive_init(&gateway, &hal, board_time_us(), board_restarted())) {
        return 1;
    }
    for (;;) {
        const iw_time_us_t now_us = board_time_us();
        (void)first_drive_command(&gateway, now_us);
        const iw_time_us_t next_us = iw_gateway_step(&gateway, now_us);
        board_watchdog_feed();
        board_sleep_until(next_us);
    }
}
