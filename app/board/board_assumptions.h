// SPDX-License-Identifier: MIT
/// Learned facts about the wheels, from one run of the board to the next: entries of the assumption store, and the
/// offsets of the forces. The rules are those of the daemon (docs/developer/ledger.md): facts that were found for other
/// settings are dropped, a stored offset is replaced as iwheel/force_offset.h says, and only a tare replaces a tare.
///
///     start: record --> the core
///     run:   a fact changes --> nothing is sent for BRD_ASSUMPTIONS_PERIOD_US --> a record
///
/// A repeated measurement of a figure, or an offset that moved by no more than BRD_ASSUMPTIONS_MOVED_mN, does not cause
/// a record, because each record wears the flash.
#ifndef BOARD_ASSUMPTIONS_H
#define BOARD_ASSUMPTIONS_H

#include "board_settings.h"

#include "iwheel/gateway.h"

/// Time without any setpoint before a record is written, and period of the checks.
#define BRD_ASSUMPTIONS_PERIOD_US 2000000U
#define BRD_ASSUMPTIONS_MOVED_mN  500

/// The force offset of one wheel.
typedef struct {
    int32_t offset_mN;
    int16_t drift_mN;      ///< Drift in the window of which it is the mean, with ESTIMATED and OPERATOR.
    uint16_t deviation_mN; ///< Deviation in that window.
    uint8_t from;          ///< First source of the offset (iw_offset_provenance_t); IW_OFFSET_NONE if there is none.
} brd_assumptions_zero_t;

/// Layout in flash: new members go to the end. All zero: nothing was learned.
typedef struct {
    brd_settings_t settings; ///< Settings for which the facts were found.
    brd_assumptions_zero_t zero[IW_SIDES];
    int32_t figure[IW_ASSUMPTION_ITEMS];
    uint8_t item[IW_ASSUMPTION_ITEMS]; ///< State, with the source in the upper half; 0: none.
} brd_assumptions_t;

/// Returns the offset that results from this window.
brd_assumptions_zero_t brd_assumptions_zero(const iw_force_t *force, const iw_force_quality_t *window);

/// Writes to `*self` all facts about a gateway with these settings and offsets.
void brd_assumptions_note(brd_assumptions_t *self, const iw_snapshot_t *seen, const brd_settings_t *settings,
                          const brd_assumptions_zero_t zero[IW_SIDES]);

/// Restores the facts directly after the init of the gateway. `out_zero` receives the restored offsets.
void brd_assumptions_restore(const brd_assumptions_t *self, const brd_settings_t *settings, iw_gateway_t *gateway,
                             brd_assumptions_zero_t out_zero[IW_SIDES]);

/// Returns true if `now` contains more facts than `stored`, or other ones.
bool brd_assumptions_differs(const brd_assumptions_t *now, const brd_assumptions_t *stored);

/// Returns the configuration key of an item; BRD_KEY_NONE: its value is "yes".
brd_key_t brd_assumptions_key(iw_assumption_item_t item);

#endif
