// SPDX-License-Identifier: MIT
// Pretended wheels: replace pretend_wheels_hal by the functions of your CAN controller, see iwheel/hal.h.
extern "C" {
#include "first_drive.h"
#include "pretend_wheels.h"
}

static iw_gateway_t gateway;
static pretend_wheels_t wheels;
static iw_hal_t hal;
static iw_time_us_t now_us;
static uint32_t last_us;

void setup() {
    Serial.begin(115200);
    hal = pretend_wheels_hal(&wheels);
    last_us = micros();
    if (!first_drive_init(&gateway, &hal, now_us, false)) {
        Serial.println("the configuration is not valid");
        for (;;) {
        }
    }
}

void loop() {
    const uint32_t now = micros();
    now_us += now - last_us; // micros() wraps after 71 minutes; the core's time must not.
    last_us = now;
    pretend_wheels_run(&wheels);
    const iw_refusal_t refusal = first_drive_command(&gateway, now_us);
    if (refusal != IW_REFUSE_NONE) {
        Serial.println(iw_refusal_text(refusal));
    }
    (void)iw_gateway_step(&gateway, now_us);
}
