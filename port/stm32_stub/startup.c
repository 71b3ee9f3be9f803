// SPDX-License-Identifier: MIT
#include <stdint.h>

int main(void);
void iw_systick_handler(void);
void iw_reset_handler(void);

extern uint32_t iw_link_stack_top[], iw_link_data_load[], iw_link_data_start[], iw_link_data_end[];
extern uint32_t iw_link_bss_start[], iw_link_bss_end[];

/// Any fault, and the failure of the crystal (NMI): the watchdog ends it, and the next start sends zeros.
static void wait_for_watchdog(void) {
    for (;;) {
    }
}

void iw_reset_handler(void) {
    const uint32_t *from = iw_link_data_load;
    for (uint32_t *to = iw_link_data_start; to < iw_link_data_end; to++, from++) {
        *to = *from;
    }
    for (uint32_t *to = iw_link_bss_start; to < iw_link_bss_end; to++) {
        *to = 0;
    }
    (void)main();
    wait_for_watchdog();
}

typedef union {
    void (*handler)(void);
    uint32_t *stack_top;
} iw_vector_t;

/// The sixteen vectors of the core. No interrupt of a peripheral is enabled, so their vectors do not exist.
__attribute__((section(".vectors"), used)) static const iw_vector_t vectors[16] = {
    {.stack_top = iw_link_stack_top},      {.handler = iw_reset_handler},
    {.handler = wait_for_watchdog},        {.handler = wait_for_watchdog},
    {.handler = wait_for_watchdog},        {.handler = wait_for_watchdog},
    {.handler = wait_for_watchdog},        [11] = {.handler = wait_for_watchdog},
    [14] = {.handler = wait_for_watchdog}, [15] = {.handler = iw_systick_handler},
};
