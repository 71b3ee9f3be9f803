// SPDX-License-Identifier: MIT
/// What this board keeps over power-off, in one record of store.h: how many power-ons there were, the configuration,
/// and what was learnt of the wheels. It is read where it is kept: RAM holds no copy.
#ifndef BOARD_RECORDS_H
#define BOARD_RECORDS_H

#include "board_assumptions.h"
#include "store.h"

typedef struct {
    brd_store_t store;
    uint32_t power_ons; ///< This one among them. 0: the flash has failed.
} brd_records_t;

/// Right after a start, before the watchdog runs. A power-on is counted; another start writes only where blank slots
/// have run short. Either may take as long as an erase, unless `is_urgent`: the wheels may be turning.
void brd_records_open(brd_records_t *self, bool power_on, bool is_urgent);

/// The configuration that was committed. False: none was, or it is none.
bool brd_records_settings(const brd_records_t *self, brd_settings_t *out_settings);
/// What was learnt. False: nothing.
bool brd_records_assumptions(const brd_records_t *self, brd_assumptions_t *out_learned);

/// Each of both writes a record with the rest as it was. False if the flash did not take it: what was before stays. May
/// stall the CPU for as long as store.h says. The last blank slot is not for what is learnt.
bool brd_records_commit(brd_records_t *self, const brd_settings_t *settings);
bool brd_records_write_assumptions(brd_records_t *self, const brd_assumptions_t *learned);

#endif
