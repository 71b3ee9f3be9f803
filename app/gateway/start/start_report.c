// SPDX-License-Identifier: MIT
#include "start_report.h"

#include "angles.h"
#include "config/gateway_config.h"
#include "sockets/log.h"

#include <inttypes.h>
#include <string.h>

#define TENTHS(value) (value) / 10U, (value) % 10U

/// Logs the largest angles by a fault of one wheel, each with its assumption. All of them depend on the track.
static void report_angles(const gateway_config_t *config, sock_log_t *log) {
    if (config->core.track_mm == 0U) {
        sock_log(log, SOCK_LOG_WARNING,
                 "track_mm is not configured: arm will be refused; set it under [wheels] (iwheelctl "
                 "bringup measures it)");
        return;
    }
    const gw_angles_t angles = gw_angles(config);
    sock_log(log, SOCK_LOG_INFO,
             "angle budget, zero without ramp: the machine turns by %u.%u degrees if a wheel is blocked, by %u.%u if "
             "it is slow (assumes %u mm/s2, not measured)",
             TENTHS(angles.blocked), TENTHS(angles.slow), GW_ANGLES_BRAKE_MM_S2);
    sock_log(
        log, SOCK_LOG_INFO,
        "angle budget, ramp: the machine turns by %u.%u degrees if a wheel coasts (assumes %u mm/s2, not measured), by "
        "%u.%u if it follows 100 ms late",
        TENTHS(angles.coasting), GW_ANGLES_COAST_MM_S2, TENTHS(angles.late));
    sock_log(log, SOCK_LOG_INFO,
             "angle budget, unbounded: the machine turns by %u.%u degrees per second if only one wheel drives; up to "
             "%u.%u per second are not detected",
             TENTHS(angles.runs_on), TENTHS(angles.unnoticed));
}

void gw_report_start(const gateway_config_t *config, bool simulated, bool watched, sock_log_t *log) {
    const iw_stop_budget_t budget = iw_config_stop_budget(&config->core);
    sock_log(log, SOCK_LOG_INFO, "version " IWHEEL_VERSION "; bus %s; clients at %s%s", config->bus.interface,
             config->northbound.socket, config->core.listen_only ? "; listens only" : "");
    if (watched) {
        sock_log(log, SOCK_LOG_INFO, "watchers at %s", config->northbound.watch_socket);
    }
    const bool two = strcmp(config->estop.line2, "none") != 0;
    sock_log(log, SOCK_LOG_INFO, "e-stop: %s%s%s%s", config->estop.line, two ? " and " : "",
             two ? config->estop.line2 : "", simulated ? " (SIMULATED)" : "");
    sock_log(log, SOCK_LOG_INFO, "stop budget, client lost: %" PRIu32 " ms and %" PRIu32 " mm after its last command",
             budget.client_lost_ms, budget.client_lost_mm);
    sock_log(log, SOCK_LOG_INFO,
             "stop budget, gateway killed: %" PRIu32 " ms and %" PRIu32 " mm at full command, then unknown",
             budget.killed_ms, budget.killed_mm);
    report_angles(config, log);
    if (!config->core.setpoint_type_set || config->core.current_role == IW_ROLE_UNSET) {
        sock_log(log, SOCK_LOG_WARNING,
                 "setpoint_type or current_role is not configured: arm will be refused; set both under [wheels]");
    }
}

void gw_report_room(const iwl_bus_link_t *link, sock_log_t *log) {
    static inspect_findings_t findings; // Too large for a stack.
    char sentence[INSPECT_TEXT_SIZE + INSPECT_FIX_SIZE];
    inspect_begin(&findings);
    inspect_room(link, &findings);
    if (findings.count > 0U) {
        inspect_sentence(&findings.finding[0], sentence, sizeof sentence);
        sock_log(log, (findings.finding[0].verdict == INSPECT_OK) ? SOCK_LOG_INFO : SOCK_LOG_WARNING, "%s", sentence);
    }
}

void gw_report_unopened(const gateway_config_t *config, const char *cause, int error, FILE *err) {
    static inspect_findings_t findings; // Too large for a stack.
    char sentence[INSPECT_TEXT_SIZE + INSPECT_FIX_SIZE];
    inspect_begin(&findings);
    inspect_unopened(cause, cause == config->bus.interface, error, &findings);
    inspect_sentence(&findings.finding[0], sentence, sizeof sentence);
    (void)fprintf(err, "iwheel-gateway: %s\n", sentence);
}

inspect_config_t gw_report_config(const gateway_config_t *config) {
    return (inspect_config_t){
        .name = config->bus.interface,
        .bitrate_hz = config->bus.bitrate,
        .sample_point_permille = config->bus.sample_point_permille,
        .refuses = config->bus.on_mismatch == GATEWAY_MISMATCH_REFUSE,
    };
}

iwl_estop_config_t gw_report_estop(const gateway_config_t *config) {
    return (iwl_estop_config_t){.name = config->estop.line,
                                .active_high = config->estop.active_high,
                                .debounce_ms = config->estop.debounce_ms,
                                .chip = config->estop.chip,
                                .chip_line = config->estop.chip_line,
                                .name2 = config->estop.line2,
                                .active_high2 = config->estop.active2_high,
                                .chip2 = config->estop.chip2,
                                .chip2_line = config->estop.chip2_line,
                                .discrepancy_ms = config->estop.discrepancy_ms};
}

sock_listener_config_t gw_report_socket(const gateway_config_t *config, sock_right_t right) {
    return (right == SOCK_DRIVE)
               ? (sock_listener_config_t){"iwheel-gateway", right, config->northbound.socket, config->northbound.group,
                                          config->northbound.mode}
               : (sock_listener_config_t){"iwheel-gateway", right, config->northbound.watch_socket,
                                          config->northbound.watch_group, config->northbound.watch_mode};
}
