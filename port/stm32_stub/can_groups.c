// SPDX-License-Identifier: MIT
#include "can_groups.h"

#include "iwheel/codec.h"

#include <assert.h>

const brd_can_group_t brd_can_groups[BRD_CAN_GROUPS] = {
    {IW_ID_LEFT_SPEED, 0x21U},
    {IW_ID_LEFT_FORCE, 0x21U},
    {IW_ID_LEFT_SETPOINT, 0x20U},
    {IW_ID_RIGHT_POSE, 0x00U},
};

static_assert((IW_ID_LEFT_SPEED ^ IW_ID_LEFT_STATUS) == 0x01U && (IW_ID_LEFT_SPEED ^ IW_ID_RIGHT_SPEED) == 0x20U &&
                  (IW_ID_LEFT_SPEED ^ IW_ID_RIGHT_STATUS) == 0x21U,
              "0x100, 0x101, 0x120, 0x121");
static_assert((IW_ID_LEFT_FORCE ^ IW_ID_LEFT_OFFSET) == 0x01U && (IW_ID_LEFT_FORCE ^ IW_ID_RIGHT_FORCE) == 0x20U &&
                  (IW_ID_LEFT_FORCE ^ IW_ID_RIGHT_OFFSET) == 0x21U,
              "0x200, 0x201, 0x220, 0x221");
static_assert((IW_ID_LEFT_SETPOINT ^ IW_ID_RIGHT_SETPOINT) == 0x20U, "0x10A, 0x12A");
