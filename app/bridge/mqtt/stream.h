// SPDX-License-Identifier: MIT
/// Reads the stream of events of a cluster of nats-servers (share/fleet/stream creates it) by libnats. It changes
/// nothing there.
///
/// Reading waits for the network, so it is for programs without other work. Each host is tried for 2 s. Servers that
/// have just lost one of them are asked up to ten times. The read ends after 5 s without a message. With TLS the
/// name of the server is checked against its certificate.
#ifndef MQTT_STREAM_H
#define MQTT_STREAM_H

#include "mqtt_settings.h"

/// Name of the stream at the servers.
#define STREAM_NAME     "iwheel"
#define STREAM_WHY_SIZE 512U

/// Receives one event: its topic and payload, and the wall clock of the servers at its storage. Returns false to end
/// the reading.
typedef bool (*stream_visit_t)(void *context, const char *topic, const char *payload, size_t length, int64_t stored_us);

/// Selection of events, and their receiver.
typedef struct {
    const char *machine; ///< NULL: all machines.
    const char *event;   ///< NULL: all events.
    bool last;           ///< Only the last event of each machine and kind.
    int64_t since_us; ///< Time of storage from which on events are read, by the clock of the servers; not with `last`.
    stream_visit_t visit;
    void *context; ///< Context of `visit`.
} stream_config_t;

/// Reads the stored events in the order of their storage. Returns 0 and sets `out_host` to the host that served;
/// otherwise returns an exit code of sysexits, with cause and fix in `out_why`.
int stream_read(const mqtt_settings_t *settings, const stream_config_t *config, char out_host[MQTT_HOST_SIZE],
                char out_why[STREAM_WHY_SIZE]);

#endif
