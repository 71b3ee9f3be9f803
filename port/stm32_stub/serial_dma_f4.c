// SPDX-License-Identifier: MIT
// Section numbers refer to RM0090: 7.3.10 clock enable, 10.5 DMA. Table 42: USART2 uses channel 4 of DMA1's streams 5
// (receive) and 6 (transmit).
#include "serial.h"

typedef struct {
    volatile uint32_t CR, NDTR, PAR, M0AR, M1AR, FCR;
} stream_t;

typedef struct {
    volatile uint32_t LISR, HISR, LIFCR, HIFCR;
    stream_t stream[8];
} dma_t;

#define AHB1ENR  (*(volatile uint32_t *)0x40023830U)
#define DMA1     ((dma_t *)0x40026000U)
#define RECEIVE  (&DMA1->stream[5])
#define TRANSMIT (&DMA1->stream[6])

#define ENABLE      (1U << 0) // 10.5.5
#define AT_HALF     (1U << 3)
#define AT_END      (1U << 4)
#define FROM_MEMORY (1U << 6)
#define CIRCULAR    (1U << 8)
#define MEMORY_NEXT (1U << 10)
#define HIGH        (2U << 16) // Priority: a received byte that waits too long is lost, a byte to send is not.
#define CHANNEL_4   (4U << 25)

#define ALL_FLAGS ((0x3DU << 6) | (0x3DU << 16)) // 10.5.4: streams 5 and 6.

void brd_serial_dma_start(volatile uint32_t *data_register, char *buffer, uint32_t length) {
    AHB1ENR |= 1U << 21;
    RECEIVE->CR = 0;
    TRANSMIT->CR = 0;
    // 10.3.17: a stream stops immediately, or after the byte in progress. Here both streams have been off since the
    // reset, so the code does not wait.
    DMA1->HIFCR = ALL_FLAGS;
    RECEIVE->PAR = (uint32_t)(uintptr_t)data_register;
    RECEIVE->M0AR = (uint32_t)(uintptr_t)buffer;
    RECEIVE->NDTR = length;
    RECEIVE->CR = CHANNEL_4 | HIGH | MEMORY_NEXT | CIRCULAR | AT_HALF | AT_END | ENABLE;
}

bool brd_serial_dma_receives(void) {
    return (RECEIVE->CR & ENABLE) != 0U;
}

uint32_t brd_serial_dma_left(void) {
    return RECEIVE->NDTR;
}

/// 10.3.17: the flags of the last transfer must be cleared before a stream is enabled again. It has disabled itself.
void brd_serial_dma_send(volatile uint32_t *data_register, const char *bytes, uint32_t length) {
    DMA1->HIFCR = 0x3DU << 16;
    TRANSMIT->PAR = (uint32_t)(uintptr_t)data_register;
    TRANSMIT->M0AR = (uint32_t)(uintptr_t)bytes;
    TRANSMIT->NDTR = length;
    TRANSMIT->CR = CHANNEL_4 | MEMORY_NEXT | FROM_MEMORY | AT_END | ENABLE;
}

bool brd_serial_dma_sends(void) {
    return (TRANSMIT->CR & ENABLE) != 0U;
}

void brd_serial_dma_acknowledge(void) {
    DMA1->HIFCR = ALL_FLAGS;
}
