// SPDX-License-Identifier: MIT
/// What each cause of a stop does: one row per cause, read by the permission.
#ifndef IW_CAUSE_H
#define IW_CAUSE_H

#include "iwheel/private/permit.h"

typedef enum {
    IW_STOPS = 0,      ///< Stops what is ARMED.
    IW_LATCHES,        ///< Latches while setpoints are sent; else remembered, to refuse arm and reset while present.
    IW_ALWAYS_LATCHES, ///< Latches whatever the state.
} iw_effect_t;

typedef struct {
    uint8_t effect;  ///< An iw_effect_t.
    bool level;      ///< Present while it is raised in every step; else an event that is past after IW_PERMIT_EVENT_US.
    bool at_once;    ///< Stops without a ramp.
    uint8_t refusal; ///< An iw_refusal_t: how it refuses while it is present.
} iw_cause_row_t;

extern const iw_cause_row_t iw_cause_rows[IW_CAUSES];

/// The bit of a cause in a set of causes.
#define IW_CAUSE_BIT(cause) (1U << (uint32_t)(cause))

/// The latching causes present now: levels that are raised, events that were seen less than IW_PERMIT_EVENT_US ago.
uint32_t iw_cause_present(uint32_t told, const iw_time_us_t seen_us[IW_CAUSES], iw_time_us_t now_us);

/// How a set of latching causes refuses: the one that explains the others decides. IW_REFUSE_NONE if the set is empty.
iw_refusal_t iw_cause_refusal(uint32_t present);

#endif
