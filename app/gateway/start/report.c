// SPDX-License-Identifier: MIT
#include "report.h"

#include "bus/bus_facts.h"

#include <inttypes.h>
#include <stdarg.h>

__attribute__((format(printf, 2, 3))) static void warn(gw_daemon_t *daemon, const char *format, ...) {
    if (daemon->warnings < GW_WARNINGS) {
        va_list arguments;
        va_start(arguments, format);
        (void)vsnprintf(daemon->warning[daemon->warnings], GW_WARNING_SIZE, format, arguments);
        va_end(arguments);
        ++daemon->warnings;
    }
}

void gw_report_warnings(gw_daemon_t *daemon) {
    const iw_linux_hal_t *hal = &daemon->hal;
    daemon->warnings = 0;
    if (!hal->estop_ops->present) {
        warn(daemon, "there is no e-stop line: only software and the wheels' own 1 s watchdog can stop the wheels; "
                     "configure [estop] line");
    } else if (hal->estop_ops->simulated) {
        warn(daemon, "the e-stop %s is SIMULATED: no button of this machine stops the wheels",
             daemon->config.estop.line);
    }
    inspect_findings_t findings;
    inspect_begin(&findings);
    gw_bus_facts_judge(daemon, &findings);
    for (unsigned i = 0; i < findings.count; ++i) {
        if (findings.finding[i].verdict != INSPECT_OK) {
            char sentence[GW_WARNING_SIZE];
            inspect_sentence(&findings.finding[i], sentence, sizeof sentence);
            warn(daemon, "%s", sentence);
        }
    }
}

void gw_report_start(gw_daemon_t *daemon) {
    const gateway_config_t *config = &daemon->config;
    const iw_stop_budget_t budget = iw_config_stop_budget(&config->core);
    gw_log_t *log = &daemon->log;
    gw_log(log, GW_LOG_INFO, "version " IWHEEL_VERSION "; bus %s; clients at %s%s", config->bus.interface,
           config->northbound.socket, config->core.listen_only ? "; listens only" : "");
    gw_log(log, GW_LOG_INFO, "e-stop: %s%s", config->estop.line,
           daemon->hal.estop_ops->simulated ? " (SIMULATED)" : "");
    gw_log(log, GW_LOG_INFO, "stop budget, client lost: %" PRIu32 " ms and %" PRIu32 " mm after its last command",
           budget.client_lost_ms, budget.client_lost_mm);
    gw_log(log, GW_LOG_INFO,
           "stop budget, gateway killed: %" PRIu32 " ms and %" PRIu32 " mm at full command, then unknown",
           budget.killed_ms, budget.killed_mm);
    for (uint32_t i = 0; i < daemon->warnings; ++i) {
        gw_log(log, GW_LOG_WARNING, "%s", daemon->warning[i]);
    }
    if (!config->core.setpoint_type_set || config->core.current_role == IW_ROLE_UNSET) {
        gw_log(log, GW_LOG_WARNING,
               "setpoint_type or current_role is not configured: arm will be refused; set both under [wheels]");
    }
}

void gw_report_unopened(const gateway_config_t *config, const char *culprit, int error, FILE *err) {
    inspect_findings_t findings;
    char sentence[INSPECT_TEXT_SIZE + INSPECT_CURE_SIZE];
    inspect_begin(&findings);
    inspect_unopened(culprit, culprit == config->bus.interface, error, &findings);
    inspect_sentence(&findings.finding[0], sentence, sizeof sentence);
    (void)fprintf(err, "iwheel-gateway: %s\n", sentence);
}
