// SPDX-License-Identifier: MIT
#include "bus_lock.h"

#include <errno.h>
#include <fcntl.h>
#include <stddef.h>
#include <string.h>
#include <sys/file.h>
#include <sys/socket.h>
#include <sys/un.h>
#include <unistd.h>

#define ASKERS_MAX 64

static const char local_prefix[] = "unix:";

const char *gw_bus_lock_local_path(const char *bus) {
    const size_t length = sizeof local_prefix - 1U;
    return strncmp(bus, local_prefix, length) == 0 ? bus + length : NULL;
}

static int lock_file(gw_bus_lock_t *self) {
    const int fd = open(self->name, O_RDWR | O_CREAT | O_NOFOLLOW | O_NONBLOCK | O_CLOEXEC, 0600);
    if (fd < 0) {
        return errno;
    }
    if (flock(fd, LOCK_EX | LOCK_NB) != 0) {
        const int error = errno;
        (void)close(fd);
        return error;
    }
    self->fd = fd;
    return 0;
}

/// Whoever listens at the address, by the kernel's word.
static pid_t ask_who(const struct sockaddr_un *address, socklen_t length) {
    struct ucred peer = {0};
    socklen_t size = sizeof peer;
    const int fd = socket(AF_UNIX, SOCK_STREAM | SOCK_NONBLOCK | SOCK_CLOEXEC, 0);
    if (fd < 0 || connect(fd, (const struct sockaddr *)address, length) != 0 ||
        getsockopt(fd, SOL_SOCKET, SO_PEERCRED, &peer, &size) != 0) {
        peer.pid = 0;
    }
    if (fd >= 0) {
        (void)close(fd);
    }
    return peer.pid;
}

static int lock_name(gw_bus_lock_t *self) {
    struct sockaddr_un address = {.sun_family = AF_UNIX};
    const size_t name_length = strlen(self->name);
    const socklen_t length = (socklen_t)(offsetof(struct sockaddr_un, sun_path) + name_length);
    if (name_length > sizeof address.sun_path) {
        return ENAMETOOLONG;
    }
    (void)memcpy(address.sun_path + 1, self->name + 1, name_length - 1U); // A zero byte stands for the `@`.
    const int fd = socket(AF_UNIX, SOCK_STREAM | SOCK_NONBLOCK | SOCK_CLOEXEC, 0);
    if (fd < 0) {
        return errno;
    }
    if (bind(fd, (const struct sockaddr *)&address, length) != 0 || listen(fd, ASKERS_MAX) != 0) {
        const int error = errno;
        (void)close(fd);
        self->holder = error == EADDRINUSE ? ask_who(&address, length) : 0;
        return error == EADDRINUSE ? EWOULDBLOCK : error;
    }
    self->fd = fd;
    return 0;
}

int gw_bus_lock_take(gw_bus_lock_t *self, const char *bus) {
    const char *path = gw_bus_lock_local_path(bus);
    *self = (gw_bus_lock_t){.fd = -1};
    if (path != NULL) {
        (void)snprintf(self->name, sizeof self->name, "%s.gateway-lock", path);
        return lock_file(self);
    }
    (void)snprintf(self->name, sizeof self->name, "@iwheel-gateway/%s", bus);
    return lock_name(self);
}

void gw_bus_lock_release(gw_bus_lock_t *self) {
    if (self->fd >= 0) {
        (void)close(self->fd); // The file stays: removing it would let two gateways lock two files of one name.
        self->fd = -1;
    }
}
