// SPDX-License-Identifier: MIT
// The parts of Arduino's SPI library that examples/hal/mcp2515_drive.ino uses: compiles the sketch without the vendor's packages.
#ifndef SPI_H
#define SPI_H

#include <stddef.h>
#include <stdint.h>

enum { LSBFIRST, MSBFIRST };
enum { SPI_MODE0 };

struct SPISettings {
    SPISettings(uint32_t, int, int) {}
};

struct SpiStub {
    void begin() {}
    void usingInterrupt(int) {}
    void beginTransaction(SPISettings) {}
    void transfer(void *, size_t) {}
    void endTransaction() {}
};
static SpiStub SPI;

#endif
