// SPDX-License-Identifier: MIT
#include "file_store.h"

#include "sockets/owners.h"

#include <errno.h>
#include <fcntl.h>
#include <stdio.h>
#include <string.h>
#include <sys/file.h>
#include <sys/socket.h>
#include <sys/stat.h>
#include <time.h>
#include <unistd.h>

/// A reader waits at most this long for writers: 1000 times 10 ms.
#define LOCK_TRIES    1000U
#define LOCK_PAUSE_NS 10000000L

/// First byte of a message to the store process. In a message from it, the first byte is the news.
#define ORDER_WRITE 'w'
#define ORDER_ASIDE 'a'

/// State of the store process.
typedef struct {
    const char *directory;
    const char *name;
    char fresh[GW_FILE_STORE_NAME_SIZE + 8U];   ///< Name of the file while it is written.
    char damaged[GW_FILE_STORE_NAME_SIZE + 8U]; ///< Name of a file that is set aside.
    int fd;
    char message[GW_FILE_STORE_MESSAGE_MAX];
} work_t;

static void answer(const work_t *work, gw_file_store_news_t news, int error) {
    char message[1U + sizeof error] = {(char)news};
    memcpy(&message[1], &error, sizeof error);
    (void)send(work->fd, message, sizeof message, MSG_NOSIGNAL);
}

static int read_whole(int fd, char *text, size_t *out_length) {
    const sock_owners_t owners = sock_owners_of(SOCK_RUNTIME_DIRECTORY);
    struct stat status;
    if (fstat(fd, &status) != 0) {
        return errno;
    }
    if (!sock_owners_wrote(&owners, &status)) {
        return SOCK_FOLDER_FILE;
    }
    if (status.st_size > (off_t)GW_FILE_STORE_TEXT_MAX) {
        return EFBIG;
    }
    size_t length = 0;
    ssize_t count = 1;
    while (count > 0 && length < GW_FILE_STORE_TEXT_MAX) {
        count = read(fd, &text[length], GW_FILE_STORE_TEXT_MAX - length);
        length += (count > 0) ? (size_t)count : 0U;
    }
    *out_length = length;
    return (count < 0) ? errno : 0;
}

/// Waits until no other store process writes: after a quick restart, the process of the earlier gateway may still flush
/// the text that this one must read. If the lock is not released in time (a disk that hangs, another program), the file
/// is read without it: an older text is better than none. A small window remains: the earlier process may have received
/// its last text and not run since, so that it has not locked yet. The start of a gateway takes much longer than that.
static void wait_for_writers(int directory) {
    const struct timespec pause = {.tv_nsec = LOCK_PAUSE_NS};
    for (unsigned i = 0; i < LOCK_TRIES && flock(directory, LOCK_SH | LOCK_NB) != 0 && errno == EWOULDBLOCK; i++) {
        (void)nanosleep(&pause, NULL);
    }
}

static void send_file(work_t *work) {
    size_t length = 0;
    const int directory = sock_folder_open_own(work->directory);
    if (directory < 0) {
        answer(work, GW_FILE_STORE_FAILED, errno);
        return;
    }
    wait_for_writers(directory);
    const int fd = openat(directory, work->name, O_RDONLY | O_NOFOLLOW | O_NONBLOCK | O_CLOEXEC);
    int error = (fd < 0) ? errno : 0;
    (void)close(directory);
    if (fd >= 0) {
        error = read_whole(fd, &work->message[1], &length);
        (void)close(fd);
    }
    if (error == 0) {
        work->message[0] = (char)GW_FILE_STORE_READ;
        (void)send(work->fd, work->message, length + 1U, MSG_NOSIGNAL);
    } else {
        answer(work, (error == ENOENT) ? GW_FILE_STORE_ABSENT : GW_FILE_STORE_BAD, error);
    }
}

/// Writes a new file, flushes it to the disk, and renames it; never writes into an existing file. The directory is
/// locked meanwhile, because the store process of an earlier gateway may still write, and the next one reads.
static int write_over(const work_t *work, int directory, size_t length) {
    const char *text = &work->message[1];
    (void)unlinkat(directory, work->fresh, 0);
    const int fd = openat(directory, work->fresh, O_WRONLY | O_CREAT | O_EXCL | O_NOFOLLOW | O_CLOEXEC, 0644);
    if (fd < 0) {
        return errno;
    }
    const ssize_t count = write(fd, text, length);
    int error = (count < 0) ? errno : ((size_t)count < length) ? ENOSPC : 0;
    if (error == 0 && fsync(fd) != 0) {
        error = errno;
    }
    if (close(fd) != 0 && error == 0) {
        error = errno;
    }
    if (error == 0 && renameat(directory, work->fresh, directory, work->name) != 0) {
        error = errno;
    }
    if (error != 0) {
        (void)unlinkat(directory, work->fresh, 0);
    } else {
        (void)fsync(directory);
    }
    return error;
}

static int in_directory(const work_t *work, size_t length) {
    const int directory = sock_folder_open_own(work->directory);
    if (directory < 0) {
        return errno;
    }
    int error = 0;
    (void)flock(directory, LOCK_EX);
    if (work->message[0] == ORDER_ASIDE) {
        (void)renameat(directory, work->name, directory, work->damaged);
    } else {
        error = write_over(work, directory, length);
    }
    (void)close(directory);
    return error;
}

static void serve(int fd, const void *context) {
    const gw_file_store_t *self = (const gw_file_store_t *)context;
    static work_t work; // Too large for a stack.
    ssize_t length;
    work = (work_t){.directory = self->directory, .name = self->name, .fd = fd};
    (void)snprintf(work.fresh, sizeof work.fresh, "%s.new", work.name);
    (void)snprintf(work.damaged, sizeof work.damaged, "%s.damaged", work.name);
    send_file(&work);
    do {
        length = recv(fd, work.message, sizeof work.message, 0);
        if (length > 0) {
            const bool writes = work.message[0] == ORDER_WRITE;
            const int error = in_directory(&work, (size_t)length - 1U);
            if (writes) {
                answer(&work, (error == 0) ? GW_FILE_STORE_WRITTEN : GW_FILE_STORE_FAILED, error);
            }
        }
    } while (length > 0 || (length < 0 && errno == EINTR));
}

int gw_file_store_open(gw_file_store_t *self, const char *directory, const char *name) {
    *self = (gw_file_store_t){.directory = directory};
    (void)snprintf(self->name, sizeof self->name, "%s", name);
    const int error = gw_child_start(&self->child, &(gw_child_work_t){"iwheel-store", 0, serve, self});
    self->waits = error == 0;
    return error;
}

static bool send_order(gw_file_store_t *self, char what, const char *text, size_t length) {
    if (length > GW_FILE_STORE_TEXT_MAX) {
        errno = EAGAIN;
        return false;
    }
    self->message[0] = what;
    memcpy(&self->message[1], text, length);
    return gw_child_send(&self->child, self->message, length + 1U);
}

bool gw_file_store_write(gw_file_store_t *self, const char *text, size_t length) {
    if (self->waits || self->child.fd < 0) {
        return false;
    }
    const bool accepted = send_order(self, ORDER_WRITE, text, length);
    self->waits = accepted || errno != EAGAIN; // If the process has ended, the next news report it.
    return accepted;
}

void gw_file_store_set_aside(gw_file_store_t *self) {
    (void)send_order(self, ORDER_ASIDE, "", 0U);
}

gw_file_store_news_t gw_file_store_receive(gw_file_store_t *self, const char **out_text, size_t *out_length,
                                           int *out_error) {
    size_t length;
    const gw_child_news_t child_news =
        self->waits ? gw_child_receive(&self->child, self->message, sizeof self->message, &length) : GW_CHILD_SILENT;
    if (child_news == GW_CHILD_SILENT) {
        return GW_FILE_STORE_NO_NEWS;
    }
    self->waits = false;
    if (child_news == GW_CHILD_ENDED) {
        return GW_FILE_STORE_GONE;
    }
    const gw_file_store_news_t news = (gw_file_store_news_t)self->message[0];
    if (news == GW_FILE_STORE_READ) {
        *out_length = length - 1U;
        *out_text = &self->message[1];
    } else if (length == 1U + sizeof *out_error) {
        memcpy(out_error, &self->message[1], sizeof *out_error);
    }
    return news;
}

void gw_file_store_close(gw_file_store_t *self) {
    gw_child_close(&self->child);
}
