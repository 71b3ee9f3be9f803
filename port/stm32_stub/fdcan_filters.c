// SPDX-License-Identifier: MIT
#include "fdcan_filters.h"

#include "can_groups.h"
#include "iwheel/can_frame.h"

// Filter elements (RM0440 44.3): kind (id and mask), action (to FIFO 0), id, mask.
#define STANDARD(id, mask) ((2UL << 30) | (1UL << 27) | ((uint32_t)(id) << 16) | (mask))
#define EXTENDED_0(id)     ((1UL << 29) | (id))
#define EXTENDED_1(mask)   ((2UL << 30) | (mask))

void brd_fdcan_filters_write(brd_fdcan_registers_t *device, brd_fdcan_ram_t *ram) {
    for (uint32_t i = 0; i < BRD_CAN_GROUPS; i++) {
        const brd_can_group_t *const group = &brd_can_groups[i];
        const uint32_t varying = group->varying;
        brd_register_write(&ram->standard_filter[i], STANDARD(group->id, IW_CAN_ID_MASK & ~varying));
        brd_register_write(&ram->extended_filter[i][0], EXTENDED_0(group->id));
        brd_register_write(&ram->extended_filter[i][1], EXTENDED_1(BRD_ELEMENT_ID & ~varying));
    }
    // A full FIFO retains its frames (F0OM is 0), and no filter for remote frames rejects them (RRFE, RRFS).
    brd_register_write(&device->RXGFC,
                       BRD_RXGFC_REJECT | (BRD_CAN_GROUPS << BRD_RXGFC_LSS) | (BRD_CAN_GROUPS << BRD_RXGFC_LSE));
}
