// SPDX-License-Identifier: MIT
// Sections are those of RM0008: 7.3 clock enables, 9.2 ports, 9.4 alternate functions.
#include "pins.h"

typedef struct {
    volatile uint32_t CRL, CRH, IDR, ODR, BSRR;
} port_t;

#define APB2ENR      (*(volatile uint32_t *)0x40021018U)
#define APB1ENR      (*(volatile uint32_t *)0x4002101CU)
#define AFIO_EXTICR1 (*(volatile uint32_t *)0x40010008U)
#define PORT_A       ((port_t *)0x40010800U)
#define PORT_C       ((port_t *)0x40011000U)

#define ESTOP  (1U << 0)
#define BUTTON (1U << 1)
#define CAN_RX (1U << 11)
#define LAMP   (1U << 13)

// Four bits a pin, 9.2.1 and 9.2.2.
#define INPUT_PULLED     0x8U
#define OUTPUT_SLOW      0x2U
#define ALTERNATE        0x9U // Push-pull, 10 MHz: enough for 1 Mbit/s, and quiet.
#define FIELD(pin, mode) ((uint32_t)(mode) << (4U * ((pin) % 8U)))

static void set_fields(volatile uint32_t *address, uint32_t mask, uint32_t fields) {
    *address = (*address & ~mask) | fields;
}

void iw_pins_init(void) {
    APB2ENR |= (1U << 0) | (1U << 2) | (1U << 4); // 7.3.7: AFIO, ports A and C.
    APB1ENR |= 1U << 25;                          // 7.3.8: CAN.
    PORT_A->BSRR = ESTOP | BUTTON | CAN_RX; // 9.1.1: an input's output bit chooses up. No transceiver reads recessive.
    iw_pins_lamp(false);
    set_fields(&PORT_A->CRL, FIELD(0, 0xF) | FIELD(1, 0xF), FIELD(0, INPUT_PULLED) | FIELD(1, INPUT_PULLED));
    set_fields(&PORT_A->CRH, FIELD(11, 0xF) | FIELD(12, 0xF), FIELD(11, INPUT_PULLED) | FIELD(12, ALTERNATE));
    set_fields(&PORT_C->CRH, FIELD(13, 0xF), FIELD(13, OUTPUT_SLOW));
    set_fields(&AFIO_EXTICR1, 0xFU, 0U); // 9.4.3: EXTI0 is PA0.
}

bool iw_pins_estop_high(void) {
    return (PORT_A->IDR & ESTOP) != 0U;
}

bool iw_pins_button_low(void) {
    return (PORT_A->IDR & BUTTON) == 0U;
}

void iw_pins_lamp(bool lit) {
    PORT_C->BSRR = lit ? LAMP << 16 : LAMP; // 9.2.5: the upper half clears.
}
