// SPDX-License-Identifier: MIT
/// The bridge as a whole: a client of the gateway on one side, of an MQTT broker on the other, in one thread that waits for neither.
///
/// It repeats no command and passes each on at most once, so the wheels stop by the gateway's lease however it ends. If who drives by it
/// falls silent, or the broker is gone, it says `stop` once, if the lease is its own. Fixed memory but for the spool, which is bounded.
#ifndef MQTT_BRIDGE_H
#define MQTT_BRIDGE_H

#include "broker.h"
#include "mqtt_tell.h"
#include "spool.h"

#include "common/bridge_link.h"
#include "common/lease.h"

/// How long who has armed may take for the first command, and who drives between two.
#define MQTT_FIRST_US  1000000U
#define MQTT_SILENT_US 500000U
/// Events that the broker has not confirmed at one time.
#define MQTT_INFLIGHT_MAX 8U
/// An event with which the connection ended so often in a row is set aside: by MQTT 3.1.1 some brokers refuse a message only so.
#define MQTT_LOSSES_MAX 5U
/// Retained messages under way, of which a refusal names the topic.
#define MQTT_NOTES_MAX 16U

typedef enum { MQTT_WAITS, MQTT_CONFIRMED, MQTT_REFUSED } mqtt_fate_t;

typedef struct {
    int message;
    uint64_t number;
    bool aside; ///< It was set aside before.
    mqtt_fate_t fate;
} mqtt_inflight_t;

typedef struct {
    int message;
    char topic[MQTT_TOPIC_SIZE];
} mqtt_note_t;

/// What the broker does not accept. Events are set aside and tried again after 5 s, then after twice that, up to an hour.
typedef struct {
    uint64_t due_us;                  ///< When events that are set aside are tried again,
    uint64_t wait_us;                 ///< and how long after that, unless the broker accepts them.
    bool tries;                       ///< They are being tried.
    int proof;                        ///< The last message before the events of this connection,
    bool works;                       ///< and whether the broker has answered it: the line carries both ways.
    uint64_t suspect;                 ///< The oldest event under way when the connection ended; 0: none.
    unsigned losses;                  ///< How often in a row that was so.
    bool careful;                     ///< The connection ended with events under way, and none was confirmed since.
    uint64_t count;                   ///< Messages that were not accepted.
    uint64_t told;                    ///< How many of them the log knows of,
    uint64_t told_us;                 ///< and since when.
    char last[MQTT_TOPIC_SIZE + 96U]; ///< Topic and reason of the last one; empty: none.
    mqtt_note_t notes[MQTT_NOTES_MAX];
    size_t note;    ///< Place of the next one.
    bool has_event; ///< `last` is an event that the log has not named yet.
} mqtt_refusals_t;

typedef struct {
    const mqtt_settings_t *settings;
    bridge_link_t link;
    bridge_lease_t lease; ///< Of the person who has armed: a connection, and the key that only the reply to `arm` has.
    bridge_movers_t movers;
    mqtt_broker_t broker;
    mqtt_spool_t spool;
    mqtt_judge_t judge;
    char name[MQTT_ID_SIZE + MQTT_BOOT_SIZE + 8U]; ///< At the broker.
    char will[MQTT_TOPIC_SIZE];
    char commands[MQTT_TOPIC_SIZE];
    char sensors[MQTT_TOPIC_SIZE]; ///< Of Home Assistant: what is published there must come back.
    const char *topics[3];
    char boot[MQTT_BOOT_SIZE]; ///< Of this run: random.
    uint64_t silent_us;        ///< When the holder of the lease counts as silent.
    uint64_t now_us;
    uint64_t state_us;     ///< When `state` was sent last.
    uint64_t second_us;    ///< When what is done once a second is due.
    uint64_t info_us;      ///< When `info` was sent last.
    uint64_t sensors_us;   ///< When all sensors must have come back; 0: none are waited for.
    uint32_t sensors_seen; ///< A bit for each that did.
    size_t sensors_sent;
    uint64_t sent_number;  ///< Newest event that was handed to the broker in this connection.
    bool info_due;         ///< Something in it has changed.
    bool online;           ///< What was said last of it.
    bool told_behind;      ///< In the log, that the disk takes nothing.
    size_t told_waiting;   ///< Events, in `info`.
    uint64_t told_dropped; ///< How many were, in the log.
    char condition[128];   ///< What makes a state worth sending at once.
    char state[IWC_LINE_MAX + 1U];
    size_t state_length; ///< 0: not known.
    mqtt_stop_t stop;    ///< The last one that the gateway told.
    char payload[MQTT_PAYLOAD_SIZE];
    mqtt_inflight_t inflight[MQTT_INFLIGHT_MAX];
    size_t inflights;
    mqtt_refusals_t refusals;
} mqtt_bridge_t;

/// 0, or an exit code of sysexits with a line on stderr. Nothing is connected yet.
int mqtt_bridge_open(mqtt_bridge_t *self, const mqtt_settings_t *settings);

/// Looks at what `open` needs, and writes nothing. As `open`.
int mqtt_bridge_check(const mqtt_settings_t *settings);

/// Whatever can be done now. 0, or an exit code.
int mqtt_bridge_step(mqtt_bridge_t *self, uint64_t now_us);

/// Milliseconds until `step` has something to do, if no descriptor has.
int mqtt_bridge_wait_ms(const mqtt_bridge_t *self);

/// Stops the wheels if they are driven by it, and leaves. False: end by _exit().
bool mqtt_bridge_close(mqtt_bridge_t *self);

// ---- between its parts --------------------------------------------------------------------------------------------

/// Publishes `length` bytes of `payload`; as `mqtt_broker_send`. 0 bytes: it did not fit, which is MQTT_NEVER.
int mqtt_bridge_publish(mqtt_bridge_t *self, const char *what, const char *name, size_t length, mqtt_way_t way);

/// Publishes the sensors of Home Assistant, if it is switched on. Once a second: reports those that did not come back in time.
void mqtt_sensors_send(mqtt_bridge_t *self);
void mqtt_sensors_poll(mqtt_bridge_t *self);

/// A message that is no command: a sensor of Home Assistant that this bridge has published comes back.
void mqtt_sensors_take(mqtt_bridge_t *self, const struct mosquitto_message *message);

/// What came to a topic of commands. `context` is the bridge.
void mqtt_bridge_command(void *context, const struct mosquitto_message *message, const mqtt_labels_t *labels);

/// The same to any topic.
int mqtt_bridge_publish_to(mqtt_bridge_t *self, const char *topic, size_t length, mqtt_way_t way);

/// Hands the broker what it has not got of the spool.
void mqtt_events_send(mqtt_bridge_t *self);

/// A connection is up, and all that comes before the events is sent. It is lost. Once a second: reports refusals, and tries again what is set
/// aside.
void mqtt_events_begin(mqtt_bridge_t *self);
void mqtt_events_lost(mqtt_bridge_t *self);
void mqtt_events_poll(mqtt_bridge_t *self);

/// The broker has confirmed a message, or does not accept it. `context` is the bridge.
void mqtt_events_sent(void *context, int message);
void mqtt_events_refused(void *context, int message, const char *why);

/// Sends `stop` once, and only if a person holds the lease by this bridge.
void mqtt_bridge_stop_if_ours(mqtt_bridge_t *self);

/// The newest state of the gateway. False: it is away.
bool mqtt_bridge_state(const mqtt_bridge_t *self, iwc_message_t *out_state);

#endif
