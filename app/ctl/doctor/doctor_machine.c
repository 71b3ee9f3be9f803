// SPDX-License-Identifier: MIT
// Findings about the machine before the bus is opened.
#include "doctor.h"

#include "iwheel_northbound/text.h"

#include <dirent.h>
#include <grp.h>
#include <linux/can.h>
#include <stdio.h>
#include <string.h>
#include <sys/socket.h>
#include <sys/timex.h>
#include <sys/utsname.h>
#include <time.h>
#include <unistd.h>

/// ARPHRD_CAN, as the kernel writes it.
#define TYPE_CAN "280"
/// No release of this program is older than this time.
#define WALL_MIN_S 1735689600
/// Number and length of the measured sleeps, and the lateness above which a warning is printed.
#define NAPS         200
#define NAP_NS       1000000L
#define LATE_CARE_us 20000

static bool is_local(const char *bus) {
    return strncmp(bus, "unix:", 5U) == 0;
}

static bool read_word(const char *path, char *out_word, size_t size) {
    FILE *file = fopen(path, "re");
    if (file == NULL) {
        return false;
    }
    const bool got = fgets(out_word, (int)size, file) != NULL;
    (void)fclose(file);
    out_word[strcspn(out_word, "\n")] = '\0';
    return got;
}

unsigned doctor_interfaces(char *out_names, size_t size) {
    unsigned found = 0;
    DIR *folder = opendir("/sys/class/net");
    iwn_text_t names = iwn_text_begin(out_names, size);
    if (folder == NULL) {
        return 0;
    }
    for (const struct dirent *entry = readdir(folder); entry != NULL; entry = readdir(folder)) {
        char path[512];
        char type[16] = "";
        (void)snprintf(path, sizeof path, "/sys/class/net/%s/type", entry->d_name);
        if (entry->d_name[0] != '.' && read_word(path, type, sizeof type) && strcmp(type, TYPE_CAN) == 0) {
            IWN_TEXT_JOIN(&names, (found > 0) ? " " : "", entry->d_name);
            found++;
        }
    }
    (void)closedir(folder);
    return found;
}

/// Reads the name of the interface's driver; "" if the interface has no device.
static void read_driver(const char *bus, char *out_name, size_t size) {
    char path[128];
    char target[256];
    out_name[0] = '\0';
    (void)snprintf(path, sizeof path, "/sys/class/net/%.20s/device/driver", bus);
    const ssize_t length = readlink(path, target, sizeof target - 1U);
    if (length > 0) {
        target[length] = '\0';
        const char *slash = strrchr(target, '/');
        (void)snprintf(out_name, size, "%.63s", (slash != NULL) ? slash + 1 : target);
    }
}

static void add_no_can(doctor_t *self) {
    struct utsname kernel;
    char path[512];
    (void)uname(&kernel);
    (void)snprintf(path, sizeof path, "/lib/modules/%s", kernel.release);
    inspect_add(&self->findings, "kernel", INSPECT_FAIL, "kernel %s: no CAN sockets", kernel.release);
    if (access(path, F_OK) == 0) {
        inspect_fix(&self->findings, "modprobe can_raw (and permanently: echo can_raw > /etc/modules-load.d/can.conf)");
    } else {
        inspect_fix(&self->findings,
                    "its modules are not installed (%s is missing): boot a kernel with CAN; without "
                    "hardware, try the simulator: iwheel-sim --can unix:/tmp/bus",
                    path);
    }
}

static bool check_kernel(doctor_t *self) {
    char driver[64];
    const int probe = socket(PF_CAN, SOCK_RAW | SOCK_CLOEXEC, CAN_RAW);
    if (probe < 0) {
        add_no_can(self);
        return false;
    }
    (void)close(probe);
    read_driver((self->bus != NULL) ? self->bus : "", driver, sizeof driver);
    if (driver[0] != '\0') {
        inspect_add(&self->findings, "kernel", INSPECT_OK, "kernel: CAN sockets are available; %s has the driver %s",
                    self->bus, driver);
    } else {
        inspect_add(&self->findings, "kernel", INSPECT_OK, "kernel: CAN sockets are available");
    }
    return true;
}

/// Returns the largest lateness of many short sleeps.
static int64_t worst_lateness_us(void) {
    int64_t worst_us = 0;
    for (unsigned i = 0; i < NAPS; i++) {
        const struct timespec nap = {0, NAP_NS};
        const int64_t begin_us = client_now_us();
        (void)nanosleep(&nap, NULL);
        const int64_t late_us = client_now_us() - begin_us - NAP_NS / 1000;
        if (late_us > worst_us) {
            worst_us = late_us;
        }
    }
    return worst_us;
}

static void check_clock(doctor_t *self) {
    struct timespec resolution = {0, 0};
    struct timex state = {.modes = 0};
    inspect_findings_t *findings = &self->findings;
    (void)clock_getres(CLOCK_MONOTONIC, &resolution);
    const int64_t late_us = worst_lateness_us();
    if (resolution.tv_nsec > NAP_NS || late_us > LATE_CARE_us) {
        inspect_add(findings, "clock", INSPECT_WARN, "clock: a sleep of 1 ms ended up to %.1f ms late",
                    (double)late_us / 1e3);
        inspect_fix(findings, "the gateway stops the wheels when it is 100 ms late: reduce this machine's load, or "
                              "run it with priority: chrt -f 10 iwheel-gateway ...");
    } else {
        inspect_add(findings, "clock", INSPECT_OK, "clock: a sleep of 1 ms ends at most %.1f ms late",
                    (double)late_us / 1e3);
    }
    if (time(NULL) < WALL_MIN_S) {
        inspect_add(findings, "clock", INSPECT_WARN, "wall clock: it is not set; only dates in logs are wrong");
        inspect_fix(findings, "timedatectl set-ntp true");
    } else if (adjtimex(&state) == TIME_ERROR || ((unsigned)state.status & (unsigned)STA_UNSYNC) != 0U) {
        inspect_add(findings, "clock", INSPECT_OK,
                    "wall clock: set, not synchronised; only dates in logs depend on it");
    }
}

/// Checks whether this user may use the gateway's socket, by the group of the service.
static void check_rights(doctor_t *self) {
    static const char group_name[] = "iwheel";
    gid_t groups[256];
    const struct group *group = getgrnam(group_name);
    if (group == NULL || geteuid() == 0) {
        return;
    }
    const int count = getgroups((int)(sizeof groups / sizeof groups[0]), groups);
    bool member = getegid() == group->gr_gid;
    for (int i = 0; i < count; i++) {
        member = member || groups[i] == group->gr_gid;
    }
    if (member) {
        inspect_add(&self->findings, "rights", INSPECT_OK, "rights: you are in group %s", group_name);
    } else {
        inspect_add(&self->findings, "rights", INSPECT_WARN,
                    "rights: you are not in group %s, whose members may use the gateway", group_name);
        inspect_fix(&self->findings, "sudo usermod -aG %s $USER, then log in again", group_name);
    }
}

bool doctor_check_machine(doctor_t *self) {
    const bool able = (self->bus != NULL && is_local(self->bus)) || check_kernel(self);
    check_clock(self);
    check_rights(self);
    return able;
}
