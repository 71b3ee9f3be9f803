// SPDX-License-Identifier: MIT
#include "can.h"

#include "bit_rate.h"
#include "cortex_m.h"
#include "estop.h"
#include "fdcan.h"

// A poll takes at least 8 cycles, and the longest frame with an error at its end takes 200 us. This number of polls
// takes at least 250 us and at most 1.5 ms.
#define CANCEL_POLLS (BRD_CORE_HZ / 8U / 4000U)
#define FDCAN_RESET  (1U << 25) // In APB1RSTR1 of the RCC: RM0440 7.4.

void brd_can_handler(void);

static brd_fdcan_t bus; // At file scope, because interrupt handlers have no argument.

const iw_hal_t brd_can_hal = {brd_fdcan_send,  brd_fdcan_receive, brd_fdcan_bus_state,
                              brd_fdcan_purge, brd_estop_pressed, &bus};

void brd_can_handler(void) {
    brd_fdcan_on_interrupt(&bus);
    brd_wake();
}

void brd_can_start(bool silent) {
    const brd_fdcan_config_t config = {
        .registers = (brd_fdcan_registers_t *)BRD_FDCAN_ADDRESS,
        .ram = (brd_fdcan_ram_t *)BRD_FDCAN_RAM_ADDRESS,
        .bit_timing = BRD_BIT_BTR,
        .poll_limit = CANCEL_POLLS,
        .silent = silent,
        .reset_register = (brd_register_t *)BRD_CAN_RESET_ADDRESS,
        .reset_bits = FDCAN_RESET,
    };
    brd_fdcan_init(&bus, &config);
    brd_irq_enable(BRD_IRQ_FDCAN);
}
