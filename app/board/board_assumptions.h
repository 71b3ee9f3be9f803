// SPDX-License-Identifier: MIT
/// What was learnt of the wheels, from one run of the board to the next: evidence of the ledger, and the zeros of the
/// force. The rules are the daemon's (docs/developer/ledger.md): what was found for other settings is forgotten, a zero of before
/// gives way to whatever this run measures, a tare only to a tare.
///
///     start: record --> the core
///     run:   something of it has changed --> silence for BRD_ASSUMPTIONS_PERIOD_US --> a record
///
/// A figure that was measured once more, or a zero that has moved by less than BRD_ASSUMPTIONS_MOVED_mN, is not worth a
/// record: the flash wears.
#ifndef BOARD_ASSUMPTIONS_H
#define BOARD_ASSUMPTIONS_H

#include "board_settings.h"

#include "iwheel/gateway.h"

/// Nothing has been sent for so long, without a pause, before a record is written; and between two looks.
#define BRD_ASSUMPTIONS_PERIOD_US 2000000U
#define BRD_ASSUMPTIONS_MOVED_mN  500

/// The zero of one wheel's force.
typedef struct {
    int32_t offset_mN;
    int16_t drift_mN;      ///< Of the window that it is the mean of, with ESTIMATED and OPERATOR.
    uint16_t deviation_mN; ///< The same.
    uint8_t from;          ///< iw_offset_provenance_t: where it came from first; IW_OFFSET_NONE: there is none.
} brd_assumptions_zero_t;

/// As flash holds it: what grows is put to the end. All zero: nothing is known.
typedef struct {
    brd_settings_t settings; ///< For which it was found.
    brd_assumptions_zero_t zero[IW_SIDES];
    int32_t figure[IW_ASSUMPTION_ITEMS];
    uint8_t item[IW_ASSUMPTION_ITEMS]; ///< State, and in the upper half the evidence; 0: none.
} brd_assumptions_t;

/// What this window gave.
brd_assumptions_zero_t brd_assumptions_zero(const iw_force_t *force, const iw_force_quality_t *window);

/// What is known of a gateway with these settings and zeros.
void brd_assumptions_note(brd_assumptions_t *self, const iw_snapshot_t *seen, const brd_settings_t *settings,
                          const brd_assumptions_zero_t zero[IW_SIDES]);

/// Puts it in force, right after the gateway's init; `out_zero`: those of its zeros that were.
void brd_assumptions_restore(const brd_assumptions_t *self, const brd_settings_t *settings, iw_gateway_t *gateway,
                             brd_assumptions_zero_t out_zero[IW_SIDES]);

/// Whether there is more in `now` than in `kept`, or something else.
bool brd_assumptions_differs(const brd_assumptions_t *now, const brd_assumptions_t *kept);

/// Where an item is configured; NULL: nowhere, and its value is "yes".
const char *brd_assumptions_key(iw_assumption_item_t item);

#endif
