// SPDX-License-Identifier: MIT
/// The items of the assumption ledger in words: which value is in force, what speaks for it, what a contradiction
/// costs.
///
/// Pure functions of configuration and entry. The value of an item is written as the configuration file writes it; an
/// item without a key there ("the raw force still contains the offset") is "yes".
#ifndef GATEWAY_ASSUMPTION_H
#define GATEWAY_ASSUMPTION_H

#include "iwheel/config.h"
#include "iwheel/types.h"
#include "iwheel_northbound/words.h"

/// The longest sentence with its terminator.
#define INSPECT_SOURCE_SIZE 256U
/// A radius within this share of the configured one is the configured one: nobody measures a tyre better.
#define INSPECT_RADIUS_PERCENT 2
/// The same for the track: tyres are broad.
#define INSPECT_TRACK_PERCENT 2

/// What somebody found, beside what is in force.
typedef enum {
    INSPECT_FOUND_SAME = 0,
    INSPECT_FOUND_DIFFERENT,
    INSPECT_FOUND_IMPOSSIBLE, ///< Not a value of this item.
    INSPECT_FOUND_UNSET,      ///< Nothing is configured that could be confirmed.
} inspect_found_t;

/// The operator's word on an item. Both texts may be empty: not told.
typedef struct {
    char found[IWN_VALUE_SIZE]; ///< Which value.
    char how[IWN_HOW_SIZE];     ///< By what it was found: "bringup: 3 full turns by hand, ...".
} inspect_word_t;

/// What is configured of the wheels.
typedef struct {
    const iw_config_t *core;
    uint32_t track_mm;
} inspect_configured_t;

/// The value in force; empty if none is configured.
void inspect_assumption_value(const inspect_configured_t *configured, iw_assumption_item_t item,
                              char out_value[IWN_VALUE_SIZE]);

/// Compares `found` with the value in force. `found` may be empty: the operator confirms what is in force.
inspect_found_t inspect_assumption_compare(const inspect_configured_t *configured, iw_assumption_item_t item,
                                           const char *found);

/// The values that `found` may have, for messages.
const char *inspect_assumption_values(iw_assumption_item_t item);

/// What the entry rests on, as a clause: "measured -392 mm/s while told to go forward". `word` matters only to what
/// rests on the operator.
void inspect_assumption_source(iw_assumption_item_t item, const iw_assumption_entry_t *entry,
                               const inspect_word_t *word, char out_text[INSPECT_SOURCE_SIZE]);

/// What a contradiction of it disables, and what mends it.
const char *inspect_assumption_cost(iw_assumption_item_t item);

/// What settles a contradiction, with the command that does it. For any value.
const char *inspect_assumption_cure(iw_assumption_item_t item);

#endif
