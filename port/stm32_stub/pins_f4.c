// SPDX-License-Identifier: MIT
// Sections are those of RM0090: 7.3 clock enables, 8.4 ports, 9.2 system configuration.
#include "pins.h"

typedef struct {
    volatile uint32_t MODER, OTYPER, OSPEEDR, PUPDR, IDR, ODR, BSRR, LCKR, AFRL, AFRH;
} port_t;

#define AHB1ENR        (*(volatile uint32_t *)0x40023830U)
#define APB1ENR        (*(volatile uint32_t *)0x40023840U)
#define APB2ENR        (*(volatile uint32_t *)0x40023844U)
#define SYSCFG_EXTICR1 (*(volatile uint32_t *)0x40013808U)
#define PORT_A         ((port_t *)0x40020000U)

#define ESTOP  (1U << 0)
#define BUTTON (1U << 1)
#define LAMP   (1U << 5)

// Two bits a pin in MODER (8.4.1) and PUPDR (8.4.4), four in AFRH (8.4.10).
#define OUTPUT            1U
#define ALTERNATE         2U
#define PULL_UP           1U
#define AF_CAN1           9U
#define FIELD(pin, value) ((uint32_t)(value) << (2U * (pin)))

static void set_fields(volatile uint32_t *address, uint32_t mask, uint32_t fields) {
    *address = (*address & ~mask) | fields;
}

void iw_pins_init(void) {
    AHB1ENR |= 1U << 0;  // 7.3.10: port A.
    APB1ENR |= 1U << 25; // 7.3.13: CAN1.
    APB2ENR |= 1U << 14; // 7.3.14: SYSCFG.
    iw_pins_lamp(false);
    set_fields(&PORT_A->PUPDR, FIELD(0, 3) | FIELD(1, 3) | FIELD(11, 3),
               FIELD(0, PULL_UP) | FIELD(1, PULL_UP) | FIELD(11, PULL_UP)); // No transceiver reads recessive.
    set_fields(&PORT_A->AFRH, 0x000FF000U, (AF_CAN1 << 12) | (AF_CAN1 << 16));
    set_fields(&PORT_A->MODER, FIELD(0, 3) | FIELD(1, 3) | FIELD(5, 3) | FIELD(11, 3) | FIELD(12, 3),
               FIELD(5, OUTPUT) | FIELD(11, ALTERNATE) | FIELD(12, ALTERNATE));
    set_fields(&SYSCFG_EXTICR1, 0xFU, 0U); // 9.2.3: EXTI0 is PA0.
}

bool iw_pins_estop_high(void) {
    return (PORT_A->IDR & ESTOP) != 0U;
}

bool iw_pins_button_low(void) {
    return (PORT_A->IDR & BUTTON) == 0U;
}

void iw_pins_lamp(bool lit) {
    PORT_A->BSRR = lit ? LAMP : LAMP << 16; // 8.4.7: the upper half clears.
}
