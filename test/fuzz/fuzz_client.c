// SPDX-License-Identifier: MIT
// Any bytes from a gateway to libiwheel-client: the client returns whole messages, within bounds, and the end of the connection ends it once.
// The connection is a buffer: the linker replaces the system calls by functions of this file (--wrap); the real calls would use most of the time.
#include "connection.h"
#include "fuzz.h"

#include <errno.h>
#include <fcntl.h>
#include <poll.h>
#include <signal.h>
#include <stdarg.h>
#include <sys/socket.h>
#include <unistd.h>

/// A descriptor that the process does not have.
#define CONNECTION 100000
#define WIRE_MAX   65536U

static struct {
    uint8_t bytes[WIRE_MAX];
    size_t begin;
    size_t end;
    bool closed;    ///< Closed by the gateway.
    bool narrow;    ///< Accepts half of the sent bytes, then no more.
    bool shut;      ///< Shut by the client.
    size_t written; ///< Bytes that the client sent.
} wire;

ssize_t __wrap_recv(int fd, void *out, size_t size, int flags);
ssize_t __wrap_send(int fd, const void *bytes, size_t size, int flags);
int __wrap_ppoll(struct pollfd *entry, nfds_t count, const struct timespec *timeout, const sigset_t *mask);
int __wrap_shutdown(int fd, int how);
int __wrap_close(int fd);
int __wrap_fcntl(int fd, int command, ...);
int __real_close(int fd);
int __real_fcntl(int fd, int command, ...);

ssize_t __wrap_recv(int fd, void *out, size_t size, int flags) {
    const size_t there = wire.end - wire.begin;
    const size_t now = (size < there) ? size : there;
    fuzz_require(fd == CONNECTION && !wire.shut && flags == 0 && size > 0U, "it reads from the connection");
    if (now == 0U && !wire.closed) {
        errno = EAGAIN;
        return -1;
    }
    memcpy(out, &wire.bytes[wire.begin], now);
    wire.begin += now;
    return (ssize_t)now;
}

ssize_t __wrap_send(int fd, const void *bytes, size_t size, int flags) {
    fuzz_require(fd == CONNECTION && !wire.shut && flags == MSG_NOSIGNAL && bytes != NULL && size > 0U,
                 "it writes to the connection");
    if (wire.closed) {
        errno = EPIPE;
        return -1;
    }
    if (wire.narrow && wire.written > 0U) {
        errno = EAGAIN;
        return -1;
    }
    const size_t now = wire.narrow ? (size + 1U) / 2U : size;
    wire.written += now;
    return (ssize_t)now;
}

/// No time passes.
int __wrap_ppoll(struct pollfd *entry, nfds_t count, const struct timespec *timeout, const sigset_t *mask) {
    (void)timeout;
    (void)mask;
    fuzz_require(count == 1U && entry->fd == CONNECTION, "it waits for one connection");
    const bool comes = (entry->events & POLLIN) != 0 && (wire.end > wire.begin || wire.closed);
    return (comes || ((entry->events & POLLOUT) != 0 && !wire.narrow)) ? 1 : 0;
}

int __wrap_shutdown(int fd, int how) {
    fuzz_require(fd == CONNECTION && how == SHUT_RDWR && !wire.shut, "it is shut once");
    return 0;
}

int __wrap_close(int fd) {
    if (fd != CONNECTION) {
        return __real_close(fd);
    }
    fuzz_require(!wire.shut, "it is closed once");
    wire.shut = true;
    return 0;
}

int __wrap_fcntl(int fd, int command, ...) {
    va_list list;
    va_start(list, command);
    const long value = va_arg(list, long);
    va_end(list);
    return (fd == CONNECTION) ? 0 : __real_fcntl(fd, command, value);
}

static void feed(const void *bytes, size_t size) {
    fuzz_require(size <= WIRE_MAX - wire.end, "the bytes fit");
    memcpy(&wire.bytes[wire.end], bytes, size);
    wire.end += size;
}

static const char HELLO[] = "{\"event\":\"hello\",\"api\":1,\"client\":3}\n";

static void judge_handle(const iwc_t *self) {
    fuzz_require(self->begin <= self->whole && self->whole <= self->end && self->end <= IWC_IN_SIZE,
                 "the buffer's parts are in order");
    fuzz_require((self->fd >= 0) == (self->over == IWC_OK), "it is open or over");
}

static void judge_message(const iwc_t *self, const iwc_message_t *message) {
    char text[16];
    iwc_state_t state;
    size_t length = 0;
    fuzz_require(message->length <= IWC_LINE_MAX && strlen(message->text) == message->length,
                 "a message is one terminated line");
    fuzz_require(message->is_event == (iwc_json(message, "event", &length) != NULL), "it is an event or a reply");
    (void)iwc_state(self, message, &state);
    if (iwc_text(message, message->is_event ? "event" : "error", text, sizeof text)) {
        fuzz_require(strlen(text) < sizeof text, "a text ends");
    }
}

/// Reads with the call that the byte selects.
static iwc_result_t read_some(iwc_t *self, uint8_t how) {
    iwc_message_t message;
    iwc_result_t result = IWC_OK;
    if ((how & 1U) != 0U) {
        (void)iwc_latest(self);
        judge_handle(self);
    }
    if ((how & 2U) != 0U && iwc_ask(self, "{\"cmd\":\"status\"}", 0, &message) == IWC_OK) {
        judge_message(self, &message);
    }
    if ((how & 4U) != 0U) {
        (void)iwc_drive(self, &(iwc_drive_t){.left_mm_s = 100}, 0, NULL);
    }
    while ((how & 8U) == 0U && result == IWC_OK) {
        result = iwc_next(self, 0, &message);
        if (result == IWC_OK) {
            judge_message(self, &message);
        }
        judge_handle(self);
    }
    return result;
}

/// Uses the same bytes as the greeting of the peer.
static void judge_greeting(iwc_t *self, const uint8_t *data, size_t size) {
    feed(data, size);
    wire.closed = (size % 2U) != 0U;
    const iwc_result_t result = iwc_adopt(self, CONNECTION, 0);
    fuzz_position((result == IWC_OK || result == IWC_NEWER || result == IWC_REFUSED) ? "accepted" : "refused");
    fuzz_require((result == IWC_OK || result == IWC_NEWER) || self->fd < 0, "no connection without a greeting");
    fuzz_require(result != IWC_REFUSED || strlen(iwc_reason(self)) < sizeof self->reason, "a refusal's words end");
    iwc_close(self);
}

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size) {
    static iwc_t *self;
    fuzz_bytes_t bytes = {.data = data, .size = size};
    const uint8_t how = fuzz_byte(&bytes);
    if (size > WIRE_MAX - sizeof HELLO) {
        return -1;
    }
    self = (self != NULL) ? self : iwc_new();
    wire.begin = wire.end = wire.written = 0;
    wire.closed = wire.narrow = wire.shut = false;
    fuzz_require(self != NULL, "there is memory");
    if ((how & 0xF0U) == 0x90U) {
        judge_greeting(self, data + bytes.at, size - bytes.at);
        return 0;
    }
    feed(HELLO, sizeof HELLO - 1U);
    fuzz_require(iwc_adopt(self, CONNECTION, 1000) == IWC_OK, "it is greeted");
    wire.narrow = (how & 0xF0U) == 0x70U;
    self->requests = 0;
    // The first byte selects where the input is cut, so lines are torn.
    const size_t piece = (how >= 16U) ? how : 65536U;
    iwc_result_t result = IWC_TIMEOUT;
    while (bytes.at < size && self->fd >= 0) {
        const size_t now = (size - bytes.at < piece) ? size - bytes.at : piece;
        feed(data + bytes.at, now);
        bytes.at += now;
        result = read_some(self, how);
    }
    result = read_some(self, 0);
    fuzz_position((result == IWC_TIMEOUT && self->begin == self->whole && self->whole == self->end && size > 1U)
                      ? "accepted"
                      : "refused");
    wire.closed = true;
    result = read_some(self, 0);
    fuzz_require(result == IWC_CLOSED || result == IWC_GARBLED, "it is over");
    iwc_close(self);
    return 0;
}
