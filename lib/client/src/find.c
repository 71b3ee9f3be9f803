// SPDX-License-Identifier: MIT
// Finds the gateway if the caller names none, and the socket through which this user may reach it.
#include "iwheel_client/client.h"

#include <dirent.h>
#include <errno.h>
#include <fcntl.h>
#include <limits.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
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

/// Sockets found in a directory.
typedef struct {
    char *out;
    size_t size;
    size_t used;
    unsigned count;
} found_t;

static void note_found(found_t *self, const char *path) {
    const int n = snprintf(self->out + self->used, self->size - self->used, "%s%s", (self->used > 0) ? " " : "", path);
    self->count++;
    self->used += (n > 0 && (size_t)n < self->size - self->used) ? (size_t)n : 0U;
    self->out[self->used] = '\0';
}

static bool may_use(const char *path) {
    return faccessat(AT_FDCWD, path, W_OK, AT_EACCESS) == 0;
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
    const bool has_drive = is_socket(drive);
    const bool has_watch = is_socket(watch);
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

static iwc_result_t find_in(const char *directory, char *out, size_t size) {
    found_t found = {.out = out, .size = size};
    const int error = find_gateways(&found, directory, false);
    (void)find_gateways(&found, directory, true);
    if (found.count > 0) {
        return (found.count == 1) ? IWC_OK : IWC_SEVERAL;
    }
    return (error == EACCES) ? IWC_DENIED : IWC_NOT_THERE;
}

iwc_result_t iwc_find(const char *directory, char *out, size_t size) {
    const char *named = (directory == NULL) ? getenv("IWHEEL_SOCKET") : NULL;
    if (size == 0) {
        return IWC_INVALID;
    }
    out[0] = '\0';
    if (named != NULL && named[0] != '\0') {
        (void)snprintf(out, size, "%s", named);
        return (strlen(named) < size) ? IWC_OK : IWC_INVALID;
    }
    return find_in((directory != NULL) ? directory : IWC_DIRECTORY, out, size);
}
