// SPDX-License-Identifier: MIT
// Section numbers refer to RM0008: 7.3.6 clock enable, 13.4 DMA. Table 78: USART2 uses channels 6 (receive) and 7
// (transmit) of DMA1. The DMA of an STM32G4 has the same registers (RM0440 12.6). Its requests come from a multiplexer
// (RM0440 13), of which input 26 and 27 are USART2.
#include "serial.h"

#include "board.h"

typedef struct {
    volatile uint32_t CCR, CNDTR, CPAR, CMAR;
    uint32_t reserved;
} channel_t;

typedef struct {
    volatile uint32_t ISR, IFCR;
    channel_t channel[7];
} dma_t;

#define AHBENR   (*(volatile uint32_t *)BRD_DMA_CLOCK_ADDRESS)
#define DMA1     ((dma_t *)0x40020000U)
#define RECEIVE  (&DMA1->channel[5])
#define TRANSMIT (&DMA1->channel[6])

#define ENABLE      (1U << 0) // 13.4.3
#define AT_END      (1U << 1)
#define AT_HALF     (1U << 2)
#define FROM_MEMORY (1U << 4)
#define CIRCULAR    (1U << 5)
#define MEMORY_NEXT (1U << 7)
#define HIGH        (2U << 12) // Priority: a received byte that waits too long is lost, a byte to send is not.

// 13.4.2: channels 6 and 7, four bits each. CGIF, the lowest of the four, stays zero: a transfer error at the moment of
// that write would be lost, and its channel would stay on (ES0548 2.4.1, for the same DMA of an STM32G0).
#define ALL_FLAGS  (0xEEU << 20)
#define SEND_FLAGS (0xEU << 24)

/// Connects USART2 with both channels, where the chip has a multiplexer for it.
static void connect(void) {
#ifdef BRD_DMAMUX_ADDRESS
    (void)AHBENR; // A clock needs two cycles after its register is written (RM0440 7.2).
    volatile uint32_t *const multiplexer = (volatile uint32_t *)BRD_DMAMUX_ADDRESS; // Counts the channels from 0.
    multiplexer[5] = 26U;
    multiplexer[6] = 27U;
#endif
}

void brd_serial_dma_start(volatile uint32_t *data_register, char *buffer, uint32_t length) {
    AHBENR |= BRD_DMA_CLOCKS;
    connect();
    RECEIVE->CCR = 0;
    TRANSMIT->CCR = 0;
    DMA1->IFCR = ALL_FLAGS;
    RECEIVE->CPAR = (uint32_t)(uintptr_t)data_register;
    RECEIVE->CMAR = (uint32_t)(uintptr_t)buffer;
    RECEIVE->CNDTR = length;
    RECEIVE->CCR = HIGH | MEMORY_NEXT | CIRCULAR | AT_HALF | AT_END | ENABLE;
}

bool brd_serial_dma_receives(void) {
    return (RECEIVE->CCR & ENABLE) != 0U;
}

uint32_t brd_serial_dma_left(void) {
    return RECEIVE->CNDTR;
}

/// 13.3.3: the count can be written only while the channel is off.
void brd_serial_dma_send(volatile uint32_t *data_register, const char *bytes, uint32_t length) {
    TRANSMIT->CCR = 0;
    DMA1->IFCR = SEND_FLAGS; // After a bus error a channel of the G4 starts only without its flag (RM0440 12.4).
    TRANSMIT->CPAR = (uint32_t)(uintptr_t)data_register;
    TRANSMIT->CMAR = (uint32_t)(uintptr_t)bytes;
    TRANSMIT->CNDTR = length;
    TRANSMIT->CCR = MEMORY_NEXT | FROM_MEMORY | AT_END | ENABLE;
}

bool brd_serial_dma_sends(void) {
    return (TRANSMIT->CCR & ENABLE) != 0U && TRANSMIT->CNDTR != 0U;
}

void brd_serial_dma_acknowledge(void) {
    DMA1->IFCR = ALL_FLAGS;
}
