// SPDX-License-Identifier: MIT
#include "bxcan_filters.h"

#include "bxcan.h"
#include "iwheel/codec.h"

#include <assert.h>

#define GROUPS       4U
#define WIDE_BANKS   GROUPS
#define NARROW_BANKS (GROUPS / 2U)

typedef struct {
    uint16_t id;
    uint16_t varying; ///< Bits that may have any value.
} group_t;

static const group_t groups[GROUPS] = {
    {IW_ID_LEFT_SPEED, 0x21U},
    {IW_ID_LEFT_FORCE, 0x21U},
    {IW_ID_LEFT_SETPOINT, 0x20U},
    {IW_ID_RIGHT_POSE, 0x00U},
};

static_assert(NARROW_BANKS + WIDE_BANKS == BRD_BXCAN_BANKS, "the header tells how many banks are taken");
static_assert((IW_ID_LEFT_SPEED ^ IW_ID_LEFT_STATUS) == 0x01U && (IW_ID_LEFT_SPEED ^ IW_ID_RIGHT_SPEED) == 0x20U &&
                  (IW_ID_LEFT_SPEED ^ IW_ID_RIGHT_STATUS) == 0x21U,
              "0x100, 0x101, 0x120, 0x121");
static_assert((IW_ID_LEFT_FORCE ^ IW_ID_LEFT_OFFSET) == 0x01U && (IW_ID_LEFT_FORCE ^ IW_ID_RIGHT_FORCE) == 0x20U &&
                  (IW_ID_LEFT_FORCE ^ IW_ID_RIGHT_OFFSET) == 0x21U,
              "0x200, 0x201, 0x220, 0x221");
static_assert((IW_ID_LEFT_SETPOINT ^ IW_ID_RIGHT_SETPOINT) == 0x20U, "0x10A, 0x12A");

/// 16-bit scale (bxCAN 7.4): mask in the upper half, id in the lower half, each STID[15:5] RTR[4] IDE[3] EXID[2:0]. IDE
/// must be 0.
static uint32_t narrow(const group_t *group) {
    const uint32_t mask = ((IW_CAN_ID_MASK & ~(uint32_t)group->varying) << 5) | 0x08U;
    return (mask << 16) | ((uint32_t)group->id << 5);
}

/// 32-bit scale (bxCAN 7.4): STID and EXID[31:3], IDE[2], RTR[1]. IDE must be 1.
static void write_wide(brd_register_t *bank, const group_t *group) {
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
    for (size_t i = 0; i < NARROW_BANKS; i++) {
        brd_register_write(&device->filter[first_bank + i][0], narrow(&groups[(size_t)2 * i]));
        brd_register_write(&device->filter[first_bank + i][1], narrow(&groups[(size_t)2 * i + 1U]));
    }
    for (size_t i = 0; i < WIDE_BANKS; i++) {
        write_wide(device->filter[first_bank + NARROW_BANKS + i], &groups[i]);
    }
    set_bits(&device->FA1R, ours);
    clear_bits(&device->FMR, BRD_FMR_FINIT);
}
