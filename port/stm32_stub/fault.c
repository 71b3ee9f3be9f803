// SPDX-License-Identifier: MIT
#include "fault.h"

#include "cortex_m.h"

#define SCB_ICSR     (*(volatile uint32_t *)0xE000ED04U) // 4.4.3: VECTACTIVE.
#define SCB_CFSR     (*(volatile uint32_t *)0xE000ED28U) // 4.4.11
#define VECTACTIVE   0x1FFU
#define NUMBER_SHIFT 26U
#define FRAME_PC     6U // 2.4.7: r0 to r3, r12, lr, pc, xPSR.
#define FRAME_BYTES  32U

extern const char brd_link_stack_bottom[], brd_link_stack_top[];

// RAM does not contain such a triple after power-on.
__attribute__((section(".noinit"))) static volatile uint32_t cause, pc, check;

/// Only the assembly of the handler refers to it.
__attribute__((used)) void brd_fault_store(const uint32_t *frame) {
    const uint32_t size = (uint32_t)(brd_link_stack_top - brd_link_stack_bottom);
    const bool is_stored = (uint32_t)((const char *)frame - brd_link_stack_bottom) <= size - FRAME_BYTES;
    cause = (SCB_ICSR & VECTACTIVE) << NUMBER_SHIFT | SCB_CFSR;
    pc = is_stored ? frame[FRAME_PC] : 0U;
    check = ~(cause ^ pc);
    brd_system_reset();
}

brd_fault_t brd_fault_take(void) {
    brd_fault_t fault = {0, 0};
    if (check == ~(cause ^ pc)) {
        fault = (brd_fault_t){cause, pc};
    }
    cause = pc = 0;
    check = ~0U;
    return fault;
}
