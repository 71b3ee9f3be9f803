// SPDX-License-Identifier: MIT
#include "board.h"
#include "registers.h"

#define POLLS_MAX 20000U // About 25 ms at 8 MHz: the crystal needs 2 ms, and the watchdog must not strike first.

IW_STATIC_ASSERT(IW_STM32_APB1_HZ * 2U == IW_STM32_CORE_HZ, apb1_is_half);

static volatile uint32_t ticks_ms; // Counted by the interrupt below; there is no other place for it.

void iw_systick_handler(void);
void iw_systick_handler(void) {
    ticks_ms++;
}

static bool wait_for(const iw_register_t *flags, uint32_t mask, uint32_t value) {
    for (uint32_t poll = 0; poll < POLLS_MAX; poll++) {
        if ((*flags & mask) == value) {
            return true;
        }
    }
    return false;
}

/// HSE 8 MHz x 8 = 64 MHz; APB1 32 MHz, a multiple of 8 MHz as the sample point demands; APB2 64 MHz.
static bool clock_init(void) {
    IW_STM32_RCC->CR |= 1U << 16; // HSEON
    if (!wait_for(&IW_STM32_RCC->CR, 1U << 17, 1U << 17)) {
        return false;
    }
    *IW_STM32_FLASH = 0x12U;                                  // Prefetch, two wait states above 48 MHz.
    IW_STM32_RCC->CFGR = (6U << 18) | (1U << 16) | (4U << 8); // PLL x 8 from HSE, APB1 / 2.
    IW_STM32_RCC->CR |= (1U << 24) | (1U << 19);              // PLLON, clock security.
    if (!wait_for(&IW_STM32_RCC->CR, 1U << 25, 1U << 25)) {
        return false;
    }
    IW_STM32_RCC->CFGR |= 2U;
    return wait_for(&IW_STM32_RCC->CFGR, 3U << 2, 2U << 2);
}

static void pins_init(void) {
    IW_STM32_RCC->APB2ENR |= (1U << 0) | (1U << 2) | (1U << 3); // AFIO, port A, port B.
    IW_STM32_GPIOA->BSRR = 1U << 11;                            // Pull-up: a missing transceiver reads as recessive.
    IW_STM32_GPIOA->CRH = (IW_STM32_GPIOA->CRH & ~0x000FF000U) | 0x000B8000U; // PA12 alternate output, PA11 input.
    IW_STM32_GPIOB->BSRR = 1U << 0;
    IW_STM32_GPIOB->CRL = (IW_STM32_GPIOB->CRL & ~0x0000000FU) | 0x00000008U; // PB0 input with pull-up.
    IW_STM32_AFIO->EXTICR[0] = (IW_STM32_AFIO->EXTICR[0] & ~0xFU) | 1U;       // EXTI0 is PB0.
    IW_STM32_EXTI->RTSR |= 1U;
    IW_STM32_EXTI->FTSR |= 1U;
    IW_STM32_EXTI->IMR |= 1U; // Latches edges in PR; the interrupt itself stays disabled in the NVIC.
}

bool iw_board_init(void) {
    const bool is_exact = clock_init();
    pins_init();
    IW_STM32_SYSTICK->LOAD = IW_STM32_CORE_HZ / 1000U - 1U;
    IW_STM32_SYSTICK->VAL = 0;
    IW_STM32_SYSTICK->CTRL = 7U;
    return is_exact;
}

bool iw_board_was_reset_by_watchdog(void) {
    const bool was = (IW_STM32_RCC->CSR & (1U << 29)) != 0U;
    IW_STM32_RCC->CSR |= 1U << 24; // Clears the flags for the next start.
    return was;
}

iw_time_us_t iw_board_now_us(void) {
    static uint32_t last_ms; // Extends the 32-bit count, which wraps after 49 days.
    static uint64_t high_ms;
    uint32_t now_ms;
    uint32_t left;
    do {
        now_ms = ticks_ms;
        left = IW_STM32_SYSTICK->VAL;
    } while (now_ms != ticks_ms);
    if (now_ms < last_ms) {
        high_ms += 1ULL << 32;
    }
    last_ms = now_ms;
    return (high_ms + now_ms) * 1000U + (IW_STM32_CORE_HZ / 1000U - 1U - left) / (IW_STM32_CORE_HZ / 1000000U);
}

int iw_board_estop_pressed(void *context) {
    (void)context;
    const uint32_t edge = IW_STM32_EXTI->PR & 1U;
    IW_STM32_EXTI->PR = edge; // Clears what was read and no edge that came since.
    return (edge != 0U || (IW_STM32_GPIOB->IDR & 1U) != 0U) ? 1 : 0;
}

void iw_board_watchdog_start(void) {
    IW_STM32_IWDG->KR = 0xCCCCU;
    IW_STM32_IWDG->KR = 0x5555U;
    IW_STM32_IWDG->PR = 0; // 40 kHz / 4
    IW_STM32_IWDG->RLR = 1000U;
    IW_STM32_IWDG->KR = 0xAAAAU;
}

void iw_board_watchdog_feed(void) {
    IW_STM32_IWDG->KR = 0xAAAAU;
}
