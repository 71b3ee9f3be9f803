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
#ifndef BRD_BOARD_PINS_H
#define BRD_BOARD_PINS_H

/// A pin as one number: 16 to a port.
#define BRD_PIN(port, number) ((uint32_t)(port)*16U + (number))
#define BRD_PIN_A(number)     BRD_PIN(0U, number)
#define BRD_PIN_B(number)     BRD_PIN(1U, number)
#define BRD_PIN_C(number)     BRD_PIN(2U, number)
#define BRD_PIN_D(number)     BRD_PIN(3U, number)

#ifndef BRD_ESTOP
#define BRD_ESTOP BRD_PIN_B(0U) ///< Of any port, but number 0: the interrupt is EXTI line 0's.
#endif
#ifndef BRD_BUTTON
#define BRD_BUTTON BRD_PIN_A(1U)
#endif

#define BRD_UART_TX BRD_PIN_A(2U) ///< USART2's.
#define BRD_UART_RX BRD_PIN_A(3U)

#ifndef BRD_CAN_ON_PA11
#define BRD_CAN_ON_PA11 0 ///< 1 by -DIWHEEL_CAN_PINS=PA11.
#endif
#define BRD_CAN_RX (BRD_CAN_ON_PA11 != 0 ? BRD_PIN_A(11U) : BRD_PIN_B(8U))
#define BRD_CAN_TX (BRD_CAN_ON_PA11 != 0 ? BRD_PIN_A(12U) : BRD_PIN_B(9U))

#endif
