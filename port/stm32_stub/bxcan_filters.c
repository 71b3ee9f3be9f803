// SPDX-License-Identifier: MIT
#include "bxcan_filters.h"

#include "bxcan.h"
#include "can_groups.h"

#include <assert.h>

#define WIDE_BANKS   BRD_CAN_GROUPS
#define NARROW_BANKS (BRD_CAN_GROUPS / 2U)

static_assert(NARROW_BANKS + WIDE_BANKS == BRD_BXCAN_BANKS, "the header states how many banks are in use");

/// 16-bit scale (bxCAN 7.4): mask in the upper half, id in the lower half, each STID[15:5] RTR[4] IDE[3] EXID[2:0]. IDE
/// must be 0.
static uint32_t narrow(const brd_can_group_t *group) {
    const uint32_t mask = ((IW_CAN_ID_MASK & ~(uint32_t)group->varying) << 5) | 0x08U;
    return (mask << 16) | ((uint32_t)group->id << 5);
}

/// 32-bit scale (bxCAN 7.4): STID and EXID[31:3], IDE[2], RTR[1]. IDE must be 1.
static void write_wide(brd_register_t *bank, const brd_can_group_t *group) {
    brd_register_write(&bank[0], ((uint32_t)group->id << 3) | 0x04U);
    brd_register_write(&bank[1], ((0x1FFFFFFFU & ~(uint32_t)group->varying) << 3) | 0x04U);
}

/// Changes only the bits of this driver's banks, because the same registers contain the banks of CAN1 and CAN2.
static void set_bits(brd_register_t *address, uint32_t bits) {
    brd_register_write(address, brd_register_read(address) | bits);
}

static void clear_bits(brd_register_t *address, uint32_t bits) {
    brd_register_write(address, brd_register_read(address) & ~bits);
}

void brd_bxcan_filters_write(brd_bxcan_registers_t *device, uint32_t first_bank) {
    const uint32_t ours = ((UINT32_C(1) << BRD_BXCAN_BANKS) - 1U) << first_bank;
    const uint32_t wide = ((UINT32_C(1) << WIDE_BANKS) - 1U) << (first_bank + NARROW_BANKS);
    set_bits(&device->FMR, BRD_FMR_FINIT); // The following changes are allowed only in this mode (bxCAN 9.4).
    clear_bits(&device->FM1R, ours);       // Masks, not lists.
    clear_bits(&device->FFA1R, ours);      // FIFO 0.
    clear_bits(&device->FS1R, ours);
    set_bits(&device->FS1R, wide);
    for (size_t i = 0; i < BRD_CAN_GROUPS; i++) {
        const brd_can_group_t *const group = &brd_can_groups[i];
        brd_register_write(&device->filter[first_bank + i / 2U][i % 2U], narrow(group));
        write_wide(device->filter[first_bank + NARROW_BANKS + i], group);
    }
    set_bits(&device->FA1R, ours);
    clear_bits(&device->FMR, BRD_FMR_FINIT);
}
