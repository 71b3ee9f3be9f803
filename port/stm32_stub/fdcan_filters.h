// SPDX-License-Identifier: MIT
/// Acceptance filters of FDCAN: the ids of can_groups.h, once as 11-bit ids and once as 29-bit ids with the same
/// number. Remote frames pass like data frames.
#ifndef BRD_FDCAN_FILTERS_H
#define BRD_FDCAN_FILTERS_H

#include "fdcan_registers.h"

/// Writes the filters to the message RAM and connects them to FIFO 0. Call it only while CCE is set.
void brd_fdcan_filters_write(brd_fdcan_registers_t *device, brd_fdcan_ram_t *ram);

#endif
