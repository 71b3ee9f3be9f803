// SPDX-License-Identifier: MIT
// Section numbers refer to RM0008: 7.3 clock enables, 9.2 ports, 9.4 alternate functions.
#include "pins.h"

typedef struct {
    volatile uint32_t CRL, CRH, IDR, ODR, BSRR;
    uint32_t reserved[251];
} port_t;

static_assert(sizeof(port_t) == 0x400, "port B follows port A");

#define APB2ENR      (*(volatile uint32_t *)0x40021018U)
#define APB1ENR      (*(volatile uint32_t *)0x4002101CU)
#define AFIO_MAPR    (*(volatile uint32_t *)0x40010004U)
#define AFIO_EXTICR1 (*(volatile uint32_t *)0x40010008U)
#define PORTS        ((port_t *)0x40010800U)

// Four bits per pin: 9.2.1 and 9.2.2.
#define INPUT_PULLED 0x8U
#define OUTPUT_SLOW  0x2U
#define ALTERNATE    0x9U // Push-pull, 10 MHz: fast enough for 1 Mbit/s, with low emission.

static port_t *port_of(uint32_t pin) {
    return &PORTS[pin / 16U];
}

static void set_level(uint32_t pin, bool high) {
    port_of(pin)->BSRR = (high ? 1U : 0x10000U) << (pin % 16U); // 9.2.5: the upper half clears pins.
}

static bool is_high(uint32_t pin) {
    return ((port_of(pin)->IDR >> (pin % 16U)) & 1U) != 0U;
}

static void set_mode(uint32_t pin, uint32_t mode) {
    volatile uint32_t *const fields = (pin % 16U < 8U) ? &port_of(pin)->CRL : &port_of(pin)->CRH;
    const uint32_t shift = 4U * (pin % 8U);
    *fields = (*fields & ~(0xFU << shift)) | (mode << shift);
}

/// 9.1.1: the output bit of an input selects the pull-up.
static void pull_up(uint32_t pin) {
    set_level(pin, true);
    set_mode(pin, INPUT_PULLED);
}

static void enable_clocks(void) {
    static const uint8_t pins[] = {BRD_ESTOP, BRD_BUTTON, BRD_LAMP, BRD_CAN_RX, BRD_UART_RX};
    uint32_t ports = 0;
    for (size_t i = 0; i < sizeof pins; i++) {
        ports |= 1U << (pins[i] / 16U);
    }
    APB2ENR |= (ports << 2) | (1U << 0); // 7.3.7: ports, AFIO.
    APB1ENR |= (1U << 25) | (1U << 17);  // 7.3.8: CAN, USART2.
}

/// Sets the pull-ups before the first read, so that an open contact or a cut wire reads high from the beginning.
void brd_pins_init(void) {
    enable_clocks();
    pull_up(BRD_ESTOP);
    pull_up(BRD_BUTTON);
    pull_up(BRD_CAN_RX); // Without a transceiver the pin reads recessive.
    pull_up(BRD_UART_RX);
    brd_pins_lamp(false);
    set_mode(BRD_LAMP, OUTPUT_SLOW);
    AFIO_MAPR = (BRD_CAN_ON_PA11 != 0) ? 0U : (2U << 13); // 9.4.2: CAN_REMAP; SWJ_CFG 0 leaves the debugger its pins.
    set_mode(BRD_CAN_TX, ALTERNATE);
    set_mode(BRD_UART_TX, ALTERNATE);
    AFIO_EXTICR1 = (AFIO_EXTICR1 & ~0xFU) | (BRD_ESTOP / 16U); // 9.4.3: port of EXTI0.
}

bool brd_pins_estop_high(void) {
    return is_high(BRD_ESTOP);
}

bool brd_pins_button_low(void) {
    return !is_high(BRD_BUTTON);
}

void brd_pins_lamp(bool lit) {
    set_level(BRD_LAMP, lit == (BRD_LAMP_LIT != 0));
}
