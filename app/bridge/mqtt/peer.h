// SPDX-License-Identifier: MIT
/// Finds the user that owns the process at the other end of a local connection, by the kernel.
///
/// Any local user may bind a free port. So a local broker without TLS is trusted only if its process belongs to an
/// allowed user.
#ifndef MQTT_PEER_H
#define MQTT_PEER_H

#include <stdbool.h>
#include <stddef.h>
#include <sys/types.h>

#define MQTT_PEER_USERS_MAX 3U
#define MQTT_ADDRESS_SIZE   256U

typedef struct {
    uid_t users[MQTT_PEER_USERS_MAX];
    size_t count;
} mqtt_peers_t;

typedef enum {
    MQTT_PEER_ALLOWED,
    MQTT_PEER_STRANGER, ///< Another user.
    MQTT_PEER_UNKNOWN,  ///< The kernel names no owner: not accepted within a second, or not in this network namespace.
    MQTT_PEER_NONE      ///< No connection; errno has the reason.
} mqtt_peer_t;

/// Returns the allowed users: root, the own user, and the user with this name if it exists.
mqtt_peers_t mqtt_peers_of(const char *user);

/// Judges the other end of a connected socket: local TCP, or a unix socket. Sets `out_uid` unless the owner is unknown.
/// Waits at most a second for the other end to accept.
mqtt_peer_t mqtt_peer_judge(int fd, const mqtt_peers_t *allowed, uid_t *out_uid);

/// Connects to `host` (a loopback name or address, or the path of a unix socket), judges the other end and disconnects.
/// Sets `out_address` to the address of that connection, so that the next connection has the same target. Waits for the
/// network.
mqtt_peer_t mqtt_peer_probe(const char *host, int port, const mqtt_peers_t *allowed,
                            char out_address[MQTT_ADDRESS_SIZE], uid_t *out_uid);

#endif
