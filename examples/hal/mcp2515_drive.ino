// SPDX-License-Identifier: MIT
// first_drive with real wheels behind an MCP2515, see hal_mcp2515.h. Boards whose SPI works in interrupts: SAMD, Teensy,
// AVR with 8 KB of RAM (Mega). Not an ESP32: use its own controller, hal_twai.h.
#include <SPI.h>

extern "C" {
#include "first_drive.h"
#include "hal_mcp2515.h"
}

static const int SELECT_PIN = 10, INTERRUPT_PIN = 2;
static const int ESTOP_PIN = 3; // Contact to ground, closed while released: a broken wire counts as pressed.
static const SPISettings SPEED(10000000, MSBFIRST, SPI_MODE0);

static iw_gateway_t gateway;
static hal_mcp2515_t bus;
static iw_hal_t hal;
static volatile bool estop_edge;

static void transfer(uint8_t *bytes, uint32_t count) {
    SPI.beginTransaction(SPEED);
    digitalWrite(SELECT_PIN, LOW);
    SPI.transfer(bytes, count);
    digitalWrite(SELECT_PIN, HIGH);
    SPI.endTransaction();
}

static void mask(bool masked) {
    if (masked) {
        noInterrupts();
    } else {
        interrupts();
    }
}

static uint32_t read_micros() {
    return micros();
}

static int estop_pressed() {
    const bool edge = estop_edge;
    if (edge) {
        estop_edge = false; // Before the level is read: a later edge is not lost.
    }
    return edge || digitalRead(ESTOP_PIN) == HIGH;
}

static void on_bus() {
    hal_mcp2515_on_interrupt(&bus);
}

static void on_estop() {
    estop_edge = true;
}

void setup() {
    static const hal_mcp2515_board_t board = {transfer, mask, read_micros, estop_pressed};
    Serial.begin(115200);
    pinMode(SELECT_PIN, OUTPUT);
    digitalWrite(SELECT_PIN, HIGH);
    pinMode(INTERRUPT_PIN, INPUT_PULLUP);
    pinMode(ESTOP_PIN, INPUT_PULLUP);
    SPI.begin();
    SPI.usingInterrupt(digitalPinToInterrupt(INTERRUPT_PIN));
    hal_mcp2515_start(&bus, &board);
    attachInterrupt(digitalPinToInterrupt(INTERRUPT_PIN), on_bus, FALLING);
    attachInterrupt(digitalPinToInterrupt(ESTOP_PIN), on_estop, CHANGE);
    hal = hal_mcp2515(&bus);
    // `true`: after a reset the wheels may still turn, so the core begins with zeros.
    if (!first_drive_init(&gateway, &hal, hal_mcp2515_time_us(&bus), true)) {
        Serial.println("the configuration is not valid");
        for (;;) {
        }
    }
    iw_bus_facts_t facts = iw_bus_facts_t();
    facts.echo_proven = true; // The echo is the acknowledgement.
    iw_gateway_bus_facts(&gateway, &facts);
}

/// Prints each new state, also that of the zeros at the start ("stopping"), and each new reason to wait.
static void report(iw_refusal_t refusal) {
    static const char *const names[] = {"listening", "armed", "stopping", "latched"};
    static int state_before = -1;
    static iw_refusal_t refusal_before = IW_REFUSE_NONE;
    const iw_state_t state = iw_gateway_state(&gateway);
    if (state != state_before) {
        Serial.println(names[state]);
    }
    if (refusal != IW_REFUSE_NONE && refusal != refusal_before) {
        Serial.println(iw_refusal_text(refusal));
    }
    state_before = state;
    refusal_before = refusal;
}

void loop() {
    const iw_time_us_t now_us = hal_mcp2515_time_us(&bus);
    const iw_refusal_t refusal = first_drive_command(&gateway, now_us);
    (void)iw_gateway_step(&gateway, now_us);
    report(refusal);
}
