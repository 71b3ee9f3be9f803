// SPDX-License-Identifier: MIT
/// Gateway on bare metal: one loop around the core. It sleeps until there is something to do.
#include "board_clock.h"
#include "can.h"
#include "commander.h"
#include "console.h"
#include "cortex_m.h"
#include "estop.h"
#include "iwheel/gateway.h"
#include "lamp.h"
#include "marker.h"
#include "pins.h"
#include "report.h"
#include "watchdog.h"

// Time after which a crystal that has not started is reported.
#define CRYSTAL_LATE_US 100000U
// Period of the loop while text waits.
#define CHARACTER_US 1000U

void brd_exti0_handler(void);

void brd_exti0_handler(void) {
    brd_estop_on_edge();
}

/// Tries until the crystal runs. Until then the internal oscillator counts the time; lamp and console report the state.
static void wait_for_crystal(void) {
    bool is_reported = false;
    brd_time_start(BRD_INTERNAL_HZ);
    brd_console_start(BRD_INTERNAL_HZ);
    while (!brd_clock_start()) {
        if (!is_reported && brd_time_now_us() > CRYSTAL_LATE_US) {
            is_reported = true;
            brd_report_no_crystal();
        }
        (void)brd_console_step();
        brd_pins_lamp(brd_lamp_is_lit(BRD_LAMP_NO_CRYSTAL, brd_time_now_us()));
        brd_watchdog_feed();
    }
    brd_time_start(BRD_CORE_HZ);
    brd_console_start(BRD_APB1_HZ);
}

static iw_config_t configuration(void) {
    iw_config_t config;
    iw_config_default(&config);
    config.setpoint_type = IWHEEL_SETPOINT_TYPE_VALUE;
    config.setpoint_type_set = IWHEEL_SETPOINT_TYPE_IS_SET;
    config.current_role = IWHEEL_CURRENT_ROLE_VALUE;
    config.track_mm = IWHEEL_TRACK_MM_VALUE;
    brd_commander_configure(&config);
    return config;
}

static bool start_gateway(iw_gateway_t *gateway, const iw_config_t *config, bool restarted) {
    const iw_bus_facts_t facts = {.timing_contradicted = false, .echo_proven = true};
    if (iw_gateway_init(gateway, config, &brd_can_hal, brd_time_now_us(), restarted) != IW_CONFIG_OK) {
        return false;
    }
    iw_gateway_bus_facts(gateway, &facts);
    return true;
}

/// Steps the gateway before and after the commander, because a request and a report can each take milliseconds, and the
/// e-stop is read between any two of them. The watchdog is fed at the end: only a complete cycle counts as alive (fault
/// 26).
static void cycle(iw_gateway_t *gateway, brd_commander_t *commander) {
    iw_time_us_t now_us = brd_time_now_us();
    (void)iw_gateway_step(gateway, now_us);
    brd_commander_step(commander, gateway, now_us);
    now_us = brd_time_now_us();
    const iw_time_us_t next_us = iw_gateway_step(gateway, now_us);
    const bool estop_high = brd_pins_estop_high();
    iw_snapshot_t *const seen = brd_report_room(); // Not on the stack, which it would nearly double.
    iw_gateway_snapshot(gateway, now_us, seen);
    brd_marker_step(seen);
    brd_pins_lamp(brd_lamp_is_lit(brd_lamp_pattern(seen, estop_high), now_us));
    brd_report_step(seen, estop_high);
    const bool more = brd_console_step();
    brd_watchdog_feed();
    brd_sleep_until((more && next_us > now_us + CHARACTER_US) ? now_us + CHARACTER_US : next_us);
}

/// Returns only if the configuration is wrong, which the tests of the image exclude.
int main(void) {
    static iw_gateway_t gateway;
    static brd_commander_t commander;
    const bool power_on = brd_clock_was_power_on();
    const bool restarted = brd_marker_take();
    brd_commander_open(power_on, restarted);
    brd_watchdog_start();
    brd_pins_init();
    wait_for_crystal();
    brd_estop_init();
    brd_irq_enable(BRD_IRQ_EXTI0);
    const iw_config_t config = configuration();
    // An image that only listens must not acknowledge: another master would count frames as received that no wheel has
    // received.
    brd_can_start(!brd_commander_sends());
    if (!start_gateway(&gateway, &config, restarted)) {
        return 1;
    }
    brd_report_start(restarted);
    for (;;) {
        cycle(&gateway, &commander);
    }
}
