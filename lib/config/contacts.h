// SPDX-License-Identifier: MIT
/// Relations between the keys of the two e-stop contacts.
#ifndef CONFIG_CONTACTS_H
#define CONFIG_CONTACTS_H

#include "config/gateway_config.h"
#include "config/settings.h"

/// Reports relations that do not hold. `lines`: line numbers of `line2` and `estop_discrepancy_ms` in the file; 0 if
/// not set. Two names of the same line are detected when it is opened.
void config_relate_contacts(const gateway_config_t *config, settings_report_t *report, unsigned line2_at,
                            unsigned limit_at);

#endif
