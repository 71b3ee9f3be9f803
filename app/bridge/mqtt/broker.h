// SPDX-License-Identifier: MIT
/// The one connection to the MQTT broker, kept up for ever, by libmosquitto. It waits for nothing.
///
///     AWAY --try--> CONNECTING --socket--> GREETING --CONNACK--> UP --lost--> AWAY, tried again after 0.5 s to 30 s
///
/// "Not now" and "never" are different: a message that cannot be sent now is tried again by the caller; of one that this broker does not
/// accept (too large, its rights) the caller is informed, and the connection goes on.
///
/// CONNECTING asks for names and shakes hands, which may wait: a thread of its own does that, and touches nothing else. Clean sessions:
/// the broker keeps nothing for this machine while it is away, so no command comes late from there.
#ifndef MQTT_BROKER_H
#define MQTT_BROKER_H

#include "mqtt_settings.h"
#include "peer.h"

#include <mosquitto.h>
#include <pthread.h>
#include <stdatomic.h>

/// A broker that has not answered for so long after the connection was made is lost, and the next host is tried.
#define MQTT_GREETING_US 10000000U

/// What MQTT 5 carries beside a message; by 3.1.1 nothing of it is sent, and nothing comes.
typedef struct {
    uint32_t expiry_s; ///< The broker drops what it could not deliver in this time; 0: never. Not read of what comes.
    const char *answer_to;   ///< Response topic; NULL: none.
    const void *correlation; ///< Correlation data; NULL: none.
    uint16_t correlation_length;
} mqtt_labels_t;

typedef struct {
    const char *program;       ///< For the log.
    const char *name;          ///< Of the client at the broker; no other may have it.
    const char *const *topics; ///< What it listens to, by QoS 0; ends with NULL.
    const char *will;          ///< Where the broker says `offline` when this client is gone, retained; NULL: nowhere.
    void *context;
    void (*up)(void *context);
    void (*down)(void *context);
    void (*sent)(void *context, int message);                     ///< The broker has confirmed it.
    void (*refused)(void *context, int message, const char *why); ///< By MQTT 5: the broker does not accept it.
    void (*came)(void *context, const struct mosquitto_message *message, const mqtt_labels_t *labels);
} mqtt_broker_listener_t; ///< The texts must outlive the connection.

typedef enum { MQTT_AWAY, MQTT_CONNECTING, MQTT_GREETING, MQTT_UP } mqtt_broker_state_t;

/// For the thread that connects.
typedef struct {
    struct mosquitto *client;
    const char *host;
    int port;
    int keepalive_s;
    int result;
    int error;
    bool guarded;         ///< The other end is judged before and after.
    mqtt_peers_t allowed; ///< By these,
    mqtt_peer_t peer;     ///< with this result
    uid_t uid;            ///< and this user.
    int wake;             ///< Where it tells that it has ended.
    atomic_bool ended;
} mqtt_caller_t;

typedef struct {
    const mqtt_settings_t *settings;
    mqtt_broker_listener_t listener;
    mqtt_broker_state_t state;
    struct mosquitto *client; ///< NULL in MQTT_AWAY.
    mqtt_caller_t caller;
    char host[MQTT_HOST_SIZE]; ///< The one it is at, or tries.
    size_t next;               ///< Number of the one to try next.
    char *user;                ///< NULL: none.
    char *password;            ///< Behind `user`.
    bool told_away;            ///< In the log; in every state: many tries in a row are one absence.
    int subscriptions[4];      ///< Message numbers, in the order of the listener's topics.
    uint64_t up_us;            ///< When the broker accepted this connection.
    unsigned short_ones;       ///< Connections in a row that ended at once after that.
    uint64_t short_us;         ///< When the log may mention them again.
    uint64_t taken;            ///< Connections that another client with this name has ended, as far as is known.
    bool lost;                 ///< The library says so, from within a call of it; the state changes after that call.
    int refusal;               ///< Of the last CONNACK, or by MQTT 5 of a message.
    char words[160];           ///< What the library said last of its trouble.
    uint64_t now_us;
    uint64_t try_us;
    uint64_t wait_us;
    uint64_t random;
    uint64_t until_us; ///< MQTT_GREETING: for CONNACK.
    uint64_t look_us;  ///< When the library wants to look at its keepalive.
    unsigned behind;   ///< Messages given while others were not gone yet.
    uint64_t unsent;   ///< Messages not given because of too many of those.
    const char *unfit; ///< Why the last message with MQTT_NEVER was none for this broker.
} mqtt_broker_t;

/// Reads the credentials and looks at the files of TLS. 0, or an exit code of sysexits with a line on stderr.
int mqtt_broker_open(mqtt_broker_t *self, const mqtt_settings_t *settings, const mqtt_broker_listener_t *listener);

/// Says goodbye with `offline`, within 0.2 s. True: all is freed. False: its thread still waits for the network, so end by _exit().
bool mqtt_broker_close(mqtt_broker_t *self);

void mqtt_broker_step(mqtt_broker_t *self, uint64_t now_us);

/// When `step` has something to do, whatever comes.
uint64_t mqtt_broker_next_us(const mqtt_broker_t *self);

/// For poll(): a descriptor, -1: none; and whether it waits to write.
int mqtt_broker_fd(const mqtt_broker_t *self, bool *out_writes);

typedef struct {
    int qos;
    bool retain;
    bool spare; ///< Only if all before it is gone already: there will be a newer one.
    mqtt_labels_t labels;
} mqtt_way_t;

#define MQTT_NOT_NOW 0
#define MQTT_NEVER   (-1)

/// Hands a message over. Its number for `sent` or `refused`. MQTT_NOT_NOW: the broker is not there or does not read. MQTT_NEVER: this broker
/// does not accept it, with the reason in `unfit`.
int mqtt_broker_send(mqtt_broker_t *self, const char *topic, const char *payload, size_t length, mqtt_way_t way);

#endif
