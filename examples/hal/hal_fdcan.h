// SPDX-License-Identifier: MIT
/// @file
/// HAL of the core on the FDCAN controller of an STM32G4, with ST's HAL and a project of STM32CubeMX.
///
/// The project tests this file on a PC with headers that only declare what it uses, and a model of ST's HAL
/// (test/examples). It was not compiled with ST's package, and did not run on a chip: test it on your board first
/// (docs/developer/porting.md, section 5). port/stm32_stub is the complete port without ST's HAL; it also replaces a
/// waiting setpoint by a newer one.
///
/// **Settings.** CubeMX sets pins, FDCAN clock, the interrupt of FDCAN and the EXTI interrupt of the e-stop, both
/// interrupts with one priority; `hal_fdcan_start` sets the rest. STM32H7: also set the sizes of the message RAM, with
/// at least 2 elements for transmission, 2 events and 16 received frames.
///
/// **Time limit.** No function waits for the bus, except `purge`: for the end of a frame, at most for a fixed number of
/// register reads. ST's start and stop functions limit their loops in the same way.
///
/// **Echo.** The controller writes a TX event only after another node has acknowledged the frame.
///
/// **Time stamps.** The controller stamps frames and TX events with one counter of bit times, at the start of the frame.
/// The driver sorts both by these stamps into one queue, in the order of the bus. The stamps have 16 bits (65 ms) and go
/// no further: a frame has the time of the step that reads it.
///
/// **Pair.** Both requests follow each other with interrupts off.
///
/// **Full.** At most one frame of each id waits in the controller, so an old speed never leaves after a zero. While it
/// waits, `send` refuses the next pair.
///
/// **Purge.** The controller can cancel each frame that is not on the bus. A frame on the bus ends first, and is then
/// not repeated. The buffers are a queue, because M_CAN does not support cancellation in FIFO mode.
///
/// **Bus-off.** The controller stays off the bus until `bus_state` restarts it, so no loss is too short to see. The
/// restart drops all frames; the controller then waits for 129 times 11 recessive bits.
///
/// **Bit timing.** 1 Mbit/s at 62.5 % needs 8 quanta: an FDCAN clock that is a multiple of 8 MHz, from a crystal. With
/// another clock `hal_fdcan_start` returns false.
#ifndef HAL_FDCAN_H
#define HAL_FDCAN_H

#include "frame_ring.h" // port/stm32_stub
#include "iwheel/hal.h"
#include "stm32g4xx_hal.h"

typedef struct {
    FDCAN_HandleTypeDef *controller; ///< As MX_FDCAN1_Init of CubeMX leaves it.
    uint32_t clock_hz;               ///< HAL_RCCEx_GetPeriphCLKFreq(RCC_PERIPHCLK_FDCAN).
    TIM_HandleTypeDef *timer;        ///< 32-bit timer (TIM2) that counts microseconds and was started.
    GPIO_TypeDef *estop_port;        ///< Contact to ground with a pull-up, closed while released.
    uint16_t estop_pin;              ///< Its EXTI interrupt is set to both edges.
} hal_fdcan_config_t;

#define HAL_FDCAN_SENT 8U ///< Frames whose TX event can be recognised; the controller holds three of each.

typedef struct {
    hal_fdcan_config_t config;
    brd_frame_ring_t ring;
    iw_can_frame_t sent[HAL_FDCAN_SENT]; ///< Its index is the marker of the frame.
    uint8_t sent_epoch[HAL_FDCAN_SENT];
    uint8_t next_marker;
    uint8_t epoch;             ///< Counts purges: echoes from before a purge are dropped.
    uint32_t buffer[IW_SIDES]; ///< Buffer of the last frame of each id.
    volatile uint32_t lost;    ///< Frames that were lost since the start.
    uint32_t lost_reported;
    volatile uint32_t estop_edges;
    uint32_t estop_edges_seen;
    iw_time_us_t time_us;
} hal_fdcan_t;

/// Configures the controller and joins the bus. The callbacks of ST's HAL use the last `self`. Returns false if the
/// clock cannot make the bit timing, or if ST's HAL refuses a setting.
bool hal_fdcan_start(hal_fdcan_t *self, const hal_fdcan_config_t *config);

/// Returns the functions for `iw_gateway_init`.
iw_hal_t hal_fdcan(hal_fdcan_t *self);

/// Returns the time for the core: the timer, extended to 64 bits. Call it at least every 71 minutes, not in an interrupt.
iw_time_us_t hal_fdcan_time_us(hal_fdcan_t *self);

#endif
