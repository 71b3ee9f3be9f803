// SPDX-License-Identifier: MIT
// Section numbers refer to RM0090: 7.3 clock enables, 8.4 ports, 9.2 system configuration. An STM32G4 has the same
// registers at other addresses (RM0440 7.4, 9.4, 10.2), and the same numbers of the functions (DS12288 table 13).
#include "pins.h"

typedef struct {
    volatile uint32_t MODER, OTYPER, OSPEEDR, PUPDR, IDR, ODR, BSRR, LCKR, AFR[2];
    uint32_t reserved[246];
} port_t;

static_assert(sizeof(port_t) == 0x400, "port B follows port A");

#define AHB1ENR        (*(volatile uint32_t *)BRD_PORT_CLOCKS)
#define APB1ENR        (*(volatile uint32_t *)BRD_APB1_CLOCKS)
#define APB2ENR        (*(volatile uint32_t *)BRD_APB2_CLOCKS)
#define SYSCFG_EXTICR1 (*(volatile uint32_t *)BRD_EXTICR1_ADDRESS)
#define PORTS          ((port_t *)BRD_PORTS_ADDRESS)

// Two bits per pin in MODER (8.4.1), OSPEEDR (8.4.3) and PUPDR (8.4.4), four in AFR (8.4.9).
#ifdef BRD_PINS_ARE_ANALOG
#define INPUT 0U
#endif
#define OUTPUT    1U
#define ALTERNATE 2U
#define MEDIUM    1U // The slowest setting, that after reset, has edges of up to 100 ns: a tenth of a bit.
#define PULL_UP   1U
#define AF_USART2 7U
#define AF_CAN1   9U // On an STM32G4 FDCAN1.

static port_t *port_of(uint32_t pin) {
    return &PORTS[pin / 16U];
}

static bool is_high(uint32_t pin) {
    return ((port_of(pin)->IDR >> (pin % 16U)) & 1U) != 0U;
}

static void set_two(volatile uint32_t *fields, uint32_t pin, uint32_t value) {
    const uint32_t shift = 2U * (pin % 16U);
    *fields = (*fields & ~(3U << shift)) | (value << shift);
}

static void pull_up(uint32_t pin) {
    set_two(&port_of(pin)->PUPDR, pin, PULL_UP);
}

/// After a reset the pins of an STM32G4 are analog: they read low, as a released e-stop does. Those of an STM32F4 are
/// inputs.
static void set_input(uint32_t pin) {
    pull_up(pin);
#ifdef BRD_PINS_ARE_ANALOG
    set_two(&port_of(pin)->MODER, pin, INPUT);
#endif
}

static void set_alternate(uint32_t pin, uint32_t function) {
    port_t *const port = port_of(pin);
    volatile uint32_t *const fields = &port->AFR[pin % 16U / 8U];
    const uint32_t shift = 4U * (pin % 8U);
    *fields = (*fields & ~(0xFU << shift)) | (function << shift);
    set_two(&port->OSPEEDR, pin, MEDIUM);
    set_two(&port->MODER, pin, ALTERNATE);
}

static void enable_clocks(void) {
    static const uint8_t pins[] = {BRD_ESTOP, BRD_BUTTON, BRD_LAMP, BRD_CAN_RX, BRD_UART_RX};
    uint32_t ports = 0;
    for (size_t i = 0; i < sizeof pins; i++) {
        ports |= 1U << (pins[i] / 16U);
    }
    AHB1ENR |= ports;                   // 7.3.10
    APB1ENR |= (1U << 25) | (1U << 17); // 7.3.13: CAN1, USART2.
    APB2ENR |= BRD_SYSCFG_CLOCK;        // 7.3.14
}

/// Sets the pull-ups before the first read, so that an open contact or a cut wire reads high from the beginning.
void brd_pins_init(void) {
    enable_clocks();
    brd_pins_lamp(false);
    set_two(&port_of(BRD_LAMP)->MODER, BRD_LAMP, OUTPUT);
    set_input(BRD_ESTOP);
    set_input(BRD_BUTTON);
    pull_up(BRD_CAN_RX); // Without a transceiver the pin reads recessive.
    pull_up(BRD_UART_RX);
    set_alternate(BRD_CAN_RX, AF_CAN1);
    set_alternate(BRD_CAN_TX, AF_CAN1);
    set_alternate(BRD_UART_RX, AF_USART2);
    set_alternate(BRD_UART_TX, AF_USART2);
    SYSCFG_EXTICR1 = (SYSCFG_EXTICR1 & ~0xFU) | (BRD_ESTOP / 16U); // 9.2.3: port of EXTI0.
}

bool brd_pins_estop_high(void) {
    return is_high(BRD_ESTOP);
}

bool brd_pins_button_low(void) {
    return !is_high(BRD_BUTTON);
}

void brd_pins_lamp(bool lit) {
    const bool high = lit == (BRD_LAMP_LIT != 0);
    port_of(BRD_LAMP)->BSRR = (high ? 1U : 0x10000U) << (BRD_LAMP % 16U); // 8.4.7: the upper half clears pins.
}
