// SPDX-License-Identifier: MIT
#include "cortex_m.h"

#include <stdatomic.h>

#define SYST_CSR  (*(volatile uint32_t *)0xE000E010U) // 4.5.1: enable, interrupt, core clock.
#define SYST_RVR  (*(volatile uint32_t *)0xE000E014U)
#define SYST_CVR  (*(volatile uint32_t *)0xE000E018U)
#define NVIC_ISER ((volatile uint32_t *)0xE000E100U)  // 4.3.2
#define SCB_ICSR  (*(volatile uint32_t *)0xE000ED04U) // 4.4.3: PENDSTSET.
#define SCB_AIRCR (*(volatile uint32_t *)0xE000ED0CU) // 4.4.5: key and SYSRESETREQ.
#define PENDSTSET (1U << 26)

void brd_systick_handler(void);

// Interrupt handlers write these variables. They have no argument, so the variables have file scope.
static volatile uint64_t ticks_ms;
static volatile uint32_t ticks_slept; // Lower half of ticks_ms, which one access reads.
static atomic_bool is_woken;
static uint32_t cycles_per_us = 1;

/// A handler that returns before its last write has arrived can make the CPU enter the wrong handler (ES0430 2.1.3: Arm
/// erratum 838869). It would then lose a tick.
static void finish_writes(void) {
    __asm volatile("dsb" ::: "memory");
}

void brd_systick_handler(void) {
    ticks_ms++;
    ticks_slept++;
    finish_writes();
}

void brd_irq_enable(brd_irq_t irq) {
    NVIC_ISER[(uint32_t)irq / 32U] = 1UL << ((uint32_t)irq % 32U);
}

void brd_time_start(uint32_t core_hz) {
    cycles_per_us = core_hz / 1000000U;
    SYST_RVR = core_hz / 1000U - 1U;
    SYST_CVR = 0;
    SYST_CSR = 7U;
}

/// Repeats the reads if a tick came between them: either the handler has counted it, or it is still pending.
iw_time_us_t brd_time_now_us(void) {
    uint64_t now_ms;
    uint32_t left;
    do {
        now_ms = ticks_ms;
        left = SYST_CVR;
    } while ((SCB_ICSR & PENDSTSET) != 0U || now_ms != ticks_ms);
    return now_ms * IW_US_PER_MS + (SYST_RVR - left) / cycles_per_us;
}

void brd_wake(void) {
    atomic_store_explicit(&is_woken, true, memory_order_relaxed);
    finish_writes();
}

/// WFI also returns for an interrupt that is pending but masked, so none is missed between the check and the sleep.
static void sleep_unless_woken(uint32_t tick) {
    __asm volatile("cpsid i" ::: "memory");
    if (!atomic_load_explicit(&is_woken, memory_order_relaxed) && ticks_slept == tick) {
        __asm volatile("dsb\n wfi" ::: "memory");
    }
    __asm volatile("cpsie i\n isb" ::: "memory");
}

void brd_sleep_until(iw_time_us_t until_us) {
    for (;;) {
        const uint32_t tick = ticks_slept;
        if (atomic_load_explicit(&is_woken, memory_order_relaxed) || brd_time_now_us() >= until_us) {
            break;
        }
        sleep_unless_woken(tick);
    }
    atomic_store_explicit(&is_woken, false, memory_order_relaxed);
}

void brd_system_reset(void) {
    __asm volatile("dsb" ::: "memory");
    SCB_AIRCR = 0x05FA0004U;
    __asm volatile("dsb" ::: "memory");
    for (;;) {
    }
}
