// SPDX-License-Identifier: MIT
/// Data that this board stores over power-off in one record of store.h: the number of power-ons, the configuration,
/// learned facts about the wheels, and the last fault. Each read accesses the flash: RAM has no copy.
#ifndef BOARD_RECORDS_H
#define BOARD_RECORDS_H

#include "board_assumptions.h"
#include "fault.h"
#include "store.h"

typedef struct {
    brd_store_t store;
    uint32_t power_ons; ///< Number of power-ons, including the last one. 0: the flash has failed.
    brd_fault_t fault;  ///< Last fault; cause 0: none since the power-on before the last one.
} brd_records_t;

/// Call it directly after a start, before the watchdog runs. It counts a power-on; after another start it writes only
/// if blank slots run short, or if `fault`, which ended the previous run, is the first since power-on. All may last as
/// long as an erase, unless `is_urgent` is set, because the wheels may be turning.
void brd_records_open(brd_records_t *self, bool power_on, bool is_urgent, brd_fault_t fault);

/// Reads the committed configuration. Returns false, and leaves `*out_settings` unchanged, if there is none. The values
/// may be invalid, because another version has checked them: see brd_settings_apply.
bool brd_records_settings(const brd_records_t *self, brd_settings_t *out_settings);
/// Reads the learned facts. Returns false if there are none.
bool brd_records_assumptions(const brd_records_t *self, brd_assumptions_t *out_learned);

/// Both functions write a record and leave the rest of it unchanged. They return false if the flash did not accept it;
/// the previous record then stays. They may stall the CPU for the time that store.h states. The last blank slot is not
/// for learned facts.
bool brd_records_commit(brd_records_t *self, const brd_settings_t *settings);
bool brd_records_write_assumptions(brd_records_t *self, const brd_assumptions_t *learned);

#endif
