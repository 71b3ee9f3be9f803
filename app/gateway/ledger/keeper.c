// SPDX-License-Identifier: MIT
#include "keeper.h"

#include "process/owners.h"

#include <errno.h>
#include <fcntl.h>
#include <signal.h>
#include <stdio.h>
#include <string.h>
#include <sys/file.h>
#include <sys/prctl.h>
#include <sys/socket.h>
#include <sys/stat.h>
#include <unistd.h>

/// The first byte of a message: to the keeper ...
#define SAY_WRITE 'w'
#define SAY_ASIDE 'a'
/// ... and the byte before an errno or a text, from it.
#define MESSAGE_MAX   (1U + GW_KEEPER_TEXT_MAX)
#define NAME_SIZE     288U
#define INHERITED_MAX 256

/// The keeper's own side.
typedef struct {
    const char *directory;
    char name[NAME_SIZE];
    char fresh[NAME_SIZE];   ///< The file while it is being written.
    char damaged[NAME_SIZE]; ///< Where a file is set aside.
    int fd;
    char message[MESSAGE_MAX];
} work_t;

static void answer(const work_t *work, gw_keeper_news_t news, int error) {
    char message[1U + sizeof error] = {(char)news};
    memcpy(&message[1], &error, sizeof error);
    (void)send(work->fd, message, sizeof message, MSG_NOSIGNAL);
}

static int read_whole(int fd, char *text, size_t *out_length) {
    const gw_owners_t owners = gw_owners_of(GW_RUNTIME_DIRECTORY);
    struct stat status;
    if (fstat(fd, &status) != 0) {
        return errno;
    }
    if (!gw_owners_wrote(&owners, &status)) {
        return GW_FOLDER_FILE;
    }
    if (status.st_size > (off_t)GW_KEEPER_TEXT_MAX) {
        return EFBIG;
    }
    size_t length = 0;
    ssize_t count = 1;
    while (count > 0 && length < GW_KEEPER_TEXT_MAX) {
        count = read(fd, &text[length], GW_KEEPER_TEXT_MAX - length);
        length += (count > 0) ? (size_t)count : 0U;
    }
    *out_length = length;
    return (count < 0) ? errno : 0;
}

static void tell_file(work_t *work) {
    size_t length = 0;
    const int directory = gw_folder_open_own(work->directory);
    if (directory < 0) {
        answer(work, GW_KEEPER_FAILED, errno);
        return;
    }
    const int fd = openat(directory, work->name, O_RDONLY | O_NOFOLLOW | O_NONBLOCK | O_CLOEXEC);
    int error = (fd < 0) ? errno : 0;
    (void)close(directory);
    if (fd >= 0) {
        error = read_whole(fd, &work->message[1], &length);
        (void)close(fd);
    }
    if (error == 0) {
        work->message[0] = (char)GW_KEEPER_READ;
        (void)send(work->fd, work->message, length + 1U, MSG_NOSIGNAL);
    } else {
        answer(work, (error == ENOENT) ? GW_KEEPER_ABSENT : GW_KEEPER_BAD, error);
    }
}

/// Beside the file, to the disk, then over it; never into a file that is there already. The directory is locked meanwhile: the keeper of a gateway that died may
/// still be at it.
static int write_over(const work_t *work, int directory, size_t length) {
    const char *text = &work->message[1];
    (void)unlinkat(directory, work->fresh, 0);
    const int fd = openat(directory, work->fresh, O_WRONLY | O_CREAT | O_EXCL | O_NOFOLLOW | O_CLOEXEC, 0644);
    if (fd < 0) {
        return errno;
    }
    const ssize_t count = write(fd, text, length);
    int error = (count < 0) ? errno : ((size_t)count < length) ? ENOSPC : 0;
    error = (error == 0 && fsync(fd) != 0) ? errno : error;
    error = (close(fd) != 0 && error == 0) ? errno : error;
    error = (error == 0 && renameat(directory, work->fresh, directory, work->name) != 0) ? errno : error;
    if (error != 0) {
        (void)unlinkat(directory, work->fresh, 0);
    } else {
        (void)fsync(directory);
    }
    return error;
}

static int in_directory(const work_t *work, size_t length) {
    const int directory = gw_folder_open_own(work->directory);
    if (directory < 0) {
        return errno;
    }
    int error = 0;
    (void)flock(directory, LOCK_EX);
    if (work->message[0] == SAY_ASIDE) {
        (void)renameat(directory, work->name, directory, work->damaged);
    } else {
        error = write_over(work, directory, length);
    }
    (void)close(directory);
    return error;
}

static void keep(work_t *work) {
    ssize_t length;
    tell_file(work);
    do {
        length = recv(work->fd, work->message, sizeof work->message, 0);
        if (length > 0) {
            const bool writes = work->message[0] == SAY_WRITE;
            const int error = in_directory(work, (size_t)length - 1U);
            if (writes) {
                answer(work, (error == 0) ? GW_KEEPER_WRITTEN : GW_KEEPER_FAILED, error);
            }
        }
    } while (length > 0 || (length < 0 && errno == EINTR));
}

/// Nothing of the gateway's stays open here but our end of the connection.
static void become_keeper(int fd) {
    const int null = open("/dev/null", O_RDWR);
    (void)prctl(PR_SET_NAME, "iwheel-keeper");
    (void)signal(SIGTERM, SIG_IGN);
    (void)signal(SIGINT, SIG_IGN);
    (void)signal(SIGHUP, SIG_IGN);
    if (null >= 0) { // And above the standard streams, which are open.
        for (int i = STDIN_FILENO; i <= STDERR_FILENO; i++) {
            (void)dup2(null, i);
        }
        (void)close(null);
    }
    for (int i = STDERR_FILENO + 1; i < INHERITED_MAX; i++) {
        if (i != fd) {
            (void)close(i);
        }
    }
}

int gw_keeper_open(gw_keeper_t *self, const char *directory, const char *name) {
    int pair[2];
    *self = (gw_keeper_t){.fd = -1};
    if (socketpair(AF_UNIX, SOCK_SEQPACKET | SOCK_CLOEXEC, 0, pair) != 0) {
        return errno;
    }
    const pid_t child = fork();
    if (child == 0) {
        work_t work = {.directory = directory, .fd = pair[1]};
        (void)snprintf(work.name, sizeof work.name, "%s", name);
        (void)snprintf(work.fresh, sizeof work.fresh, "%.270s.new", name);
        (void)snprintf(work.damaged, sizeof work.damaged, "%.270s.damaged", name);
        become_keeper(pair[1]);
        keep(&work);
        _exit(0);
    }
    const int error = (child < 0) ? errno : 0;
    (void)close(pair[1]);
    if (error != 0) {
        (void)close(pair[0]);
        return error;
    }
    self->fd = pair[0];
    self->waits = true;
    return 0;
}

static bool say(const gw_keeper_t *self, char what, const char *text, size_t length) {
    char message[MESSAGE_MAX];
    if (length > GW_KEEPER_TEXT_MAX) {
        errno = EAGAIN;
        return false;
    }
    message[0] = what;
    memcpy(&message[1], text, length);
    return send(self->fd, message, length + 1U, MSG_DONTWAIT | MSG_NOSIGNAL) == (ssize_t)length + 1;
}

bool gw_keeper_write(gw_keeper_t *self, const char *text, size_t length) {
    if (self->waits || self->fd < 0) {
        return false;
    }
    const bool taken = say(self, SAY_WRITE, text, length);
    self->waits = taken || errno != EAGAIN; // If it is gone, that is the news.
    return taken;
}

void gw_keeper_set_aside(gw_keeper_t *self) {
    (void)say(self, SAY_ASIDE, "", 0U);
}

gw_keeper_news_t gw_keeper_hear(gw_keeper_t *self, char out_text[GW_KEEPER_TEXT_MAX], size_t *out_length,
                                int *out_error) {
    char message[MESSAGE_MAX];
    if (self->fd < 0 || !self->waits) {
        return GW_KEEPER_NO_NEWS;
    }
    const ssize_t length = recv(self->fd, message, sizeof message, MSG_DONTWAIT);
    if (length < 0 && (errno == EAGAIN || errno == EINTR)) {
        return GW_KEEPER_NO_NEWS;
    }
    self->waits = false;
    if (length <= 0) {
        gw_keeper_close(self);
        return GW_KEEPER_GONE;
    }
    const gw_keeper_news_t news = (gw_keeper_news_t)message[0];
    if (news == GW_KEEPER_READ) {
        *out_length = (size_t)length - 1U;
        memcpy(out_text, &message[1], *out_length);
    } else if (length == (ssize_t)(1U + sizeof *out_error)) {
        memcpy(out_error, &message[1], sizeof *out_error);
    }
    return news;
}

void gw_keeper_close(gw_keeper_t *self) {
    if (self->fd >= 0) {
        (void)close(self->fd);
        self->fd = -1;
    }
}
