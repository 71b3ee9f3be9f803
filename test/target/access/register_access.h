// SPDX-License-Identifier: MIT
/// Replaces the port's file of the same name: every access to a register of the bus controller goes to a model. The addresses
/// are those of the `brd_bxcan_registers_t` passed to `register_access_connect`; its memory is never accessed.
#ifndef BRD_REGISTER_ACCESS_H
#define BRD_REGISTER_ACCESS_H

#include <stdint.h>

typedef volatile uint32_t brd_register_t;

uint32_t brd_register_read(const brd_register_t *address);
void brd_register_write(brd_register_t *address, uint32_t value);

#endif
