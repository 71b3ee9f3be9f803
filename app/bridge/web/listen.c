// SPDX-License-Identifier: MIT
#include "listen.h"

#include "common/reach.h"

#include <arpa/inet.h>
#include <errno.h>
#include <fcntl.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/socket.h>
#include <sys/stat.h>
#include <sys/un.h>
#include <sysexits.h>
#include <unistd.h>

/// First descriptor that systemd passes (sd_listen_fds(3)).
#define FIRST_FD 3

static int complain(const char *what, const char *fix) {
    (void)fprintf(stderr, "iwheel-web: %s; %s\n", what, fix);
    return (errno == EACCES) ? EX_NOPERM : EX_UNAVAILABLE;
}

static bool is_socket(const char *path) {
    struct stat status;
    return lstat(path, &status) == 0 && S_ISSOCK(status.st_mode);
}

static int listen_unix(const char *path) {
    struct sockaddr_un address = {.sun_family = AF_UNIX};
    (void)snprintf(address.sun_path, sizeof address.sun_path, "%.107s", path);
    const int fd = socket(AF_UNIX, SOCK_STREAM | SOCK_CLOEXEC | SOCK_NONBLOCK, 0);
    const int other = socket(AF_UNIX, SOCK_STREAM | SOCK_CLOEXEC | SOCK_NONBLOCK, 0);
    if (connect(other, (const struct sockaddr *)&address, sizeof address) != 0 && errno == ECONNREFUSED &&
        is_socket(path)) {
        (void)unlink(path); // Left by a bridge that was killed. A regular file or a link stays.
    }
    (void)close(other);
    const mode_t before = umask(0117);
    const int bound = bind(fd, (const struct sockaddr *)&address, sizeof address);
    (void)umask(before);
    if (bound != 0 || listen(fd, SOMAXCONN) != 0) {
        const int error = errno;
        (void)close(fd);
        errno = error;
        return -1;
    }
    return fd;
}

typedef union {
    struct sockaddr any;
    struct sockaddr_in v4;
    struct sockaddr_in6 v6;
} address_t;

static socklen_t make_address(const char *text, uint32_t port, address_t *out) {
    memset(out, 0, sizeof *out);
    if (inet_pton(AF_INET6, text, &out->v6.sin6_addr) == 1) {
        out->v6.sin6_family = AF_INET6;
        out->v6.sin6_port = htons((uint16_t)port);
        return sizeof out->v6;
    }
    out->v4.sin_family = AF_INET;
    out->v4.sin_port = htons((uint16_t)port);
    (void)inet_pton(AF_INET, text, &out->v4.sin_addr);
    return sizeof out->v4;
}

static bool is_same(const address_t *one, const address_t *other) {
    if (one->any.sa_family != other->any.sa_family) {
        return false;
    }
    return (one->any.sa_family == AF_INET6)
               ? one->v6.sin6_port == other->v6.sin6_port &&
                     memcmp(&one->v6.sin6_addr, &other->v6.sin6_addr, sizeof one->v6.sin6_addr) == 0
               : one->v4.sin_port == other->v4.sin_port && one->v4.sin_addr.s_addr == other->v4.sin_addr.s_addr;
}

static int listen_tcp(const char *text, uint32_t port) {
    const int one = 1;
    address_t address;
    const socklen_t size = make_address(text, port, &address);
    const int fd = socket(address.any.sa_family, SOCK_STREAM | SOCK_CLOEXEC | SOCK_NONBLOCK, 0);
    if (fd < 0) {
        return -1;
    }
    (void)setsockopt(fd, SOL_SOCKET, SO_REUSEADDR, &one, sizeof one);
    if (address.any.sa_family == AF_INET6 && strcmp(text, "::1") == 0) {
        (void)setsockopt(fd, IPPROTO_IPV6, IPV6_V6ONLY, &one, sizeof one);
    }
    if (bind(fd, &address.any, size) != 0 || listen(fd, SOMAXCONN) != 0) {
        const int error = errno;
        (void)close(fd);
        errno = error;
        return -1;
    }
    return fd;
}

/// Writes the addresses that the page needs: `listen`, and for loopback both families. Returns their number.
static unsigned wanted(const web_settings_t *settings, const char *out[WEB_BACKLOG_LISTENERS]) {
    const char *listen = settings->web.listen;
    const bool loopback = strcmp(listen, "127.0.0.1") == 0 || strcmp(listen, "::1") == 0;
    out[0] = loopback ? "127.0.0.1" : listen;
    out[1] = "::1";
    return loopback ? 2U : 1U;
}

/// Returns true if IPv6 is missing: then no process can bind its loopback.
static bool has_none(int error) {
    return error == EAFNOSUPPORT || error == EADDRNOTAVAIL;
}

static int open_own(const web_settings_t *settings, int out_fds[WEB_BACKLOG_LISTENERS]) {
    const char *texts[WEB_BACKLOG_LISTENERS];
    const unsigned count = wanted(settings, texts);
    for (unsigned i = 0; i < count; i++) {
        out_fds[i] = listen_tcp(texts[i], settings->web.port);
        if (out_fds[i] < 0 && !(i > 0U && has_none(errno))) {
            char what[256];
            (void)snprintf(what, sizeof what, "cannot listen on %s port %u: %s", texts[i], settings->web.port,
                           strerror(errno));
            return complain(what, "end the program that has it: ss -ltnp");
        }
    }
    return 0;
}

static unsigned count_passed(void) {
    const char *pid = getenv("LISTEN_PID");
    const char *fds = getenv("LISTEN_FDS");
    if (pid == NULL || fds == NULL || strtol(pid, NULL, 10) != (long)getpid()) {
        return 0;
    }
    const long count = strtol(fds, NULL, 10);
    return (count > 0 && count < 100) ? (unsigned)count : 0U;
}

/// Returns the passed socket that listens on this address, as the kernel reports; -1 if there is none.
static int find_passed(unsigned count, const char *text, uint32_t port) {
    address_t address;
    (void)make_address(text, port, &address);
    for (int fd = FIRST_FD; fd < FIRST_FD + (int)count; fd++) {
        address_t found = {.any = {.sa_family = AF_UNSPEC}};
        socklen_t size = sizeof found;
        int listens = 0;
        socklen_t length = sizeof listens;
        if (getsockname(fd, &found.any, &size) == 0 && is_same(&found, &address) &&
            getsockopt(fd, SOL_SOCKET, SO_ACCEPTCONN, &listens, &length) == 0 && listens == 1) {
            return fd;
        }
    }
    return -1;
}

/// Returns true if no socket can bind the IPv6 loopback: systemd then omits it.
static bool lacks_v6(const web_settings_t *settings) {
    const int fd = listen_tcp("::1", settings->web.port);
    if (fd >= 0) {
        (void)close(fd);
    }
    return fd < 0 && has_none(errno);
}

static int take_passed(const web_settings_t *settings, unsigned count, int out_fds[WEB_BACKLOG_LISTENERS]) {
    const char *texts[WEB_BACKLOG_LISTENERS];
    const unsigned needed = web_settings_is_unix(settings) ? 0U : wanted(settings, texts);
    unsigned found = 0;
    for (unsigned i = 0; i < needed; i++) {
        out_fds[i] = find_passed(count, texts[i], settings->web.port);
        if (out_fds[i] >= 0) {
            found++;
            (void)fcntl(out_fds[i], F_SETFD, FD_CLOEXEC);
            (void)fcntl(out_fds[i], F_SETFL, fcntl(out_fds[i], F_GETFL) | O_NONBLOCK);
        }
    }
    if (found != count || (found != needed && !(found == 1U && out_fds[0] >= 0 && lacks_v6(settings)))) {
        errno = 0;
        return complain(
            "iwheel-web.socket listens elsewhere: its addresses differ from listen and port in web.conf",
            "systemctl edit iwheel-web.socket (docs/user/web.md), then: systemctl restart iwheel-web.socket");
    }
    return 0;
}

int web_listen(const web_settings_t *settings, int out_fds[WEB_BACKLOG_LISTENERS]) {
    const unsigned passed = count_passed();
    int code = 0;
    out_fds[0] = -1;
    out_fds[1] = -1;
    if (passed > 0U) {
        code = take_passed(settings, passed, out_fds);
    } else if (web_settings_is_unix(settings)) {
        out_fds[0] = listen_unix(settings->web.listen + 5);
        if (out_fds[0] < 0) {
            char what[256];
            (void)snprintf(what, sizeof what, "cannot listen on %s: %s", settings->web.listen, strerror(errno));
            code = complain(what, "remove the file if it is not needed, or set listen to another path");
        }
    } else {
        code = open_own(settings, out_fds);
    }
    for (unsigned i = 0; code != 0 && i < WEB_BACKLOG_LISTENERS; i++) {
        if (out_fds[i] >= 0) {
            (void)close(out_fds[i]);
        }
    }
    return code;
}

int web_listen_verify(const web_settings_t *settings, const int fds[WEB_BACKLOG_LISTENERS]) {
    const char *texts[WEB_BACKLOG_LISTENERS];
    const bool local = web_settings_is_unix(settings) || wanted(settings, texts) > 1U;
    return bridge_reach_is_local("iwheel-web", fds, local ? 0U : WEB_BACKLOG_LISTENERS) ? 0 : EX_UNAVAILABLE;
}

void web_listen_end(const web_settings_t *settings) {
    if (web_settings_is_unix(settings) && is_socket(settings->web.listen + 5)) {
        (void)unlink(settings->web.listen + 5);
    }
}
