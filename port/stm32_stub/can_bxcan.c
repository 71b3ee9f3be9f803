// SPDX-License-Identifier: MIT
#include "can.h"

#include "bit_rate.h"
#include "bxcan.h"
#include "cortex_m.h"
#include "estop.h"

// A poll takes at least 4 cycles, and the longest frame with an error at its end takes 200 us. This number of polls
// takes at least 250 us and at most 1.5 ms.
#define ABORT_POLLS (BRD_CORE_HZ / 4U / 4000U)
#define CAN_RESET   (1U << 25) // In APB1RSTR of the RCC: RM0008 7.3.4 and RM0090 7.3.8.

void brd_can_transmit_handler(void);
void brd_can_receive_handler(void);
void brd_can_error_handler(void);

static brd_bxcan_t bus; // At file scope, because interrupt handlers have no argument.

const iw_hal_t brd_can_hal = {brd_bxcan_send,  brd_bxcan_receive, brd_bxcan_bus_state,
                              brd_bxcan_purge, brd_estop_pressed, &bus};

void brd_can_transmit_handler(void) {
    brd_bxcan_on_transmit(&bus);
    brd_wake();
}

void brd_can_receive_handler(void) {
    brd_bxcan_on_receive(&bus);
    brd_wake();
}

void brd_can_error_handler(void) {
    brd_bxcan_on_error(&bus);
    brd_wake();
}

void brd_can_start(bool silent) {
    const brd_bxcan_config_t config = {
        .registers = (brd_bxcan_registers_t *)BRD_BXCAN_ADDRESS,
        .filters = (brd_bxcan_registers_t *)BRD_BXCAN_ADDRESS,
        .bit_timing = BRD_BIT_BTR,
        .poll_limit = ABORT_POLLS,
        .silent = silent,
        .reset_register = (brd_register_t *)BRD_CAN_RESET_ADDRESS,
        .reset_bits = CAN_RESET,
    };
    brd_bxcan_init(&bus, &config);
    brd_irq_enable(BRD_IRQ_CAN_TRANSMIT);
    brd_irq_enable(BRD_IRQ_CAN_RECEIVE);
    brd_irq_enable(BRD_IRQ_CAN_ERROR);
}
