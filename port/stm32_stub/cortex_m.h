// SPDX-License-Identifier: MIT
/// Functions that every Cortex-M has: time, interrupts, sleep, reset.
///
/// Section numbers refer to PM0056 (Cortex-M3) and PM0214 (Cortex-M4): 4.3 NVIC, 4.4 system control, 4.5 SysTick.
#ifndef BRD_CORTEX_M_H
#define BRD_CORTEX_M_H

#include "iwheel/types.h"

/// Interrupts of this port. The numbers are the same on every STM32F1, F4 and G4, except those of the bus controller.
typedef enum {
    BRD_IRQ_EXTI0 = 6,
    BRD_IRQ_SERIAL_RECEIVE = 16,  ///< DMA1 channel 6 on an F1 and G4, stream 5 on an F4.
    BRD_IRQ_SERIAL_TRANSMIT = 17, ///< DMA1 channel 7 on an F1 and G4, stream 6 on an F4.
    BRD_IRQ_CAN_TRANSMIT = 19,
    BRD_IRQ_CAN_RECEIVE = 20,
    BRD_IRQ_FDCAN = 21, ///< G4: FDCAN1, interrupt line 0. An image with bxCAN never enables it, and vice versa.
    BRD_IRQ_CAN_ERROR = 22,
    BRD_IRQ_SERIAL = 38, ///< USART2.
} brd_irq_t;

/// Enables the interrupt. All interrupts and exceptions of this port have the same priority: none interrupts another.
void brd_irq_enable(brd_irq_t irq);

/// Starts the tick of 1 ms that counts the time, or continues it with another clock. `core_hz` must be a multiple of 1
/// MHz.
void brd_time_start(uint32_t core_hz);

/// Returns the microseconds since the first `brd_time_start`, monotonic. Do not call it from an interrupt or while
/// interrupts are masked.
iw_time_us_t brd_time_now_us(void);

/// Makes the next `brd_sleep_until` return immediately. Every interrupt handler ends with this call, which also waits
/// for the writes of the handler.
void brd_wake(void);

/// Sleeps until `until_us`, at the accuracy of a tick, or until `brd_wake` is called. A call of `brd_wake` since the
/// last return ends the sleep immediately.
void brd_sleep_until(iw_time_us_t until_us);

/// Resets the chip and does not return. RAM retains its contents.
_Noreturn void brd_system_reset(void);

#endif
