// SPDX-License-Identifier: MIT
#include "report.h"

#include "bus/bus_facts.h"

#include <string.h>
#include <unistd.h>

/// How long the bus is listened to: ten periods of the slowest frame that always comes.
#define LISTEN_US 500000U

static void judge_config(const gateway_config_t *config, inspect_findings_t *findings) {
    if (config->core.setpoint_type_set && config->core.current_role != IW_ROLE_UNSET) {
        inspect_say(findings, "config", INSPECT_OK, "setpoint type %u, current role %s", config->core.setpoint_type,
                    config->core.current_role == IW_ROLE_LIMIT ? "limit" : "setpoint");
    } else {
        inspect_say(findings, "config", INSPECT_FAIL, "%s%s%s not configured: arm will be refused",
                    config->core.setpoint_type_set ? "" : "setpoint_type",
                    !config->core.setpoint_type_set && config->core.current_role == IW_ROLE_UNSET ? " and " : "",
                    config->core.current_role == IW_ROLE_UNSET ? "current_role" : "");
        inspect_cure(findings, "set it under [wheels] in the configuration");
    }
    const iw_stop_budget_t budget = iw_config_stop_budget(&config->core);
    inspect_say(findings, "budget", INSPECT_OK,
                "stop budget: client lost %u ms, %u mm; gateway killed %u ms, %u mm at full command, then unknown",
                (unsigned)budget.client_lost_ms, (unsigned)budget.client_lost_mm, (unsigned)budget.killed_ms,
                (unsigned)budget.killed_mm);
}

static void judge_socket(const gateway_config_t *config, inspect_findings_t *findings) {
    char directory[GATEWAY_PATH_SIZE];
    const char *path = config->northbound.socket;
    const char *slash = strrchr(path, '/');
    (void)snprintf(directory, sizeof directory, "%.*s", slash == NULL ? 1 : (int)(slash - path) + 1,
                   slash == NULL ? "." : path);
    if (access(directory, W_OK | X_OK) == 0) {
        inspect_say(findings, "socket", INSPECT_OK, "socket %s: its directory is there", path);
    } else {
        inspect_say(findings, "socket", INSPECT_FAIL, "socket %s: its directory cannot be written", path);
        inspect_cure(findings, "make it: mkdir -p %s", directory);
    }
}

int gw_report_check(gw_daemon_t *daemon, FILE *out) {
    inspect_findings_t findings;
    inspect_heard_t heard;
    char sentence[INSPECT_TEXT_SIZE + INSPECT_CURE_SIZE];
    const inspect_wish_t wish = gw_bus_facts_wish(daemon);
    inspect_begin(&findings);
    inspect_listen(&daemon->hal, LISTEN_US, &heard);
    judge_config(&daemon->config, &findings);
    judge_socket(&daemon->config, &findings);
    inspect_link(iw_linux_hal_link(&daemon->hal), &wish, &findings);
    inspect_bus(iw_linux_hal_link(&daemon->hal), &heard, &wish, &findings);
    const inspect_estop_t estop = inspect_estop_of(&daemon->hal, daemon->config.estop.line);
    inspect_estop(&estop, &findings);
    for (unsigned i = 0; i < findings.count; ++i) {
        inspect_sentence(&findings.finding[i], sentence, sizeof sentence);
        (void)fprintf(out, "%-4s %s\n", inspect_verdict_word(findings.finding[i].verdict), sentence);
    }
    return findings.total[INSPECT_FAIL] > 0U ? 1 : 0;
}
