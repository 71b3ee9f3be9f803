// SPDX-License-Identifier: MIT
#include "runtime.h"

#include <errno.h>
#include <fcntl.h>
#include <string.h>
#include <sys/stat.h>
#include <sysexits.h>
#include <unistd.h>

static void name_places(gw_runtime_t *self, const gateway_config_t *config, const char *directory) {
    const char *bus = config->bus.interface;
    const char *local_path = gw_bus_lock_local_path(bus);
    const char *socket_path = config->northbound.socket;
    const char *slash = strrchr(socket_path, '/');
    const int length = slash == NULL ? 0 : (int)(slash - socket_path) + 1;
    if (local_path != NULL) {
        (void)snprintf(self->place[0], GW_RUNTIME_PATH_SIZE, "%s.armed", local_path);
    } else {
        self->directory = directory;
        (void)snprintf(self->place[0], GW_RUNTIME_PATH_SIZE, "%s/%s.armed", directory, bus);
        (void)snprintf(self->place[1], GW_RUNTIME_PATH_SIZE, "%.*s%s.armed", length, socket_path, bus);
    }
}

static int explain(const gw_bus_lock_t *lock, const char *bus, int error, FILE *err) {
    if (error == EWOULDBLOCK) {
        char who[32] = "another program";
        if (lock->holder > 0) {
            (void)snprintf(who, sizeof who, "process %ld", (long)lock->holder);
        }
        (void)fprintf(err,
                      "iwheel-gateway: another gateway already serves %s (%s holds %s); this one sends nothing. "
                      "Stop the other one, or use it\n",
                      bus, who, lock->name);
        return EX_UNAVAILABLE;
    }
    (void)fprintf(err, "iwheel-gateway: cannot lock the bus with %s: %s; %s\n", lock->name, strerror(error),
                  error == ENOENT ? "make its directory, or correct --can"
                                  : "run as the user who owns it, or remove it if no gateway runs");
    return error == EACCES || error == EPERM || error == EROFS ? EX_NOPERM : EX_UNAVAILABLE;
}

int gw_runtime_open(gw_runtime_t *self, const gateway_config_t *config, const char *directory, FILE *err) {
    *self = (gw_runtime_t){.marker_path = self->place[0]};
    name_places(self, config, directory);
    const int error = gw_bus_lock_take(&self->lock, config->bus.interface);
    if (error != 0) {
        return explain(&self->lock, config->bus.interface, error, err);
    }
    for (size_t i = 0; i < GW_RUNTIME_PLACES; ++i) {
        self->marked = self->marked || (self->place[i][0] != '\0' && access(self->place[i], F_OK) == 0);
    }
    return 0;
}

void gw_runtime_close(gw_runtime_t *self) {
    gw_bus_lock_release(&self->lock);
}

bool gw_runtime_crashed(const gw_runtime_t *self) {
    return self->marked;
}

static bool set_marker(gw_runtime_t *self) {
    if (self->directory != NULL) {
        (void)mkdir(self->directory, 0755); // Whether it is there now is seen next.
    }
    for (size_t i = 0; i < GW_RUNTIME_PLACES && self->place[i][0] != '\0'; ++i) {
        self->marker_path = self->place[i];
        const int fd = open(self->place[i], O_WRONLY | O_CREAT | O_NOFOLLOW | O_NONBLOCK | O_CLOEXEC, 0600);
        if (fd >= 0) {
            return close(fd) == 0;
        }
    }
    return false;
}

/// Wherever it is: the one before us may have had other rights.
static bool remove_markers(gw_runtime_t *self) {
    for (size_t i = 0; i < GW_RUNTIME_PLACES && self->place[i][0] != '\0'; ++i) {
        if (unlink(self->place[i]) != 0 && errno != ENOENT && errno != ENOTDIR) {
            self->marker_path = self->place[i];
            return false;
        }
    }
    return true;
}

bool gw_runtime_mark(gw_runtime_t *self, bool sending) {
    if (sending == self->marked) {
        return true;
    }
    self->marked = sending;
    return sending ? set_marker(self) : remove_markers(self);
}
