// SPDX-License-Identifier: MIT
#include "serial.h"

#include "cortex_m.h"
#include "usart.h"

#include <stdatomic.h>
#include <string.h>

#define ERRORS (7U << 1) // SR: framing, noise, overrun.
#define RE     (1U << 2) // CR1
#define TE     (1U << 3)
#define IDLEIE (1U << 4)
#define EIE    (1U << 0) // CR3
#define DMAR   (1U << 6)
#define DMAT   (1U << 7)

static_assert((BRD_SERIAL_RECEIVE_BYTES & (BRD_SERIAL_RECEIVE_BYTES - 1U)) == 0U &&
                  (BRD_SERIAL_SEND_BYTES & (BRD_SERIAL_SEND_BYTES - 1U)) == 0U,
              "the indices wrap at a power of two");

// The DMA accesses these, and interrupt handlers have no argument, so they have file scope.
static char received[BRD_SERIAL_RECEIVE_BYTES];
static char waiting[BRD_SERIAL_SEND_BYTES];
static uint32_t tail;      // Position of the next received byte to read.
static uint32_t put, sent; // Bytes put into and sent from `waiting` since the start.
static uint32_t sending;   // Number of these bytes that the DMA sends now.
static const char *lent;   // Buffer of a caller; NULL: none.
static uint32_t lent_bytes;
static uint32_t lent_at; // The buffer is sent before this byte of `waiting`.
static bool lent_is_sending;
static atomic_bool had_error;

void brd_serial_start(uint32_t apb1_hz) {
    BRD_USART2->CR1 = 0;
    tail = put = sent = sending = 0;
    lent = NULL;
    lent_is_sending = false;
    BRD_USART2->BRR = (apb1_hz + BRD_SERIAL_BAUD / 2U) / BRD_SERIAL_BAUD; // 27.3.4: sixteenths.
    BRD_USART2->CR3 = DMAR | DMAT | EIE;
    brd_serial_dma_start(&BRD_USART2->BRD_USART_RDR, received, sizeof received);
    BRD_USART2->CR1 = BRD_USART_UE | TE | RE | IDLEIE;
    brd_irq_enable(BRD_IRQ_SERIAL_RECEIVE);
    brd_irq_enable(BRD_IRQ_SERIAL_TRANSMIT);
    brd_irq_enable(BRD_IRQ_SERIAL);
}

size_t brd_serial_read(char *out, size_t size) {
    const uint32_t head = BRD_SERIAL_RECEIVE_BYTES - brd_serial_dma_left();
    size_t count = 0;
    while (count < size && tail != head % BRD_SERIAL_RECEIVE_BYTES) {
        out[count++] = received[tail];
        tail = (tail + 1U) % BRD_SERIAL_RECEIVE_BYTES;
    }
    return count;
}

/// A bus error disables the receive channel (13.3.4). It starts again, with the loss of the bytes meanwhile.
bool brd_serial_had_error(void) {
    if (!brd_serial_dma_receives()) {
        tail = 0;
        brd_serial_dma_start(&BRD_USART2->BRD_USART_RDR, received, sizeof received);
        return true;
    }
    return atomic_exchange_explicit(&had_error, false, memory_order_relaxed);
}

size_t brd_serial_room(void) {
    return BRD_SERIAL_SEND_BYTES - (put - sent);
}

bool brd_serial_write(const char *bytes, size_t length) {
    if (length > brd_serial_room()) {
        return false;
    }
    const size_t at = put % BRD_SERIAL_SEND_BYTES;
    const size_t first = (length < BRD_SERIAL_SEND_BYTES - at) ? length : BRD_SERIAL_SEND_BYTES - at;
    memcpy(&waiting[at], bytes, first);
    memcpy(waiting, &bytes[first], length - first);
    put += (uint32_t)length;
    return true;
}

bool brd_serial_lend(const char *bytes, size_t length) {
    if (lent != NULL) {
        return false;
    }
    lent = bytes;
    lent_bytes = (uint32_t)length;
    lent_at = put;
    return true;
}

bool brd_serial_lends(void) {
    return lent != NULL;
}

bool brd_serial_is_idle(void) {
    return put == sent && lent == NULL && !brd_serial_dma_sends();
}

/// Marks the bytes as sent that the DMA has passed to the USART.
static void settle(void) {
    if (lent_is_sending) {
        lent_is_sending = false;
        lent = NULL;
    }
    sent += sending;
    sending = 0;
}

void brd_serial_step(void) {
    if (brd_serial_dma_sends()) {
        return;
    }
    settle();
    const char *from = lent;
    uint32_t length = lent_bytes;
    lent_is_sending = lent != NULL && sent == lent_at;
    if (!lent_is_sending) {
        const uint32_t until = (lent != NULL) ? lent_at : put;
        const uint32_t to_end = BRD_SERIAL_SEND_BYTES - sent % BRD_SERIAL_SEND_BYTES;
        length = sending = (until - sent < to_end) ? until - sent : to_end;
        from = &waiting[sent % BRD_SERIAL_SEND_BYTES];
    }
    if (length > 0U) {
        brd_serial_dma_send(&BRD_USART2->BRD_USART_TDR, from, length);
    }
}

/// The read of SR is the first half of the clearing of pause and errors (27.6.1).
void brd_serial_usart_handler(void) {
    if ((BRD_USART2->SR & ERRORS) != 0U) {
        atomic_store_explicit(&had_error, true, memory_order_relaxed);
    }
    brd_usart_clear();
    brd_wake();
}

void brd_serial_receive_handler(void) {
    brd_serial_dma_acknowledge();
    brd_wake();
}

void brd_serial_transmit_handler(void) {
    brd_serial_dma_acknowledge();
    brd_wake();
}
