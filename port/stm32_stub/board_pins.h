// SPDX-License-Identifier: MIT
/// Pins that are the same on all boards of this port. They are free on a Blue Pill, a Discovery and a Nucleo.
///
/// | pin        | function                                                                                     |
/// |------------|----------------------------------------------------------------------------------------------|
/// | PB0        | e-stop: normally closed contact to ground; open is pressed. Not PA0, which has a button to 3.3 V |
/// | PA1        | start and reset: normally open button to ground                                              |
/// | PA2, PA3   | USART2 to and from a terminal, 115200 8N1; on a Nucleo the serial port of the debugger       |
/// | PB8, PB9   | CAN receive and transmit, from and to the transceiver                                        |
/// | PA11, PA12 | the same with -DIWHEEL_CAN_PINS=PA11; on Blue Pill and Discovery the pins of the USB socket  |
///
/// A `board.h` may define another pin before it includes this file.
#ifndef BRD_BOARD_PINS_H
#define BRD_BOARD_PINS_H

/// A pin as one number; each port has 16 pins.
#define BRD_PIN(port, number) ((uint32_t)(port)*16U + (number))
#define BRD_PIN_A(number)     BRD_PIN(0U, number)
#define BRD_PIN_B(number)     BRD_PIN(1U, number)
#define BRD_PIN_C(number)     BRD_PIN(2U, number)
#define BRD_PIN_D(number)     BRD_PIN(3U, number)

#ifndef BRD_ESTOP
#define BRD_ESTOP BRD_PIN_B(0U) ///< Pin 0 of any port, because the interrupt is that of EXTI line 0.
#endif
#ifndef BRD_BUTTON
#define BRD_BUTTON BRD_PIN_A(1U)
#endif

#define BRD_UART_TX BRD_PIN_A(2U) ///< Pins of USART2.
#define BRD_UART_RX BRD_PIN_A(3U)

#ifndef BRD_CAN_ON_PA11
#define BRD_CAN_ON_PA11 0 ///< 1: set by -DIWHEEL_CAN_PINS=PA11.
#endif
#define BRD_CAN_RX (BRD_CAN_ON_PA11 != 0 ? BRD_PIN_A(11U) : BRD_PIN_B(8U))
#define BRD_CAN_TX (BRD_CAN_ON_PA11 != 0 ? BRD_PIN_A(12U) : BRD_PIN_B(9U))

#endif
