// SPDX-License-Identifier: MIT
/// Bytes to and from a host on USART2 (board_pins.h), 8N1, by DMA in both directions. The CPU wakes for a pause on the
/// line, for half a buffer and for the end of a transmission, not for each byte. No function waits.
///
/// Received bytes go into a circular buffer of BRD_SERIAL_RECEIVE_BYTES. A caller that reads later than one length of
/// the buffer (10 ms at 1 Mbaud) gets bytes in the wrong order, which the CRC of the lines detects. Section numbers
/// refer to RM0008: 13 DMA, 27 USART; in RM0090 they are 10 and 30.
#ifndef BRD_SERIAL_H
#define BRD_SERIAL_H

#include "iwheel/types.h"

#include <assert.h>

#ifndef BRD_SERIAL_BAUD
#define BRD_SERIAL_BAUD 1000000U ///< 115200 to 2000000; set by -DIWHEEL_BAUD.
#endif
#define BRD_SERIAL_RECEIVE_BYTES 1024U ///< A power of two.
#define BRD_SERIAL_SEND_BYTES    2048U ///< A power of two.

static_assert(BRD_SERIAL_BAUD >= 115200U && BRD_SERIAL_BAUD <= 2000000U, "see BRD_SERIAL_BAUD");

/// Call it after `brd_pins_init`, and again after every change of the clock. It discards all bytes that were received
/// or wait to be sent.
void brd_serial_start(uint32_t apb1_hz);

/// Copies at most `size` received bytes to `out`. Returns their number.
size_t brd_serial_read(char *out, size_t size);

/// Returns true once after the line lost or damaged a byte (overrun, noise, framing), or the DMA failed.
bool brd_serial_had_error(void);

/// Returns the number of bytes that `brd_serial_write` accepts now.
size_t brd_serial_room(void);

/// Appends the bytes to those that wait to be sent. If they do not all fit, it appends none and returns false.
bool brd_serial_write(const char *bytes, size_t length);

/// Sends from the caller's own buffer, after the bytes that wait now. Returns false if the previous such buffer is
/// still in use. The buffer must not change until `brd_serial_lends` returns false.
bool brd_serial_lend(const char *bytes, size_t length);
bool brd_serial_lends(void);

/// Returns true when the serial port has all bytes. It may still send the last two: its flag TC does not show the end,
/// because the DMA does not clear it (RM0008 27.3.13), and it can be set again before the DMA starts.
bool brd_serial_is_idle(void);

/// Continues to send. Call it after every write and after each wake-up.
void brd_serial_step(void);

/// One file per family implements these functions. This one enables the clock of the DMA and starts the circular
/// receive channel.
void brd_serial_dma_start(volatile uint32_t *data_register, char *buffer, uint32_t length);
/// Returns false after a bus error, which disables the receive channel.
bool brd_serial_dma_receives(void);
/// Returns the number of bytes until the receive buffer wraps: `length` down to 1.
uint32_t brd_serial_dma_left(void);
/// Starts to send. Call it only while the DMA sends nothing.
void brd_serial_dma_send(volatile uint32_t *data_register, const char *bytes, uint32_t length);
/// Returns false when all bytes have been passed to the USART.
bool brd_serial_dma_sends(void);
/// Clears the flags of both DMA interrupts.
void brd_serial_dma_acknowledge(void);

/// Interrupt handlers: pause or error on the line, DMA to memory, DMA from memory. They clear their flags, note errors
/// and wake the main loop.
void brd_serial_usart_handler(void);
void brd_serial_receive_handler(void);
void brd_serial_transmit_handler(void);

#endif
