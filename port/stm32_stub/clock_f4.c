// SPDX-License-Identifier: MIT
// Sections are those of RM0090: 7 reset and clock control, 3 flash. RM0390 (F446) has the same registers.
#include "clock.h"

#include "board.h"

#include <assert.h>

typedef struct {
    volatile uint32_t CR, PLLCFGR, CFGR;
} rcc_t;

#define RCC       ((rcc_t *)0x40023800U)
#define RCC_CSR   (*(volatile uint32_t *)0x40023874U)
#define FLASH_ACR (*(volatile uint32_t *)0x40023C00U)

#define HSEON         (1U << 16) // 7.3.1 RCC_CR
#define HSERDY        (1U << 17)
#define HSEBYP        (1U << 18)
#define CSSON         (1U << 19)
#define PLLON         (1U << 24)
#define PLLRDY        (1U << 25)
#define PLLSRC_HSE    (1U << 22) // 7.3.2 RCC_PLLCFGR
#define PLLR_LEAST    (2U << 28) // F446: not used, but 0 is not allowed. Others: reserved, as after reset.
#define SW            3U         // 7.3.3 RCC_CFGR
#define SW_PLL        2U
#define SWS           (3U << 2)
#define SWS_PLL       (2U << 2)
#define PPRE1_QUARTER (5U << 10)
#define PPRE2_HALF    (4U << 13)
#define LATENCY       0xFU // FLASH_ACR
#define PRFTEN        (1U << 8)
#define ICEN          (1U << 9)
#define DCEN          (1U << 10)
#define RMVF          (1U << 24) // 7.3.21 RCC_CSR
#define PORRSTF       (1U << 27)

#define CRYSTAL_INPUT (IW_BOARD_CRYSTAL_IS_CLOCK != 0 ? HSEBYP : 0U)

// A poll takes 8 cycles at the least, at 16 MHz: 1 ms. The PLL needs 0.3 ms at the most; the crystal goes on starting
// between the calls.
#define POLLS_MAX (IW_BOARD_INTERNAL_HZ / 8U / 1000U)

static_assert(IW_BOARD_CRYSTAL_HZ >= IW_BOARD_CRYSTAL_MIN_HZ && IW_BOARD_CRYSTAL_HZ <= IW_BOARD_CRYSTAL_MAX_HZ &&
                  IW_BOARD_PLL_INPUT_HZ * IW_BOARD_PLL_M == IW_BOARD_CRYSTAL_HZ,
              "this crystal cannot give the bus exactly: 1 to 2 MHz that divide it and 320 MHz must go into the PLL "
              "(7.3.2). Take any "
              "whole MHz from 4 to 26, or 12.5 or 19.2 MHz (-DIWHEEL_CRYSTAL_HZ=25000000)");
static_assert(IW_BOARD_PLL_M >= 2U && IW_BOARD_PLL_M <= 63U && IW_BOARD_PLL_N >= 50U && IW_BOARD_PLL_N <= 432U,
              "7.3.2");
static_assert(IW_BOARD_PLL_INPUT_HZ * IW_BOARD_PLL_N / IW_BOARD_PLL_P == IW_BOARD_CORE_HZ, "the PLL's output");
static_assert(IW_BOARD_CORE_HZ <= 168000000U, "faster needs overdrive, and an F407 cannot");
static_assert(IW_BOARD_APB1_HZ * 4U == IW_BOARD_CORE_HZ, "PPRE1_QUARTER is what is written");

/// Every wait on a flag is bounded: a crystal that is broken must end in a message, not in a dead loop.
static bool wait_for(const volatile uint32_t *flags, uint32_t mask, uint32_t value) {
    for (uint32_t poll = 0; poll < POLLS_MAX; poll++) {
        if ((*flags & mask) == value) {
            return true;
        }
    }
    return false;
}

// The voltage scale stays as it is after reset: 1, good for 168 MHz (5.4.1).
static bool try_start(void) {
    RCC->CR |= CRYSTAL_INPUT; // 7.2.1: the input's kind only while it is off.
    RCC->CR |= HSEON;
    if (!wait_for(&RCC->CR, HSERDY, HSERDY)) {
        return false;
    }
    FLASH_ACR = PRFTEN | ICEN | DCEN | IW_BOARD_FLASH_WAIT_STATES; // 3.5.1: before the clock rises, and read back.
    if (!wait_for(&FLASH_ACR, LATENCY, IW_BOARD_FLASH_WAIT_STATES)) {
        return false;
    }
    RCC->PLLCFGR = PLLR_LEAST | (IW_BOARD_PLL_Q << 24) | PLLSRC_HSE | ((IW_BOARD_PLL_P / 2U - 1U) << 16) |
                   (IW_BOARD_PLL_N << 6) | IW_BOARD_PLL_M;
    RCC->CFGR = PPRE1_QUARTER | PPRE2_HALF; // AHB is not divided.
    RCC->CR |= PLLON;
    if (!wait_for(&RCC->CR, PLLRDY, PLLRDY)) {
        return false;
    }
    RCC->CFGR |= SW_PLL;
    return wait_for(&RCC->CFGR, SWS, SWS_PLL);
}

/// The crystal stays on after a failure: one that needs longer goes on starting while the call is repeated.
bool iw_clock_start(void) {
    if (try_start()) {
        RCC->CR |= CSSON; // 7.2.7: a failing crystal raises the NMI and the internal oscillator takes over.
        return true;
    }
    RCC->CFGR &= ~SW;
    RCC->CR &= ~PLLON;
    return false;
}

bool iw_clock_was_power_on(void) {
    const bool was = (RCC_CSR & PORRSTF) != 0U;
    RCC_CSR |= RMVF;
    return was;
}
