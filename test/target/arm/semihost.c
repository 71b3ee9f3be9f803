// SPDX-License-Identifier: MIT
// Start of a test program on an emulated Cortex-M: standard output and the exit status go through semihosting.
#include <stdint.h>
#include <stdlib.h>

int main(void);
void initialise_monitor_handles(void);
void test_reset_handler(void);

extern uint32_t link_stack_top[], link_bss_start[], link_bss_end[], link_data_start[], link_data_end[],
    link_data_load[];

static void fault_handler(void) {
    _Exit(2);
}

void test_reset_handler(void) {
    const uint32_t *from = link_data_load;
    for (uint32_t *to = link_data_start; to < link_data_end; to++, from++) {
        *to = *from;
    }
    for (uint32_t *to = link_bss_start; to < link_bss_end; to++) {
        *to = 0;
    }
    initialise_monitor_handles();
    exit(main());
}

typedef union {
    void (*handler)(void);
    uint32_t *stack_top;
} vector_t;

__attribute__((section(".vectors"), used)) static const vector_t vectors[16] = {
    [0] = {.stack_top = link_stack_top}, [1] = {.handler = test_reset_handler}, [2] = {.handler = fault_handler},
    [3] = {.handler = fault_handler},    [4] = {.handler = fault_handler},      [5] = {.handler = fault_handler},
    [6] = {.handler = fault_handler},    [11] = {.handler = fault_handler},     [14] = {.handler = fault_handler},
    [15] = {.handler = fault_handler},
};
