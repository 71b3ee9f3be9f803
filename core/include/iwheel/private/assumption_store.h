// SPDX-License-Identifier: MIT
/// @file
/// Assumption store: the facts that the document leaves open, and the state of each.
///
///     ASSUMED --confirm--> CONFIRMED --contradict--> CONTRADICTED --confirm by the operator--> CONFIRMED
///        \--------------- contradict ----------------^
///
/// A contradiction from the bus remains until the operator confirms the item: intermittent observations must not hide
/// it.
#ifndef IW_ASSUMPTION_STORE_H
#define IW_ASSUMPTION_STORE_H

#include "iwheel/types.h"

#ifdef __cplusplus
extern "C" {
#endif

/// State of all assumptions.
typedef struct {
    iw_assumption_entry_t entry[IW_ASSUMPTION_ITEMS]; ///< Entries, indexed by iw_assumption_item_t.
    uint32_t changes;           ///< Increases with every change, so that a program knows when to report or store it.
    iw_assumption_item_t doubt; ///< First contradicted item that prevents motion; IW_ASSUMPTION_ITEMS if there is none.
} iw_assumption_store_t;

/// Sets every item to ASSUMED: documented items with IW_SOURCE_DOCUMENT, the others with IW_SOURCE_NONE.
void iw_assumption_init(iw_assumption_store_t *self);

/// Sets the source of an ASSUMED item. It has no effect on an item that is no longer ASSUMED.
void iw_assumption_assume(iw_assumption_store_t *self, iw_assumption_item_t item, iw_source_t source);

/// Confirms an item. A confirmation from the bus neither ends a contradiction nor replaces one from the operator.
void iw_assumption_confirm(iw_assumption_store_t *self, iw_assumption_item_t item, iw_source_t source, int32_t figure);

/// Contradicts an item.
void iw_assumption_contradict(iw_assumption_store_t *self, iw_assumption_item_t item, iw_source_t source,
                              int32_t figure);

/// Returns the item for the force unit of a wheel.
static inline iw_assumption_item_t iw_assumption_force_unit(iw_side_t side) {
    return (side == IW_LEFT) ? IW_ASSUMPTION_FORCE_UNIT_LEFT : IW_ASSUMPTION_FORCE_UNIT_RIGHT;
}

/// Returns true if a contradiction of this item prevents motion: setpoint type, current role and the signs.
bool iw_assumption_guards_motion(iw_assumption_item_t item);

#ifdef __cplusplus
}
#endif
#endif
