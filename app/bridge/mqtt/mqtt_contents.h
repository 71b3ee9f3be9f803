// SPDX-License-Identifier: MIT
/// Writes the published messages: JSON of the gateway with a few members before it, and reports of the bridge itself.
/// Pure.
///
/// All functions write into a buffer of the caller and return the length. 0: it did not fit, and must not be used.
#ifndef MQTT_CONTENTS_H
#define MQTT_CONTENTS_H

#include "mqtt_command.h"
#include "mqtt_settings.h"

#include "iwheel_client/client.h"
#include "iwheel_northbound/why.h"

/// Largest message: the longest line of the gateway, with the members before it.
#define MQTT_PAYLOAD_SIZE (IWC_LINE_MAX + 512U)
#define MQTT_TOPIC_SIZE   128U

typedef struct {
    char *data;
    size_t size;
} mqtt_buffer_t;

/// Writes `iwheel/ID/WHAT`, with `/NAME` unless that is NULL.
void mqtt_topic(const char *id, const char *what, const char *name, char out[MQTT_TOPIC_SIZE]);

/// Returns the verb in the topic of a command to this machine; NULL if it is another topic.
const char *mqtt_topic_verb(const char *id, const char *topic);

/// Writes the state of the gateway, with `boot` before its members, so that a command can quote it and its `t_us`.
size_t mqtt_write_state(const char *boot, const iwc_message_t *state, mqtt_buffer_t out);

/// Writes an event: `id` (`boot` and the number), by which a reader recognises duplicates; `boot`; and the wall clock
/// of its receipt by the bridge.
size_t mqtt_write_event(const char *boot, uint64_t number, int64_t wall_us, const iwc_message_t *event,
                        mqtt_buffer_t out);

/// Writes the reply to `why` as the event `stop`, for a stop that happened while the bridge was away. Frames are
/// omitted.
size_t mqtt_write_missed_stop(const char *boot, uint64_t number, int64_t wall_us, const iwc_message_t *why,
                              mqtt_buffer_t out);

/// Writes the answer to a command: the command, `boot`, the current `t_us`, and the reply of the gateway. Without a
/// reply (NULL) it states whether the command was accepted, and otherwise why not. `order->key` of an `arm`, unless
/// empty, is added if the reply has no key.
size_t mqtt_write_answer(const char *boot, uint64_t gateway_us, const mqtt_order_t *order, const iwc_message_t *reply,
                         mqtt_buffer_t out);

/// Last stop of a machine in `info`, for clients that missed its event.
typedef struct {
    int64_t number; ///< 0: this run of the bridge knows none.
    int64_t wall_us;
    char cause[32];
    char sentence[IWN_SENTENCE_SIZE];
} mqtt_stop_t;

/// Contents of the retained `info` of the bridge and its machine. `state`: the newest one; NULL: the gateway is away.
typedef struct {
    const char *boot;
    const mqtt_settings_t *settings;
    const iwc_message_t *state;
    const uint64_t *counts; ///< Commands, by mqtt_verdict_t.
    uint64_t spooled;       ///< Events that wait.
    uint64_t dropped;       ///< Events that were dropped since the start.
    uint64_t last;          ///< Number of the newest event.
    uint64_t aside;         ///< Waiting events that are set aside, because the broker does not accept them.
    bool on_disk;           ///< Waiting events are on the disk.
    uint64_t unsent;        ///< Messages that were not sent, because the broker did not read.
    size_t sensors;         ///< Sensors of Home Assistant that were sent; 0: disabled.
    size_t sensors_seen;    ///< Sensors that the broker returned.
    uint64_t name_taken;    ///< Connections that another client with the same name at the broker has ended.
    uint64_t refused;       ///< Messages that the broker did not accept.
    const char *refusal;    ///< Topic and reason of the last one; NULL or empty: none.
    const mqtt_stop_t *stop;
} mqtt_info_t;

size_t mqtt_write_info(const mqtt_info_t *info, mqtt_buffer_t out);

/// Writes the topic filter of all sensors of this machine.
void mqtt_sensor_topics(const mqtt_settings_t *settings, char out[MQTT_TOPIC_SIZE]);

/// Writes one sensor for Home Assistant. Returns false if there is no such number. An unknown value stays unknown
/// there.
bool mqtt_write_sensor(const mqtt_settings_t *settings, size_t number, char out_topic[MQTT_TOPIC_SIZE],
                       mqtt_buffer_t out);

#endif
