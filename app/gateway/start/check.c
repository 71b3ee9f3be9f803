// SPDX-License-Identifier: MIT
#include "start_report.h"

#include "config/gateway_config.h"
#include "sockets/owners.h"

#include <errno.h>
#include <fcntl.h>
#include <grp.h>
#include <string.h>
#include <sys/stat.h>
#include <sysexits.h>
#include <unistd.h>

/// Time of receiving from the bus: ten periods of the slowest permanent message.
#define LISTEN_US 500000U

/// Lists the keys that arm needs and that are not set; empty if all are set.
static void name_unset(const iw_config_t *core, char *out_names, size_t size) {
    const struct {
        const char *key;
        bool is_set;
    } needed[] = {{"setpoint_type", core->setpoint_type_set},
                  {"current_role", core->current_role != IW_ROLE_UNSET},
                  {"track_mm", core->track_mm != 0U}};
    size_t used = 0;
    out_names[0] = '\0';
    for (size_t i = 0; i < sizeof needed / sizeof needed[0]; i++) {
        if (!needed[i].is_set) {
            used += (size_t)snprintf(out_names + used, size - used, "%s%s", (used > 0U) ? " and " : "", needed[i].key);
        }
    }
}

/// A configuration that cannot be read was refused before. Without one of these keys the gateway starts and receives,
/// but refuses arm.
static void judge_config(const gateway_config_t *config, inspect_findings_t *findings) {
    char unset[64];
    name_unset(&config->core, unset, sizeof unset);
    if (config->core.listen_only) {
        inspect_add(findings, "config", INSPECT_OK,
                    "listen only: setpoint type, current role and track are not needed");
    } else if (unset[0] == '\0') {
        inspect_add(findings, "config", INSPECT_OK, "setpoint type %u, current role %s, track %u mm",
                    config->core.setpoint_type, (config->core.current_role == IW_ROLE_LIMIT) ? "limit" : "setpoint",
                    config->core.track_mm);
    } else {
        inspect_add(findings, "config", INSPECT_WARN,
                    "%s not configured: the gateway starts and listens, arm will be refused", unset);
        inspect_fix(findings,
                    "set it under [wheels] in the configuration; if it is unknown: iwheelctl bringup finds it");
    }
    const iw_stop_budget_t budget = iw_config_stop_budget(&config->core);
    inspect_add(findings, "budget", INSPECT_OK,
                "stop budget: client lost %u ms, %u mm; gateway killed %u ms, %u mm at full command, then unknown",
                (unsigned)budget.client_lost_ms, (unsigned)budget.client_lost_mm, (unsigned)budget.killed_ms,
                (unsigned)budget.killed_mm);
}

// Checks of the directories that the start would use. Nothing is created.
// -------------------------------------------------

/// Returns true if the start would create the directory. `*out_error` is the errno of the reason why it could not;
/// otherwise 0.
static bool is_to_be_made(const char *path, int *out_error) {
    char bare[GATEWAY_PATH_SIZE];
    char above[GATEWAY_PATH_SIZE];
    struct stat status;
    (void)snprintf(bare, sizeof bare, "%s", path);
    for (size_t length = strlen(bare); length > 1U && bare[length - 1U] == '/'; length--) {
        bare[length - 1U] = '\0'; // mkdir accepts it too.
    }
    *out_error = (lstat(bare, &status) == 0) ? 0 : errno;
    if (*out_error != ENOENT) {
        return false;
    }
    sock_folder_of(bare, above, sizeof above);
    *out_error = (faccessat(AT_FDCWD, above, W_OK | X_OK, AT_EACCESS) == 0) ? 0 : errno;
    return true;
}

static int write_error(int directory) {
    return (faccessat(directory, ".", W_OK | X_OK, AT_EACCESS) == 0) ? 0 : errno;
}

/// `key`: configuration key of the directory.
static void fix_directory(const char *path, const char *key, int error, inspect_findings_t *findings) {
    const unsigned uid = (unsigned)geteuid();
    switch (error) {
    case ENOENT:
        inspect_fix(findings, "create it: sudo mkdir -p %s; sudo chown %u %s", path, uid, path);
        break;
    case EACCES:
    case EPERM:
        inspect_fix(findings, "sudo chown %u %s (or run this check as the user of the service)", uid, path);
        break;
    case ENOTDIR:
        inspect_fix(findings, "correct %s in the configuration", key);
        break;
    default:
        inspect_fix(findings, "%s, or set %s to another directory", sock_folder_fix(error), key);
        break;
    }
}

/// Adds a message that the start prints, which ends with a fix.
static void add_printed(char *text, inspect_verdict_t verdict, inspect_findings_t *findings) {
    static const char *const prefixes[] = {"iwheel-gateway: ", "warning: "};
    char *what = text;
    for (size_t i = 0; i < sizeof prefixes / sizeof prefixes[0]; i++) {
        const size_t length = strlen(prefixes[i]);
        what += (strncmp(what, prefixes[i], length) == 0) ? length : 0U;
    }
    what[strcspn(what, "\n")] = '\0';
    char *const fix = strstr(what, "; ");
    if (fix != NULL) {
        *fix = '\0';
    }
    inspect_add(findings, "socket", verdict, "%s", what);
    inspect_fix(findings, "%s", (fix != NULL) ? fix + 2 : "choose another with --socket");
}

/// `text`: message that the start would print.
static int judge_place(const sock_listener_config_t *wanted, char *text, size_t size, int *out_error) {
    static sock_listener_t listener;
    FILE *const stream = fmemopen(text, size, "w");
    if (stream == NULL) {
        return 0;
    }
    int result = sock_listener_prepare(&listener, wanted, stream);
    if (result == 0) {
        *out_error = write_error(listener.folder.fd);
        rewind(stream); // A warning about the directory remains if there is nothing worse.
        result = sock_listener_judge(&listener, stream);
    }
    (void)fclose(stream);
    sock_folder_close(&listener.folder);
    return result;
}

/// Without the socket for driving there is no start; without the socket for watchers there is.
static void judge_socket(const sock_listener_config_t *wanted, inspect_findings_t *findings) {
    const inspect_verdict_t trouble = (wanted->right == SOCK_DRIVE) ? INSPECT_FAIL : INSPECT_WARN;
    char path[GATEWAY_PATH_SIZE];
    char text[INSPECT_TEXT_SIZE] = "";
    int error = 0;
    sock_folder_of(wanted->path, path, sizeof path);
    const bool new = is_to_be_made(path, &error);
    const int result = (new || error != 0) ? 0 : judge_place(wanted, text, sizeof text, &error);
    if (result != 0) {
        add_printed(text, trouble, findings);
    } else if (error != 0) {
        inspect_add(findings, "socket", trouble, "socket %s: directory %s: %s", wanted->path, path, strerror(error));
        fix_directory(path, (wanted->right == SOCK_DRIVE) ? "[northbound] socket" : "[northbound] watch_socket", error,
                      findings);
    } else if (text[0] != '\0') {
        add_printed(text, INSPECT_WARN, findings);
    } else {
        inspect_add(findings, "socket", INSPECT_OK, "socket: directory %s %s", path,
                    new ? "will be created" : "can be written");
    }
}

/// The start does not depend on it: the gateway only reports what cannot be stored. Recordings and assumptions are
/// written only where no other user can write.
static void judge_record(const char *path, inspect_findings_t *findings) {
    int error = 0;
    if (is_to_be_made(path, &error) && error == 0) {
        inspect_add(findings, "record", INSPECT_OK, "record: directory %s will be created", path);
        return;
    }
    const int directory = (error == 0) ? sock_folder_open_own(path) : -1;
    if (error == 0) {
        error = (directory < 0) ? errno : write_error(directory);
    }
    if (directory >= 0) {
        (void)close(directory);
    }
    if (error == 0) {
        inspect_add(findings, "record", INSPECT_OK, "record: directory %s can be written", path);
        return;
    }
    inspect_add(findings, "record", INSPECT_WARN,
                "record: directory %s: %s: the gateway starts, but records no stop and stores no assumption", path,
                sock_folder_fault(error));
    fix_directory(path, "[record] directory", error, findings);
}

// Rights of groups ----------------------------------------------------------------------------------------------------

/// Checks a group. `may`: rights of the group by this key of [northbound].
static void judge_group(const char *key, const char *group, const char *may, inspect_findings_t *findings) {
    if (strcmp(group, "none") == 0 || getgrnam(group) != NULL) {
        inspect_add(findings, key, INSPECT_OK, "group %s may %s", group, may);
        return;
    }
    inspect_add(findings, key, INSPECT_WARN, "group %s does not exist: the socket%s will have the gateway's own group",
                group, (strcmp(key, "watch_group") == 0) ? " for watching" : "");
    inspect_fix(findings, "sudo groupadd --system %s, or set [northbound] %s to another, or to none", group, key);
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
        inspect_add(findings, "mode", INSPECT_WARN, "socket mode %04o: every user of this machine may move the wheels",
                    (unsigned)config->northbound.mode);
        inspect_fix(findings, "set [northbound] mode = 0660");
    }
}

static void judge_files(const gateway_config_t *config, inspect_findings_t *findings) {
    const sock_listener_config_t drive = gw_report_socket(config, SOCK_DRIVE);
    const sock_listener_config_t watch = gw_report_socket(config, SOCK_WATCH);
    judge_socket(&drive, findings);
    if (strcmp(watch.path, "none") != 0) {
        judge_socket(&watch, findings);
    }
    judge_rights(config, findings);
    judge_record(config->record.directory, findings);
}

/// Checks the bus and the e-stop, as far as they can be opened.
static void judge_machine(const gateway_config_t *config, inspect_findings_t *findings) {
    static iwl_hal_t hal;
    inspect_traffic_t traffic;
    const iwl_estop_config_t line = gw_report_estop(config);
    const inspect_config_t wanted = gw_report_config(config);
    const inspect_opened_t opened = inspect_open(&hal, config->bus.interface, &line, findings);
    if (!opened.hal) {
        return;
    }
    inspect_listen(&hal, LISTEN_US, &traffic);
    if (opened.bus) {
        inspect_link(iwl_hal_link(&hal), &wanted, findings);
        inspect_room(iwl_hal_link(&hal), findings);
        inspect_bus(iwl_hal_link(&hal), &traffic, &wanted, findings);
    }
    if (opened.estop) {
        const inspect_estop_t estop = inspect_estop_of(&hal, config->estop.line);
        inspect_estop(&estop, findings);
    }
    iwl_hal_close(&hal);
}

int gw_report_check(const gateway_config_t *config, FILE *out) {
    static inspect_findings_t findings; // Too large for a stack.
    char sentence[INSPECT_TEXT_SIZE + INSPECT_FIX_SIZE];
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
