// SPDX-License-Identifier: MIT
#include "board_assumptions.h"

#include <string.h>

#define STATE(item)  ((iw_assumption_state_t)((item)&15U))
#define SOURCE(item) ((iw_source_t)((item) >> 4))
/// Largest raw force that is not saturated (32766 cN), in mN: no offset of a wheel exceeds it.
#define ZERO_MAX_mN 327660

brd_key_t brd_assumptions_key(iw_assumption_item_t item) {
    switch (item) {
    case IW_ASSUMPTION_SETPOINT_TYPE:
        return BRD_KEY_SETPOINT_TYPE;
    case IW_ASSUMPTION_CURRENT_ROLE:
        return BRD_KEY_CURRENT_ROLE;
    case IW_ASSUMPTION_FORCE_UNIT_LEFT:
        return BRD_KEY_UNIT_LEFT;
    case IW_ASSUMPTION_FORCE_UNIT_RIGHT:
        return BRD_KEY_UNIT_RIGHT;
    case IW_ASSUMPTION_MOUNT_SIGN_LEFT:
        return BRD_KEY_INVERT_LEFT;
    case IW_ASSUMPTION_MOUNT_SIGN_RIGHT:
        return BRD_KEY_INVERT_RIGHT;
    case IW_ASSUMPTION_WHEEL_RADIUS:
        return BRD_KEY_RADIUS;
    case IW_ASSUMPTION_TRACK:
        return BRD_KEY_TRACK;
    case IW_ASSUMPTION_GEAR_RATIO:
        return BRD_KEY_GEAR_RATIO;
    default:
        return BRD_KEY_NONE;
    }
}

static bool has_value(brd_key_t key, const brd_settings_t *one, const brd_settings_t *other) {
    char value[BRD_SETTINGS_TEXT];
    char wanted[BRD_SETTINGS_TEXT];
    return brd_settings_value(one, key, value) && brd_settings_value(other, key, wanted) && strcmp(value, wanted) == 0;
}

/// Returns true if both settings have the same value of the item. Facts that were found for another value do not apply.
static bool is_for(iw_assumption_item_t item, const brd_settings_t *found, const brd_settings_t *now) {
    const brd_key_t key = brd_assumptions_key(item);
    return (key == BRD_KEY_NONE || has_value(key, found, now)) &&
           (key != BRD_KEY_GEAR_RATIO || has_value(BRD_KEY_RPM_OF, found, now));
}

static iw_assumption_item_t unit_of(unsigned side) {
    return (side == (unsigned)IW_LEFT) ? IW_ASSUMPTION_FORCE_UNIT_LEFT : IW_ASSUMPTION_FORCE_UNIT_RIGHT;
}

brd_assumptions_zero_t brd_assumptions_zero(const iw_force_t *force, const iw_force_quality_t *window) {
    return (brd_assumptions_zero_t){.offset_mN = force->offset_mN,
                                    .drift_mN =
                                        (int16_t)window->drift_mN, // It fits: the window of an offset has little drift.
                                    .deviation_mN = (uint16_t)window->deviation_mN,
                                    .from = (uint8_t)force->provenance};
}

void brd_assumptions_note(brd_assumptions_t *self, const iw_snapshot_t *seen, const brd_settings_t *settings,
                          const brd_assumptions_zero_t zero[IW_SIDES]) {
    memset(self, 0, sizeof *self);
    self->settings = *settings;
    for (unsigned side = 0; side < IW_SIDES; side++) {
        self->zero[side] = zero[side];
    }
    for (unsigned item = 0; item < IW_ASSUMPTION_ITEMS; item++) {
        const iw_assumption_entry_t *const entry = &seen->assumed[item];
        if (entry->state != IW_ASSUMED) {
            self->item[item] = (uint8_t)((unsigned)entry->state | (unsigned)entry->source << 4);
            self->figure[item] = entry->figure;
        }
    }
}

void brd_assumptions_restore(const brd_assumptions_t *self, const brd_settings_t *settings, iw_gateway_t *gateway,
                             brd_assumptions_zero_t out_zero[IW_SIDES]) {
    for (unsigned i = 0; i < IW_ASSUMPTION_ITEMS; i++) {
        const iw_assumption_item_t item = (iw_assumption_item_t)i;
        const iw_assumption_entry_t entry = {STATE(self->item[i]), SOURCE(self->item[i]), self->figure[i]};
        if (is_for(item, &self->settings, settings)) {
            iw_gateway_set_assumption(gateway, item, &entry);
        }
    }
    for (unsigned side = 0; side < IW_SIDES; side++) {
        const brd_assumptions_zero_t *const zero = &self->zero[side];
        const bool can_be = zero->from > IW_OFFSET_STORED && zero->from <= IW_OFFSET_OPERATOR &&
                            zero->offset_mN >= -ZERO_MAX_mN && zero->offset_mN <= ZERO_MAX_mN;
        out_zero[side] = (brd_assumptions_zero_t){.from = IW_OFFSET_NONE};
        if (can_be && is_for(unit_of(side), &self->settings, settings)) {
            out_zero[side] = *zero;
            iw_gateway_restore_offset(gateway, (iw_side_t)side,
                                      (zero->from == IW_OFFSET_OPERATOR) ? IW_OFFSET_OPERATOR : IW_OFFSET_STORED,
                                      zero->offset_mN);
        }
    }
}

static bool is_another_zero(const brd_assumptions_zero_t *now, const brd_assumptions_zero_t *stored) {
    const int32_t moved = now->offset_mN - stored->offset_mN;
    const bool tared = now->from == IW_OFFSET_OPERATOR || stored->from == IW_OFFSET_OPERATOR;
    return (now->from == IW_OFFSET_NONE) != (stored->from == IW_OFFSET_NONE) || moved > BRD_ASSUMPTIONS_MOVED_mN ||
           moved < -BRD_ASSUMPTIONS_MOVED_mN || (tared && (now->from != stored->from || moved != 0));
}

bool brd_assumptions_differs(const brd_assumptions_t *now, const brd_assumptions_t *stored) {
    bool differs = memcmp(now->item, stored->item, sizeof now->item) != 0;
    for (unsigned item = 0; item < IW_ASSUMPTION_ITEMS; item++) {
        differs = differs ||
                  (now->item[item] != 0U && !is_for((iw_assumption_item_t)item, &now->settings, &stored->settings));
    }
    for (unsigned side = 0; side < IW_SIDES; side++) {
        differs = differs || is_another_zero(&now->zero[side], &stored->zero[side]) ||
                  (now->zero[side].from != IW_OFFSET_NONE && !is_for(unit_of(side), &now->settings, &stored->settings));
    }
    return differs;
}
