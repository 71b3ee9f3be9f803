// SPDX-License-Identifier: MIT
/// What boards with an STM32F103 have in common: the clocks and where things are. For the `board.h` of such a board.
#ifndef IW_STM32_BOARD_F1_H
#define IW_STM32_BOARD_F1_H

#include "board_pins.h"

#ifndef IW_BOARD_CRYSTAL_IS_CLOCK
#define IW_BOARD_CRYSTAL_IS_CLOCK 0 ///< 1: no crystal, but a clock signal on its input pin.
#endif
#ifndef IW_BOARD_CRYSTAL_HZ
#define IW_BOARD_CRYSTAL_HZ 8000000U ///< 4, 6, 8, 12 or 16 MHz: -DIWHEEL_CRYSTAL_HZ.
#endif
#define IW_BOARD_CRYSTAL_MIN_HZ 4000000U ///< Data sheet, 5.3.6.
#define IW_BOARD_CRYSTAL_MAX_HZ (IW_BOARD_CRYSTAL_IS_CLOCK != 0 ? 25000000U : 16000000U)
#define IW_BOARD_INTERNAL_HZ    8000000U ///< The oscillator that runs after reset. Too inaccurate for the bus.
/// 64 MHz if a multiple of the crystal, else 48. The usual 72 MHz gives 36 on APB1, and that cannot give the bus
/// exactly.
#define IW_BOARD_CORE_HZ        ((64000000U % IW_BOARD_CRYSTAL_HZ == 0U) ? 64000000U : 48000000U)
#define IW_BOARD_PLL_MULTIPLIER (IW_BOARD_CORE_HZ / IW_BOARD_CRYSTAL_HZ)
#ifndef IW_BOARD_APB1_HZ
#define IW_BOARD_APB1_HZ (IW_BOARD_CORE_HZ / 2U) ///< At most 36 MHz. A multiple of 8 MHz.
#endif

#define IW_BOARD_FLASH_WAIT_STATES ((IW_BOARD_CORE_HZ > 48000000U) ? 2U : 1U)

/// The watchdog's oscillator: nominal and fastest.
#define IW_BOARD_LSI_HZ     40000U
#define IW_BOARD_LSI_MAX_HZ 60000U

#define IW_BOARD_RCC_ADDRESS       0x40021000U
#define IW_BOARD_RCC_CFGR_ADDRESS  0x40021004U
#define IW_BOARD_RCC_CSR_ADDRESS   0x40021024U
#define IW_BOARD_BXCAN_ADDRESS     0x40006400U
#define IW_BOARD_CAN_RESET_ADDRESS 0x40021010U ///< RCC_APB1RSTR
#define IW_BOARD_UNIQUE_ID_ADDRESS 0x1FFFF7E8U
#define IW_BOARD_STORE_ADDRESS     0x0800F800U ///< Pages for what is kept; memory.ld leaves them out.
#define IW_BOARD_EXTI_ADDRESS      0x40010400U

#endif
