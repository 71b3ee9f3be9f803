// SPDX-License-Identifier: MIT
/// An STM32F103x8 or xB with a crystal of 8 MHz ("Blue Pill" and its relatives).
///
/// A board is this header and `memory.ld` beside it; the family's files do the rest. To make another board of the same family copy
/// this folder, change what differs, and name it with -DIWHEEL_BOARD; a clock that cannot give the bus exactly does not compile.
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

#ifndef IW_BOARD_CRYSTAL_IS_CLOCK
#define IW_BOARD_CRYSTAL_IS_CLOCK 0 ///< 1: no crystal, but a clock signal on its input pin.
#endif
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
