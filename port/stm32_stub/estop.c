// SPDX-License-Identifier: MIT
#include "estop.h"

#include "board.h"
#include "cortex_m.h"
#include "pins.h"

#include <stdatomic.h>

// RM0008 10.3, RM0090 12.3: interrupt mask, event mask, rising, falling, software event, pending (written 1: cleared).
typedef struct {
    volatile uint32_t IMR, EMR, RTSR, FTSR, SWIER, PR;
} exti_t;

#define EXTI ((exti_t *)IW_BOARD_EXTI_ADDRESS)
#define LINE (1U << 0)

static atomic_uint edges; // Counted by the interrupt.

void iw_estop_init(void) {
    EXTI->RTSR |= LINE;
    EXTI->FTSR |= LINE;
    EXTI->PR = LINE;
    EXTI->IMR |= LINE;
}

void iw_estop_on_edge(void) {
    EXTI->PR = LINE;
    atomic_store_explicit(&edges, atomic_load_explicit(&edges, memory_order_relaxed) + 1U, memory_order_relaxed);
    iw_wake();
}

int iw_estop_pressed(void *context) {
    static unsigned edges_told;
    (void)context;
    const unsigned now = atomic_load_explicit(&edges, memory_order_relaxed);
    const bool edge = now != edges_told;
    edges_told = now;
    return (edge || iw_pins_estop_high()) ? 1 : 0;
}
