// SPDX-License-Identifier: MIT
// A board for qemu's mps2-an386 (Cortex-M4): pretended wheels, and a clock that advances while the program sleeps. After
// five seconds of that clock the program sends the result to the debugger (semihosting), and the emulation ends.
#include "board.h"
#include "pretend_wheels.h"

#define SYS_WRITE0 0x04U
#define SYS_EXIT   0x18U
#define EXIT_OK    0x20026U // ADP_Stopped_ApplicationExit
#define EXIT_BAD   0x20023U // ADP_Stopped_RunTimeError
#define END_us     5000000U

extern uint32_t link_stack_top[], link_bss_start[], link_bss_end[], link_data_start[], link_data_end[],
    link_data_load[];
int main(void);
void reset_handler(void);

static pretend_wheels_t wheels;
static iw_time_us_t time_us;

static void semihost(uint32_t operation, uintptr_t argument) {
    register uint32_t r0 __asm__("r0") = operation;
    register uintptr_t r1 __asm__("r1") = argument;
    __asm__ volatile("bkpt 0xAB" : "+r"(r0) : "r"(r1) : "memory");
}

static void end(bool good) {
    semihost(SYS_WRITE0, (uintptr_t)(good ? "drove at 200 mm/s and stopped\n" : "did not drive and stop\n"));
    semihost(SYS_EXIT, good ? EXIT_OK : EXIT_BAD);
}

static void fault_handler(void) {
    end(false);
}

void reset_handler(void) {
    const uint32_t *from = link_data_load;
    for (uint32_t *to = link_data_start; to < link_data_end; ++to, ++from) {
        *to = *from;
    }
    for (uint32_t *to = link_bss_start; to < link_bss_end; to++) {
        *to = 0;
    }
    (void)main();
    end(false);
}

typedef union {
    void (*handler)(void);
    uint32_t *stack_top;
} vector_t;

__attribute__((section(".vectors"), used)) static const vector_t vectors[] = {
    {.stack_top = link_stack_top}, {.handler = reset_handler}, {.handler = fault_handler}, {.handler = fault_handler}};

void board_start(void) {}

iw_time_us_t board_time_us(void) {
    return time_us;
}

iw_hal_t board_hal(void) {
    return pretend_wheels_hal(&wheels);
}

bool board_restarted(void) {
    return false;
}

void board_watchdog_feed(void) {}

void board_sleep_until(iw_time_us_t until_us) {
    const iw_time_us_t frame_us = time_us + IW_US_PER_MS;
    time_us = (until_us < frame_us && until_us > time_us) ? until_us : frame_us;
    pretend_wheels_run(&wheels);
    if (time_us >= END_us) {
        end(wheels.fastest_mm_s == 200 && wheels.speed_mm_s[IW_LEFT] == 0 && wheels.speed_mm_s[IW_RIGHT] == 0);
    }
}
