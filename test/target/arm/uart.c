// SPDX-License-Identifier: MIT
// The UART code of the image on an independent model of an STM32: QEMU's, which has the USARTs and no DMA. First
// console.c as it is, which polls; then serial.c as it is, with a loop in the place of the DMA's two channels.
#include "console.h"
#include "serial.h"

#include <stdlib.h>
#include <string.h>

#define HZ   16000000U // APB1 after a reset.
#define SR   (*(volatile uint32_t *)0x40004400U)
#define RXNE (1U << 5)
#define TXE  (1U << 7)

// ---- what the DMA would do ----------------------------------------------------------------------------------------

static volatile uint32_t *data_register;
static char *ring;
static uint32_t ring_length, ring_left, outgoing_left;
static const char *outgoing;

void brd_serial_dma_start(volatile uint32_t *data, char *buffer, uint32_t length) {
    data_register = data;
    ring = buffer;
    ring_length = ring_left = length;
}

bool brd_serial_dma_receives(void) {
    return true;
}

uint32_t brd_serial_dma_left(void) {
    return ring_left;
}

void brd_serial_dma_send(volatile uint32_t *data, const char *bytes, uint32_t length) {
    data_register = data;
    outgoing = bytes;
    outgoing_left = length;
}

bool brd_serial_dma_sends(void) {
    return outgoing_left > 0U;
}

void brd_serial_dma_acknowledge(void) {}

static void move_bytes(void) {
    if ((SR & RXNE) != 0U) {
        ring[ring_length - ring_left] = (char)*data_register;
        ring_left = (ring_left > 1U) ? ring_left - 1U : ring_length;
    }
    if (outgoing_left > 0U && (SR & TXE) != 0U) {
        *data_register = (uint8_t)*outgoing++;
        outgoing_left--;
    }
}

// ---- the program --------------------------------------------------------------------------------------------------

static void console(void) {
    brd_console_start(HZ);
    brd_console_text("console ");
    brd_console_number(115200);
    brd_console_text("\n");
    while (brd_console_step()) {
    }
    while (!brd_console_asked()) { // Any character.
    }
}

static void step(void) {
    move_bytes();
    brd_serial_step();
}

/// Each line comes back, from the ring and from a buffer that is lent, in that order. After "end" it waits for one more
/// byte before it exits: a terminal whose other end is gone loses what was not read.
int main(void) {
    static char line[600];
    static char copy[600];
    size_t length = 0;
    console();
    brd_serial_start(HZ);
    (void)brd_serial_write("serial\n", 7);
    for (;;) {
        step();
        if (brd_serial_read(&line[length], 1) == 0U || line[length++] != '\n') {
            length %= sizeof line;
            continue;
        }
        while (brd_serial_lends() || brd_serial_room() < length) {
            step();
        }
        memcpy(copy, line, length);
        (void)brd_serial_write(line, length);
        (void)brd_serial_lend(copy, length);
        while (!brd_serial_is_idle()) {
            step();
        }
        if (strncmp(line, "end\n", 4) == 0) {
            while (brd_serial_read(line, 1) == 0U) {
                step();
            }
            exit(brd_serial_had_error() ? 1 : 0);
        }
        length = 0;
    }
}
