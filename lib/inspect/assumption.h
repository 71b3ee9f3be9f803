// SPDX-License-Identifier: MIT
/// Texts about the items of the assumption store: the configured value, its source, and the effect of a contradiction.
///
/// Pure functions of configuration and entry. A value has the form of the configuration file. An item without a key
/// there ("the raw force still contains the offset") has the value "yes".
#ifndef GATEWAY_ASSUMPTION_H
#define GATEWAY_ASSUMPTION_H

#include "iwheel/config.h"
#include "iwheel/types.h"
#include "iwheel_northbound/words.h"

/// Size of the longest sentence with its terminator.
#define INSPECT_SOURCE_SIZE 256U
/// A measured radius within this share of the configured one confirms it: a tyre cannot be measured better.
#define INSPECT_RADIUS_PERCENT 2
/// The same for the track, because tyres are broad.
#define INSPECT_TRACK_PERCENT 2

/// Result of comparing a found value with the configured one.
typedef enum {
    INSPECT_FOUND_SAME = 0,
    INSPECT_FOUND_DIFFERENT,
    INSPECT_FOUND_IMPOSSIBLE, ///< The value is not possible for this item.
    INSPECT_FOUND_UNSET,      ///< No value is configured that could be confirmed.
} inspect_found_t;

/// Decision of the operator on an item. Both texts may be empty.
typedef struct {
    char found[IWN_VALUE_SIZE]; ///< The found value.
    char how[IWN_HOW_SIZE];     ///< Method: "bringup: 3 full turns by hand, ...".
} inspect_word_t;

/// Configuration of the wheels.
typedef struct {
    const iw_config_t *core;
    uint32_t track_mm;
} inspect_configured_t;

/// Writes the configured value; empty if there is none.
void inspect_assumption_value(const inspect_configured_t *configured, iw_assumption_item_t item,
                              char out_value[IWN_VALUE_SIZE]);

/// Compares `found` with the configured value. If `found` is empty, the operator confirms the configured value.
inspect_found_t inspect_assumption_compare(const inspect_configured_t *configured, iw_assumption_item_t item,
                                           const char *found);

/// Returns the possible values of `found`, for messages.
const char *inspect_assumption_values(iw_assumption_item_t item);

/// Writes the source of the entry as a clause: "measured -392 mm/s while commanded forward". `word` is used only for
/// entries of the operator.
void inspect_assumption_source(iw_assumption_item_t item, const iw_assumption_entry_t *entry,
                               const inspect_word_t *word, char out_text[INSPECT_SOURCE_SIZE]);

/// Returns what a contradiction of the item disables, and the fix.
const char *inspect_assumption_cost(iw_assumption_item_t item);

/// Returns how to decide a contradiction, with the command for it. It applies to every value.
const char *inspect_assumption_fix(iw_assumption_item_t item);

#endif
