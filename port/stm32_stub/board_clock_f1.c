// SPDX-License-Identifier: MIT
// Section numbers refer to RM0008: 7 reset and clock control, 3.3 flash.
#include "board_clock.h"

#include "board.h"

#include <assert.h>

#define RCC_CFGR  (*(volatile uint32_t *)BRD_RCC_CFGR_ADDRESS)
#define FLASH_ACR (*(volatile uint32_t *)0x40022000U)

#define PPRE1_HALF     (4U << 8) // 7.3.2 RCC_CFGR
#define PLLSRC_HSE     (1U << 16)
#define PLLMUL(factor) (((factor)-2U) << 18)
#define PRFTBE         (1U << 4) // FLASH_ACR: prefetch buffer.

static_assert(BRD_CRYSTAL_HZ >= BRD_CRYSTAL_MIN_HZ && BRD_CRYSTAL_HZ <= BRD_CRYSTAL_MAX_HZ &&
                  BRD_PLL_MULTIPLIER >= 2U && BRD_PLL_MULTIPLIER <= 16U &&
                  BRD_CRYSTAL_HZ * BRD_PLL_MULTIPLIER == BRD_CORE_HZ,
              "this crystal cannot produce the bit rate exactly: an STM32F1 multiplies it by 2 to 16 (7.3.2), and half "
              "of that must be a "
              "multiple of 8 MHz and at most 36 MHz. Use one of 4, 6, 8, 12 or 16 MHz (-DIWHEEL_CRYSTAL_HZ=8000000)");
static_assert(BRD_CORE_HZ <= 72000000U, "the chip's limit");
static_assert(BRD_APB1_HZ * 2U == BRD_CORE_HZ, "PPRE1_HALF is what is written");

bool brd_clock_prepare(void) {
    FLASH_ACR = PRFTBE | BRD_FLASH_WAIT_STATES;                      // 3.3.3: before the clock rises.
    RCC_CFGR = PLLMUL(BRD_PLL_MULTIPLIER) | PLLSRC_HSE | PPRE1_HALF; // AHB and APB2 are not divided.
    return true;
}
