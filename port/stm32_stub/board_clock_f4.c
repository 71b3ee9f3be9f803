// SPDX-License-Identifier: MIT
// Section numbers refer to RM0090: 7 reset and clock control, 3 flash. RM0390 (F446) has the same registers.
#include "board_clock.h"

#include "board.h"

#include <assert.h>

#define RCC_PLLCFGR (*(volatile uint32_t *)(BRD_RCC_ADDRESS + 4U))
#define RCC_CFGR    (*(volatile uint32_t *)BRD_RCC_CFGR_ADDRESS)
#define FLASH_ACR   (*(volatile uint32_t *)0x40023C00U)

#define PLLSRC_HSE    (1U << 22) // 7.3.2 RCC_PLLCFGR
#define PLLR_LEAST    (2U << 28) // F446: not used, but 0 is not allowed. Other chips: reserved, value after reset.
#define PPRE1_QUARTER (5U << 10) // 7.3.3 RCC_CFGR
#define PPRE2_HALF    (4U << 13)
#define LATENCY       0xFU // FLASH_ACR
#define PRFTEN        (1U << 8)
#define ICEN          (1U << 9)
#define DCEN          (1U << 10)
#define PREFETCH      ((BRD_CAN_PREFETCH != 0) ? PRFTEN : 0U)

static_assert(
    BRD_CRYSTAL_HZ >= BRD_CRYSTAL_MIN_HZ && BRD_CRYSTAL_HZ <= BRD_CRYSTAL_MAX_HZ &&
        BRD_PLL_INPUT_HZ * BRD_PLL_M == BRD_CRYSTAL_HZ,
    "this crystal cannot produce the bit rate exactly: 1 to 2 MHz that divide it and 320 MHz must go into the PLL "
    "(7.3.2). Use any "
    "whole MHz from 4 to 26, or 12.5 or 19.2 MHz (-DIWHEEL_CRYSTAL_HZ=25000000)");
static_assert(BRD_PLL_M >= 2U && BRD_PLL_M <= 63U && BRD_PLL_N >= 50U && BRD_PLL_N <= 432U, "7.3.2");
static_assert(BRD_PLL_INPUT_HZ * BRD_PLL_N / BRD_PLL_P == BRD_CORE_HZ, "the PLL's output");
static_assert(BRD_CORE_HZ <= 168000000U, "faster needs overdrive, and an F407 cannot");
static_assert(BRD_APB1_HZ * 4U == BRD_CORE_HZ, "PPRE1_QUARTER is what is written");

// Leaves the voltage scale at its value after reset: 1, which allows 168 MHz (5.4.1).
bool brd_clock_prepare(void) {
    FLASH_ACR = PREFETCH | ICEN | DCEN | BRD_FLASH_WAIT_STATES; // 3.5.1: before the clock rises, and read back.
    RCC_PLLCFGR =
        PLLR_LEAST | (BRD_PLL_Q << 24) | PLLSRC_HSE | ((BRD_PLL_P / 2U - 1U) << 16) | (BRD_PLL_N << 6) | BRD_PLL_M;
    RCC_CFGR = PPRE1_QUARTER | PPRE2_HALF; // AHB is not divided.
    return brd_clock_wait_for(&FLASH_ACR, LATENCY, BRD_FLASH_WAIT_STATES);
}
