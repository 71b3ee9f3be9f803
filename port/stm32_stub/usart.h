// SPDX-License-Identifier: MIT
/// Registers of USART2 in the two versions of this peripheral: STM32F1 and F4 (RM0008 27.6, RM0090 30.6), and STM32G4
/// (RM0440 37.8), which has separate data registers and clears flags by a register of its own. The bits of the status
/// register and of CR3 are the same in both.
#ifndef BRD_USART_H
#define BRD_USART_H

#include "board.h"

#include <stdint.h>

#ifdef BRD_USART_HAS_ICR
typedef struct {
    volatile uint32_t CR1, CR2, CR3, BRR, GTPR, RTOR, RQR, SR, ICR, RDR, TDR, PRESC; ///< SR is called ISR here.
} brd_usart_t;
#define BRD_USART_RDR RDR
#define BRD_USART_TDR TDR
#define BRD_USART_UE  (1U << 0) ///< CR1
#else
typedef struct {
    volatile uint32_t SR, DR, BRR, CR1, CR2, CR3;
} brd_usart_t;
#define BRD_USART_RDR DR
#define BRD_USART_TDR DR
#define BRD_USART_UE  (1U << 13) ///< CR1
#endif

#define BRD_USART2 ((brd_usart_t *)0x40004400U)

/// Clears a pause and errors after a read of SR. Without ICR this reads the data register; the DMA has already fetched
/// the byte in it, or the byte is damaged. With ICR a read could remove a byte before the DMA reads it.
static inline void brd_usart_clear(void) {
#ifdef BRD_USART_HAS_ICR
    BRD_USART2->ICR = 0x1FU; // Parity, framing, noise, overrun, pause.
#else
    (void)BRD_USART2->DR;
#endif
}

/// Discards a received byte and clears the overrun of earlier ones after a read of SR.
static inline void brd_usart_discard(void) {
    (void)BRD_USART2->BRD_USART_RDR;
#ifdef BRD_USART_HAS_ICR
    brd_usart_clear();
#endif
}

#endif
