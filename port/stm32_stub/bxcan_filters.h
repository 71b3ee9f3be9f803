// SPDX-License-Identifier: MIT
/// Which frames the controller lets through: the eleven ids of the iWheel, and nothing else.
///
/// The ids differ in few bits, so masks select them exactly:
///
/// | id, hex | bits that may differ | passes exactly                |
/// |---------|----------------------|-------------------------------|
/// | 0x100   | 0x021                | 256, 257, 288, 289 (0x100...) |
/// | 0x200   | 0x021                | 512, 513, 544, 545 (0x200...) |
/// | 0x10A   | 0x020                | 266, 298 (0x10A, 0x12A)       |
/// | 0x122   | none                 | 290 (0x122)                   |
///
/// Once as 11-bit ids (two of them in each 16-bit bank) and once as 29-bit ids with the same number (one in each 32-bit
/// bank). Remote frames pass with data frames.
#ifndef BRD_BXCAN_FILTERS_H
#define BRD_BXCAN_FILTERS_H

#include "bxcan_registers.h"

/// Writes BRD_BXCAN_BANKS banks from `first_bank` on and connects them to FIFO 0; leaves the other banks alone.
/// `device` holds the banks. Nothing is received meanwhile.
void brd_bxcan_filters_write(brd_bxcan_registers_t *device, uint32_t first_bank);

#endif
