// SPDX-License-Identifier: MIT
// The parts of Arduino's interface that examples/first_drive.ino uses: builds and runs the sketch without the vendor's packages.
#ifndef ARDUINO_H
#define ARDUINO_H

#include <stdint.h>
#include <stdio.h>

struct SerialStub {
    void begin(unsigned long) {}
    void println(const char *text) {
        (void)puts(text);
    }
};
static SerialStub Serial;

uint32_t micros();
void setup();
void loop();

#endif
