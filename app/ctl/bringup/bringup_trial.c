// SPDX-License-Identifier: MIT
// Gateway of the session: it runs with a trial configuration in a folder of its own. Both end with this program in
// every case.
#include "bringup.h"

#include <errno.h>
#include <fcntl.h>
#include <ftw.h>
#include <signal.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/prctl.h>
#include <sys/stat.h>
#include <sys/wait.h>
#include <time.h>
#include <unistd.h>

#define START_US 5000000
#define END_US   4000000
#define POLL_NS  20000000L

static void nap(void) {
    const struct timespec pause = {0, POLL_NS};
    (void)nanosleep(&pause, NULL);
}

static void path_of(const trial_t *trial, const char *name, char *out_path, size_t size) {
    (void)snprintf(out_path, size, "%s/%s", trial->folder, name);
}

static int remove_one(const char *path, const struct stat *status, int kind, struct FTW *place) {
    (void)status;
    (void)kind;
    (void)place;
    (void)remove(path); // If it cannot be removed now, the caller tries again.
    return 0;
}

/// Removes the folder with its contents: the gateway leaves its assumption store and recordings of stops there. The
/// processes that write them end a little later than the gateway, and may still write. Returns 0, or an exit code.
static int remove_folder(const char *folder) {
    const int64_t end_us = client_now_us() + END_US;
    while (access(folder, F_OK) == 0) {
        (void)nftw(folder, remove_one, 8, FTW_DEPTH | FTW_PHYS | FTW_MOUNT);
        if (client_now_us() > end_us) {
            return CTL_UNAVAILABLE;
        }
        nap();
    }
    return 0;
}

/// Waits until neither this program nor the gateway holds the leash, whatever ended them, and removes the folder. The
/// guard has a session of its own, which neither Ctrl-C nor the end of a terminal reaches. It holds no other
/// descriptor: neither the client's socket nor a pipe.
_Noreturn static void become_guard(const char *folder, int held) {
    char nothing;
    (void)setsid();
    (void)signal(SIGTERM, SIG_IGN);
    (void)dup2(held, STDIN_FILENO);
    closefrom(STDOUT_FILENO);
    while (read(STDIN_FILENO, &nothing, 1) < 0 && errno == EINTR) {
    }
    _exit(remove_folder(folder));
}

/// Returns false if the guard cannot be started.
static bool start_guard(trial_t *trial) {
    int ends[2];
    if (pipe2(ends, O_CLOEXEC) != 0) {
        return false;
    }
    trial->guard = fork();
    if (trial->guard == 0) {
        (void)close(ends[1]);
        become_guard(trial->folder, ends[0]);
    }
    trial->leash = ends[1];
    (void)close(ends[0]);
    if (trial->guard < 0) {
        (void)close(ends[1]);
    }
    return trial->guard > 0;
}

static bool make_folder(trial_t *trial) {
    const char *runtime = getenv("XDG_RUNTIME_DIR");
    if (trial->folder[0] != '\0') {
        return true;
    }
    (void)snprintf(trial->folder, sizeof trial->folder, "%.30s/iwheel-bringup-XXXXXX",
                   (runtime != NULL && runtime[0] == '/' && strlen(runtime) <= 30U) ? runtime : "/tmp");
    const bool made = mkdtemp(trial->folder) != NULL;
    if (made && start_guard(trial)) {
        return true;
    }
    (void)ctl_fail(CTL_UNAVAILABLE, "cannot create a folder like %s: %s", trial->folder, strerror(errno));
    if (made) {
        (void)rmdir(trial->folder);
    }
    trial->folder[0] = '\0';
    return false;
}

/// Makes the trial configuration: slow limits, and the folder of the session for all files of a real gateway.
/// `with_records` leaves the directory of the records unchanged.
static void slow_down(const bringup_t *self, const gateway_config_t *config, bool with_records,
                      gateway_config_t *out_trial) {
    *out_trial = *config;
    out_trial->core.max_speed_mm_s = 2 * BRINGUP_SPEED_MM_S;
    out_trial->core.max_current_mA = (uint16_t)self->current_mA;
    out_trial->core.min_current_mA = iw_config_range(IW_CONFIG_MIN_CURRENT).min;
    out_trial->core.accel_mm_s2 = 800;
    out_trial->core.decel_mm_s2 = 1500;
    out_trial->core.lease_ms = 200;
    out_trial->core.period_ms = 20;
    out_trial->core.zero_hold_ms = 1100;
    out_trial->core.hold_max_s = 10;   // Wheels in the air: no machine rolls away during a wait.
    out_trial->core.blocked_ms = 2000; // A wheel that does not turn is a result here. No burst lasts that long.
    out_trial->core.pair_mm = 150;     // A pair in the air does not turn a machine: the widest limit.
    out_trial->core.pair_leak_ms = 500;
    out_trial->core.track_mm =
        (with_records || config->core.track_mm != 0U) ? config->core.track_mm : iw_config_range(IW_CONFIG_TRACK).max;
    out_trial->core.max_yaw_mrad_s = 10000;
    out_trial->core.yaw_accel_mrad_s2 = 10000;
    out_trial->core.wheel_silent_ms = 150; // Wheels in the air drive no person: waiting is better than a stop.
    out_trial->core.echo_ms = 150;
    out_trial->northbound.mode = 0600;
    out_trial->northbound.max_clients = 4;
    (void)snprintf(out_trial->northbound.group, sizeof out_trial->northbound.group, "none");
    path_of(&self->trial, "gateway.sock", out_trial->northbound.socket, sizeof out_trial->northbound.socket);
    if (!with_records) {
        (void)snprintf(out_trial->record.directory, sizeof out_trial->record.directory, "%s", self->trial.folder);
    }
}

static bool write_config(const bringup_t *self, const gateway_config_t *config, bool with_records) {
    gateway_config_t trial;
    char path[128];
    slow_down(self, config, with_records, &trial);
    path_of(&self->trial, "gateway.conf", path, sizeof path);
    FILE *file = fopen(path, "we");
    if (file == NULL) {
        (void)ctl_fail(CTL_UNAVAILABLE, "cannot write %s: %s", path, strerror(errno));
        return false;
    }
    gateway_config_print(&trial, file);
    return fclose(file) == 0;
}

/// Finds the gateway's program: by --gateway, next to this program, in the folder of the build, or in PATH.
static void find_program(trial_t *trial) {
    char self[400];
    const ssize_t length = readlink("/proc/self/exe", self, sizeof self - 1U);
    if (trial->program[0] != '\0') {
        return;
    }
    self[(length > 0) ? length : 0] = '\0';
    char *slash = strrchr(self, '/');
    if (slash != NULL) {
        static const char *const places[] = {"", "/../gateway"};
        *slash = '\0';
        for (size_t i = 0; i < sizeof places / sizeof places[0]; i++) {
            (void)snprintf(trial->program, sizeof trial->program, "%s%s/iwheel-gateway", self, places[i]);
            if (access(trial->program, X_OK) == 0) {
                return;
            }
        }
    }
    (void)snprintf(trial->program, sizeof trial->program, "iwheel-gateway");
}

_Noreturn static void become_gateway(const trial_t *trial) {
    char config[128];
    char log[128];
    sigset_t none;
    path_of(trial, "gateway.conf", config, sizeof config);
    path_of(trial, "gateway.log", log, sizeof log);
    const int fd = open(log, O_WRONLY | O_CREAT | O_TRUNC | O_CLOEXEC, 0600);
    if (fd >= 0) {
        (void)dup2(fd, STDOUT_FILENO);
        (void)dup2(fd, STDERR_FILENO);
    }
    (void)sigemptyset(&none);
    (void)sigprocmask(SIG_SETMASK, &none, NULL);
    (void)setpgid(0, 0); // Ctrl-C reaches only bringup, which ends the gateway in order.
    (void)prctl(PR_SET_PDEATHSIG, SIGTERM);
    (void)fcntl(trial->leash, F_SETFD, 0); // The folder exists as long as the gateway runs.
    (void)execlp(trial->program, trial->program, "-c", config, (char *)NULL);
    (void)fprintf(stderr, "%s: %s; name it with --gateway PROGRAM\n", trial->program, strerror(errno));
    _exit(CTL_UNAVAILABLE);
}

/// Prints the last line that the gateway wrote.
static void report_log(const trial_t *trial) {
    char path[128];
    char line[512];
    char last[512] = "it wrote nothing";
    path_of(trial, "gateway.log", path, sizeof path);
    FILE *file = fopen(path, "re");
    while (file != NULL && fgets(line, sizeof line, file) != NULL) {
        line[strcspn(line, "\n")] = '\0';
        memcpy(last, line, sizeof last);
    }
    if (file != NULL) {
        (void)fclose(file);
    }
    (void)ctl_fail(CTL_UNAVAILABLE, "the gateway for this session does not run: %s", last);
}

static bool connect_to(bringup_t *self) {
    near_gateway_t gateway;
    char path[128];
    const char *const named = self->ctl->socket;
    const int64_t end_us = client_now_us() + START_US;
    path_of(&self->trial, "gateway.sock", path, sizeof path);
    self->ctl->socket = path;
    do {
        near_find(self->ctl, NULL, &gateway);
        json_decref(gateway.status);
        if (gateway.result == NEAR_FOUND) {
            break;
        }
        nap();
    } while (client_now_us() < end_us && waitpid(self->trial.pid, NULL, WNOHANG) == 0);
    self->ctl->socket = named;
    return gateway.result == NEAR_FOUND;
}

static bool start(bringup_t *self, const gateway_config_t *config, bool with_records) {
    trial_t *trial = &self->trial;
    trial_stop(self);
    if (!make_folder(trial) || !write_config(self, config, with_records)) {
        return false;
    }
    find_program(trial);
    trial->pid = fork();
    if (trial->pid == 0) {
        become_gateway(trial);
    }
    if (trial->pid < 0 || !connect_to(self)) {
        report_log(trial);
        trial_stop(self);
        return false;
    }
    return true;
}

void trial_start(bringup_t *self, const gateway_config_t *config) {
    if (!start(self, config, false)) {
        bringup_fail(self);
    }
}

bool trial_start_with_records(bringup_t *self) {
    return start(self, &self->config, true);
}

void trial_stop(bringup_t *self) {
    if (self->trial.pid <= 0) {
        client_close(&self->ctl->client);
        return;
    }
    ready_retain_estop(self);
    client_close(&self->ctl->client);
    const int64_t end_us = client_now_us() + END_US;
    (void)kill(self->trial.pid, SIGTERM);
    while (waitpid(self->trial.pid, NULL, WNOHANG) == 0) {
        if (client_now_us() > end_us) {
            (void)kill(self->trial.pid, SIGKILL);
        }
        nap();
    }
    self->trial.pid = 0;
}

void trial_close(bringup_t *self) {
    trial_t *trial = &self->trial;
    int status = 0;
    trial_stop(self);
    if (trial->folder[0] == '\0') {
        return;
    }
    (void)close(trial->leash);
    while (waitpid(trial->guard, &status, 0) < 0 && errno == EINTR) {
    }
    if (status != 0) {
        talk_print("%s could not be removed; remove it by hand.", trial->folder);
    }
    trial->folder[0] = '\0';
}

json_t *trial_status(bringup_t *self) {
    return near_ask(self->ctl, json_pack("{s:s}", "cmd", "status"));
}
