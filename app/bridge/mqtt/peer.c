// SPDX-License-Identifier: MIT
#include "peer.h"

#include "common/bridge_service.h"

#include <arpa/inet.h>
#include <errno.h>
#include <netdb.h>
#include <netinet/in.h>
#include <pwd.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/socket.h>
#include <sys/un.h>
#include <unistd.h>

#define ACCEPT_US 1000000U
#define WAIT_US   10000U
/// Size of an address and a port as /proc/net/tcp6 prints them.
#define END_SIZE 48U

mqtt_peers_t mqtt_peers_of(const char *user) {
    mqtt_peers_t self = {.users = {0U, geteuid()}, .count = 2U};
    const struct passwd *entry = getpwnam(user);
    if (entry != NULL) {
        self.users[self.count++] = entry->pw_uid;
    }
    return self;
}

static mqtt_peer_t judge(uid_t uid, const mqtt_peers_t *allowed) {
    for (size_t i = 0; i < allowed->count; i++) {
        if (allowed->users[i] == uid) {
            return MQTT_PEER_ALLOWED;
        }
    }
    return MQTT_PEER_STRANGER;
}

/// Writes an address as the kernel prints it: each 32-bit word in the byte order of this machine.
static void write_end(const void *address, size_t words, in_port_t port, char out[END_SIZE]) {
    uint32_t word[4] = {0};
    size_t used = 0;
    memcpy(word, address, words * sizeof word[0]);
    for (size_t i = 0; i < words; i++) {
        used += (size_t)snprintf(out + used, END_SIZE - used, "%08X", (unsigned)word[i]);
    }
    (void)snprintf(out + used, END_SIZE - used, ":%04X", (unsigned)ntohs(port));
}

/// Writes an IPv4 address as a socket for both versions prints it.
static void write_mapped(const struct sockaddr_in *end, char out[END_SIZE]) {
    uint8_t mapped[16] = {[10] = 0xFFU, [11] = 0xFFU};
    memcpy(mapped + 12, &end->sin_addr, sizeof end->sin_addr);
    write_end(mapped, 4, end->sin_port, out);
}

/// Finds the owner of the socket with these addresses. Returns false if there is none, or if it has no inode: the
/// kernel shows a connection that is not accepted yet, or is closed, as owned by root.
static bool find_owner(const char *table, const char *local, const char *remote, uid_t *out_uid) {
    char line[512];
    bool found = false;
    FILE *file = fopen(table, "re");
    while (file != NULL && !found && fgets(line, sizeof line, file) != NULL) {
        char ends[2][END_SIZE];
        char uid[16];
        char inode[24];
        found = sscanf(line, " %*[^:]: %47s %47s %*s %*s %*s %*s %15[0-9] %*s %23[0-9]", ends[0], ends[1], uid,
                       inode) == 4 &&
                strtoul(inode, NULL, 10) != 0U && strcmp(ends[0], local) == 0 && strcmp(ends[1], remote) == 0;
        if (found) {
            *out_uid = (uid_t)strtoul(uid, NULL, 10);
        }
    }
    if (file != NULL) {
        (void)fclose(file);
    }
    return found;
}

typedef union {
    struct sockaddr any;
    struct sockaddr_in v4;
    struct sockaddr_in6 v6;
    struct sockaddr_un local;
} end_t;

/// Finds the owner of the other socket: the remote address here is its local address.
static bool find_tcp_owner(const end_t *here, const end_t *there, uid_t *out_uid) {
    char ends[2][END_SIZE];
    if (there->any.sa_family == AF_INET6) {
        write_end(&there->v6.sin6_addr, 4, there->v6.sin6_port, ends[0]);
        write_end(&here->v6.sin6_addr, 4, here->v6.sin6_port, ends[1]);
        return find_owner("/proc/self/net/tcp6", ends[0], ends[1], out_uid);
    }
    write_end(&there->v4.sin_addr, 1, there->v4.sin_port, ends[0]);
    write_end(&here->v4.sin_addr, 1, here->v4.sin_port, ends[1]);
    if (find_owner("/proc/self/net/tcp", ends[0], ends[1], out_uid)) {
        return true;
    }
    write_mapped(&there->v4, ends[0]);
    write_mapped(&here->v4, ends[1]);
    return find_owner("/proc/self/net/tcp6", ends[0], ends[1], out_uid);
}

mqtt_peer_t mqtt_peer_judge(int fd, const mqtt_peers_t *allowed, uid_t *out_uid) {
    end_t here = {.any = {.sa_family = AF_UNSPEC}};
    end_t there = here;
    socklen_t lengths[2] = {sizeof here, sizeof there};
    if (getsockname(fd, &here.any, &lengths[0]) != 0 || getpeername(fd, &there.any, &lengths[1]) != 0) {
        return MQTT_PEER_UNKNOWN;
    }
    if (here.any.sa_family == AF_UNIX) {
        struct ucred other = {.uid = (uid_t)-1};
        socklen_t length = sizeof other;
        if (getsockopt(fd, SOL_SOCKET, SO_PEERCRED, &other, &length) != 0) {
            return MQTT_PEER_UNKNOWN;
        }
        *out_uid = other.uid;
        return judge(other.uid, allowed);
    }
    const uint64_t until_us = bridge_now_us() + ACCEPT_US;
    while (!find_tcp_owner(&here, &there, out_uid)) {
        if (bridge_now_us() >= until_us) {
            return MQTT_PEER_UNKNOWN;
        }
        (void)usleep(WAIT_US);
    }
    return judge(*out_uid, allowed);
}

static mqtt_peer_t probe(const struct sockaddr *address, socklen_t length, const mqtt_peers_t *allowed,
                         uid_t *out_uid) {
    mqtt_peer_t result = MQTT_PEER_NONE;
    const int fd = socket(address->sa_family, SOCK_STREAM | SOCK_CLOEXEC, 0);
    if (fd >= 0 && connect(fd, address, length) == 0) {
        result = mqtt_peer_judge(fd, allowed, out_uid);
    }
    const int error = errno;
    if (fd >= 0) {
        (void)close(fd);
    }
    errno = error;
    return result;
}

static mqtt_peer_t probe_path(const char *path, const mqtt_peers_t *allowed, uid_t *out_uid) {
    struct sockaddr_un address = {.sun_family = AF_UNIX};
    const size_t length = strlen(path);
    if (length >= sizeof address.sun_path) {
        errno = ENAMETOOLONG;
        return MQTT_PEER_NONE;
    }
    memcpy(address.sun_path, path, length);
    return probe((const struct sockaddr *)&address, sizeof address, allowed, out_uid);
}

/// Returns true for a loopback address. Other addresses of the name are not used.
static bool is_loopback(const struct sockaddr *address) {
    end_t end = {.any = {.sa_family = AF_UNSPEC}};
    if (address->sa_family == AF_INET) {
        memcpy(&end.v4, address, sizeof end.v4);
        return ntohl(end.v4.sin_addr.s_addr) >> 24U == 127U;
    }
    memcpy(&end.v6, address, sizeof end.v6);
    return address->sa_family == AF_INET6 && IN6_IS_ADDR_LOOPBACK(&end.v6.sin6_addr);
}

mqtt_peer_t mqtt_peer_probe(const char *host, int port, const mqtt_peers_t *allowed,
                            char out_address[MQTT_ADDRESS_SIZE], uid_t *out_uid) {
    const struct addrinfo wanted = {.ai_family = AF_UNSPEC, .ai_socktype = SOCK_STREAM};
    struct addrinfo *list = NULL;
    char digits[16];
    mqtt_peer_t result = MQTT_PEER_NONE;
    (void)snprintf(out_address, MQTT_ADDRESS_SIZE, "%s", host);
    if (host[0] == '/') {
        return probe_path(host, allowed, out_uid);
    }
    (void)snprintf(digits, sizeof digits, "%d", port);
    errno = EADDRNOTAVAIL;
    if (getaddrinfo(host, digits, &wanted, &list) != 0) {
        return MQTT_PEER_NONE;
    }
    for (const struct addrinfo *one = list; one != NULL && result == MQTT_PEER_NONE; one = one->ai_next) {
        if (is_loopback(one->ai_addr) &&
            getnameinfo(one->ai_addr, one->ai_addrlen, out_address, MQTT_ADDRESS_SIZE, NULL, 0, NI_NUMERICHOST) == 0) {
            result = probe(one->ai_addr, one->ai_addrlen, allowed, out_uid);
        }
    }
    freeaddrinfo(list);
    return result;
}
