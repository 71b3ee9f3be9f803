// SPDX-License-Identifier: MIT
/// What boards with an STM32F405, F407 or F446 have in common: the clocks and where things are. For the `board.h` of
/// such a board.
#ifndef BRD_BOARD_F4_H
#define BRD_BOARD_F4_H

#include "board_pins.h"

#ifndef BRD_CRYSTAL_IS_CLOCK
#define BRD_CRYSTAL_IS_CLOCK 0 ///< 1: no crystal, but a clock signal on its input pin.
#endif
#ifndef BRD_CRYSTAL_HZ
#define BRD_CRYSTAL_HZ 8000000U ///< Any whole MHz from 4 to 26, or 12.5 or 19.2 MHz: -DIWHEEL_CRYSTAL_HZ.
#endif
#define BRD_CRYSTAL_MIN_HZ 4000000U ///< Data sheet, 5.3.8 (F446: 6.3.8).
#define BRD_CRYSTAL_MAX_HZ (BRD_CRYSTAL_IS_CLOCK != 0 ? 50000000U : 26000000U)
#define BRD_INTERNAL_HZ    16000000U ///< The oscillator that runs after reset. Too inaccurate for the bus.

/// Into the PLL, 1 to 2 MHz: the fastest that divides the crystal and 320 MHz, for little jitter.
#define BRD_PLL_INPUT_HZ                                                                                               \
    ((BRD_CRYSTAL_HZ % 2000000U == 0U)   ? 2000000U                                                                    \
     : (BRD_CRYSTAL_HZ % 1600000U == 0U) ? 1600000U                                                                    \
     : (BRD_CRYSTAL_HZ % 1250000U == 0U) ? 1250000U                                                                    \
                                         : 1000000U)
#define BRD_PLL_M   (BRD_CRYSTAL_HZ / BRD_PLL_INPUT_HZ)
#define BRD_PLL_N   (320000000U / BRD_PLL_INPUT_HZ) ///< 320 MHz in the PLL.
#define BRD_PLL_P   2U                              ///< 160 MHz out. The usual 168 and 180 cannot give the bus exactly.
#define BRD_PLL_Q   7U                              ///< 45.7 MHz for USB, which is not used: at most 48.
#define BRD_CORE_HZ 160000000U
#ifndef BRD_APB1_HZ
#define BRD_APB1_HZ 40000000U ///< A quarter of the core's, at most 42 MHz (F446: 45). A multiple of 8 MHz.
#endif

#define BRD_FLASH_WAIT_STATES 5U ///< Above 150 MHz at 2.7 to 3.6 V.

/// The watchdog's oscillator at its fastest; nominal 32 kHz.
#define BRD_LSI_MAX_HZ 47000U

#define BRD_RCC_ADDRESS       0x40023800U
#define BRD_RCC_CFGR_ADDRESS  0x40023808U
#define BRD_RCC_CSR_ADDRESS   0x40023874U
#define BRD_BXCAN_ADDRESS     0x40006400U ///< CAN1
#define BRD_CAN_RESET_ADDRESS 0x40023820U ///< RCC_APB1RSTR
#define BRD_UNIQUE_ID_ADDRESS 0x1FFF7A10U
#define BRD_EXTI_ADDRESS      0x40013C00U

#endif
