// SPDX-License-Identifier: MIT
/// @file
/// The assumption ledger: what the document leaves open, what we assume, and what was found out.
///
///     ASSUMED --confirm--> CONFIRMED --contradict--> CONTRADICTED --confirm by the operator--> CONFIRMED
///        \--------------- contradict ----------------^
///
/// A contradiction found on the bus stays until the operator settles it: evidence that comes and goes must not hide it.
#ifndef IW_ASSUMPTION_STORE_H
#define IW_ASSUMPTION_STORE_H

#include "iwheel/types.h"

/// What is assumed of the wheels.
typedef struct {
    iw_assumption_entry_t entry[IW_ASSUMPTION_ITEMS]; ///< By iw_assumption_item_t.
    uint32_t changes; ///< Grows with every change, so that a program sees when to report or store it.
    iw_assumption_item_t
        doubt; ///< The first contradicted item that guards motion; IW_ASSUMPTION_ITEMS if there is none.
} iw_assumption_store_t;

/// Every item ASSUMED: documented ones with IW_SOURCE_DOCUMENT, the others with IW_SOURCE_NONE.
void iw_assumption_init(iw_assumption_store_t *self);

/// States where an ASSUMED item comes from. Changes nothing if it is no longer ASSUMED.
void iw_assumption_assume(iw_assumption_store_t *self, iw_assumption_item_t item, iw_source_t source);

/// Evidence for it. From the bus it does not lift a contradiction, and does not replace the operator's word.
void iw_assumption_confirm(iw_assumption_store_t *self, iw_assumption_item_t item, iw_source_t source, int32_t figure);

/// Evidence against it.
void iw_assumption_contradict(iw_assumption_store_t *self, iw_assumption_item_t item, iw_source_t source,
                              int32_t figure);

/// The item of a wheel's force unit.
static inline iw_assumption_item_t iw_assumption_force_unit(iw_side_t side) {
    return (side == IW_LEFT) ? IW_ASSUMPTION_FORCE_UNIT_LEFT : IW_ASSUMPTION_FORCE_UNIT_RIGHT;
}

/// True if the wheels must not be moved while this item is contradicted: type, role and the signs.
bool iw_assumption_guards_motion(iw_assumption_item_t item);

/// The item's present entry.
const iw_assumption_entry_t *iw_assumption_entry(const iw_assumption_store_t *self, iw_assumption_item_t item);

#endif
