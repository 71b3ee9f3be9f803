// SPDX-License-Identifier: MIT
#include "runtime.h"

#include <errno.h>
#include <fcntl.h>
#include <string.h>
#include <sys/stat.h>
#include <sysexits.h>
#include <unistd.h>

static void name_places(gw_runtime_t *self, const char *bus, const char *socket, const char *directory) {
    const char *local_path = gw_bus_lock_local_path(bus);
    const char *slash = strrchr(socket, '/');
    const int length = (slash == NULL) ? 0 : (int)(slash - socket) + 1;
    if (local_path != NULL) {
        (void)snprintf(self->place[0], GW_RUNTIME_PATH_SIZE, "%s.armed", local_path);
    } else {
        self->directory = directory;
        (void)snprintf(self->place[0], GW_RUNTIME_PATH_SIZE, "%s/%s.armed", directory, bus);
        (void)snprintf(self->place[1], GW_RUNTIME_PATH_SIZE, "%.*s%s.armed", length, socket, bus);
    }
}

/// Writes "process 4711 of user 65534", as far as it is known.
static const char *describe(const gw_holder_t *holder, char out_text[64]) {
    char user[24] = "";
    if (holder->uid != (uid_t)-1) {
        (void)snprintf(user, sizeof user, " of user %u", (unsigned)holder->uid);
    }
    if (holder->pid > 0) {
        (void)snprintf(out_text, 64, "process %ld%s", (long)holder->pid, user);
    } else {
        (void)snprintf(out_text, 64, "another program%s", user);
    }
    return out_text;
}

static int explain(const gw_bus_lock_t *lock, const char *bus, int error, FILE *err) {
    char who[64];
    if (error == EWOULDBLOCK) {
        (void)fprintf(err,
                      "iwheel-gateway: another gateway already serves %s (%s holds %s); this one sends nothing. "
                      "Stop the other one, or use it\n",
                      bus, describe(&lock->holder, who), lock->holder.name);
        return EX_UNAVAILABLE;
    }
    (void)fprintf(err, "iwheel-gateway: cannot lock the bus with %s: %s; %s\n", lock->path, strerror(error),
                  (error == ENOENT) ? "create its directory, or correct --can" : "correct --can, or start it again");
    return EX_UNAVAILABLE;
}

/// Warns of a problem that does not prevent the start.
static void warn(const gw_bus_lock_t *lock, const char *bus, FILE *err) {
    static const char prefix[] = "iwheel-gateway: warning:";
    const sock_owners_t *owners = &lock->names.owners;
    char who[64];
    for (size_t i = 0; i < sizeof lock->stranger / sizeof lock->stranger[0]; i++) {
        if (lock->stranger[i].name[0] != '\0') {
            (void)fprintf(err,
                          "%s %s holds %s, with which gateways lock %s; it is neither root nor the service, and does "
                          "not prevent a start. Find out what it is: if it is a gateway, end it\n",
                          prefix, describe(&lock->stranger[i], who), lock->stranger[i].name, bus);
        }
    }
    if (lock->fd < 0 && (owners->own == 0U || owners->own == owners->service)) {
        (void)fprintf(err, "%s %s cannot be locked (%s); a second gateway on %s is detected by its name only\n", prefix,
                      lock->path, strerror(lock->error), bus);
    }
    if (lock->fd < 0 && lock->names.fd < 0) {
        (void)fprintf(err,
                      "%s foreign processes hold every name that locks %s: a second gateway would not be detected\n",
                      prefix, bus);
    }
}

/// Returns true if there is a marker. A foreign file does not count.
static bool is_marked(const sock_owners_t *owners, const char *path) {
    struct stat status;
    return path[0] != '\0' && lstat(path, &status) == 0 && sock_owners_have(owners, status.st_uid);
}

int gw_runtime_open(gw_runtime_t *self, const char *bus, const char *socket, const char *directory, FILE *err) {
    *self = (gw_runtime_t){.marker_path = self->place[0]};
    name_places(self, bus, socket, directory);
    const int error = gw_bus_lock_take(&self->lock, bus, directory);
    if (error != 0) {
        return explain(&self->lock, bus, error, err);
    }
    warn(&self->lock, bus, err);
    for (size_t i = 0; i < GW_RUNTIME_PLACES; i++) {
        self->marked = self->marked || is_marked(&self->lock.names.owners, self->place[i]);
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
        (void)mkdir(self->directory, 0755); // The next call shows whether it exists now.
    }
    for (size_t i = 0; i < GW_RUNTIME_PLACES && self->place[i][0] != '\0'; i++) {
        self->marker_path = self->place[i];
        (void)unlink(self->place[i]); // Its owner could remove a foreign file again.
        const int fd = open(self->place[i], O_WRONLY | O_CREAT | O_EXCL | O_NOFOLLOW | O_NONBLOCK | O_CLOEXEC, 0600);
        if (fd >= 0) {
            return close(fd) == 0;
        }
    }
    return false;
}

/// Removes the marker at all places, because the gateway before this one may have had other rights.
static bool remove_markers(gw_runtime_t *self) {
    for (size_t i = 0; i < GW_RUNTIME_PLACES && self->place[i][0] != '\0'; i++) {
        if (unlink(self->place[i]) != 0 && errno != ENOENT && errno != ENOTDIR) {
            self->marker_path = self->place[i];
            return false;
        }
    }
    return true;
}

bool gw_runtime_mark(gw_runtime_t *self, bool sending) {
    if (sending == self->marked && !self->unsure) {
        return true;
    }
    const bool done = sending ? set_marker(self) : remove_markers(self);
    if (done) {
        self->marked = sending;
    }
    self->unsure = !done; // A failed removal may have been done in part.
    return done;
}
