// SPDX-License-Identifier: MIT
/// Common settings of boards with an STM32G474: clocks and addresses. The `board.h` of such a board includes this file.
#ifndef BRD_BOARD_G4_H
#define BRD_BOARD_G4_H

/// The default here, because PB8 is also BOOT0: the receive output of a transceiver is high during a reset, and the
/// chip would start its ROM and not this image (RM0440 2.6).
#ifndef BRD_CAN_ON_PA11
#define BRD_CAN_ON_PA11 1
#endif

#include "board_pins.h"

#ifndef BRD_CRYSTAL_IS_CLOCK
#define BRD_CRYSTAL_IS_CLOCK 0 ///< 1: a clock signal on the input pin of the crystal instead of a crystal.
#endif
#ifndef BRD_CRYSTAL_HZ
#define BRD_CRYSTAL_HZ 24000000U ///< A multiple of 4 or 5 MHz from 4 to 48; set by -DIWHEEL_CRYSTAL_HZ.
#endif
#define BRD_CRYSTAL_MIN_HZ 4000000U ///< Data sheet, 5.3.7.
#define BRD_CRYSTAL_MAX_HZ 48000000U
#define BRD_INTERNAL_HZ    16000000U ///< Oscillator that runs after reset; too inaccurate for the bus.

/// Input of the PLL, 2.66 to 16 MHz, for which the PLL runs at 320 MHz.
#define BRD_PLL_INPUT_HZ ((BRD_CRYSTAL_HZ % 4000000U == 0U) ? 4000000U : 5000000U)
#define BRD_PLL_M        (BRD_CRYSTAL_HZ / BRD_PLL_INPUT_HZ)
#define BRD_PLL_N        (320000000U / BRD_PLL_INPUT_HZ)
#define BRD_PLL_R        4U
#define BRD_CORE_HZ      80000000U ///< The exact bit rate needs a multiple of 8 MHz; 160 MHz needs the boost mode.
#ifndef BRD_APB1_HZ
#define BRD_APB1_HZ 80000000U ///< Also the kernel clock of FDCAN and USART2.
#endif

#define BRD_FLASH_WAIT_STATES 2U ///< For 61 to 90 MHz in voltage range 1 (RM0440 3.3).

/// Highest frequency of the watchdog's oscillator; nominal 32 kHz.
#define BRD_LSI_MAX_HZ 34000U

#define BRD_RCC_ADDRESS       0x40021000U
#define BRD_RCC_CFGR_ADDRESS  0x40021008U
#define BRD_RCC_CSR_ADDRESS   0x40021094U
#define BRD_RCC_SW_INTERNAL   1U ///< SW of RCC_CFGR; 0 is reserved.
#define BRD_RCC_SW_PLL        3U
#define BRD_RCC_RMVF          (1U << 23) ///< RCC_CSR
#define BRD_PORTS_ADDRESS     0x48000000U
#define BRD_PORT_CLOCKS       0x4002104CU ///< RCC_AHB2ENR
#define BRD_APB1_CLOCKS       0x40021058U ///< RCC_APB1ENR1
#define BRD_APB2_CLOCKS       0x40021060U ///< RCC_APB2ENR
#define BRD_SYSCFG_CLOCK      (1U << 0)
#define BRD_EXTICR1_ADDRESS   0x40010008U
#define BRD_PINS_ARE_ANALOG   1                       ///< After a reset.
#define BRD_DMA_CLOCK_ADDRESS 0x40021048U             ///< RCC_AHB1ENR
#define BRD_DMA_CLOCKS        ((1U << 0) | (1U << 2)) ///< DMA1 and its multiplexer.
#define BRD_DMAMUX_ADDRESS    0x40020800U
#define BRD_USART_HAS_ICR     1           ///< See usart.h.
#define BRD_FDCAN_ADDRESS     0x40006400U ///< FDCAN1
#define BRD_FDCAN_RAM_ADDRESS 0x4000A400U ///< Its part of the message RAM is the first one.
#define BRD_CAN_RESET_ADDRESS 0x40021038U ///< RCC_APB1RSTR1
#define BRD_UNIQUE_ID_ADDRESS 0x1FFF7590U
#define BRD_STORE_ADDRESS     0x0807E000U ///< First of the pages for stored records; memory.ld excludes them.
#define BRD_EXTI_ADDRESS      0x40010400U

#endif
