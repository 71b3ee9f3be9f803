// SPDX-License-Identifier: MIT
/// An STM32F103x8 or xB with a crystal of 8 MHz ("Blue Pill" and its relatives).
///
/// A board is this header, `memory.ld` beside it, and the two files for its family that CMakeLists.txt names. To make another board of
/// the same family copy this folder and change what differs; bit_rate.h refuses a clock that cannot give the bus exactly.
///
/// | pin  | is                                                             |
/// |------|----------------------------------------------------------------|
/// | PA0  | e-stop: normally closed contact to ground; open is pressed     |
/// | PA1  | start and reset: normally open button to ground (demo only)    |
/// | PA11 | CAN receive, from the transceiver                              |
/// | PA12 | CAN transmit, to the transceiver                               |
/// | PC13 | lamp, lit by a low level; see lamp.h                           |
#ifndef IW_STM32_BOARD_H
#define IW_STM32_BOARD_H

#define IW_BOARD_CRYSTAL_HZ     8000000U
#define IW_BOARD_INTERNAL_HZ    8000000U ///< The oscillator that runs after reset. Too inaccurate for the bus.
#define IW_BOARD_PLL_MULTIPLIER 8U       ///< 2..9. The usual 9 gives 72 and 36 MHz, and 36 cannot give the bus exactly.
#define IW_BOARD_CORE_HZ        64000000U
#ifndef IW_BOARD_APB1_HZ
#define IW_BOARD_APB1_HZ 32000000U ///< Half of the core's, at most 36 MHz. A multiple of 8 MHz.
#endif

#define IW_BOARD_FLASH_WAIT_STATES 2U ///< 48 to 72 MHz.

/// The watchdog's oscillator: nominal and fastest.
#define IW_BOARD_LSI_HZ     40000U
#define IW_BOARD_LSI_MAX_HZ 60000U

#define IW_BOARD_BXCAN_ADDRESS 0x40006400U
#define IW_BOARD_EXTI_ADDRESS  0x40010400U

#endif
