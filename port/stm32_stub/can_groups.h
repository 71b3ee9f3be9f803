// SPDX-License-Identifier: MIT
/// The eleven ids of the iWheel as the acceptance filters of a bus controller select them: id and mask.
///
/// The ids differ in few bits, so masks select them exactly:
///
/// | id, hex | bits that may differ | passes exactly                |
/// |---------|----------------------|-------------------------------|
/// | 0x100   | 0x021                | 256, 257, 288, 289 (0x100...) |
/// | 0x200   | 0x021                | 512, 513, 544, 545 (0x200...) |
/// | 0x10A   | 0x020                | 266, 298 (0x10A, 0x12A)       |
/// | 0x122   | none                 | 290 (0x122)                   |
#ifndef BRD_CAN_GROUPS_H
#define BRD_CAN_GROUPS_H

#include <stdint.h>

#define BRD_CAN_GROUPS 4U

typedef struct {
    uint16_t id;
    uint16_t varying; ///< Bits that may have any value.
} brd_can_group_t;

extern const brd_can_group_t brd_can_groups[BRD_CAN_GROUPS];

#endif
