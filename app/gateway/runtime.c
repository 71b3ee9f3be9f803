// SPDX-License-Identifier: MIT
#include "runtime.h"

#include <errno.h>
#include <fcntl.h>
#include <string.h>
#include <sys/file.h>
#include <sysexits.h>
#include <unistd.h>

static const char local_prefix[] = "unix:";

/// The paths without their ends.
static void name_stem(const gateway_config_t *config, char *out_stem, size_t size) {
    const char *bus = config->bus.interface;
    const char *socket_path = config->northbound.socket;
    const char *slash = strrchr(socket_path, '/');
    const int directory = slash == NULL ? 0 : (int)(slash - socket_path) + 1;
    if (strncmp(bus, local_prefix, sizeof local_prefix - 1U) == 0) {
        (void)snprintf(out_stem, size, "%s", bus + sizeof local_prefix - 1U);
    } else {
        (void)snprintf(out_stem, size, "%.*s%s", directory, socket_path, bus);
    }
}

static int explain(const gw_runtime_t *self, int error, FILE *err) {
    if (error == EWOULDBLOCK) {
        (void)fprintf(err,
                      "iwheel-gateway: another gateway already serves this bus (it holds %s); this one sends nothing. "
                      "Stop the other one, or use it\n",
                      self->lock_path);
        return EX_UNAVAILABLE;
    }
    (void)fprintf(err, "iwheel-gateway: cannot lock the bus with %s: %s; %s\n", self->lock_path, strerror(error),
                  error == ENOENT ? "make its directory, or correct --can or --socket"
                                  : "run as the user who owns it, or remove it if no gateway runs");
    return error == EACCES || error == EPERM || error == EROFS ? EX_NOPERM : EX_UNAVAILABLE;
}

int gw_runtime_open(gw_runtime_t *self, const gateway_config_t *config, FILE *err) {
    char stem[GW_RUNTIME_PATH_SIZE - 16U];
    name_stem(config, stem, sizeof stem);
    *self = (gw_runtime_t){.lock_fd = -1};
    (void)snprintf(self->lock_path, sizeof self->lock_path, "%s.gateway-lock", stem);
    (void)snprintf(self->marker_path, sizeof self->marker_path, "%s.armed", stem);
    self->lock_fd = open(self->lock_path, O_RDWR | O_CREAT | O_NOFOLLOW | O_NONBLOCK | O_CLOEXEC, 0600);
    if (self->lock_fd < 0) {
        return explain(self, errno, err);
    }
    if (flock(self->lock_fd, LOCK_EX | LOCK_NB) != 0) {
        const int error = errno;
        (void)close(self->lock_fd);
        self->lock_fd = -1;
        return explain(self, error, err);
    }
    self->marked = access(self->marker_path, F_OK) == 0;
    return 0;
}

void gw_runtime_close(gw_runtime_t *self) {
    if (self->lock_fd >= 0) {
        (void)close(self->lock_fd); // The file stays: removing it would let two gateways lock two files of one name.
        self->lock_fd = -1;
    }
}

bool gw_runtime_crashed(const gw_runtime_t *self) {
    return self->marked;
}

bool gw_runtime_mark(gw_runtime_t *self, bool sending) {
    if (sending == self->marked) {
        return true;
    }
    self->marked = sending;
    if (!sending) {
        return unlink(self->marker_path) == 0 || errno == ENOENT;
    }
    const int fd = open(self->marker_path, O_WRONLY | O_CREAT | O_NOFOLLOW | O_NONBLOCK | O_CLOEXEC, 0600);
    return fd >= 0 && close(fd) == 0;
}
