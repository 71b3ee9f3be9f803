// SPDX-License-Identifier: MIT
/// How the keys of the e-stop's two contacts must fit together.
#ifndef CONFIG_CONTACTS_H
#define CONFIG_CONTACTS_H

#include "config/gateway_config.h"
#include "config/settings.h"

/// The lines of the file on which `line2` and `estop_discrepancy_ms` stand; 0: not given. Two names of one line are found out when
/// it is opened.
void config_relate_contacts(const gateway_config_t *config, settings_report_t *report, unsigned line2_at,
                            unsigned limit_at);

#endif
