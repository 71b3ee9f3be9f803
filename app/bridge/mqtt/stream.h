// SPDX-License-Identifier: MIT
/// The stream of events that a cluster of nats-servers keeps (share/fleet/stream makes it), read by libnats. It changes nothing there.
///
/// Reading waits for the network: for programs that have nothing else to do meanwhile. Each host is tried for 2 s; servers that have
/// just lost one of theirs are asked up to ten times; a stream that falls silent in the middle is given up after 5 s. With TLS the name of the server is checked as its certificate has it.
#ifndef MQTT_STREAM_H
#define MQTT_STREAM_H

#include "mqtt_settings.h"

/// Its name at the servers.
#define STREAM_NAME     "iwheel"
#define STREAM_WHY_SIZE 512U

/// One event: where and what was published, and the servers' wall clock when they stored it. False: that is enough.
typedef bool (*stream_take_t)(void *context, const char *topic, const char *payload, size_t length, int64_t stored_us);

/// What is wanted of it, and who takes it.
typedef struct {
    const char *machine; ///< NULL: of all.
    const char *event;   ///< NULL: all.
    bool last;           ///< Of each machine and event only the last one.
    int64_t since_us;    ///< Unless `last`: wall clock of the servers, from which on they have stored it.
    stream_take_t take;
    void *context; ///< For `take`.
} stream_config_t;

/// Reads what is there now, in the order in which it was stored. 0 with the host that served in `out_host`; else an exit code of sysexits,
/// with cause and cure in `out_why`.
int stream_read(const mqtt_settings_t *settings, const stream_config_t *config, char out_host[MQTT_HOST_SIZE],
                char out_why[STREAM_WHY_SIZE]);

#endif
