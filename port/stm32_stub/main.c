// SPDX-License-Identifier: MIT
/// The gateway on bare metal, as far as it goes: clock, bus, e-stop and watchdog are real and the core runs on them.
///
/// Not there yet: a way to configure it and to command it, so it listens and never arms (setpoint type and current role are unknown);
/// sleep between steps; a receive buffer behind the controller's three-deep FIFO, which is why it does not sleep.
#include "board.h"
#include "bxcan.h"
#include "iwheel/gateway.h"

static void run(bool restarted) {
    static iw_bxcan_t bus;
    static iw_gateway_t gateway;
    iw_config_t config;
    const iw_hal_t hal = {iw_bxcan_send,  iw_bxcan_receive,       iw_bxcan_bus_state,
                          iw_bxcan_purge, iw_board_estop_pressed, &bus};
    const iw_bus_facts_t facts = {.timing_contradicted = false, .echo_proven = true};
    iw_config_default(&config);
    if (!iw_bxcan_init(&bus) ||
        iw_gateway_init(&gateway, &config, &hal, iw_board_now_us(), restarted) != IW_CONFIG_OK) {
        return;
    }
    iw_gateway_bus_facts(&gateway, &facts);
    for (;;) {
        (void)iw_gateway_step(&gateway, iw_board_now_us());
        iw_board_watchdog_feed();
    }
}

int main(void) {
    const bool restarted = iw_board_was_reset_by_watchdog();
    iw_board_watchdog_start();
    if (iw_board_init()) {
        iw_board_watchdog_feed();
        run(restarted);
    }
    return 1; // The watchdog starts us again: a late crystal is waited for, a missing one leaves the bus alone.
}
