// SPDX-License-Identifier: MIT
// Finds the gateway if the caller names none, and the socket through which this user may reach it.
#include "connection.h"

#include <dirent.h>
#include <errno.h>
#include <fcntl.h>
#include <limits.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/socket.h>
#include <sys/stat.h>
#include <unistd.h>

static const char SUFFIX[] = ".sock";

static bool is_socket(const char *path) {
    struct stat status;
    const size_t length = strlen(path);
    const char *name = strrchr(path, '/') + 1;
    return strlen(name) > sizeof(SUFFIX) - 1U && strcmp(path + length - (sizeof(SUFFIX) - 1U), SUFFIX) == 0 &&
           stat(path, &status) == 0 && S_ISSOCK(status.st_mode);
}

/// Sockets found in a directory: paths, each with a terminator.
typedef struct {
    char *out;
    size_t size;
    size_t used;
    unsigned count;
    bool live_only; ///< Leave out sockets on which no program listens.
} found_t;

static void note_found(found_t *self, const char *path) {
    const size_t length = strlen(path) + 1U;
    self->count++;
    if (length <= self->size - self->used) {
        memcpy(self->out + self->used, path, length);
        self->used += length;
    }
}

/// Returns false if no program listens on the socket: a gateway that was killed leaves its file behind.
static bool is_live(const char *path) {
    struct sockaddr_un address = {.sun_family = AF_UNIX};
    const int fd =
        (strlen(path) < sizeof address.sun_path) ? socket(AF_UNIX, SOCK_STREAM | SOCK_CLOEXEC | SOCK_NONBLOCK, 0) : -1;
    if (fd < 0) {
        return true;
    }
    memcpy(address.sun_path, path, strlen(path));
    const bool refused = connect(fd, (const struct sockaddr *)&address, sizeof address) != 0 && errno == ECONNREFUSED;
    (void)close(fd);
    return !refused;
}

static bool may_use(const char *path) {
    return faccessat(AT_FDCWD, path, W_OK, AT_EACCESS) == 0;
}

static bool is_found(const found_t *self, const char *path) {
    return is_socket(path) && (!self->live_only || is_live(path));
}

/// Adds the drive socket of a gateway, or its watch socket if the drive socket does not exist or this user may not use
/// it.
static void note_gateway(found_t *self, const char *directory, const char *name) {
    char drive[PATH_MAX];
    char watch[PATH_MAX];
    const int length = snprintf(drive, sizeof drive, "%s/%s", directory, name);
    const int watch_length = snprintf(watch, sizeof watch, "%s/" IWC_WATCH_DIRECTORY "/%s", directory, name);
    if (length < 0 || (size_t)length >= sizeof drive || watch_length < 0 || (size_t)watch_length >= sizeof watch) {
        return;
    }
    const bool has_drive = is_found(self, drive);
    const bool has_watch = is_found(self, watch);
    if (has_watch && (!has_drive || (!may_use(drive) && may_use(watch)))) {
        note_found(self, watch);
    } else if (has_drive) {
        note_found(self, drive);
    }
}

/// Finds the gateways with a socket in `directory`; with `alone` those with only a watch socket.
static int find_gateways(found_t *self, const char *directory, bool alone) {
    char path[PATH_MAX];
    (void)snprintf(path, sizeof path, "%s%s", directory, alone ? "/" IWC_WATCH_DIRECTORY : "");
    DIR *folder = opendir(path);
    if (folder == NULL) {
        return errno;
    }
    for (const struct dirent *entry = readdir(folder); entry != NULL; entry = readdir(folder)) {
        const int length = snprintf(path, sizeof path, "%s/%s", directory, entry->d_name);
        const bool counted = alone && length > 0 && (size_t)length < sizeof path && is_socket(path);
        if (!counted) {
            note_gateway(self, directory, entry->d_name);
        }
    }
    (void)closedir(folder);
    return 0;
}

/// Writes the paths of the gateways to `found`. Returns an errno.
static int search(found_t *found, const char *directory) {
    const int error = find_gateways(found, directory, false);
    (void)find_gateways(found, directory, true);
    return error;
}

/// Writes the paths of the gateways to `found`. Of several only those on which a program listens count, unless there is
/// none.
static iwc_result_t find_in(found_t *found, const char *directory) {
    const int error = search(found, directory);
    if (found->count == 0) {
        return (error == EACCES) ? IWC_DENIED : IWC_NOT_THERE;
    }
    if (found->count > 1) {
        found_t live = {.out = found->out, .size = found->size, .live_only = true};
        (void)search(&live, directory);
        found->count = 1; // The first of the files, if no program listens.
        if (live.count > 0) {
            *found = live;
        }
    }
    return (found->count == 1) ? IWC_OK : IWC_SEVERAL;
}

/// Finds as iwc_find does. Each path in `found` has a terminator.
static iwc_result_t find_by_name(found_t *found, const char *directory) {
    const char *named = (directory == NULL) ? getenv("IWHEEL_SOCKET") : NULL;
    if (found->size == 0) {
        return IWC_INVALID;
    }
    found->out[0] = '\0';
    if (named != NULL && named[0] != '\0') {
        note_found(found, named);
        return (found->used > 0) ? IWC_OK : IWC_INVALID;
    }
    return find_in(found, (directory != NULL) ? directory : IWC_DIRECTORY);
}

iwc_result_t iwc_find_paths(char *out, size_t size, size_t *out_length) {
    found_t found = {.out = out, .size = size};
    const iwc_result_t result = find_by_name(&found, NULL);
    *out_length = found.used;
    return result;
}

iwc_result_t iwc_find(const char *directory, char *out, size_t size) {
    found_t found = {.out = out, .size = size};
    const iwc_result_t result = find_by_name(&found, directory);
    for (size_t i = 0; result == IWC_SEVERAL && i + 1U < found.used; i++) {
        out[i] = (out[i] == '\0') ? ' ' : out[i];
    }
    return result;
}
