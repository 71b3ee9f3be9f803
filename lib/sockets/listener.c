// SPDX-License-Identifier: MIT
#include "listener.h"

#include "log.h"

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

static const char *option_of(const sock_listener_t *self) {
    return (self->config.right == SOCK_DRIVE) ? "--socket" : "--watch-socket";
}

/// Reports an error. `fix` is the fix up to the name of the option, which the function appends.
static int complain(const sock_listener_t *self, FILE *err, const char *what, const char *fix) {
    (void)fprintf(err, "%s: socket %s: %s; %s %s\n", self->config.program, self->config.path, what, fix,
                  option_of(self));
    return EX_UNAVAILABLE;
}

static int complain_errno(const sock_listener_t *self, FILE *err, int error) {
    const bool may_not = error == EACCES || error == EPERM;
    char fix[128];
    if (may_not) {
        (void)snprintf(fix, sizeof fix, "run as a user who may write to its directory, or choose another with");
    } else {
        (void)snprintf(fix, sizeof fix, "%scorrect [northbound] %s in the configuration, or",
                       (error == ENOENT) ? "make its directory, or " : "",
                       (self->config.right == SOCK_DRIVE) ? "socket" : "watch_socket");
    }
    (void)complain(self, err, strerror(error), fix);
    return may_not ? EX_NOPERM : EX_UNAVAILABLE;
}

static int complain_folder(const sock_listener_t *self, FILE *err, int error) {
    char fix[128];
    (void)snprintf(fix, sizeof fix, "%s, or choose another with", sock_folder_fix(error));
    (void)complain(self, err, sock_folder_fault(error), fix);
    return (error == EACCES || error == EPERM || error >= SOCK_FOLDER_FOREIGN) ? EX_NOPERM : EX_UNAVAILABLE;
}

int sock_listener_prepare(sock_listener_t *self, const sock_listener_config_t *config, FILE *err) {
    const char *path = config->path;
    const char *slash = strrchr(path, '/');
    char folder[SOCK_PATH_SIZE];
    *self = (sock_listener_t){.config = *config,
                              .fd = -1,
                              .reserve_fd = -1,
                              .owners = sock_owners_of(SOCK_RUNTIME_DIRECTORY),
                              .folder = {.fd = -1}};
    (void)snprintf(self->name, sizeof self->name, "%s", (slash == NULL) ? path : slash + 1);
    sock_folder_of(path, folder, sizeof folder);
    if (mkdir(folder, 0755) != 0 && errno != EEXIST) {
        return complain_errno(self, err, errno);
    }
    const int error = sock_folder_open(&self->folder, folder, &self->owners);
    if (error != 0) {
        return complain_folder(self, err, error);
    }
    if (self->folder.shared) {
        (void)fprintf(err,
                      "%s: warning: socket %s: while no gateway runs, any user can create another socket there "
                      "and answer instead; for more than a trial choose a separate directory with %s\n",
                      config->program, path, option_of(self));
    }
    return 0;
}

// In the folder -------------------------------------------------------------------------------------------------------

/// Changes to the folder, because the address of a socket cannot be relative to a descriptor. `*out_back` is a
/// descriptor of the folder before; -1 if the process has no rights to open it.
static bool enter(const sock_listener_t *self, int *out_back) {
    *out_back = open(".", O_PATH | O_DIRECTORY | O_CLOEXEC);
    return fchdir(self->folder.fd) == 0;
}

static void leave(int back) {
    if (back >= 0) {
        (void)!fchdir(back);
        (void)close(back);
    }
}

static bool is_answered(const struct sockaddr_un *address) {
    const int fd = socket(AF_UNIX, SOCK_STREAM | SOCK_NONBLOCK | SOCK_CLOEXEC, 0);
    const bool answered =
        fd >= 0 && (connect(fd, (const struct sockaddr *)address, sizeof *address) == 0 || errno != ECONNREFUSED);
    if (fd >= 0) {
        (void)close(fd);
    }
    return answered;
}

static int remove_name(const sock_listener_t *self, bool stranger, FILE *err) {
    if (unlinkat(self->folder.fd, self->name, 0) == 0 || errno == ENOENT) {
        return 0;
    }
    if (stranger) {
        (void)complain(self, err, "it belongs to another user, and only that user can remove it",
                       "choose a directory of your own with");
        return EX_NOPERM;
    }
    return complain_errno(self, err, errno);
}

/// Reads the status of the file with the name of the socket; `st_mode` is 0 if there is none. A link and a regular file
/// are refused.
static int read_name(const sock_listener_t *self, struct stat *out_status, FILE *err) {
    *out_status = (struct stat){.st_mode = 0};
    if (fstatat(self->folder.fd, self->name, out_status, AT_SYMLINK_NOFOLLOW) != 0) {
        return (errno == ENOENT) ? 0 : complain_errno(self, err, errno);
    }
    if (S_ISLNK(out_status->st_mode)) {
        return complain(self, err, "is a symbolic link, which is not followed",
                        "remove it, or name the real path with");
    }
    return S_ISSOCK(out_status->st_mode) ? 0
                                         : complain(self, err, "exists and is not a socket, so it is left unchanged",
                                                    "remove it, or choose another path with");
}

int sock_listener_judge(const sock_listener_t *self, FILE *err) {
    struct stat status;
    return read_name(self, &status, err);
}

/// Removes the file with the name of the socket if that is safe.
static int clear_name(const sock_listener_t *self, const struct sockaddr_un *address, FILE *err) {
    struct stat status;
    const int result = read_name(self, &status, err);
    if (result != 0 || status.st_mode == 0U) {
        return result;
    }
    const bool stranger = !sock_owners_have(&self->owners, status.st_uid);
    if (!stranger && is_answered(address)) {
        return complain(self, err, "another program answers on it", "stop that one, or choose another path with");
    }
    return remove_name(self, stranger, err);
}

/// Checks that the gateway itself has created the socket. Another one is not used.
static int verify(sock_listener_t *self, FILE *err) {
    struct stat status;
    if (fstatat(self->folder.fd, self->name, &status, AT_SYMLINK_NOFOLLOW) != 0) {
        return complain_errno(self, err, errno);
    }
    if (!S_ISSOCK(status.st_mode) || status.st_uid != geteuid()) {
        return complain(self, err, "another file replaced it",
                        "choose a directory to which no other user may write with");
    }
    self->device = status.st_dev;
    self->inode = status.st_ino;
    const bool right = (status.st_mode & 0777U) == self->config.mode; // Not if the folder has access control lists.
    return (right || fchmodat(self->folder.fd, self->name, self->config.mode, AT_SYMLINK_NOFOLLOW) == 0)
               ? 0
               : complain_errno(self, err, errno);
}

/// The socket has its mode from the beginning, and accepts no connection before it listens.
static int bind_socket(sock_listener_t *self, const struct sockaddr_un *address, FILE *err) {
    self->fd = socket(AF_UNIX, SOCK_STREAM | SOCK_NONBLOCK | SOCK_CLOEXEC, 0);
    if (self->fd < 0) {
        return complain_errno(self, err, errno);
    }
    const mode_t before = umask(~self->config.mode & 0777U);
    const int result = bind(self->fd, (const struct sockaddr *)address, sizeof *address);
    const int error = errno;
    (void)umask(before);
    return (result == 0) ? verify(self, err) : complain_errno(self, err, error);
}

static int make_socket(sock_listener_t *self, FILE *err) {
    struct sockaddr_un address = {.sun_family = AF_UNIX};
    (void)snprintf(address.sun_path, sizeof address.sun_path, "%s", self->name);
    int back;
    int result = enter(self, &back) ? clear_name(self, &address, err) : complain_errno(self, err, errno);
    if (result == 0) {
        result = bind_socket(self, &address, err);
    }
    leave(back);
    return result;
}

static void assign_group(const sock_listener_t *self, sock_log_t *log) {
    const char *name = self->config.group;
    if (strcmp(name, "none") == 0) {
        return;
    }
    struct stat status;
    const struct group *group = getgrnam(name);
    if (group != NULL && fstatat(self->folder.fd, self->name, &status, AT_SYMLINK_NOFOLLOW) == 0 &&
        status.st_gid == group->gr_gid) {
        return; // As a service, which must not call chown.
    }
    if (group == NULL) {
        sock_log(log, SOCK_LOG_WARNING,
                 "there is no group %s; socket %s has the group of the gateway (groupadd --system %s)", name,
                 self->config.path, name);
    } else if (fchownat(self->folder.fd, self->name, (uid_t)-1, group->gr_gid, AT_SYMLINK_NOFOLLOW) != 0) {
        sock_log(log, SOCK_LOG_WARNING, "cannot change socket %s to group %s: %s; it has the group of the gateway",
                 self->config.path, name, strerror(errno));
    }
}

/// Opens the reserved descriptor again.
static void restore(sock_listener_t *self) {
    if (self->reserve_fd < 0) {
        self->reserve_fd = open("/dev/null", O_RDONLY | O_CLOEXEC);
    }
}

int sock_listener_open(sock_listener_t *self, sock_log_t *log, FILE *err) {
    int result = make_socket(self, err);
    if (result == 0) {
        assign_group(self, log);
        result = (listen(self->fd, BACKLOG) == 0) ? 0 : complain_errno(self, err, errno);
    }
    if (result != 0) {
        sock_listener_close(self);
        return result;
    }
    restore(self);
    return 0;
}

static void close_one(int *fd) {
    if (*fd >= 0) {
        (void)close(*fd);
        *fd = -1;
    }
}

void sock_listener_close(sock_listener_t *self) {
    struct stat status;
    if (self->inode != 0U && fstatat(self->folder.fd, self->name, &status, AT_SYMLINK_NOFOLLOW) == 0 &&
        status.st_dev == self->device && status.st_ino == self->inode) {
        (void)unlinkat(self->folder.fd, self->name, 0);
    }
    self->inode = 0;
    sock_folder_close(&self->folder);
    close_one(&self->fd);
    close_one(&self->reserve_fd);
}

sock_accept_t sock_listener_accept(sock_listener_t *self, int *out_fd) {
    restore(self);
    *out_fd = accept4(self->fd, NULL, NULL, SOCK_NONBLOCK | SOCK_CLOEXEC);
    if (*out_fd >= 0) {
        return SOCK_ACCEPT_ONE;
    }
    if (errno == EAGAIN || errno == EINTR || errno == ECONNABORTED) {
        return SOCK_ACCEPT_NONE;
    }
    if ((errno != EMFILE && errno != ENFILE) || self->reserve_fd < 0) {
        return SOCK_ACCEPT_PAUSE;
    }
    (void)close(self->reserve_fd);
    self->reserve_fd = -1;
    *out_fd = accept4(self->fd, NULL, NULL, SOCK_NONBLOCK | SOCK_CLOEXEC);
    if (*out_fd >= 0) {
        return SOCK_ACCEPT_CROWDED;
    }
    return (errno == EAGAIN) ? SOCK_ACCEPT_NONE : SOCK_ACCEPT_PAUSE;
}
