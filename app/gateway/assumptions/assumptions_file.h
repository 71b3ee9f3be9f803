// SPDX-License-Identifier: MIT
/// Text form of the data that the gateway stores from one run to the next: assumptions, force offsets, and the test of
/// the e-stop button.
///
/// The text is one line of JSON and one line with its checksum. It has the name of the bus, and for each observation
/// the configured value at that time, because an observation for another value is void. The reader refuses a text that
/// no run of this program could have written. It ignores blanks and unknown members. Pure functions.
#ifndef GATEWAY_ASSUMPTIONS_FILE_H
#define GATEWAY_ASSUMPTIONS_FILE_H

#include "button.h"
#include "inspect/assumption.h"

#include "iwheel/force_offset.h"

/// Longest text.
#define GW_ASSUMPTIONS_FILE_SIZE 12288U
/// Longest reason for a refusal.
#define GW_ASSUMPTIONS_REASON_SIZE 128U

/// Stored state of one item.
typedef struct {
    iw_assumption_entry_t entry; ///< IW_ASSUMED if nothing is stored.
    int64_t since_wall_us;
    char value[IWN_VALUE_SIZE]; ///< Configured value at the time of the observation.
    inspect_word_t word;        ///< Value that the operator found instead, and how; empty if there is none.
} gw_stored_item_t;

/// Stored force offset of one wheel.
typedef struct {
    iw_offset_provenance_t from; ///< WHEEL, ESTIMATED or OPERATOR; IW_OFFSET_NONE if nothing is stored.
    iw_force_unit_t unit;        ///< Configured unit at the time of the offset.
    int32_t offset_mN;
    int32_t drift_mN;      ///< Drift of its window, with ESTIMATED and OPERATOR.
    uint32_t deviation_mN; ///< Deviation of its window, with ESTIMATED and OPERATOR.
    uint32_t samples;      ///< Samples in its window, with ESTIMATED and OPERATOR.
    int64_t wall_us;       ///< Time of the offset.
} gw_stored_offset_t;

typedef struct {
    gw_stored_item_t item[IW_ASSUMPTION_ITEMS];
    gw_stored_offset_t offset[IW_SIDES];
    gw_tried_t tried; ///< The e-stop button. Versions before 0.3 ignore it.
} gw_stored_t;

/// Writes the text and returns its length; 0 if it does not fit.
size_t gw_assumptions_file_write(const gw_stored_t *known, const char *bus, char *out_text, size_t size);

/// Reads a text. Returns false, sets the reason and leaves `*out_known` unchanged unless the checksum is right, the
/// text is for this bus, and gw_assumptions_file_write could have written its contents.
bool gw_assumptions_file_read(const char *text, size_t length, const char *bus, gw_stored_t *out_known,
                              char out_reason[GW_ASSUMPTIONS_REASON_SIZE]);

void gw_assumptions_file_name(const char *bus, char *out_name, size_t size);

/// Limits of measured values. Stored values are checked against them, because a file with a right checksum can still
/// have impossible values. Pure functions.
///
/// Largest raw force in cN that is not saturated. With a zero beyond it, no force could be measured. Both wheels are of
/// the same type, so the limit of the finer unit applies to both.
#define GW_BOUNDS_ZERO_mN 327660

/// Returns true if a run of the gateway could have stored this: state, source, figure, values and time must match.
bool gw_bounds_item(iw_assumption_item_t item, const gw_stored_item_t *known);

/// Returns true if a wheel could have sent this offset, or a quiet window could have resulted in it.
bool gw_bounds_offset(const gw_stored_offset_t *known);

#endif
