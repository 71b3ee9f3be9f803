// SPDX-License-Identifier: MIT
// Section numbers refer to RM0008: 27.6; in RM0090 it is 30.6.
#include "console.h"

#include "usart.h"

#include <assert.h>

#define BAUD   115200U
#define RXNE   (1U << 5)
#define TXE    (1U << 7)
#define RE     (1U << 2)
#define TE     (1U << 3)
#define LENGTH 512U

static_assert((LENGTH & (LENGTH - 1U)) == 0U, "the indices wrap at a power of two");

static char waiting[LENGTH];
static uint32_t put, sent; // Characters since the start.

void brd_console_start(uint32_t apb1_hz) {
    BRD_USART2->BRR = (apb1_hz + BAUD / 2U) / BAUD; // 27.3.4: in sixteenths.
    BRD_USART2->CR1 = BRD_USART_UE | TE | RE;
}

/// Drops a character that does not fit: the control loop never waits for a terminal (R11).
static void append(char character) {
    if (put - sent < LENGTH - 1U) {
        waiting[put++ % LENGTH] = character;
    }
}

void brd_console_text(const char *text) {
    for (; *text != '\0'; text++) {
        append(*text);
    }
}

/// Does not use printf, because that of newlib needs the heap.
void brd_console_number(uint32_t value) {
    char digit[10];
    uint32_t digits = 0;
    do {
        digit[digits++] = (char)('0' + value % 10U);
        value /= 10U;
    } while (value > 0U);
    while (digits > 0U) {
        append(digit[--digits]);
    }
}

void brd_console_hex(uint32_t value) {
    brd_console_text("0x");
    for (uint32_t shift = 32U; shift > 0U; shift -= 4U) {
        append("0123456789ABCDEF"[(value >> (shift - 4U)) & 0xFU]);
    }
}

bool brd_console_step(void) {
    if (put != sent && (BRD_USART2->SR & TXE) != 0U) {
        BRD_USART2->BRD_USART_TDR = (uint8_t)waiting[sent++ % LENGTH];
    }
    return put != sent;
}

bool brd_console_asked(void) {
    if ((BRD_USART2->SR & RXNE) == 0U) {
        return false;
    }
    brd_usart_discard(); // Clears RXNE, and the overrun of earlier characters (27.6.1).
    return true;
}
