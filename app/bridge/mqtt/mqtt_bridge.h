// SPDX-License-Identifier: MIT
/// The whole bridge: a client of the gateway and of an MQTT broker, in one thread that waits for neither, nor for a disk.
///
/// It repeats no command and passes each on at most once. So the wheels stop by the lease of the gateway, however the
/// bridge ends. If the person who drives sends nothing more, or the broker is gone, the bridge sends `stop` once if it
/// holds the lease. Memory is fixed, except for the spool, which is bounded.
#ifndef MQTT_BRIDGE_H
#define MQTT_BRIDGE_H

#include "broker.h"
#include "mqtt_contents.h"
#include "spool.h"

#include "common/bridge_link.h"
#include "common/lease.h"

/// Longest time from `arm` to the first command of the same person, and between two commands.
#define MQTT_FIRST_US  1000000U
#define MQTT_SILENT_US 500000U
/// Without a state of the gateway for this time, the machine is offline although the connection stays: the gateway
/// hangs, or its line is lost. Three and a half of the longest interval of its states, so two lost states are no cause;
/// and longer than iwheel-serial waits for a board (3.2 s) before it ends the connection.
#define MQTT_HUNG_US 3500000U
/// Largest number of events that wait for a confirmation.
#define MQTT_INFLIGHT_MAX 8U
/// An event is set aside if the connection ended with it this number of times in a row. With MQTT 3.1.1 some brokers
/// can refuse a message only in this way.
#define MQTT_LOSSES_MAX 5U
/// Number of retained messages whose topics are stored, so that a refusal can name the topic.
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

/// Messages that the broker does not accept. Events are set aside and tried again after 5 s, then after twice the time,
/// up to an hour.
typedef struct {
    uint64_t due_us;                  ///< Time of the next try of events that are set aside.
    uint64_t wait_us;                 ///< Delay of the try after that, unless the broker accepts them.
    bool tries;                       ///< They are being tried.
    int proof;                        ///< Last message before the events of this connection.
    bool works;                       ///< The broker has answered it, so the connection works in both directions.
    uint64_t suspect;                 ///< Oldest event under way at the end of the connection; 0: none.
    unsigned losses;                  ///< Number of times in a row that it was the same.
    bool careful;                     ///< The connection ended with events under way; none was confirmed since.
    uint64_t count;                   ///< Messages that were not accepted.
    uint64_t logged;                  ///< Value of `count` in the last log line.
    uint64_t logged_us;               ///< Time from which the next log line is allowed.
    char last[MQTT_TOPIC_SIZE + 96U]; ///< Topic and reason of the last one; empty: none.
    mqtt_note_t notes[MQTT_NOTES_MAX];
    size_t note;    ///< Index of the next note.
    bool has_event; ///< `last` is an event that is not in the log yet.
} mqtt_refusals_t;

typedef struct {
    const mqtt_settings_t *settings;
    bridge_link_t link;
    bridge_lease_t lease; ///< Lease of the person who armed: a connection, and the key of the reply to `arm`.
    bridge_movers_t movers;
    mqtt_broker_t broker;
    mqtt_spool_t spool;
    mqtt_judge_t judge;
    char name[MQTT_ID_SIZE + MQTT_BOOT_SIZE + 8U]; ///< Name at the broker.
    char will[MQTT_TOPIC_SIZE];
    char commands[MQTT_TOPIC_SIZE];
    char sensors[MQTT_TOPIC_SIZE]; ///< Topics of Home Assistant: the bridge must receive its own messages there.
    const char *topics[3];
    char boot[MQTT_BOOT_SIZE]; ///< Random id of this run.
    uint64_t silent_us;        ///< Time at which the holder of the lease counts as silent.
    uint64_t now_us;
    uint64_t state_us;     ///< Time of the last `state`.
    uint64_t second_us;    ///< Time of the next work that is done once a second.
    uint64_t info_us;      ///< Time of the last `info`.
    uint64_t sensors_us;   ///< Deadline for the return of all sensors; 0: not waiting.
    uint32_t sensors_seen; ///< One bit for each sensor that returned.
    size_t sensors_sent;
    uint64_t sent_number;    ///< Newest event that was sent to the broker in this connection.
    bool info_due;           ///< The contents of `info` have changed.
    bool online;             ///< Last published availability.
    bool logged_behind;      ///< The log contains that the disk accepts nothing.
    size_t logged_waiting;   ///< Waiting events in the last `info`.
    uint64_t logged_dropped; ///< Dropped events in the last log line.
    char condition[128];     ///< Part of a state whose change is sent immediately.
    char state[IWC_LINE_MAX + 1U];
    size_t state_length; ///< 0: unknown.
    uint64_t heard_us;   ///< Time of the receipt of `state`.
    mqtt_stop_t stop;    ///< Last stop that the gateway reported.
    char payload[MQTT_PAYLOAD_SIZE];
    mqtt_inflight_t inflight[MQTT_INFLIGHT_MAX];
    size_t inflights;
    mqtt_refusals_t refusals;
} mqtt_bridge_t;

/// Returns 0, or an exit code of sysexits with a line on stderr. Connects to nothing yet.
int mqtt_bridge_open(mqtt_bridge_t *self, const mqtt_settings_t *settings);

/// Checks what `open` needs, and writes nothing. Returns the same as `open`.
int mqtt_bridge_check(const mqtt_settings_t *settings);

/// Does all work that is due. Returns 0, or an exit code.
int mqtt_bridge_step(mqtt_bridge_t *self, uint64_t now_us);

/// Returns the time in milliseconds until `step` has work without input.
int mqtt_bridge_wait_ms(const mqtt_bridge_t *self);

/// Stops the wheels if the bridge drives them, and disconnects. Returns false if the caller must end by _exit().
bool mqtt_bridge_close(mqtt_bridge_t *self);

// ---- between its parts --------------------------------------------------------------------------------------------

/// Publishes `length` bytes of `payload`. Returns the same as `mqtt_broker_send`. 0 bytes: it did not fit (MQTT_NEVER).
int mqtt_bridge_publish(mqtt_bridge_t *self, const char *what, const char *name, size_t length, mqtt_way_t way);

/// Publishes the sensors of Home Assistant, if enabled. The second function runs once a second and reports sensors that
/// did not return in time.
void mqtt_sensors_send(mqtt_bridge_t *self);
void mqtt_sensors_poll(mqtt_bridge_t *self);

/// Handles a message that is not a command: a sensor of Home Assistant that this bridge published and the broker
/// returned.
void mqtt_sensors_take(mqtt_bridge_t *self, const struct mosquitto_message *message);

/// Handles a message of a subscribed topic. `context` is the bridge.
void mqtt_bridge_command(void *context, const struct mosquitto_message *message, const mqtt_labels_t *labels);

/// Publishes `length` bytes of `payload` to any topic.
int mqtt_bridge_publish_to(mqtt_bridge_t *self, const char *topic, size_t length, mqtt_way_t way);

/// Sends the events of the spool that the broker does not have yet.
void mqtt_events_send(mqtt_bridge_t *self);

/// Begin: a connection is up, and all messages before the events are sent. Lost: it has ended. Poll, once a second:
/// reports refusals, and tries again the events that are set aside.
void mqtt_events_begin(mqtt_bridge_t *self);
void mqtt_events_lost(mqtt_bridge_t *self);
void mqtt_events_poll(mqtt_bridge_t *self);

/// The broker has confirmed a message, or does not accept it. `context` is the bridge.
void mqtt_events_sent(void *context, int message);
void mqtt_events_refused(void *context, int message, const char *why);

/// Sends `stop` once, only if a person holds the lease through this bridge.
void mqtt_bridge_stop_if_ours(mqtt_bridge_t *self);

/// Writes the newest state of the gateway. Returns false if the gateway is away, or has sent none for MQTT_HUNG_US.
bool mqtt_bridge_state(const mqtt_bridge_t *self, iwc_message_t *out_state);

#endif
