// SPDX-License-Identifier: MIT
#include "lamp.h"

/// The e-stop has priority: while it is pressed, no other action of the operator helps.
uint16_t brd_lamp_pattern(const iw_snapshot_t *seen, bool estop_pressed) {
    if (estop_pressed) {
        return BRD_LAMP_ESTOP;
    }
    switch (seen->state) {
    case IW_STATE_ARMED:
        return BRD_LAMP_ARMED;
    case IW_STATE_STOPPING:
        return BRD_LAMP_STOPPING;
    case IW_STATE_LATCHED:
        return BRD_LAMP_LATCHED;
    case IW_STATE_LISTENING:
    default:
        return (seen->bus < IW_BUS_PASSIVE) ? BRD_LAMP_NO_BUS : BRD_LAMP_LISTENING;
    }
}

bool brd_lamp_is_lit(uint16_t pattern, iw_time_us_t now_us) {
    return (((uint32_t)pattern >> (now_us / BRD_LAMP_SLOT_US % 16U)) & 1U) != 0U;
}
