// SPDX-License-Identifier: MIT
/// Reading and writing one register of the bus controller.
///
/// The driver includes this file by name only. A test puts another one before it in the include path, whose two
/// functions ask a model of the controller; the driver's text stays the same.
#ifndef IW_STM32_REGISTER_ACCESS_H
#define IW_STM32_REGISTER_ACCESS_H

#include <stdint.h>

typedef volatile uint32_t iw_register_t;

static inline uint32_t iw_register_read(const iw_register_t *address) {
    return *address;
}

static inline void iw_register_write(iw_register_t *address, uint32_t value) {
    *address = value;
}

#endif
