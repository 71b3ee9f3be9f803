// SPDX-License-Identifier: MIT
/// What every Cortex-M has inside: time, interrupts, sleep, reset.
///
/// Sections are those of PM0056 (Cortex-M3) and PM0214 (Cortex-M4): 4.3 NVIC, 4.4 system control, 4.5 SysTick.
#ifndef BRD_CORTEX_M_H
#define BRD_CORTEX_M_H

#include "iwheel/types.h"

/// The interrupts of this port. The numbers are the same on every STM32F1 and F4.
typedef enum {
    BRD_IRQ_EXTI0 = 6,
    BRD_IRQ_SERIAL_RECEIVE = 16,  ///< DMA1 channel 6 of an F1, stream 5 of an F4.
    BRD_IRQ_SERIAL_TRANSMIT = 17, ///< DMA1 channel 7, stream 6.
    BRD_IRQ_CAN_TRANSMIT = 19,
    BRD_IRQ_CAN_RECEIVE = 20,
    BRD_IRQ_CAN_ERROR = 22,
    BRD_IRQ_SERIAL = 38, ///< USART2.
} brd_irq_t;

/// Interrupts and exceptions may come from here on, all with the same priority: none interrupts another.
void brd_irq_enable(brd_irq_t irq);

/// Starts the tick of 1 ms that time is counted with, or continues it on another clock. `core_hz` is a multiple of 1
/// MHz.
void brd_time_start(uint32_t core_hz);

/// Microseconds since the first `brd_time_start`, monotonic. Not from an interrupt, and not while interrupts are held
/// off.
iw_time_us_t brd_time_now_us(void);

/// Makes the next `brd_sleep_until` return at once. From an interrupt that the main loop must act upon.
void brd_wake(void);

/// Sleeps until that time, to the next tick, or until `brd_wake` was called since the last return.
void brd_sleep_until(iw_time_us_t until_us);

/// Does not return. RAM keeps its contents.
_Noreturn void brd_system_reset(void);

#endif
