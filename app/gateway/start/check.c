// SPDX-License-Identifier: MIT
#include "report.h"

#include "config/gateway_config.h"
#include "process/owners.h"

#include <errno.h>
#include <grp.h>
#include <string.h>
#include <sys/stat.h>
#include <sysexits.h>
#include <unistd.h>

/// How long the bus is listened to: ten periods of the slowest frame that always comes.
#define LISTEN_US 500000U

/// What cannot be read at all has been refused before. Without type or role the gateway starts, listens, and refuses arm.
static void judge_config(const gateway_config_t *config, inspect_findings_t *findings) {
    if (config->core.listen_only) {
        inspect_say(findings, "config", INSPECT_OK, "it only listens: setpoint type and current role are not needed");
    } else if (config->core.setpoint_type_set && config->core.current_role != IW_ROLE_UNSET) {
        inspect_say(findings, "config", INSPECT_OK, "setpoint type %u, current role %s", config->core.setpoint_type,
                    (config->core.current_role == IW_ROLE_LIMIT) ? "limit" : "setpoint");
    } else {
        inspect_say(findings, "config", INSPECT_WARN,
                    "%s%s%s not configured: it starts and listens, arm will be refused",
                    config->core.setpoint_type_set ? "" : "setpoint_type",
                    (!config->core.setpoint_type_set && config->core.current_role == IW_ROLE_UNSET) ? " and " : "",
                    (config->core.current_role == IW_ROLE_UNSET) ? "current_role" : "");
        inspect_cure(findings, "set it under [wheels] in the configuration; unknown: iwheelctl bringup finds it");
    }
    const iw_stop_budget_t budget = iw_config_stop_budget(&config->core);
    inspect_say(findings, "budget", INSPECT_OK,
                "stop budget: client lost %u ms, %u mm; gateway killed %u ms, %u mm at full command, then unknown",
                (unsigned)budget.client_lost_ms, (unsigned)budget.client_lost_mm, (unsigned)budget.killed_ms,
                (unsigned)budget.killed_mm);
}

/// Whether files can be made in a directory, or it can be made itself, by who looks.
static bool judge_directory(const char *check, const char *path, inspect_findings_t *findings) {
    char above[GATEWAY_PATH_SIZE];
    struct stat status;
    const char *const key = (strcmp(check, "record") == 0) ? "[record] directory" : "[northbound] socket";
    gw_folder_of(path, above, sizeof above);
    const bool there = stat(path, &status) == 0;
    if (there && !S_ISDIR(status.st_mode)) {
        inspect_say(findings, check, INSPECT_FAIL, "%s: %s is no directory", check, path);
        inspect_cure(findings, "correct %s in the configuration", key);
    } else if (!there && errno == ENOENT && access(above, W_OK | X_OK) == 0) {
        inspect_say(findings, check, INSPECT_OK, "%s: directory %s will be made", check, path);
        return true;
    } else if (!there) {
        inspect_say(findings, check, INSPECT_FAIL, "%s: directory %s: %s, and uid %u cannot make it", check, path,
                    strerror(errno), (unsigned)geteuid());
        inspect_cure(findings, "make it: sudo mkdir -p %s; sudo chown %u %s", path, (unsigned)geteuid(), path);
    } else if (access(path, W_OK | X_OK) != 0) {
        inspect_say(findings, check, INSPECT_FAIL, "%s: directory %s cannot be written by uid %u", check, path,
                    (unsigned)geteuid());
        inspect_cure(findings, "sudo chown %u %s (or check as the user whom the service has)", (unsigned)geteuid(),
                     path);
    } else {
        inspect_say(findings, check, INSPECT_OK, "%s: directory %s can be written", check, path);
        return true;
    }
    return false;
}

/// What the start would refuse. The directory must be there, or it would be made.
static void judge_safety(const gateway_config_t *config, inspect_findings_t *findings) {
    char text[INSPECT_TEXT_SIZE] = "";
    FILE *const memory = fmemopen(text, sizeof text, "w");
    if (memory == NULL) {
        return;
    }
    static gw_listener_t listener;
    const gw_listener_wish_t wish = gw_report_socket(config, GW_DRIVE);
    const int result = gw_listener_prepare(&listener, &wish, memory);
    (void)fclose(memory);
    gw_folder_close(&listener.folder);
    if (result != 0) {
        const char *const ours = "iwheel-gateway: ";
        char *const what = (strncmp(text, ours, strlen(ours)) == 0) ? text + strlen(ours) : text;
        char *const cure = strstr(what, "; ");
        what[strcspn(what, "\n")] = '\0';
        if (cure != NULL) {
            *cure = '\0';
        }
        inspect_say(findings, "socket", INSPECT_FAIL, "%s", what);
        inspect_cure(findings, "%s", (cure != NULL) ? cure + 2 : "choose another with --socket");
    }
}

/// Recordings and the ledger are written only where nobody else can put anything.
static void judge_own(const char *path, inspect_findings_t *findings) {
    const int fd = gw_folder_open_own(path);
    if (fd >= 0) {
        (void)close(fd);
    } else if (errno != ENOENT) {
        const int error = errno;
        inspect_say(findings, "record", INSPECT_FAIL, "record: directory %s: %s", path, gw_folder_fault(error));
        inspect_cure(findings, "%s", gw_folder_cure(error));
    }
}

/// `may`: what the group is allowed by that key of [northbound].
static void judge_group(const char *key, const char *group, const char *may, inspect_findings_t *findings) {
    if (strcmp(group, "none") == 0 || getgrnam(group) != NULL) {
        inspect_say(findings, key, INSPECT_OK, "group %s may %s", group, may);
        return;
    }
    inspect_say(findings, key, INSPECT_WARN, "group %s does not exist: the socket%s keeps the gateway's own group",
                group, (strcmp(key, "watch_group") == 0) ? " for watching" : "");
    inspect_cure(findings, "sudo groupadd --system %s, or set [northbound] %s to another, or to none", group, key);
}

static void judge_rights(const gateway_config_t *config, inspect_findings_t *findings) {
    char watch[GATEWAY_PATH_SIZE + 16U];
    (void)snprintf(watch, sizeof watch, "watch on %s", config->northbound.watch_socket);
    if (strcmp(config->northbound.watch_socket, "none") != 0) {
        judge_group("watch_group", config->northbound.watch_group, watch, findings);
    }
    if (strcmp(config->northbound.group, "none") != 0) {
        judge_group("group", config->northbound.group, "use the socket", findings);
    }
    if ((config->northbound.mode & S_IWOTH) != 0U) {
        inspect_say(findings, "mode", INSPECT_WARN, "socket mode %04o: everybody on this machine may move the wheels",
                    (unsigned)config->northbound.mode);
        inspect_cure(findings, "set [northbound] mode = 0660");
    }
}

static void judge_files(const gateway_config_t *config, inspect_findings_t *findings) {
    char directory[GATEWAY_PATH_SIZE];
    gw_folder_of(config->northbound.socket, directory, sizeof directory);
    if (judge_directory("socket", directory, findings) && access(directory, F_OK) == 0) {
        judge_safety(config, findings);
    }
    judge_rights(config, findings);
    if (judge_directory("record", config->record.directory, findings)) {
        judge_own(config->record.directory, findings);
    }
}

/// The bus and the e-stop, as far as they can be opened.
static void judge_machine(const gateway_config_t *config, inspect_findings_t *findings) {
    static iw_linux_hal_t hal;
    inspect_heard_t heard;
    const iw_estop_wish_t line = {
        .name = config->estop.line, .active_high = config->estop.active_high, .debounce_ms = config->estop.debounce_ms};
    const inspect_wish_t wish = gw_report_wish(config);
    const inspect_opened_t opened = inspect_open(&hal, config->bus.interface, &line, findings);
    if (!opened.hal) {
        return;
    }
    inspect_listen(&hal, LISTEN_US, &heard);
    if (opened.bus) {
        inspect_link(iw_linux_hal_link(&hal), &wish, findings);
        inspect_room(iw_linux_hal_link(&hal), findings);
        inspect_bus(iw_linux_hal_link(&hal), &heard, &wish, findings);
    }
    if (opened.estop) {
        const inspect_estop_t estop = inspect_estop_of(&hal, config->estop.line);
        inspect_estop(&estop, findings);
    }
    iw_linux_hal_close(&hal);
}

int gw_report_check(const gateway_config_t *config, FILE *out) {
    static inspect_findings_t findings; // Too large for a stack.
    char sentence[INSPECT_TEXT_SIZE + INSPECT_CURE_SIZE];
    inspect_begin(&findings);
    findings.absent = INSPECT_SKIP;
    judge_config(config, &findings);
    judge_files(config, &findings);
    judge_machine(config, &findings);
    for (unsigned i = 0; i < findings.count; i++) {
        inspect_sentence(&findings.finding[i], sentence, sizeof sentence);
        (void)fprintf(out, "%-4s %s\n", inspect_verdict_word(findings.finding[i].verdict), sentence);
    }
    return (findings.total[INSPECT_FAIL] > 0U) ? 1 : (findings.total[INSPECT_SKIP] > 0U) ? EX_UNAVAILABLE : 0;
}
