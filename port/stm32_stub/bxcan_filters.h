// SPDX-License-Identifier: MIT
/// Acceptance filters of the controller: the eleven ids of the iWheel (can_groups.h), and no others.
///
/// The filters exist once for 11-bit ids (two of them in each 16-bit bank) and once for 29-bit ids with the same number
/// (one in each 32-bit bank). Remote frames pass like data frames.
#ifndef BRD_BXCAN_FILTERS_H
#define BRD_BXCAN_FILTERS_H

#include "bxcan_registers.h"

/// Writes BRD_BXCAN_BANKS banks from `first_bank` on and connects them to FIFO 0. It does not change the other banks.
/// `device` contains the banks. The controller receives nothing during the call.
void brd_bxcan_filters_write(brd_bxcan_registers_t *device, uint32_t first_bank);

#endif
