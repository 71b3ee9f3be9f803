// SPDX-License-Identifier: MIT
/// @file
/// HAL of the core on an MCP2515 behind SPI. mcp2515_drive.ino uses it on an Arduino board.
///
/// The project tests this file on a PC with a model of the chip after its data sheet (test/examples), and compiles the
/// sketch with stub headers. It was not compiled with Arduino's packages, and did not run with a chip: test it on your
/// board first (docs/developer/porting.md, section 5).
///
/// **Crystal.** 16 MHz: 8 quanta, sampled at exactly 62.5 %. The usual modules with 8 MHz cannot do 1 Mbit/s.
///
/// **Time limit.** No function waits for the bus, except `purge`: for the end of a frame, at most for a fixed number of
/// SPI transfers. SPI must have 8 MHz or more: a transfer takes 2 to 15 us.
///
/// **Interrupt.** The chip stores two received frames only: its interrupt must call `hal_mcp2515_on_interrupt` within
/// 90 us. `mask` of the board prevents this interrupt while other functions use the chip.
///
/// **Echo.** TXnIF is set after another node has acknowledged the frame. The chip has no time stamps: a frame has the
/// time of the step that reads it. Frames and echoes that the chip holds together are returned frames first.
///
/// **Pair.** One SPI byte requests both buffers. Each wheel has one buffer, so an old speed never leaves after a zero.
/// While a frame of one wheel waits, `send` refuses a pair.
///
/// **Purge.** The chip can abort each frame that is not on the bus. A frame on the bus ends first, and is then not
/// repeated.
///
/// **Bus-off.** The chip would return to the bus on its own after 128 times 11 recessive bits (1.4 ms at least) and
/// send what waits. The interrupt resets it before, which drops all frames. `bus_state` reports the loss in at least
/// one call, and lets the chip join again after 2 ms.
#ifndef HAL_MCP2515_H
#define HAL_MCP2515_H

#include "iwheel/hal.h"

#ifdef __cplusplus
extern "C" {
#endif

#define HAL_MCP2515_RING 32U ///< Frames between two steps of the core: 1.5 ms of a full bus.

/// Functions of the board.
typedef struct {
    /// One SPI transfer with chip select: sends `bytes` and replaces them by the received ones.
    void (*transfer)(uint8_t *bytes, uint32_t count);
    void (*mask)(bool masked); ///< Prevents or permits the interrupt that calls `hal_mcp2515_on_interrupt`.
    uint32_t (*micros)(void);  ///< Microseconds, 32 bits that wrap.
    int (*estop_pressed)(void);
} hal_mcp2515_board_t;

/// State of the chip. A loss of the bus leads to RESET from every state.
///
///     RESET --2 ms, and the settings read back--> JOINING --11 recessive bits--> RUNNING
typedef enum {
    HAL_MCP2515_RESET = 0,
    HAL_MCP2515_JOINING,
    HAL_MCP2515_RUNNING,
} hal_mcp2515_phase_t;

typedef struct {
    hal_mcp2515_board_t board;
    volatile hal_mcp2515_phase_t phase;
    iw_bus_state_t loss;                   ///< Reported while the phase is not RUNNING.
    uint32_t reset_us;                     ///< Time of the last reset of the chip.
    iw_can_frame_t ring[HAL_MCP2515_RING]; ///< Frames and echoes, the oldest at `first`.
    uint32_t first;
    uint32_t count;
    bool has_lost;                    ///< `receive` must report a loss.
    bool buffer_1_older;              ///< A frame in receive buffer 1 is older than one in buffer 0.
    iw_can_frame_t waiting[IW_SIDES]; ///< Frames in the chip.
    bool waits[IW_SIDES];
    iw_time_us_t time_us;
} hal_mcp2515_t;

/// Resets the chip. `bus_state` then configures it and joins the bus.
void hal_mcp2515_start(hal_mcp2515_t *self, const hal_mcp2515_board_t *board);

/// Call it in the interrupt of the chip (low level or falling edge of INT).
void hal_mcp2515_on_interrupt(hal_mcp2515_t *self);

/// Returns the functions for `iw_gateway_init`.
iw_hal_t hal_mcp2515(hal_mcp2515_t *self);

/// Returns the time for the core, extended to 64 bits. Call it at least every 71 minutes, not in an interrupt.
iw_time_us_t hal_mcp2515_time_us(hal_mcp2515_t *self);

#ifdef __cplusplus
}
#endif
#endif
