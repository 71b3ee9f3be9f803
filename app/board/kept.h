// SPDX-License-Identifier: MIT
/// What this board keeps over power-off, in one record of store.h: how many power-ons there were, the configuration,
/// and what was learnt of the wheels. It is read where it is kept: RAM holds no copy.
#ifndef IW_STM32_KEPT_H
#define IW_STM32_KEPT_H

#include "learnt.h"
#include "store.h"

typedef struct {
    iw_store_t store;
    uint32_t power_ons; ///< This one among them. 0: the flash has failed.
} iw_kept_t;

/// Right after a start, before the watchdog runs. A power-on is counted; another start writes only where blank slots
/// have run short. Either may take as long as an erase, unless `is_urgent`: the wheels may be turning.
void iw_kept_open(iw_kept_t *self, bool power_on, bool is_urgent);

/// The configuration that was committed. False: none was, or it is none.
bool iw_kept_settings(const iw_kept_t *self, iw_settings_t *out_settings);
/// What was learnt. False: nothing.
bool iw_kept_learnt(const iw_kept_t *self, iw_learnt_t *out_learnt);

/// Each of both writes a record with the rest as it was. False if the flash did not take it: what was before stays. May
/// stall the CPU for as long as store.h says. The last blank slot is not for what is learnt.
bool iw_kept_commit(iw_kept_t *self, const iw_settings_t *settings);
bool iw_kept_learn(iw_kept_t *self, const iw_learnt_t *learnt);

#endif
