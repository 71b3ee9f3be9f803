// SPDX-License-Identifier: MIT
// Sections are those of RM0008: 7 reset and clock control, 3.3 flash.
#include "clock.h"

#include "board.h"

#include <assert.h>

typedef struct {
    volatile uint32_t CR, CFGR, CIR, APB2RSTR, APB1RSTR, AHBENR, APB2ENR, APB1ENR, BDCR, CSR;
} rcc_t;

#define RCC       ((rcc_t *)0x40021000U)
#define FLASH_ACR (*(volatile uint32_t *)0x40022000U)

#define HSEON          (1U << 16) // 7.3.1 RCC_CR
#define HSERDY         (1U << 17)
#define HSEBYP         (1U << 18)
#define CSSON          (1U << 19)
#define PLLON          (1U << 24)
#define PLLRDY         (1U << 25)
#define SW             3U // 7.3.2 RCC_CFGR
#define SW_PLL         2U
#define SWS            (3U << 2)
#define SWS_PLL        (2U << 2)
#define PPRE1_HALF     (4U << 8)
#define PLLSRC_HSE     (1U << 16)
#define PLLMUL(factor) (((factor)-2U) << 18)
#define PRFTBE         (1U << 4)  // FLASH_ACR: prefetch buffer.
#define RMVF           (1U << 24) // 7.3.10 RCC_CSR
#define PORRSTF        (1U << 27)

#define CRYSTAL_INPUT (IW_BOARD_CRYSTAL_IS_CLOCK != 0 ? HSEBYP : 0U)

// A poll takes 8 cycles at the least, at 8 MHz: 1 ms. The PLL needs 0.3 ms at the most; the crystal goes on starting
// between the calls.
#define POLLS_MAX (IW_BOARD_INTERNAL_HZ / 8U / 1000U)

static_assert(
    IW_BOARD_CRYSTAL_HZ >= IW_BOARD_CRYSTAL_MIN_HZ && IW_BOARD_CRYSTAL_HZ <= IW_BOARD_CRYSTAL_MAX_HZ &&
        IW_BOARD_PLL_MULTIPLIER >= 2U && IW_BOARD_PLL_MULTIPLIER <= 16U &&
        IW_BOARD_CRYSTAL_HZ * IW_BOARD_PLL_MULTIPLIER == IW_BOARD_CORE_HZ,
    "this crystal cannot give the bus exactly: an STM32F1 multiplies it by 2 to 16 (7.3.2), and half of that must be a "
    "multiple of 8 MHz and at most 36 MHz. Take one of 4, 6, 8, 12 or 16 MHz (-DIWHEEL_CRYSTAL_HZ=8000000)");
static_assert(IW_BOARD_CORE_HZ <= 72000000U, "the chip's limit");
static_assert(IW_BOARD_APB1_HZ * 2U == IW_BOARD_CORE_HZ, "PPRE1_HALF is what is written");

/// Every wait on a flag is bounded: a crystal that is broken must end in a message, not in a dead loop.
static bool wait_for(const volatile uint32_t *flags, uint32_t mask, uint32_t value) {
    for (uint32_t poll = 0; poll < POLLS_MAX; poll++) {
        if ((*flags & mask) == value) {
            return true;
        }
    }
    return false;
}

static bool try_start(void) {
    RCC->CR |= CRYSTAL_INPUT; // 7.2.1: the input's kind only while it is off.
    RCC->CR |= HSEON;
    if (!wait_for(&RCC->CR, HSERDY, HSERDY)) {
        return false;
    }
    FLASH_ACR = PRFTBE | IW_BOARD_FLASH_WAIT_STATES;                       // 3.3.3: before the clock rises.
    RCC->CFGR = PLLMUL(IW_BOARD_PLL_MULTIPLIER) | PLLSRC_HSE | PPRE1_HALF; // AHB and APB2 are not divided.
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
    const bool was = (RCC->CSR & PORRSTF) != 0U;
    RCC->CSR |= RMVF;
    return was;
}
