// SPDX-License-Identifier: MIT
/// The only connection to the MQTT broker, by libmosquitto. The connection is retried without end. Only
/// `mqtt_broker_close` waits.
///
///     AWAY --try--> CONNECTING --socket--> GREETING --CONNACK--> UP --lost--> AWAY, tried again after 0.5 s to 30 s
///
/// "Not now" and "never" differ: the caller sends a message again that cannot be sent now. If this broker does not
/// accept a message (size, rights), the caller is informed and the connection stays.
///
/// CONNECTING opens the files of TLS, resolves names and shakes hands, which may wait: a separate thread does this and
/// changes nothing else.
/// Sessions are clean: the broker stores nothing for this machine while it is away, so no command arrives late.
#ifndef MQTT_BROKER_H
#define MQTT_BROKER_H

#include "mqtt_settings.h"
#include "peer.h"

#include <mosquitto.h>
#include <pthread.h>
#include <stdatomic.h>

/// A connection without an answer of the broker (CONNACK) for this time is lost, and the next host is tried.
#define MQTT_GREETING_US 10000000U

/// Properties of a message in MQTT 5. With 3.1.1 none is sent and none is received.
typedef struct {
    uint32_t expiry_s;       ///< Time after which the broker drops the message; 0: never. Not set on receipt.
    const char *answer_to;   ///< Response topic; NULL: none.
    const void *correlation; ///< Correlation data; NULL: none.
    uint16_t correlation_length;
} mqtt_labels_t;

typedef struct {
    const char *program;       ///< Name of this program in the log.
    const char *name;          ///< Name of the client at the broker; must be unique.
    const char *const *topics; ///< Topics to subscribe to, with QoS 0; ends with NULL.
    const char *will; ///< Topic where the broker publishes `offline`, retained, when this client is gone; NULL: none.
    void *context;
    void (*up)(void *context);
    void (*down)(void *context);
    void (*sent)(void *context, int message);                     ///< The broker has confirmed the message.
    void (*refused)(void *context, int message, const char *why); ///< MQTT 5: the broker does not accept the message.
    void (*came)(void *context, const struct mosquitto_message *message, const mqtt_labels_t *labels);
} mqtt_broker_listener_t; ///< The texts must outlive the connection.

typedef enum { MQTT_AWAY, MQTT_CONNECTING, MQTT_GREETING, MQTT_UP } mqtt_broker_state_t;

/// Data of the thread that connects.
typedef struct {
    struct mosquitto *client;
    const mqtt_settings_t *settings;
    const char *host;
    int port;
    int keepalive_s;
    bool no_tls; ///< The files of TLS cannot be used.
    int result;
    int error;
    bool guarded;         ///< The process of the broker is judged before and after the connection.
    mqtt_peers_t allowed; ///< Owners that are allowed.
    mqtt_peer_t peer;     ///< Result of the judgement.
    uid_t uid;            ///< Owner of that process.
    int wake;             ///< Descriptor that wakes the main thread at the end.
    atomic_bool ended;
} mqtt_caller_t;

typedef struct {
    const mqtt_settings_t *settings;
    mqtt_broker_listener_t listener;
    mqtt_broker_state_t state;
    struct mosquitto *client; ///< NULL in MQTT_AWAY.
    mqtt_caller_t caller;
    char host[MQTT_HOST_SIZE]; ///< Host that is connected or tried.
    size_t next;               ///< Number of the host to try next.
    char *user;                ///< NULL: none.
    char *password;            ///< NULL if there is no `user`.
    bool logged_away;          ///< The absence is logged. Valid in every state: many tries in a row are one absence.
    int subscriptions[4];      ///< Message numbers, in the order of the listener's topics.
    uint64_t up_us;            ///< Time at which the broker accepted this connection.
    unsigned short_ones;       ///< Short connections in a row.
    uint64_t short_us;         ///< Time from which the log may report them again.
    uint64_t name_in_use;      ///< Connections that another client with this name has ended, as far as known.
    bool lost;                 ///< Set by callbacks of the library; the state changes after the call.
    int refusal;               ///< Reason of the last CONNACK, or of a DISCONNECT of MQTT 5.
    char words[160];           ///< Last error or warning of the library.
    uint64_t now_us;
    uint64_t try_us;
    uint64_t wait_us;
    uint64_t random;
    uint64_t until_us; ///< MQTT_GREETING: deadline of CONNACK.
    uint64_t poll_us;  ///< Next time at which the library checks its keepalive.
    unsigned behind;   ///< Messages that were sent while others still waited in the library.
    uint64_t unsent;   ///< Messages that were not sent, because too many waited or by an error.
    const char *unfit; ///< Reason of the last MQTT_NEVER.
} mqtt_broker_t;

/// Reads the credentials and checks the files of TLS. Returns 0, or an exit code of sysexits with a line on stderr.
int mqtt_broker_open(mqtt_broker_t *self, const mqtt_settings_t *settings, const mqtt_broker_listener_t *listener);

/// Publishes `offline` and disconnects, within 0.2 s. Returns true if all is freed. Returns false if its thread still
/// waits for the network: the caller must then end by _exit().
bool mqtt_broker_close(mqtt_broker_t *self);

void mqtt_broker_step(mqtt_broker_t *self, uint64_t now_us);

/// Returns the next time at which `step` has work without input.
uint64_t mqtt_broker_next_us(const mqtt_broker_t *self);

/// Returns the descriptor for poll(), or -1. Sets `*out_writes` if it waits to write.
int mqtt_broker_fd(const mqtt_broker_t *self, bool *out_writes);

typedef struct {
    int qos;
    bool retain;
    bool spare; ///< Send only if no earlier message waits: a newer one follows.
    mqtt_labels_t labels;
} mqtt_way_t;

#define MQTT_NOT_NOW 0
#define MQTT_NEVER   (-1)

/// Sends a message. Returns its number for `sent` or `refused`; MQTT_NOT_NOW if the broker is away or does not read;
/// MQTT_NEVER if this broker does not accept it, with the reason in `unfit`.
int mqtt_broker_send(mqtt_broker_t *self, const char *topic, const char *payload, size_t length, mqtt_way_t way);

#endif
