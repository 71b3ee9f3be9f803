// SPDX-License-Identifier: MIT
#include "connection.h"

#include <errno.h>
#include <fcntl.h>
#include <limits.h>
#include <poll.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/socket.h>
#include <time.h>
#include <unistd.h>

/// Interval between two attempts while the gateway's queue of connections is full.
#define RETRY_US 20000
/// Most reads of one iwc_latest, because a gateway may send faster than this process reads.
#define READS_MAX 64

int64_t iwc_now_us(void) {
    struct timespec now;
    (void)clock_gettime(CLOCK_MONOTONIC, &now);
    return (int64_t)now.tv_sec * 1000000 + now.tv_nsec / 1000;
}

int64_t iwc_deadline_us(int timeout_ms) {
    return (timeout_ms < 0) ? INT64_MAX : iwc_now_us() + (int64_t)timeout_ms * 1000;
}

iwc_t *iwc_new(void) {
    iwc_t *self = malloc(sizeof(*self));
    if (self != NULL) {
        memset(self, 0, offsetof(iwc_t, line));
        self->line[0] = '\0';
        self->fd = -1;
        self->over = IWC_CLOSED;
        self->failed = IWC_CLOSED;
    }
    return self;
}

void iwc_free(iwc_t *self) {
    if (self != NULL) {
        iwc_close(self);
        free(self);
    }
}

const char *iwc_words(iwc_result_t result) {
    static const char *const words[] = {
        [IWC_OK] = "done",
        [IWC_TIMEOUT] = "nothing came in time; if the gateway does not answer, see its log",
        [IWC_INTERRUPTED] = "a signal ended the wait",
        [IWC_REFUSED] = "the gateway refused; its message states cause and fix",
        [IWC_FULL] = "not sent, because the gateway does not read; see its log",
        [IWC_CLOSED] = "there is no connection; connect, and arm again to drive",
        [IWC_GARBLED] = "this socket does not use the gateway's protocol; check its path and the versions",
        [IWC_NEWER] = "the gateway has a newer protocol; install the libiwheel-client of its version",
        [IWC_INVALID] = "an argument is outside its range; see the contract in iwheel_client/client.h",
        [IWC_NOT_THERE] =
            "no program listens on the socket; start the gateway (systemctl start iwheel-gateway), or name its socket",
        [IWC_DENIED] =
            "this user may not use the socket; join its group (sudo usermod -aG iwheel $USER), then log in again",
        [IWC_SEVERAL] = "several gateways are running; name the socket of one (IWHEEL_SOCKET)",
    };
    const size_t index = (size_t)result;
    return (index < sizeof words / sizeof words[0]) ? words[index] : "";
}

iwc_result_t iwc_await(const iwc_t *self, short events, int64_t deadline_us) {
    const int64_t now_us = iwc_now_us();
    const int64_t left_us = (deadline_us > now_us) ? deadline_us - now_us : 0;
    const struct timespec timeout = {.tv_sec = (time_t)(left_us / 1000000),
                                     .tv_nsec = (long)(left_us % 1000000 * 1000)};
    struct pollfd entry = {.fd = (events != 0) ? self->fd : -1, .events = events};
    const int ready = ppoll(&entry, 1, (deadline_us == INT64_MAX) ? NULL : &timeout, self->let_in);
    if (ready < 0) {
        return IWC_INTERRUPTED;
    }
    return (ready > 0) ? IWC_OK : IWC_TIMEOUT;
}

void iwc_end(iwc_t *self, iwc_result_t result) {
    if (self->fd >= 0) {
        // A forked child may hold a copy of the socket. Without the shutdown the lease would not end with this close.
        (void)((getpid() == self->owner) ? shutdown(self->fd, SHUT_RDWR) : 0);
        (void)close(self->fd);
    }
    self->fd = -1;
    self->over = result;
    self->number = 0;
    memset(self->driven, 0, sizeof self->driven);
}

void iwc_close(iwc_t *self) {
    iwc_end(self, IWC_CLOSED);
    self->begin = 0;
    self->whole = 0;
    self->end = 0;
    self->skipped = 0;
}

iwc_result_t iwc_fill(iwc_t *self) {
    if (self->over != IWC_OK) {
        return self->over;
    }
    iwc_queue_make_room(self);
    const ssize_t got = recv(self->fd, self->in + self->end, IWC_IN_SIZE - self->end, 0);
    if (got > 0) {
        self->end += (size_t)got;
        if (!iwc_queue_admit(self)) {
            iwc_end(self, IWC_GARBLED);
        }
        return IWC_OK;
    }
    if (got < 0 && (errno == EAGAIN || errno == EINTR)) {
        return IWC_TIMEOUT;
    }
    iwc_end(self, IWC_CLOSED);
    return self->over;
}

iwc_result_t iwc_put(iwc_t *self, const char *line, size_t length, int64_t deadline_us) {
    size_t sent = 0;
    while (sent < length) {
        const ssize_t now = send(self->fd, line + sent, length - sent, MSG_NOSIGNAL);
        if (now >= 0) {
            sent += (size_t)now;
            continue;
        }
        if (errno != EAGAIN && errno != EINTR) {
            return IWC_CLOSED; // The caller can still read the messages that the gateway sent before it closed.
        }
        const iwc_result_t result = iwc_await(self, POLLOUT, deadline_us);
        if (result != IWC_OK && sent > 0) {
            iwc_end(self, IWC_CLOSED); // The rest of the line must never be sent later.
            return IWC_CLOSED;
        }
        if (result != IWC_OK) {
            return (result == IWC_TIMEOUT) ? IWC_FULL : result;
        }
    }
    return IWC_OK;
}

static void begin(iwc_t *self) {
    iwc_close(self);
    self->newer = false;
    self->error_number = 0;
    self->awaited = 0;
    self->failed = IWC_OK;
    self->error[0] = '\0';
    self->reason[0] = '\0';
    self->path[0] = '\0';
}

void iwc_store_refusal(iwc_t *self, const iwc_message_t *reply) {
    (void)iwc_text(reply, "error", self->error, sizeof self->error);
    if (!iwc_text(reply, "message", self->reason, sizeof self->reason) || self->reason[0] == '\0') {
        (void)snprintf(self->reason, sizeof self->reason, "the gateway refused without a message: %s; see its log",
                       (self->error[0] != '\0') ? self->error : "no name of an error");
    }
}

iwc_result_t iwc_note(iwc_t *self, iwc_result_t result) {
    if (result != IWC_OK) {
        self->failed = result;
    }
    return result;
}

/// Reads the first line: the event hello, or the refusal of one client too many.
static iwc_result_t greet(iwc_t *self, int64_t deadline_us) {
    iwc_message_t hello;
    iwc_result_t result = IWC_OK;
    while (!iwc_queue_take(self, &hello) && result == IWC_OK) {
        result = iwc_fill(self);
        if (result == IWC_TIMEOUT) {
            result = iwc_await(self, POLLIN, deadline_us);
        }
        if (self->over != IWC_OK && !iwc_pending(self)) {
            result = self->over;
        }
    }
    if (result == IWC_OK && iwc_truth(&hello, "ok").known && iwc_truth(&hello, "ok").value == 0) {
        iwc_store_refusal(self, &hello);
        result = IWC_REFUSED;
    } else if (result == IWC_OK && !iwc_is(&hello, "event", "hello")) {
        result = IWC_GARBLED;
    }
    if (result != IWC_OK) {
        iwc_close(self);
        return result;
    }
    self->number = iwc_integer(&hello, "client").value;
    self->watches = iwc_is(&hello, "rights", "watch");
    self->newer = iwc_integer(&hello, "api").value > IWC_PROTOCOL;
    return self->newer ? IWC_NEWER : IWC_OK;
}

static void take_socket(iwc_t *self, int fd) {
    self->fd = fd;
    self->owner = getpid();
    self->over = IWC_OK;
}

iwc_result_t iwc_adopt_for_stop(iwc_t *self, int fd) {
    begin(self);
    const int flags = fcntl(fd, F_GETFL);
    if (flags < 0 || fcntl(fd, F_SETFL, flags | O_NONBLOCK) != 0 || fcntl(fd, F_SETFD, FD_CLOEXEC) != 0) {
        return iwc_note(self, IWC_INVALID);
    }
    take_socket(self, fd);
    return IWC_OK;
}

iwc_result_t iwc_adopt(iwc_t *self, int fd, int timeout_ms) {
    const iwc_result_t result = iwc_adopt_for_stop(self, fd);
    return (result == IWC_OK) ? iwc_note(self, greet(self, iwc_deadline_us(timeout_ms))) : result;
}

static iwc_result_t meaning_of(int error) {
    switch (error) {
    case EACCES:
    case EPERM:
        return IWC_DENIED;
    case EAGAIN:
        return IWC_TIMEOUT;
    default:
        return IWC_NOT_THERE;
    }
}

/// Tries to connect to `self->path` until a program accepts or the time is over.
static iwc_result_t call(iwc_t *self, int64_t deadline_us) {
    struct sockaddr_un address = {.sun_family = AF_UNIX};
    memcpy(address.sun_path, self->path, sizeof address.sun_path);
    const int fd = socket(AF_UNIX, SOCK_STREAM | SOCK_CLOEXEC | SOCK_NONBLOCK, 0);
    iwc_result_t result = IWC_OK;
    if (fd < 0) {
        self->error_number = errno;
        return IWC_NOT_THERE;
    }
    while (result == IWC_OK && connect(fd, (const struct sockaddr *)&address, sizeof address) != 0) {
        const int error = errno;
        const int64_t now_us = iwc_now_us();
        if (error == EAGAIN && now_us < deadline_us) {
            result = iwc_await(self, 0, now_us + RETRY_US);
            if (result == IWC_TIMEOUT) {
                result = IWC_OK;
            }
        } else if (error != EINTR) {
            self->error_number = (error == EAGAIN) ? ETIMEDOUT : error;
            result = meaning_of(error);
        }
    }
    if (result != IWC_OK) {
        (void)close(fd);
        return result;
    }
    take_socket(self, fd);
    return IWC_OK;
}

iwc_result_t iwc_dial(iwc_t *self, const char *path, int64_t deadline_us) {
    char found[PATH_MAX];
    begin(self);
    if (path == NULL) {
        const iwc_result_t result = iwc_find(NULL, found, sizeof found);
        if (result != IWC_OK) {
            return result;
        }
        path = found;
    }
    if (strlen(path) >= sizeof self->path) {
        self->error_number = ENAMETOOLONG;
        return IWC_INVALID;
    }
    memset(self->path, 0, sizeof self->path);
    memcpy(self->path, path, strlen(path));
    return call(self, deadline_us);
}

iwc_result_t iwc_connect(iwc_t *self, const char *path, int timeout_ms) {
    const int64_t deadline_us = iwc_deadline_us(timeout_ms);
    const iwc_result_t result = iwc_dial(self, path, deadline_us);
    return iwc_note(self, (result == IWC_OK) ? greet(self, deadline_us) : result);
}

int iwc_fd(const iwc_t *self) {
    return self->fd;
}

bool iwc_pending(const iwc_t *self) {
    for (size_t at = self->begin; at < self->whole;) {
        if (self->in[at] != '\0') {
            return true;
        }
        at = (size_t)((const char *)memchr(self->in + at, '\n', self->whole - at) - self->in) + 1U;
    }
    return false;
}

bool iwc_watches_only(const iwc_t *self) {
    return self->fd >= 0 && self->watches;
}

const char *iwc_path(const iwc_t *self) {
    return self->path;
}

int iwc_errno(const iwc_t *self) {
    return self->error_number;
}

int64_t iwc_number(const iwc_t *self) {
    return self->number;
}

const char *iwc_error(const iwc_t *self) {
    return self->error;
}

const char *iwc_reason(const iwc_t *self) {
    if (self == NULL) {
        return "there is no handle, because iwc_new found no memory";
    }
    return (self->failed == IWC_REFUSED) ? self->reason : iwc_words(self->failed);
}

void iwc_let_in(iwc_t *self, const sigset_t *mask) {
    self->let_in = NULL;
    if (mask != NULL) {
        self->mask = *mask;
        self->let_in = &self->mask;
    }
}

/// Returns true if the connection continues: no message has come yet.
static bool is_waiting(iwc_result_t result) {
    return result == IWC_TIMEOUT || result == IWC_INTERRUPTED;
}

iwc_result_t iwc_next(iwc_t *self, int timeout_ms, iwc_message_t *out_message) {
    const int64_t deadline_us = iwc_deadline_us(timeout_ms);
    for (;;) {
        if (iwc_queue_take(self, out_message)) {
            return IWC_OK;
        }
        iwc_result_t result = iwc_fill(self);
        if (result == IWC_TIMEOUT && timeout_ms != 0) {
            result = iwc_await(self, POLLIN, deadline_us);
        } else if (result == IWC_OK && iwc_now_us() >= deadline_us && !iwc_pending(self)) {
            result = IWC_TIMEOUT; // Data continues to arrive, but no message for the caller.
        }
        if (result != IWC_OK) {
            return is_waiting(result) ? result : iwc_note(self, result);
        }
    }
}

iwc_result_t iwc_latest(iwc_t *self) {
    iwc_result_t result = IWC_OK;
    for (int reads = 0; reads < READS_MAX && result == IWC_OK; reads++) {
        result = iwc_fill(self);
    }
    iwc_queue_thin(self);
    return is_waiting(result) ? IWC_OK : iwc_note(self, result);
}
