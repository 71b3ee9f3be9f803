// SPDX-License-Identifier: MIT
#include "contacts.h"

#include <string.h>

static bool is_simulated(const char *line) {
    return strncmp(line, "unix:", 5) == 0;
}

void config_relate_contacts(const gateway_config_t *config, settings_report_t *report, unsigned line2_at,
                            unsigned limit_at) {
    const char *line = config->estop.line;
    const char *line2 = config->estop.line2;
    if (strcmp(line2, "none") == 0) {
        return;
    }
    if (strcmp(line, "none") == 0) {
        settings_complain(report, line2_at, "line2 = %s but line = none; write the button's first contact as line",
                          line2);
    } else if (strcmp(line, line2) == 0) {
        settings_complain(report, line2_at,
                          "line and line2 are both %s, so there is no second contact; write the line "
                          "of the other contact, or line2 = none",
                          line2);
    } else if (is_simulated(line) != is_simulated(line2)) {
        settings_complain(report, line2_at,
                          "line = %s and line2 = %s: one contact is simulated and the other is not; write two lines of "
                          "the machine, or two of the simulator, or line2 = none",
                          line, line2);
    } else if (config->estop.discrepancy_ms <= config->estop.debounce_ms) {
        settings_complain(report, limit_at,
                          "estop_discrepancy_ms = %u is not more than debounce_ms = %u: a single bounce would be a "
                          "disagreement; write more, or a shorter debounce_ms",
                          config->estop.discrepancy_ms, config->estop.debounce_ms);
    }
}
