// SPDX-License-Identifier: MIT
/// Effects of each cause of a stop: one row per cause, used by the permission.
#ifndef IW_CAUSE_H
#define IW_CAUSE_H

#include "iwheel/private/permit.h"

typedef enum {
    IW_STOPS = 0,      ///< Stops the wheels in ARMED.
    IW_LATCHES,        ///< Latches while setpoints are sent; otherwise refuses arm and reset while it is present.
    IW_ALWAYS_LATCHES, ///< Latches in every state.
} iw_effect_t;

typedef struct {
    uint8_t effect; ///< An iw_effect_t.
    bool level; ///< Present while it is raised in every step; otherwise an event that is past after IW_PERMIT_EVENT_US.
    bool at_once;    ///< Stops without a ramp.
    uint8_t refusal; ///< An iw_refusal_t: the refusal while it is present.
} iw_cause_row_t;

extern const iw_cause_row_t iw_cause_rows[IW_CAUSES];

/// Returns the bit of a cause.
#define IW_CAUSE_BIT(cause) (1U << (uint32_t)(cause))

/// Returns the latching causes that are present: levels that are raised, and events not older than IW_PERMIT_EVENT_US.
uint32_t iw_cause_present(uint32_t reported, const iw_time_us_t seen_us[IW_CAUSES], iw_time_us_t now_us);

/// Returns the refusal of the cause that explains the others in a set of latching causes, or IW_REFUSE_NONE if the set
/// is empty.
iw_refusal_t iw_cause_refusal(uint32_t present);

/// Returns true for an e-stop that begins. A bounce of the button, or another request within the time of an event,
/// belongs to the one before. Contacts that disagree are a fault, not a press.
bool iw_cause_is_new_estop(iw_cause_t cause, const iw_time_us_t seen_us[IW_CAUSES], iw_time_us_t now_us);

#endif
