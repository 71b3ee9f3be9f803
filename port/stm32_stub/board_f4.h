// SPDX-License-Identifier: MIT
/// Common settings of boards with an STM32F405, F407 or F446: clocks and addresses. The `board.h` of such a board
/// includes this file.
#ifndef BRD_BOARD_F4_H
#define BRD_BOARD_F4_H

#include "board_pins.h"

#ifndef BRD_CRYSTAL_IS_CLOCK
#define BRD_CRYSTAL_IS_CLOCK 0 ///< 1: a clock signal on the input pin of the crystal instead of a crystal.
#endif
#ifndef BRD_CRYSTAL_HZ
#define BRD_CRYSTAL_HZ 8000000U ///< Any whole MHz from 4 to 26, or 12.5 or 19.2 MHz; set by -DIWHEEL_CRYSTAL_HZ.
#endif
#define BRD_CRYSTAL_MIN_HZ 4000000U ///< Data sheet, 5.3.8 (F446: 6.3.8).
#define BRD_CRYSTAL_MAX_HZ (BRD_CRYSTAL_IS_CLOCK != 0 ? 50000000U : 26000000U)
#define BRD_INTERNAL_HZ    16000000U ///< Oscillator that runs after reset; too inaccurate for the bus.

/// Input of the PLL, 1 to 2 MHz: the highest frequency that divides the crystal and 320 MHz, for low jitter.
#define BRD_PLL_INPUT_HZ                                                                                               \
    ((BRD_CRYSTAL_HZ % 2000000U == 0U)   ? 2000000U                                                                    \
     : (BRD_CRYSTAL_HZ % 1600000U == 0U) ? 1600000U                                                                    \
     : (BRD_CRYSTAL_HZ % 1250000U == 0U) ? 1250000U                                                                    \
                                         : 1000000U)
#define BRD_PLL_M   (BRD_CRYSTAL_HZ / BRD_PLL_INPUT_HZ)
#define BRD_PLL_N   (320000000U / BRD_PLL_INPUT_HZ) ///< The PLL runs at 320 MHz.
#define BRD_PLL_P   2U ///< Output: 160 MHz. The usual 168 and 180 MHz cannot produce the exact bit rate.
#define BRD_PLL_Q   7U ///< 45.7 MHz for USB, which is not used; at most 48 MHz.
#define BRD_CORE_HZ 160000000U
#ifndef BRD_APB1_HZ
#define BRD_APB1_HZ 40000000U ///< A quarter of the core clock, at most 42 MHz (F446: 45 MHz), and a multiple of 8 MHz.
#endif

#define BRD_FLASH_WAIT_STATES 5U ///< For more than 150 MHz at 2.7 to 3.6 V.

/// Highest frequency of the watchdog's oscillator; nominal 32 kHz.
#define BRD_LSI_MAX_HZ 47000U

#define BRD_RCC_ADDRESS       0x40023800U
#define BRD_RCC_CFGR_ADDRESS  0x40023808U
#define BRD_RCC_CSR_ADDRESS   0x40023874U
#define BRD_RCC_SW_INTERNAL   0U ///< SW of RCC_CFGR.
#define BRD_RCC_SW_PLL        2U
#define BRD_RCC_RMVF          (1U << 24) ///< RCC_CSR
#define BRD_PORTS_ADDRESS     0x40020000U
#define BRD_PORT_CLOCKS       0x40023830U ///< RCC_AHB1ENR
#define BRD_APB1_CLOCKS       0x40023840U ///< RCC_APB1ENR
#define BRD_APB2_CLOCKS       0x40023844U ///< RCC_APB2ENR
#define BRD_SYSCFG_CLOCK      (1U << 14)
#define BRD_EXTICR1_ADDRESS   0x40013808U
#define BRD_BXCAN_ADDRESS     0x40006400U ///< CAN1
#define BRD_CAN_RESET_ADDRESS 0x40023820U ///< RCC_APB1RSTR
#define BRD_UNIQUE_ID_ADDRESS 0x1FFF7A10U
#define BRD_EXTI_ADDRESS      0x40013C00U

#endif
