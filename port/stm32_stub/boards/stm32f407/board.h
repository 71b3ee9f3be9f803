// SPDX-License-Identifier: MIT
/// An STM32F405 or F407 with a crystal of 8 MHz (Discovery boards).
///
/// A board is this header and `memory.ld` beside it; the family's files do the rest. To make another board of the same family copy
/// this folder, change what differs, and name it with -DIWHEEL_BOARD; a clock that cannot give the bus exactly does not compile.
///
/// | pin  | is                                                             |
/// |------|----------------------------------------------------------------|
/// | PA0  | e-stop: normally closed contact to ground; open is pressed     |
/// | PA1  | start and reset: normally open button to ground (demo only)    |
/// | PA5  | lamp, lit by a high level; see lamp.h                          |
/// | PA11 | CAN1 receive, from the transceiver                             |
/// | PA12 | CAN1 transmit, to the transceiver                              |
#ifndef IW_STM32_BOARD_H
#define IW_STM32_BOARD_H

#ifndef IW_BOARD_CRYSTAL_IS_CLOCK
#define IW_BOARD_CRYSTAL_IS_CLOCK 0 ///< 1: no crystal, but a clock signal on its input pin.
#endif
#define IW_BOARD_CRYSTAL_HZ  8000000U
#define IW_BOARD_INTERNAL_HZ 16000000U ///< The oscillator that runs after reset. Too inaccurate for the bus.
#define IW_BOARD_PLL_M       4U        ///< 2 MHz into the PLL, the best for little jitter.
#define IW_BOARD_PLL_N       160U      ///< 320 MHz in the PLL.
#define IW_BOARD_PLL_P       2U        ///< 160 MHz out. The usual 168 and 42 MHz cannot give the bus exactly.
#define IW_BOARD_PLL_Q       7U        ///< 45.7 MHz for USB, which is not used: at most 48.
#define IW_BOARD_CORE_HZ     160000000U
#ifndef IW_BOARD_APB1_HZ
#define IW_BOARD_APB1_HZ 40000000U ///< A quarter of the core's, at most 42 MHz. A multiple of 8 MHz.
#endif

#define IW_BOARD_FLASH_WAIT_STATES 5U ///< 150 to 168 MHz at 2.7 to 3.6 V.

/// The watchdog's oscillator: nominal and fastest.
#define IW_BOARD_LSI_HZ     32000U
#define IW_BOARD_LSI_MAX_HZ 47000U

#define IW_BOARD_BXCAN_ADDRESS 0x40006400U ///< CAN1
#define IW_BOARD_EXTI_ADDRESS  0x40013C00U

#endif
