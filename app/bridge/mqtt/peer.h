// SPDX-License-Identifier: MIT
/// Which user the process at the other end of a connection on this machine belongs to, as the kernel says it.
///
/// Any local user may bind a free port, so a broker on loopback without TLS is believed only if its process belongs to a user that is allowed.
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
    MQTT_PEER_STRANGER, ///< Of another user.
    MQTT_PEER_UNKNOWN,  ///< The kernel names none: not accepted within a second, or not of this network namespace.
    MQTT_PEER_NONE      ///< Nothing listens there; errno has the reason.
} mqtt_peer_t;

/// root, the own user, and the one with this name if the system knows it.
mqtt_peers_t mqtt_peers_of(const char *user);

/// Judges the other end of a connected socket: TCP on this machine, or a unix socket. `out_uid` is set unless it is unknown. Waits for the
/// other end to accept, at most a second.
mqtt_peer_t mqtt_peer_judge(int fd, const mqtt_peers_t *allowed, uid_t *out_uid);

/// Connects to `host`, a loopback name or address or the path of a unix socket, judges the other end and disconnects. `out_address` is where
/// that was, so that the next connection does not go elsewhere. Waits for the network.
mqtt_peer_t mqtt_peer_probe(const char *host, int port, const mqtt_peers_t *allowed,
                            char out_address[MQTT_ADDRESS_SIZE], uid_t *out_uid);

#endif
