// SPDX-License-Identifier: MIT
/// Reading and writing one register of the bus controller.
///
/// The driver includes this file by name only. A test puts another one before it in the include path, whose two
/// functions ask a model of the controller; the driver's text stays the same.
#ifndef BRD_REGISTER_ACCESS_H
#define BRD_REGISTER_ACCESS_H

#include <stdint.h>

typedef volatile uint32_t brd_register_t;

static inline uint32_t brd_register_read(const brd_register_t *address) {
    return *address;
}

static inline void brd_register_write(brd_register_t *address, uint32_t value) {
    *address = value;
}

#endif
