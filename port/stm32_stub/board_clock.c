// SPDX-License-Identifier: MIT
// Section numbers refer to RM0008 and RM0090: 7 reset and clock control. The bits used here mean the same in both, and
// in RM0440 (STM32G4), except those in the header of the family.
#include "board_clock.h"

#include "board.h"

#define REGISTER(address) (*(volatile uint32_t *)(address))

#define RCC_CR   REGISTER(BRD_RCC_ADDRESS)
#define RCC_CFGR REGISTER(BRD_RCC_CFGR_ADDRESS)
#define RCC_CSR  REGISTER(BRD_RCC_CSR_ADDRESS)

#define HSEON   (1U << 16) // 7.3.1 RCC_CR
#define HSERDY  (1U << 17)
#define HSEBYP  (1U << 18)
#define CSSON   (1U << 19)
#define PLLON   (1U << 24)
#define PLLRDY  (1U << 25)
#define SW      3U // RCC_CFGR: 7.3.2, F4 7.3.3
#define SWS     (3U << 2)
#define SWS_PLL (BRD_RCC_SW_PLL << 2)
#define PORRSTF (1U << 27) // RCC_CSR: 7.3.10, F4 7.3.21. On an STM32G4 BORRSTF, which is set at power-on too.

#define CRYSTAL_INPUT (BRD_CRYSTAL_IS_CLOCK != 0 ? HSEBYP : 0U)

// A poll takes at least 8 cycles of the internal oscillator, so these polls take at least 1 ms. The PLL needs at most
// 0.3 ms. The crystal continues to start between the calls.
#define POLLS_MAX (BRD_INTERNAL_HZ / 8U / 1000U)

bool brd_clock_wait_for(const volatile uint32_t *flags, uint32_t mask, uint32_t value) {
    for (uint32_t poll = 0; poll < POLLS_MAX; poll++) {
        if ((*flags & mask) == value) {
            return true;
        }
    }
    return false;
}

static bool try_start(void) {
    RCC_CR |= CRYSTAL_INPUT; // 7.2.1: the kind of input can change only while it is off.
    RCC_CR |= HSEON;
    if (!brd_clock_wait_for(&RCC_CR, HSERDY, HSERDY) || !brd_clock_prepare()) {
        return false;
    }
    RCC_CR |= PLLON;
    if (!brd_clock_wait_for(&RCC_CR, PLLRDY, PLLRDY)) {
        return false;
    }
    RCC_CFGR |= BRD_RCC_SW_PLL;
    return brd_clock_wait_for(&RCC_CFGR, SWS, SWS_PLL);
}

/// The crystal stays on after a failure, so that a slow one continues to start while the caller repeats the call.
bool brd_clock_start(void) {
    if (try_start()) {
        RCC_CR |= CSSON; // 7.2.7: a failure of the crystal raises the NMI and selects the internal oscillator.
        return true;
    }
    RCC_CFGR = (RCC_CFGR & ~SW) | BRD_RCC_SW_INTERNAL;
    RCC_CR &= ~PLLON;
    return false;
}

bool brd_clock_was_power_on(void) {
    const bool was = (RCC_CSR & PORRSTF) != 0U;
    RCC_CSR |= BRD_RCC_RMVF;
    return was;
}
