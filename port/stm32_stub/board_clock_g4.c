// SPDX-License-Identifier: MIT
// Section numbers refer to RM0440: 7 reset and clock control, 3 flash, 6 power.
#include "board_clock.h"

#include "board.h"

#include <assert.h>

#define RCC_CFGR    (*(volatile uint32_t *)BRD_RCC_CFGR_ADDRESS)
#define RCC_PLLCFGR (*(volatile uint32_t *)(BRD_RCC_ADDRESS + 0xCU))
#define RCC_CCIPR   (*(volatile uint32_t *)(BRD_RCC_ADDRESS + 0x88U))
#define FLASH_ACR   (*(volatile uint32_t *)0x40022000U)

#define PLLSRC_HSE  3U // 7.4 RCC_PLLCFGR
#define PLLREN      (1U << 24)
#define PLLR_BY_4   (1U << 25)
#define FDCAN_PCLK1 (2U << 24) // 7.4 RCC_CCIPR
#define LATENCY     0xFU       // FLASH_ACR
#define PRFTEN      (1U << 8)
#define ICEN        (1U << 9)
#define DCEN        (1U << 10)

static_assert(
    BRD_CRYSTAL_HZ >= BRD_CRYSTAL_MIN_HZ && BRD_CRYSTAL_HZ <= BRD_CRYSTAL_MAX_HZ &&
        BRD_PLL_INPUT_HZ * BRD_PLL_M == BRD_CRYSTAL_HZ,
    "this crystal cannot produce the bit rate exactly: 4 or 5 MHz that divide it must go into the PLL (7.4). Use a "
    "multiple of 4 or 5 MHz from 4 to 48 (-DIWHEEL_CRYSTAL_HZ=24000000)");
static_assert(BRD_PLL_M >= 1U && BRD_PLL_M <= 16U && BRD_PLL_N >= 8U && BRD_PLL_N <= 127U, "7.4");
static_assert(BRD_PLL_INPUT_HZ * BRD_PLL_N / BRD_PLL_R == BRD_CORE_HZ && BRD_PLL_R == 4U, "the PLL's output");
static_assert(BRD_CORE_HZ <= 150000000U, "faster needs the boost mode (6.1)");
static_assert(BRD_APB1_HZ == BRD_CORE_HZ, "APB1 has the clock of the core");

// Leaves the voltage at its value after reset: range 1 without boost, which allows 150 MHz (6.1). FDCAN has the clock
// of its bus: 44.3 requires that the bus is not slower than the kernel.
bool brd_clock_prepare(void) {
    FLASH_ACR = PRFTEN | ICEN | DCEN | BRD_FLASH_WAIT_STATES; // 3.3: before the clock rises, and read back.
    RCC_PLLCFGR = PLLR_BY_4 | PLLREN | (BRD_PLL_N << 8) | ((BRD_PLL_M - 1U) << 4) | PLLSRC_HSE;
    RCC_CCIPR = FDCAN_PCLK1;
    return brd_clock_wait_for(&FLASH_ACR, LATENCY, BRD_FLASH_WAIT_STATES);
}
