// SPDX-License-Identifier: MIT
/// The pins that are the same on all boards of this port, chosen so that nothing on a Blue Pill, a Discovery or a
/// Nucleo is in the way.
///
/// | pin           | is                                                                                        |
/// |---------------|-------------------------------------------------------------------------------------------|
/// | PB0           | e-stop: normally closed contact to ground; open is pressed. Not PA0: a button to 3.3 V there |
/// | PA1           | start and reset: normally open button to ground                                           |
/// | PA2, PA3      | USART2 to and from a terminal, 115200 8N1; on a Nucleo the debugger's serial port          |
/// | PB8, PB9      | CAN receive and transmit, from and to the transceiver                                     |
/// | PA11, PA12    | ... or these with -DIWHEEL_CAN_PINS=PA11: the USB socket's on Blue Pill and Discovery       |
///
/// A `board.h` may define another pin before it includes this.
#ifndef IW_STM32_BOARD_PINS_H
#define IW_STM32_BOARD_PINS_H

/// A pin as one number: 16 to a port.
#define IW_PIN(port, number) ((uint32_t)(port)*16U + (number))
#define IW_PIN_A(number)     IW_PIN(0U, number)
#define IW_PIN_B(number)     IW_PIN(1U, number)
#define IW_PIN_C(number)     IW_PIN(2U, number)
#define IW_PIN_D(number)     IW_PIN(3U, number)

#ifndef IW_BOARD_ESTOP
#define IW_BOARD_ESTOP IW_PIN_B(0U) ///< Of any port, but number 0: the interrupt is EXTI line 0's.
#endif
#ifndef IW_BOARD_BUTTON
#define IW_BOARD_BUTTON IW_PIN_A(1U)
#endif

#define IW_BOARD_UART_TX IW_PIN_A(2U) ///< USART2's.
#define IW_BOARD_UART_RX IW_PIN_A(3U)

#ifndef IW_BOARD_CAN_ON_PA11
#define IW_BOARD_CAN_ON_PA11 0 ///< 1 by -DIWHEEL_CAN_PINS=PA11.
#endif
#define IW_BOARD_CAN_RX (IW_BOARD_CAN_ON_PA11 != 0 ? IW_PIN_A(11U) : IW_PIN_B(8U))
#define IW_BOARD_CAN_TX (IW_BOARD_CAN_ON_PA11 != 0 ? IW_PIN_A(12U) : IW_PIN_B(9U))

#endif
