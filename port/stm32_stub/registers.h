// SPDX-License-Identifier: MIT
/// The registers of the STM32F103 that this port touches, and no others.
///
/// Names and offsets are those of the reference manual RM0008. Gaps are `reserved`; every block's size is asserted, so that a
/// forgotten gap does not compile.
#ifndef IW_STM32_REGISTERS_H
#define IW_STM32_REGISTERS_H

#include "iwheel/types.h"

typedef volatile uint32_t iw_register_t;

typedef struct {
    iw_register_t CR, CFGR, CIR, APB2RSTR, APB1RSTR, AHBENR, APB2ENR, APB1ENR, BDCR, CSR;
} iw_stm32_rcc_t;

typedef struct {
    iw_register_t CRL, CRH, IDR, ODR, BSRR, BRR, LCKR;
} iw_stm32_gpio_t;

typedef struct {
    iw_register_t EVCR, MAPR, EXTICR[4];
} iw_stm32_afio_t;

typedef struct {
    iw_register_t IMR, EMR, RTSR, FTSR, SWIER, PR;
} iw_stm32_exti_t;

typedef struct {
    iw_register_t KR, PR, RLR, SR;
} iw_stm32_iwdg_t;

typedef struct {
    iw_register_t CTRL, LOAD, VAL, CALIB;
} iw_stm32_systick_t;

typedef struct {
    iw_register_t TIR, TDTR, TDLR, TDHR;
} iw_stm32_can_mailbox_t;

typedef struct {
    iw_register_t RIR, RDTR, RDLR, RDHR;
} iw_stm32_can_fifo_t;

typedef struct {
    iw_register_t MCR, MSR, TSR, RF0R, RF1R, IER, ESR, BTR, reserved1[88];
    iw_stm32_can_mailbox_t tx[3];
    iw_stm32_can_fifo_t rx[2];
    iw_register_t reserved2[12], FMR, FM1R, reserved3, FS1R, reserved4, FFA1R, reserved5, FA1R, reserved6[8];
    iw_register_t filter[14][2];
} iw_stm32_can_t;

IW_STATIC_ASSERT(offsetof(iw_stm32_can_t, tx) == 0x180, can_tx);
IW_STATIC_ASSERT(offsetof(iw_stm32_can_t, FMR) == 0x200, can_fmr);
IW_STATIC_ASSERT(offsetof(iw_stm32_can_t, FA1R) == 0x21C, can_fa1r);
IW_STATIC_ASSERT(offsetof(iw_stm32_can_t, filter) == 0x240, can_filter);
IW_STATIC_ASSERT(offsetof(iw_stm32_rcc_t, CSR) == 0x24, rcc_csr);

#define IW_STM32_RCC ((iw_stm32_rcc_t *)0x40021000U)
#define IW_STM32_FLASH ((iw_register_t *)0x40022000U) ///< ACR, the block's first register.
#define IW_STM32_GPIOA ((iw_stm32_gpio_t *)0x40010800U)
#define IW_STM32_GPIOB ((iw_stm32_gpio_t *)0x40010C00U)
#define IW_STM32_AFIO ((iw_stm32_afio_t *)0x40010000U)
#define IW_STM32_EXTI ((iw_stm32_exti_t *)0x40010400U)
#define IW_STM32_IWDG ((iw_stm32_iwdg_t *)0x40003000U)
#define IW_STM32_CAN ((iw_stm32_can_t *)0x40006400U)
#define IW_STM32_SYSTICK ((iw_stm32_systick_t *)0xE000E010U)

#endif
