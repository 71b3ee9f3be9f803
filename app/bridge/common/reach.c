// SPDX-License-Identifier: MIT
#include "reach.h"

#include <arpa/inet.h>
#include <dirent.h>
#include <errno.h>
#include <net/if.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/ioctl.h>
#include <sys/socket.h>
#include <time.h>

#define LOOPBACK  "lo"
#define EMPTY_MS  1000U
#define SOCKETS   "/proc/self/fd"
#define BYTE_127  0x7FU
#define V4_SHIFT  24U
#define V4_OFFSET 12U ///< Offset of the IPv4 address in a mapped IPv6 address.

typedef union {
    struct sockaddr any;
    struct sockaddr_in v4;
    struct sockaddr_in6 v6;
} address_t;

static int option_of(int fd, int name) {
    int value = 0;
    socklen_t size = sizeof value;
    return (getsockopt(fd, SOL_SOCKET, name, &value, &size) == 0) ? value : 0;
}

static bool is_bound_to_lo(int fd) {
    char device[IFNAMSIZ] = "";
    socklen_t size = sizeof device;
    return getsockopt(fd, SOL_SOCKET, SO_BINDTODEVICE, device, &size) == 0 && strcmp(device, LOOPBACK) == 0;
}

static bool is_loopback(const address_t *address) {
    if (address->any.sa_family == AF_INET) {
        return ntohl(address->v4.sin_addr.s_addr) >> V4_SHIFT == BYTE_127;
    }
    const struct in6_addr *v6 = &address->v6.sin6_addr;
    return IN6_IS_ADDR_LOOPBACK(v6) || (IN6_IS_ADDR_V4MAPPED(v6) && v6->s6_addr[V4_OFFSET] == BYTE_127);
}

/// Returns true if the socket receives from any peer.
static bool is_receiver(int fd, const address_t *address) {
    address_t peer;
    socklen_t size = sizeof peer;
    switch (option_of(fd, SO_TYPE)) {
    case SOCK_STREAM:
        return option_of(fd, SO_ACCEPTCONN) != 0;
    case SOCK_DGRAM:
        return address->v4.sin_port != 0 &&
               getpeername(fd, &peer.any, &size) != 0; // Both families have the port at the same place.
    default:
        return true;
    }
}

static bool is_reachable(int fd, address_t *out_address) {
    socklen_t size = sizeof *out_address;
    memset(out_address, 0, sizeof *out_address);
    if (getsockname(fd, &out_address->any, &size) != 0) {
        return false; // Not a socket.
    }
    if (out_address->any.sa_family != AF_INET && out_address->any.sa_family != AF_INET6) {
        return false;
    }
    return is_receiver(fd, out_address) && !is_loopback(out_address) && !is_bound_to_lo(fd);
}

static void describe(int fd, const address_t *address, char out_text[BRIDGE_REACH_TEXT]) {
    char host[INET6_ADDRSTRLEN] = "";
    const void *bytes = (address->any.sa_family == AF_INET) ? (const void *)&address->v4.sin_addr
                                                            : (const void *)&address->v6.sin6_addr;
    (void)inet_ntop(address->any.sa_family, bytes, host, sizeof host);
    (void)snprintf(out_text, BRIDGE_REACH_TEXT, "%s %s port %u",
                   (option_of(fd, SO_TYPE) == SOCK_STREAM) ? "TCP" : "UDP", host, ntohs(address->v4.sin_port));
}

/// Receives each socket that other machines can reach. Returns false to end the walk.
typedef bool (*visit_t)(void *context, int fd, const address_t *address);

/// Returns false with errno if the descriptors cannot be read or a visit ended the walk.
static bool walk(visit_t visit, void *context) {
    DIR *folder = opendir(SOCKETS);
    bool goes_on = folder != NULL;
    while (goes_on) {
        errno = 0;
        const struct dirent *entry = readdir(folder);
        if (entry == NULL) {
            goes_on = errno == 0;
            break;
        }
        address_t address;
        const int fd = (int)strtol(entry->d_name, NULL, 10);
        if (entry->d_name[0] != '.' && is_reachable(fd, &address)) {
            goes_on = visit(context, fd, &address);
        }
    }
    const int error = errno;
    if (folder != NULL) {
        (void)closedir(folder);
    }
    errno = error;
    return goes_on;
}

typedef struct {
    const int *except;
    size_t except_count;
    unsigned count;
    char *text;
} found_t;

static bool count_one(void *context, int fd, const address_t *address) {
    found_t *found = context;
    for (size_t i = 0; i < found->except_count; i++) {
        if (found->except[i] == fd) {
            return true;
        }
    }
    found->count++;
    describe(fd, address, found->text);
    return true;
}

unsigned bridge_reach_count(const int *except, size_t count, char out_text[BRIDGE_REACH_TEXT]) {
    found_t found = {.except = except, .except_count = count, .text = out_text};
    out_text[0] = '\0';
    if (!walk(count_one, &found)) {
        (void)snprintf(out_text, BRIDGE_REACH_TEXT, "sockets that cannot be read from " SOCKETS " (%s)",
                       strerror(errno));
        found.count++;
    }
    return found.count;
}

bool bridge_reach_is_local(const char *program, const int *except, size_t count) {
    char text[BRIDGE_REACH_TEXT];
    const unsigned found = bridge_reach_count(except, count, text);
    if (found > 0U) {
        (void)fprintf(
            stderr,
            "%s: other machines can reach %u of its sockets against its configuration: %s; report this defect\n",
            program, found, text);
    }
    return found == 0U;
}

/// Waits until earlier input from other machines is passed on. The caller acts on no input yet.
static bool await_empty(int fd) {
    const struct timespec pause = {0, 1000000};
    int waiting = 0;
    for (unsigned ms = 0; ms < EMPTY_MS; ms++) {
        if (ioctl(fd, FIONREAD, &waiting) != 0 || waiting == 0) {
            return true;
        }
        (void)nanosleep(&pause, NULL);
    }
    errno = EBUSY;
    return false;
}

static bool bind_one(void *context, int fd, const address_t *address) {
    (void)context;
    (void)address;
    return setsockopt(fd, SOL_SOCKET, SO_BINDTODEVICE, LOOPBACK, sizeof LOOPBACK) == 0 && await_empty(fd);
}

bool bridge_reach_bind_lo(void) {
    return walk(bind_one, NULL);
}
