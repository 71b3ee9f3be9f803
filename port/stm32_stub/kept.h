// SPDX-License-Identifier: MIT
/// What this board keeps over power-off, in one record of store.h: how many power-ons there were, and the
/// configuration.
#ifndef IW_STM32_KEPT_H
#define IW_STM32_KEPT_H

#include "settings.h"
#include "store.h"

typedef struct {
    iw_store_t store;
    uint32_t power_ons;     ///< This one among them. 0: the flash has failed.
    bool has_settings;      ///< A configuration was committed.
    iw_settings_t settings; ///< That one.
} iw_kept_t;

/// Right after a start, before the watchdog runs. A power-on is counted, which may take as long as an erase; another
/// start writes nothing.
void iw_kept_open(iw_kept_t *self, bool power_on);

/// Commits a configuration. False if the flash did not take it: the one of before stays. May stall the CPU for as
/// long as store.h says.
bool iw_kept_commit(iw_kept_t *self, const iw_settings_t *settings);

#endif
