// SPDX-License-Identifier: MIT
#include "config_relations.h"

#include "config_value.h"

#include "iwheel_northbound/text.h"

#include <stdarg.h>
#include <string.h>

#define WATCHDOG_MS 1000U

void config_complain(config_report_t *report, unsigned line, const char *format, ...) {
    char text[CONFIG_MESSAGE_SIZE + 64U];
    char plain[CONFIG_MESSAGE_SIZE + 64U];
    va_list list;
    report->errors++;
    if (report->errors > CONFIG_ERRORS_SHOWN) {
        return;
    }
    (void)fputs(report->name, report->err);
    if (line > 0) {
        (void)fprintf(report->err, ":%u", line);
    }
    (void)fputs(": ", report->err);
    va_start(list, format);
    (void)vsnprintf(text, sizeof text, format, list);
    va_end(list);
    iwn_plain_copy(text, plain, sizeof plain); // It quotes the file.
    (void)fprintf(report->err, "%s\n", plain);
}

void config_complain_end(config_report_t *report) {
    if (report->errors > CONFIG_ERRORS_SHOWN) {
        (void)fprintf(report->err, "%s: %u more errors are not shown; mend these first\n", report->name,
                      report->errors - CONFIG_ERRORS_SHOWN);
    }
}

static unsigned last_line(const unsigned *seen) {
    static const char *const involved[] = {"period_ms", "lease_ms", "decel_mm_s2", "max_speed_mm_s"};
    unsigned line = 0;
    for (size_t i = 0; i < sizeof involved / sizeof involved[0]; i++) {
        const config_key_t *row = config_key_find("drive", involved[i]);
        line = (seen[row - config_keys] > line) ? seen[row - config_keys] : line;
    }
    return line;
}

/// Each way of mending the budget alone, as far as its key's range allows.
static void budget_cures(const iw_config_t *core, char *out, size_t size) {
    const uint32_t spent = (uint32_t)core->lease_ms + core->period_ms;
    const uint32_t ramp_ms = ((uint32_t)core->max_speed_mm_s * 1000U + core->decel_mm_s2 - 1U) / core->decel_mm_s2;
    const uint32_t left_ms = WATCHDOG_MS - spent;
    const uint32_t decel = ((uint32_t)core->max_speed_mm_s * 1000U + left_ms - 1U) / left_ms;
    const uint32_t speed = left_ms * core->decel_mm_s2 / 1000U;
    int used = snprintf(out, size, "write max_speed_mm_s = %u at most", (unsigned)speed);
    if (decel <= iw_config_range(IW_CONFIG_DECEL).max) {
        used += snprintf(out + used, size - (size_t)used, ", or decel_mm_s2 = %u at least", (unsigned)decel);
    }
    if (ramp_ms + core->period_ms + iw_config_range(IW_CONFIG_LEASE).min <= WATCHDOG_MS) {
        (void)snprintf(out + used, size - (size_t)used, ", or lease_ms = %u at most",
                       (unsigned)(WATCHDOG_MS - core->period_ms - ramp_ms));
    }
}

void config_relations_check(config_report_t *report, const gateway_config_t *config, const unsigned *seen) {
    const iw_config_t *core = &config->core;
    char cures[CONFIG_MESSAGE_SIZE];
    const iw_config_fault_t fault = iw_config_check(core);
    if (fault == IW_CONFIG_STOP_BUDGET) {
        budget_cures(core, cures, sizeof cures);
        config_complain(
            report, last_line(seen),
            "after a lost client the wheels would need lease_ms %u + period_ms %u + max_speed_mm_s %u / decel_mm_s2 %u "
            "= %u ms to stop, more than the %u ms of their own watchdog; %s",
            core->lease_ms, core->period_ms, core->max_speed_mm_s, core->decel_mm_s2,
            (unsigned)iw_config_stop_budget(core).client_lost_ms, WATCHDOG_MS, cures);
    } else if (fault != IW_CONFIG_OK) {
        config_complain(report, 0, "the values do not fit together (fault %d); compare with share/gateway.conf",
                        (int)fault);
    }
}
