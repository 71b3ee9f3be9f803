// SPDX-License-Identifier: MIT
/// Bytes to and from a host on USART2 (board_pins.h), 8N1, by DMA both ways: the CPU is woken for a pause, for half a
/// buffer and for the end of what was sent, not for each byte. Nobody ever waits in here.
///
/// What comes goes round in a buffer of BRD_SERIAL_RECEIVE_BYTES; who reads later than that long (10 ms at 1 Mbaud)
/// gets bytes that are not in their order, which the lines' CRC tells. Sections are those of RM0008: 13 DMA, 27 USART;
/// RM0090: 10 and 30.
#ifndef BRD_SERIAL_H
#define BRD_SERIAL_H

#include "iwheel/types.h"

#include <assert.h>

#ifndef BRD_SERIAL_BAUD
#define BRD_SERIAL_BAUD 1000000U ///< 115200 to 2000000: -DIWHEEL_BAUD.
#endif
#define BRD_SERIAL_RECEIVE_BYTES 1024U ///< A power of two.
#define BRD_SERIAL_SEND_BYTES    2048U ///< A power of two.

static_assert(BRD_SERIAL_BAUD >= 115200U && BRD_SERIAL_BAUD <= 2000000U, "see BRD_SERIAL_BAUD");

/// After `brd_pins_init`, and again after every change of the clock: begins anew, with nothing received and nothing to
/// send.
void brd_serial_start(uint32_t apb1_hz);

/// Takes at most `size` bytes of what came; how many.
size_t brd_serial_read(char *out, size_t size);

/// True once after a byte was lost or damaged on the wire (overrun, noise, framing).
bool brd_serial_had_error(void);

/// Bytes that `brd_serial_write` takes now.
size_t brd_serial_room(void);

/// Appends to what waits to be sent: all of it, or nothing and false.
bool brd_serial_write(const char *bytes, size_t length);

/// Sends from the caller's own buffer, after what waits now. False if it still sends one. Until `brd_serial_lends` is
/// false the buffer must stay as it is.
bool brd_serial_lend(const char *bytes, size_t length);
bool brd_serial_lends(void);

/// True when all is on the wire.
bool brd_serial_is_idle(void);

/// Goes on sending. After anything was written, and after each wake-up.
void brd_serial_step(void);

/// By one file per family: clocks the DMA and starts the channel that never ends.
void brd_serial_dma_start(volatile uint32_t *data_register, char *buffer, uint32_t length);
/// Bytes until the receive buffer begins anew: `length` down to 1.
uint32_t brd_serial_dma_left(void);
/// Begins to send; only while nothing is sent.
void brd_serial_dma_send(volatile uint32_t *data_register, const char *bytes, uint32_t length);
/// False once all has been handed to the USART.
bool brd_serial_dma_sends(void);
/// Ends both interrupts of the DMA.
void brd_serial_dma_acknowledge(void);

/// The interrupts: pause on the line, DMA to and from memory. They only wake the main loop.
void brd_serial_usart_handler(void);
void brd_serial_receive_handler(void);
void brd_serial_transmit_handler(void);

#endif
