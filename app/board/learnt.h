// SPDX-License-Identifier: MIT
/// What was learnt of the wheels, from one run of the board to the next: evidence of the ledger, and the zeros of the
/// force. The rules are the daemon's (docs/ledger.md): what was found for other settings is forgotten, a zero of before
/// gives way to whatever this run measures, a tare only to a tare.
///
///     start: record --> the core
///     run:   something of it has changed --> silence for IW_LEARNT_SILENT_US --> a record
///
/// A figure that was measured once more, or a zero that has moved by less than IW_LEARNT_MOVED_mN, is not worth a
/// record: the flash wears.
#ifndef IW_STM32_LEARNT_H
#define IW_STM32_LEARNT_H

#include "settings.h"

#include "iwheel/gateway.h"

/// Nothing has been sent for so long, without a pause, before a record is written; and between two looks.
#define IW_LEARNT_SILENT_US 2000000U
#define IW_LEARNT_MOVED_mN  500

/// The zero of one wheel's force.
typedef struct {
    int32_t offset_mN;
    int16_t drift_mN;      ///< Of the window that it is the mean of, with ESTIMATED and OPERATOR.
    uint16_t deviation_mN; ///< The same.
    uint8_t from;          ///< iw_offset_provenance_t: where it came from first; IW_OFFSET_NONE: there is none.
} iw_learnt_zero_t;

/// As flash holds it: what grows is put to the end. All zero: nothing is known.
typedef struct {
    iw_settings_t settings; ///< For which it was found.
    iw_learnt_zero_t zero[IW_SIDES];
    int32_t figure[IW_LEDGER_ITEMS];
    uint8_t item[IW_LEDGER_ITEMS]; ///< State, and in the upper half the evidence; 0: none.
} iw_learnt_t;

/// What this window gave.
iw_learnt_zero_t iw_learnt_zero(const iw_force_t *force, const iw_force_quality_t *window);

/// What is known of a gateway with these settings and zeros.
void iw_learnt_note(iw_learnt_t *self, const iw_snapshot_t *seen, const iw_settings_t *settings,
                    const iw_learnt_zero_t zero[IW_SIDES]);

/// Puts it in force, right after the gateway's init; `out_zero`: those of its zeros that were.
void iw_learnt_restore(const iw_learnt_t *self, const iw_settings_t *settings, iw_gateway_t *gateway,
                       iw_learnt_zero_t out_zero[IW_SIDES]);

/// Whether there is more in `now` than in `kept`, or something else.
bool iw_learnt_differs(const iw_learnt_t *now, const iw_learnt_t *kept);

/// Where an item is configured; NULL: nowhere, and its value is "yes".
const char *iw_learnt_key(iw_ledger_item_t item);

#endif
