// SPDX-License-Identifier: MIT
#include "bus_lock.h"

#include <errno.h>
#include <fcntl.h>
#include <inttypes.h>
#include <limits.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/file.h>
#include <unistd.h>

/// Size of a process id with its newline; no 32-bit number is longer.
#define DIGITS 15U
#define KEY    "@iwheel-gateway/"

static const char local_prefix[] = "unix:";

const char *gw_bus_lock_local_path(const char *bus) {
    const size_t length = sizeof local_prefix - 1U;
    return (strncmp(bus, local_prefix, length) == 0) ? bus + length : NULL;
}

/// Reduces a path of any length and spelling to 16 digits.
static void name_local(const char *path, char out_key[GW_BUS_KEY_SIZE]) {
    char folder[SOCK_ADDRESS_SIZE];
    static char real[PATH_MAX]; // Too large for a stack.
    const char *slash = strrchr(path, '/');
    uint64_t hash = 0xCBF29CE484222325U;
    sock_folder_of(path, folder, sizeof folder);
    const char *const parts[] = {(realpath(folder, real) != NULL) ? real : folder, "/",
                                 (slash == NULL) ? path : slash + 1};
    for (size_t i = 0; i < sizeof parts / sizeof parts[0]; i++) {
        for (const char *c = parts[i]; *c != '\0'; c++) {
            hash = (hash ^ (unsigned char)*c) * 0x100000001B3U;
        }
    }
    (void)snprintf(out_key, GW_BUS_KEY_SIZE, KEY "unix-%016" PRIx64, hash);
}

/// Interfaces of the same name may be in several network namespaces, which share the directory.
static unsigned long long network_namespace(void) {
    struct stat status;
    return (stat("/proc/self/ns/net", &status) == 0) ? (unsigned long long)status.st_ino : 0U;
}

static int open_file(const char *path) {
    const int flags = O_RDWR | O_NOFOLLOW | O_NONBLOCK | O_CLOEXEC;
    int fd = open(path, flags);
    if (fd < 0 &&
        errno == ENOENT) { // With O_CREAT in the first call, a foreign file in a folder like /tmp would be an error.
        fd = open(path, flags | O_CREAT | O_EXCL, 0600);
        if (fd < 0 && errno == EEXIST) {
            fd = open(path, flags);
        }
    }
    return fd;
}

static void note_stranger(gw_bus_lock_t *self, const struct stat *status) {
    self->stranger[0].uid = status->st_uid;
    (void)snprintf(self->stranger[0].name, sizeof self->stranger[0].name, "%.*s", (int)GW_BUS_NAME_SIZE, self->path);
}

/// Returns true if only users who may run a gateway can have opened it.
static bool is_ours(gw_bus_lock_t *self, int fd) {
    struct stat status;
    if (fstat(fd, &status) != 0) {
        return false;
    }
    const bool ours = sock_owners_wrote(&self->names.owners, &status) && (status.st_mode & 077U) == 0U;
    if (!ours) {
        note_stranger(self, &status);
    }
    return ours;
}

/// Reads the process id that the holder has written into the file.
static void read_holder(gw_bus_lock_t *self, int fd) {
    char digits[DIGITS + 1] = "";
    (void)!pread(fd, digits, DIGITS, 0);
    self->holder = (gw_holder_t){.uid = (uid_t)-1, .pid = (pid_t)strtol(digits, NULL, 10)};
    (void)snprintf(self->holder.name, sizeof self->holder.name, "%.*s", (int)GW_BUS_NAME_SIZE, self->path);
}

/// The service must be able to open a file that root has created.
static void sign(const gw_bus_lock_t *self, int fd) {
    char digits[DIGITS + 1];
    const int length = snprintf(digits, sizeof digits, "%ld\n", (long)getpid());
    if (self->names.owners.own == 0U && self->names.owners.service != 0U) {
        (void)!fchown(fd, self->names.owners.service, (gid_t)-1);
    }
    (void)!ftruncate(fd, 0);
    (void)!pwrite(fd, digits, (size_t)length, 0);
}

/// Returns EWOULDBLOCK, or 0 if this gateway has the lock or must not have it.
static int lock_file(gw_bus_lock_t *self) {
    struct stat status;
    const int fd = open_file(self->path);
    self->error = (fd < 0) ? errno : 0;
    if (fd < 0 && lstat(self->path, &status) == 0 && !sock_owners_have(&self->names.owners, status.st_uid)) {
        note_stranger(self, &status);
    }
    if (fd < 0) {
        return 0;
    }
    if (!is_ours(self, fd)) {
        self->error = EPERM;
        (void)close(fd);
        return 0;
    }
    if (flock(fd, LOCK_EX | LOCK_NB) != 0) {
        const int error = errno;
        read_holder(self, fd);
        (void)close(fd);
        return error;
    }
    sign(self, fd);
    self->fd = fd;
    return 0;
}

/// Creates the directory if only that is missing: for root, on a machine without the service.
static void name_interface(gw_bus_lock_t *self, const char *bus, const char *directory) {
    (void)mkdir(directory, 0755);
    (void)snprintf(self->path, sizeof self->path, "%.96s/%.16s-%llu.gateway-lock", directory, bus, network_namespace());
    (void)snprintf(self->names.key, GW_BUS_KEY_SIZE, KEY "%.32s", bus);
}

int gw_bus_lock_take(gw_bus_lock_t *self, const char *bus, const char *directory) {
    const char *path = gw_bus_lock_local_path(bus);
    char folder[SOCK_ADDRESS_SIZE];
    *self = (gw_bus_lock_t){.fd = -1, .names = {.fd = -1}};
    if (path != NULL) {
        (void)snprintf(self->path, sizeof self->path, "%s.gateway-lock", path);
        name_local(path, self->names.key);
        sock_folder_of(path, folder, sizeof folder);
    } else {
        name_interface(self, bus, directory);
        (void)snprintf(folder, sizeof folder, "%.96s", directory);
    }
    self->names.owners = sock_owners_of(folder);
    int error = lock_file(self);
    if (error == 0 && path != NULL && (self->error == ENOENT || self->error == ENOTDIR)) {
        error = self->error; // No bus can be there.
    }
    if (error == 0) {
        error = gw_bus_names_take(&self->names, &self->holder, &self->stranger[1]);
    }
    if (error != 0) {
        gw_bus_lock_release(self);
    }
    return error;
}

bool gw_bus_lock_poll(gw_bus_lock_t *self, iw_time_us_t now_us) {
    if (now_us < self->poll_us) {
        return false;
    }
    self->poll_us = now_us + GW_BUS_LOCK_POLL_US;
    return gw_bus_names_poll(&self->names, &self->holder);
}

void gw_bus_lock_release(gw_bus_lock_t *self) {
    gw_bus_names_release(&self->names);
    if (self->fd >= 0) {
        (void)close(self->fd); // The file stays: after its removal two gateways could lock two files with one name.
        self->fd = -1;
    }
}
