// SPDX-License-Identifier: MIT
#include "estop.h"

#include "board.h"
#include "cortex_m.h"
#include "pins.h"

#include <stdatomic.h>

// RM0008 10.3, RM0090 12.3: interrupt mask, event mask, rising, falling, software event, pending (writing 1 clears).
typedef struct {
    volatile uint32_t IMR, EMR, RTSR, FTSR, SWIER, PR;
} exti_t;

#define EXTI ((exti_t *)BRD_EXTI_ADDRESS)
#define LINE (1U << 0)

static atomic_bool had_edge; // Set by the interrupt.

void brd_estop_init(void) {
    EXTI->RTSR |= LINE;
    EXTI->FTSR |= LINE;
    EXTI->PR = LINE;
    EXTI->IMR |= LINE;
}

/// Any edge counts, also a falling one: after a short pulse the level, and even the first edge, may be gone (fault 12).
void brd_estop_on_edge(void) {
    EXTI->PR = LINE;
    atomic_store_explicit(&had_edge, true, memory_order_relaxed);
    brd_wake();
}

/// An edge between load and store is not lost, because this same call returns 1.
int brd_estop_pressed(void *context) {
    (void)context;
    if (atomic_load_explicit(&had_edge, memory_order_relaxed)) {
        atomic_store_explicit(&had_edge, false, memory_order_relaxed);
        return 1;
    }
    return brd_pins_estop_high() ? 1 : 0;
}
