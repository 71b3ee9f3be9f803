// SPDX-License-Identifier: MIT
#include "report.h"

#include "bus_facts.h"

#include <errno.h>
#include <inttypes.h>
#include <stdarg.h>
#include <string.h>

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
    gw_fact_verdict_t verdict;
    char fact[GW_FACT_SIZE];
    for (unsigned i = 0; gw_bus_facts_tell(daemon, i, &verdict, fact); ++i) {
        if (verdict != GW_FACT_OK) {
            warn(daemon, "%s", fact);
        }
    }
}

/// Names of the ledger's items in one state, as one text.
static void list_items(const iw_ledger_t *ledger, iw_ledger_state_t state, char *out_text, size_t size) {
    out_text[0] = '\0';
    for (unsigned item = 0; item < IW_LEDGER_ITEMS; ++item) {
        if (iw_ledger_entry(ledger, (iw_ledger_item_t)item)->state == state) {
            const size_t length = strlen(out_text);
            (void)snprintf(&out_text[length], size - length, "%s%s", length > 0U ? ", " : "",
                           gw_ledger_item_name((iw_ledger_item_t)item));
        }
    }
}

void gw_report_start(gw_daemon_t *daemon) {
    const gateway_config_t *config = &daemon->config;
    const iw_stop_budget_t budget = iw_config_stop_budget(&config->core);
    char items[512];
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
    list_items(&daemon->gateway.ledger, IW_LEDGER_ASSUMED, items, sizeof items);
    gw_log(log, GW_LOG_INFO, "assumed, never verified: %s", items);
    for (uint32_t i = 0; i < daemon->warnings; ++i) {
        gw_log(log, GW_LOG_WARNING, "%s", daemon->warning[i]);
    }
    if (!config->core.setpoint_type_set || config->core.current_role == IW_ROLE_UNSET) {
        gw_log(log, GW_LOG_WARNING,
               "setpoint_type or current_role is not configured: arm will be refused; set both under [wheels]");
    }
}

void gw_report_unopened(const gateway_config_t *config, const char *culprit, int error, FILE *err) {
    const bool is_bus = culprit == config->bus.interface;
    if (error == ENOTSUP && is_bus) {
        (void)fprintf(err,
                      "iwheel-gateway: bus %s: libmnl was missing when this was built, so it serves the simulator's "
                      "bus only (unix:PATH); apt-get install libmnl-dev, configure and build again\n",
                      culprit);
    } else if (error == ENOTSUP) {
        (void)fprintf(err,
                      "iwheel-gateway: e-stop %s: libgpiod was missing when this was built, so it reads the "
                      "simulator's button only (unix:PATH); apt-get install libgpiod-dev, configure and build again\n",
                      culprit);
    } else if (error == EAFNOSUPPORT && is_bus) {
        (void)fprintf(
            err,
            "iwheel-gateway: bus %s: this kernel has no CAN sockets; modprobe can_raw, or use the simulator's "
            "bus: --can unix:PATH\n",
            culprit);
    } else {
        (void)fprintf(err, "iwheel-gateway: %s %s: %s; correct %s\n", is_bus ? "bus" : "e-stop", culprit,
                      strerror(error), is_bus ? "[bus] interface or --can" : "[estop] line or --estop");
    }
}

const char *gw_report_estop_trouble(const gw_daemon_t *daemon) {
    const int trouble = iw_linux_hal_estop_trouble(&daemon->hal);
    if (trouble == 0) {
        return "";
    }
    if (daemon->hal.estop_ops->simulated) {
        return "the simulator is not there; start it with this --estop";
    }
    switch (trouble) {
    case ENOENT:
        return "there is no such line; gpioinfo lists them";
    case EBUSY:
        return "the line is busy: another program has it; gpioinfo names that program";
    case EACCES:
    case EPERM:
        return "not allowed; add the gateway's user to the group that owns /dev/gpiochip*";
    default:
        return "its chip is gone or does not answer; gpiodetect lists the chips";
    }
}
