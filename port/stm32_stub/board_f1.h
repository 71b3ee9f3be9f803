// SPDX-License-Identifier: MIT
/// Common settings of boards with an STM32F103: clocks and addresses. The `board.h` of such a board includes this file.
#ifndef BRD_BOARD_F1_H
#define BRD_BOARD_F1_H

#include "board_pins.h"

#ifndef BRD_CRYSTAL_IS_CLOCK
#define BRD_CRYSTAL_IS_CLOCK 0 ///< 1: a clock signal on the input pin of the crystal instead of a crystal.
#endif
#ifndef BRD_CRYSTAL_HZ
#define BRD_CRYSTAL_HZ 8000000U ///< 4, 6, 8, 12 or 16 MHz; set by -DIWHEEL_CRYSTAL_HZ.
#endif
#define BRD_CRYSTAL_MIN_HZ 4000000U ///< Data sheet, 5.3.6.
#define BRD_CRYSTAL_MAX_HZ (BRD_CRYSTAL_IS_CLOCK != 0 ? 25000000U : 16000000U)
#define BRD_INTERNAL_HZ    8000000U ///< Oscillator that runs after reset; too inaccurate for the bus.
/// 64 MHz if this is a multiple of the crystal, otherwise 48 MHz. The usual 72 MHz results in 36 MHz on APB1, from
/// which the exact bit rate cannot be derived.
#define BRD_CORE_HZ        ((64000000U % BRD_CRYSTAL_HZ == 0U) ? 64000000U : 48000000U)
#define BRD_PLL_MULTIPLIER (BRD_CORE_HZ / BRD_CRYSTAL_HZ)
#ifndef BRD_APB1_HZ
#define BRD_APB1_HZ (BRD_CORE_HZ / 2U) ///< At most 36 MHz, and a multiple of 8 MHz.
#endif

#define BRD_FLASH_WAIT_STATES ((BRD_CORE_HZ > 48000000U) ? 2U : 1U)

/// Highest frequency of the watchdog's oscillator; nominal 40 kHz.
#define BRD_LSI_MAX_HZ 60000U

#define BRD_RCC_ADDRESS       0x40021000U
#define BRD_RCC_CFGR_ADDRESS  0x40021004U
#define BRD_RCC_CSR_ADDRESS   0x40021024U
#define BRD_RCC_SW_INTERNAL   0U ///< SW of RCC_CFGR.
#define BRD_RCC_SW_PLL        2U
#define BRD_RCC_RMVF          (1U << 24)  ///< RCC_CSR
#define BRD_DMA_CLOCK_ADDRESS 0x40021014U ///< RCC_AHBENR
#define BRD_DMA_CLOCKS        (1U << 0)
#define BRD_BXCAN_ADDRESS     0x40006400U
#define BRD_CAN_RESET_ADDRESS 0x40021010U ///< RCC_APB1RSTR
#define BRD_UNIQUE_ID_ADDRESS 0x1FFFF7E8U
#define BRD_STORE_ADDRESS     0x0800F800U ///< First of the pages for stored records; memory.ld excludes them.
#define BRD_EXTI_ADDRESS      0x40010400U

#endif
