// SPDX-License-Identifier: MIT
#include "cortex_m.h"
#include "fault.h"

int main(void);
void brd_reset_handler(void);
void brd_systick_handler(void);
void brd_exti0_handler(void);
// can_bxcan.c defines the first three, can_fdcan.c the last one. An image enables only the interrupts that it has.
__attribute__((weak)) void brd_can_transmit_handler(void);
__attribute__((weak)) void brd_can_receive_handler(void);
__attribute__((weak)) void brd_can_error_handler(void);
__attribute__((weak)) void brd_can_handler(void);
// serial.c defines these handlers. An image without serial.c never enables their interrupts.
__attribute__((weak)) void brd_serial_usart_handler(void);
__attribute__((weak)) void brd_serial_receive_handler(void);
__attribute__((weak)) void brd_serial_transmit_handler(void);

extern uint32_t brd_link_stack_top[], brd_link_data_load[], brd_link_data_end[];
extern volatile uint32_t brd_link_data_start[];
extern uint32_t brd_link_bss_start[], brd_link_bss_end[];

/// Stores the cause and resets the chip after any fault, a failure of the crystal (NMI) or an unexpected exception. If
/// setpoints were being sent, the next run begins with zeros; see marker.h. A stack overflow ends here too (see
/// sections.ld), so the handler does not use the old stack. If the CPU cannot enter this handler without a stack, it
/// locks up, and the watchdog resets the chip.
__attribute__((naked)) static void fault_handler(void) {
    __asm volatile("mrs r0, msp\n ldr r1, =brd_link_stack_top\n msr msp, r1\n b brd_fault_store");
}

/// The NMI; flash_g4.c defines it for a chip that reports bad words of its flash by it.
__attribute__((weak, alias("fault_handler"))) void brd_nmi_handler(void);

typedef union {
    void (*handler)(void);
    uint32_t *stack_top;
} brd_vector_t;

#define SCB_VTOR   (*(const brd_vector_t *volatile *)0xE000ED08U) // PM0056 4.4.4
#define EXCEPTIONS 16
#define VECTORS    (EXCEPTIONS + BRD_IRQ_SERIAL + 1)

/// Vector table up to the last enabled interrupt. The exceptions without an entry cannot occur.
__attribute__((section(".vectors"), used)) static const brd_vector_t vectors[VECTORS] = {
    [0] = {.stack_top = brd_link_stack_top},
    [1] = {.handler = brd_reset_handler},
    [2] = {.handler = brd_nmi_handler},
    [3] = {.handler = fault_handler},
    [4] = {.handler = fault_handler},
    [5] = {.handler = fault_handler},
    [6] = {.handler = fault_handler},
    [11] = {.handler = fault_handler},
    [14] = {.handler = fault_handler},
    [15] = {.handler = brd_systick_handler},
    [EXCEPTIONS + BRD_IRQ_EXTI0] = {.handler = brd_exti0_handler},
    [EXCEPTIONS + BRD_IRQ_SERIAL_RECEIVE] = {.handler = brd_serial_receive_handler},
    [EXCEPTIONS + BRD_IRQ_SERIAL_TRANSMIT] = {.handler = brd_serial_transmit_handler},
    [EXCEPTIONS + BRD_IRQ_SERIAL] = {.handler = brd_serial_usart_handler},
    [EXCEPTIONS + BRD_IRQ_CAN_TRANSMIT] = {.handler = brd_can_transmit_handler},
    [EXCEPTIONS + BRD_IRQ_CAN_RECEIVE] = {.handler = brd_can_receive_handler},
    [EXCEPTIONS + BRD_IRQ_FDCAN] = {.handler = brd_can_handler},
    [EXCEPTIONS + BRD_IRQ_CAN_ERROR] = {.handler = brd_can_error_handler},
};

/// A boot loader may have left its own vector table in force, and interrupts masked. A chip that starts on its own has
/// this table at address 0.
void brd_reset_handler(void) {
    SCB_VTOR = vectors;
    // After a reset a G474 can lose the first write to its RAM, unless a read comes before (ES0430 2.2.7).
    (void)brd_link_data_start[0];
    const uint32_t *from = brd_link_data_load;
    for (volatile uint32_t *to = brd_link_data_start; to < brd_link_data_end; to++, from++) {
        *to = *from;
    }
    for (uint32_t *to = brd_link_bss_start; to < brd_link_bss_end; to++) {
        *to = 0;
    }
    __asm volatile("cpsie i");
    (void)main();
    brd_system_reset();
}
