// SPDX-License-Identifier: MIT
#include "listener.h"

#include <errno.h>
#include <fcntl.h>
#include <grp.h>
#include <string.h>
#include <sys/socket.h>
#include <sys/stat.h>
#include <sys/un.h>
#include <sysexits.h>
#include <unistd.h>

#define BACKLOG 128

static int complain(FILE *err, const char *path, const char *what, const char *cure) {
    (void)fprintf(err, "iwheel-gateway: socket %s: %s; %s\n", path, what, cure);
    return EX_UNAVAILABLE;
}

static int complain_errno(FILE *err, const char *path, int error) {
    const char *cure = "correct [northbound] socket or --socket";
    if (error == ENOENT) {
        cure = "make its directory, or correct [northbound] socket or --socket";
    } else if (error == EACCES || error == EPERM) {
        cure = "run as a user who may write to its directory, or choose another with --socket";
    }
    (void)complain(err, path, strerror(error), cure);
    return error == EACCES || error == EPERM ? EX_NOPERM : EX_UNAVAILABLE;
}

int gw_listener_prepare(const gateway_config_t *config, FILE *err) {
    const char *path = config->northbound.socket;
    char directory[GATEWAY_PATH_SIZE];
    struct stat status;
    const char *slash = strrchr(path, '/');
    const int length = slash == NULL ? 0 : (int)(slash - path);
    (void)snprintf(directory, sizeof directory, "%.*s", length, path);
    const char *name = slash == NULL ? "." : length == 0 ? "/" : directory;
    if (mkdir(name, 0755) != 0 && errno != EEXIST) {
        return complain_errno(err, path, errno);
    }
    if (stat(name, &status) != 0) {
        return complain_errno(err, path, errno);
    }
    if ((status.st_mode & S_IWOTH) != 0U && (status.st_mode & S_ISVTX) == 0U) {
        (void)complain(err, path, "anybody may write to its directory and put another socket in its place",
                       "take that right away (chmod o-w), or choose another directory with --socket");
        return EX_NOPERM;
    }
    return 0;
}

static bool somebody_answers(const struct sockaddr_un *address) {
    const int fd = socket(AF_UNIX, SOCK_STREAM | SOCK_NONBLOCK | SOCK_CLOEXEC, 0);
    const bool answered =
        fd >= 0 && (connect(fd, (const struct sockaddr *)address, sizeof *address) == 0 || errno != ECONNREFUSED);
    if (fd >= 0) {
        (void)close(fd);
    }
    return answered;
}

/// Makes the path free, if it is safe to.
static int clear_path(const struct sockaddr_un *address, FILE *err) {
    struct stat status;
    if (lstat(address->sun_path, &status) != 0) {
        return errno == ENOENT ? 0 : complain_errno(err, address->sun_path, errno);
    }
    if (S_ISLNK(status.st_mode)) {
        return complain(err, address->sun_path, "is a symbolic link, which is not followed",
                        "remove it, or name the real path with --socket");
    }
    if (!S_ISSOCK(status.st_mode)) {
        return complain(err, address->sun_path, "exists and is no socket, so it is left alone",
                        "remove it, or choose another path with --socket");
    }
    if (somebody_answers(address)) {
        return complain(err, address->sun_path, "another program answers on it",
                        "stop that one, or choose another path with --socket");
    }
    return unlink(address->sun_path) == 0 || errno == ENOENT ? 0 : complain_errno(err, address->sun_path, errno);
}

static void give_to_group(const gw_listener_t *self, const gateway_config_t *config, gw_log_t *log) {
    const char *name = config->northbound.group;
    if (strcmp(name, "none") == 0) {
        return;
    }
    struct stat status;
    const struct group *group = getgrnam(name);
    if (group != NULL && lstat(self->path, &status) == 0 && status.st_gid == group->gr_gid) {
        return; // As a service, which may not call chown.
    }
    if (group == NULL) {
        gw_log(log, GW_LOG_WARNING, "there is no group %s; the socket keeps our own group (groupadd --system %s)", name,
               name);
    } else if (lchown(self->path, (uid_t)-1, group->gr_gid) != 0) {
        gw_log(log, GW_LOG_WARNING, "the socket cannot be given to group %s: %s; it keeps our own group", name,
               strerror(errno));
    }
}

static int bind_socket(gw_listener_t *self, const struct sockaddr_un *address, FILE *err) {
    struct stat status;
    self->fd = socket(AF_UNIX, SOCK_STREAM | SOCK_NONBLOCK | SOCK_CLOEXEC, 0);
    if (self->fd < 0) {
        return complain_errno(err, address->sun_path, errno);
    }
    const mode_t before = umask(0177);
    const int result = bind(self->fd, (const struct sockaddr *)address, sizeof *address);
    const int error = errno;
    (void)umask(before);
    if (result != 0) {
        (void)close(self->fd);
        return complain_errno(err, address->sun_path, error);
    }
    (void)memcpy(self->path, address->sun_path, sizeof self->path);
    if (lstat(self->path, &status) == 0) {
        self->device = status.st_dev;
        self->inode = status.st_ino;
    }
    return 0;
}

int gw_listener_open(gw_listener_t *self, const gateway_config_t *config, gw_log_t *log, FILE *err) {
    struct sockaddr_un address = {.sun_family = AF_UNIX};
    *self = (gw_listener_t){.fd = -1, .reserve_fd = -1};
    (void)snprintf(address.sun_path, sizeof address.sun_path, "%s", config->northbound.socket);
    int result = clear_path(&address, err);
    result = result != 0 ? result : bind_socket(self, &address, err);
    if (result != 0) {
        return result;
    }
    give_to_group(self, config, log);
    if (chmod(self->path, config->northbound.mode) != 0 || listen(self->fd, BACKLOG) != 0) {
        result = complain_errno(err, self->path, errno);
        gw_listener_close(self);
        return result;
    }
    gw_listener_restore(self);
    return 0;
}

void gw_listener_close(gw_listener_t *self) {
    struct stat status;
    if (self->fd < 0) {
        return;
    }
    if (lstat(self->path, &status) == 0 && status.st_dev == self->device && status.st_ino == self->inode) {
        (void)unlink(self->path);
    }
    (void)close(self->fd);
    self->fd = -1;
    if (self->reserve_fd >= 0) {
        (void)close(self->reserve_fd);
        self->reserve_fd = -1;
    }
}

void gw_listener_restore(gw_listener_t *self) {
    if (self->reserve_fd < 0) {
        self->reserve_fd = open("/dev/null", O_RDONLY | O_CLOEXEC);
    }
}

gw_accept_t gw_listener_accept(gw_listener_t *self, int *out_fd) {
    gw_listener_restore(self);
    *out_fd = accept4(self->fd, NULL, NULL, SOCK_NONBLOCK | SOCK_CLOEXEC);
    if (*out_fd >= 0) {
        return GW_ACCEPT_ONE;
    }
    if (errno == EAGAIN || errno == EINTR || errno == ECONNABORTED) {
        return GW_ACCEPT_NONE;
    }
    if ((errno != EMFILE && errno != ENFILE) || self->reserve_fd < 0) {
        return GW_ACCEPT_PAUSE;
    }
    (void)close(self->reserve_fd);
    self->reserve_fd = -1;
    *out_fd = accept4(self->fd, NULL, NULL, SOCK_NONBLOCK | SOCK_CLOEXEC);
    if (*out_fd >= 0) {
        return GW_ACCEPT_CROWDED;
    }
    return errno == EAGAIN ? GW_ACCEPT_NONE : GW_ACCEPT_PAUSE;
}
