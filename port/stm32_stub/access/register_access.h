// SPDX-License-Identifier: MIT
/// Read and write access to one register of the bus controller.
///
/// The driver includes this file by its name only. A test puts another file of that name first in the include path. The
/// two functions of that file call a model of the controller; the source of the driver stays the same.
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
