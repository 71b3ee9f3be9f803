// SPDX-License-Identifier: MIT
/// What is known of the wheels, as it is kept from one run of the gateway to the next: evidence of the ledger, force
/// offsets, and the e-stop's button, as text.
///
/// The text is one line of JSON and one with its checksum. It names the bus it speaks of, and beside each piece of
/// evidence the configured value for which it was found: evidence for another value is worth nothing. Whatever no run of
/// this program could have found is refused as a whole; blanks, and members of the line beside its own, are passed over. Pure
/// functions.
#ifndef GATEWAY_ASSUMPTIONS_FILE_H
#define GATEWAY_ASSUMPTIONS_FILE_H

#include "button.h"
#include "inspect/assumption.h"

#include "iwheel/force_offset.h"

/// The longest text that is written.
#define GW_ASSUMPTIONS_FILE_SIZE 12288U
/// The longest reason for a refusal.
#define GW_ASSUMPTIONS_REASON_SIZE 128U

/// Evidence for or against one item.
typedef struct {
    iw_assumption_entry_t entry; ///< IW_ASSUMED: there is none.
    int64_t since_wall_us;
    char value[IWN_VALUE_SIZE]; ///< What was configured when it was found.
    inspect_word_t word;        ///< What the operator found instead, and how it was found; empty: nothing, or not told.
} gw_stored_item_t;

/// The force offset of one wheel.
typedef struct {
    iw_offset_provenance_t from; ///< WHEEL, ESTIMATED or OPERATOR; IW_OFFSET_NONE: there is none.
    iw_force_unit_t unit;        ///< Configured when it was taken.
    int32_t offset_mN;
    int32_t drift_mN;      ///< Of its window, with ESTIMATED and OPERATOR.
    uint32_t deviation_mN; ///< The same.
    uint32_t samples;      ///< The same.
    int64_t wall_us;       ///< When it was taken.
} gw_stored_offset_t;

typedef struct {
    gw_stored_item_t item[IW_ASSUMPTION_ITEMS];
    gw_stored_offset_t offset[IW_SIDES];
    gw_tried_t tried; ///< The e-stop's button. Versions before 0.3 pass it over.
} gw_stored_t;

/// Writes the text. Its length; 0 if it does not fit.
size_t gw_assumptions_file_write(const gw_stored_t *known, const char *bus, char *out_text, size_t size);

/// Reads a text. False, with the reason in words and `*out_known` untouched, unless its checksum is right, it is for this
/// bus, and gw_assumptions_file_write could have written what it says.
bool gw_assumptions_file_read(const char *text, size_t length, const char *bus, gw_stored_t *out_known,
                              char out_reason[GW_ASSUMPTIONS_REASON_SIZE]);

void gw_assumptions_file_name(const char *bus, char *out_name, size_t size);

/// What measuring can give. What was stored is held to the same: a file whose checksum is right can still hold what no
/// wheel has ever shown. Pure functions.
///
/// The furthest raw force in cN that is not saturated. The finer unit cannot say more, and both wheels are of one make: a
/// zero further off would leave no force to be measured.
#define GW_BOUNDS_ZERO_mN 327660

/// True if some run of the gateway could have found this: state, evidence, figure, values and time belong together.
bool gw_bounds_item(iw_assumption_item_t item, const gw_stored_item_t *known);

/// True if a wheel could have sent this offset, or a quiet window given it.
bool gw_bounds_offset(const gw_stored_offset_t *known);

#endif
