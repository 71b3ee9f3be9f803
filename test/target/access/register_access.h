// SPDX-License-Identifier: MIT
/// Takes the place of the port's file of the same name: every access to a register of the bus controller goes to a model. The
/// addresses are those of an `iw_bxcan_registers_t` that was told by `register_access_connect`; its memory is never touched.
#ifndef IW_STM32_REGISTER_ACCESS_H
#define IW_STM32_REGISTER_ACCESS_H

#include <stdint.h>

typedef volatile uint32_t iw_register_t;

uint32_t iw_register_read(const iw_register_t *address);
void iw_register_write(iw_register_t *address, uint32_t value);

#endif
