// SPDX-License-Identifier: MIT
// The parts of Arduino's interface that the sketches use: builds them, and runs first_drive.ino, without the vendor's packages.
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

enum { LOW, HIGH };
enum { INPUT, OUTPUT, INPUT_PULLUP };
enum { CHANGE = 1, FALLING, RISING };

uint32_t micros();
void pinMode(int pin, int mode);
void digitalWrite(int pin, int level);
int digitalRead(int pin);
int digitalPinToInterrupt(int pin);
void attachInterrupt(int interrupt, void (*handler)(), int mode);
void noInterrupts();
void interrupts();
void setup();
void loop();

#endif
