// SPDX-License-Identifier: MIT
/// The gateway on bare metal: one loop around the core that sleeps until there is something to do.
#include "bit_rate.h"
#include "bxcan.h"
#include "clock.h"
#include "commander.h"
#include "cortex_m.h"
#include "estop.h"
#include "iwheel/gateway.h"
#include "lamp.h"
#include "marker.h"
#include "pins.h"
#include "watchdog.h"

// A poll takes 4 cycles at the least, and the longest frame 160 us: 1 ms is plenty.
#define ABORT_POLLS (IW_BOARD_CORE_HZ / 4U / 1000U)

void iw_exti0_handler(void);
void iw_can_transmit_handler(void);
void iw_can_receive_handler(void);
void iw_can_error_handler(void);

static iw_bxcan_t bus; // The interrupts' handlers have no argument to bring it.

void iw_exti0_handler(void) {
    iw_estop_on_edge();
}

void iw_can_transmit_handler(void) {
    iw_bxcan_on_transmit(&bus);
    iw_wake();
}

void iw_can_receive_handler(void) {
    iw_bxcan_on_receive(&bus);
    iw_wake();
}

void iw_can_error_handler(void) {
    iw_bxcan_on_error(&bus);
    iw_wake();
}

/// Tries until the crystal runs; meanwhile time is counted on the internal oscillator, and the lamp tells.
static void wait_for_crystal(void) {
    iw_time_start(IW_BOARD_INTERNAL_HZ);
    while (!iw_clock_start()) {
        iw_pins_lamp(iw_lamp_is_lit(IW_LAMP_NO_CRYSTAL, iw_time_now_us()));
        iw_watchdog_feed();
    }
    iw_time_start(IW_BOARD_CORE_HZ);
}

static void start_bus(void) {
    const iw_bxcan_config_t config = {
        .registers = (iw_bxcan_registers_t *)IW_BOARD_BXCAN_ADDRESS,
        .filters = (iw_bxcan_registers_t *)IW_BOARD_BXCAN_ADDRESS,
        .bit_timing = IW_BIT_BTR,
        .poll_limit = ABORT_POLLS,
        .silent = !iw_commander_sends(),
    };
    iw_bxcan_init(&bus, &config);
    iw_irq_enable(IW_IRQ_CAN_TRANSMIT);
    iw_irq_enable(IW_IRQ_CAN_RECEIVE);
    iw_irq_enable(IW_IRQ_CAN_ERROR);
}

static bool start_gateway(iw_gateway_t *gateway, bool restarted) {
    static const iw_hal_t hal = {iw_bxcan_send,  iw_bxcan_receive, iw_bxcan_bus_state,
                                 iw_bxcan_purge, iw_estop_pressed, &bus};
    const iw_bus_facts_t facts = {.timing_contradicted = false, .echo_proven = true};
    iw_config_t config;
    iw_config_default(&config);
    config.setpoint_type = IWHEEL_SETPOINT_TYPE_VALUE;
    config.setpoint_type_set = IWHEEL_SETPOINT_TYPE_IS_SET;
    config.current_role = IWHEEL_CURRENT_ROLE_VALUE;
    if (iw_gateway_init(gateway, &config, &hal, iw_time_now_us(), restarted) != IW_CONFIG_OK) {
        return false;
    }
    iw_gateway_bus_facts(gateway, &facts);
    return true;
}

static void cycle(iw_gateway_t *gateway, iw_commander_t *commander) {
    const iw_time_us_t now_us = iw_time_now_us();
    iw_commander_step(commander, gateway, now_us);
    const iw_time_us_t next_us = iw_gateway_step(gateway, now_us);
    iw_marker_set(iw_permit_demand(&gateway->permit) != IW_DEMAND_SILENCE);
    iw_pins_lamp(iw_lamp_is_lit(iw_lamp_pattern(gateway, iw_pins_estop_high()), now_us));
    iw_watchdog_feed();
    iw_sleep_until(next_us);
}

/// Returns only if the configuration is wrong, which the tests of the image exclude.
int main(void) {
    static iw_gateway_t gateway;
    static iw_commander_t commander;
    const bool restarted = iw_marker_take(iw_clock_was_power_on());
    iw_watchdog_start();
    iw_pins_init();
    wait_for_crystal();
    iw_estop_init();
    iw_irq_enable(IW_IRQ_EXTI0);
    start_bus();
    if (!start_gateway(&gateway, restarted)) {
        return 1;
    }
    for (;;) {
        cycle(&gateway, &commander);
    }
}
