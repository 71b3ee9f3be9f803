// SPDX-License-Identifier: MIT
/// What is published: the gateway's JSON with a few members before its own, and what the bridge says of itself. Pure.
///
/// All lines go into a buffer of the caller's. 0: it did not fit, and must not be used.
#ifndef MQTT_TELL_H
#define MQTT_TELL_H

#include "mqtt_command.h"
#include "mqtt_settings.h"

#include "iwheel_client/client.h"

/// Longest message: the gateway's longest line and what is put before it.
#define MQTT_PAYLOAD_SIZE (IWC_LINE_MAX + 512U)
#define MQTT_TOPIC_SIZE   128U

typedef struct {
    char *data;
    size_t size;
} mqtt_buffer_t;

/// `iwheel/ID/WHAT`, with `/NAME` unless that is NULL.
void mqtt_topic(const char *id, const char *what, const char *name, char out[MQTT_TOPIC_SIZE]);

/// The verb in the topic of a command to this machine; NULL: it is none.
const char *mqtt_topic_verb(const char *id, const char *topic);

/// The gateway's message, with `boot` before its own members, so that a command can quote it and its `t_us`.
size_t mqtt_tell_state(const char *boot, const iwc_message_t *state, mqtt_buffer_t out);

/// An event: `id`, which is `boot` and the number, by which a reader knows doubles; `boot`; and the wall clock when the bridge heard it.
size_t mqtt_tell_event(const char *boot, uint64_t number, int64_t wall_us, const iwc_message_t *event,
                       mqtt_buffer_t out);

/// The reply to `why` as the event `stop`: for one that happened while the bridge was not there. Frames are left out.
size_t mqtt_tell_missed_stop(const char *boot, uint64_t number, int64_t wall_us, const iwc_message_t *why,
                             mqtt_buffer_t out);

/// The answer to a command: to which, `boot`, `t_us` now, and the gateway's reply; without one (NULL) whether it was taken, and why not.
/// `order->key` of an `arm`, unless it is empty, is added to a reply that has none.
size_t mqtt_tell_answer(const char *boot, uint64_t now_us, const mqtt_order_t *order, const iwc_message_t *reply,
                        mqtt_buffer_t out);

/// What a machine says of its last stop in `info`, for who was not listening then.
typedef struct {
    int64_t number; ///< 0: none that this run of the bridge knows of.
    int64_t wall_us;
    char cause[32];
    char sentence[256];
} mqtt_stop_t;

/// What is retained of the bridge and its machine. `state`: the newest; NULL: the gateway is away.
typedef struct {
    const char *boot;
    const mqtt_settings_t *settings;
    const iwc_message_t *state;
    const uint64_t *counts; ///< Of commands, by mqtt_verdict_t.
    uint64_t spooled;       ///< Events that wait,
    uint64_t dropped;       ///< that were dropped since the start,
    uint64_t last;          ///< number of the newest,
    uint64_t aside;         ///< of those that wait, set aside because the broker does not accept them,
    bool on_disk;           ///< and whether those that wait are on the disk.
    uint64_t unsent;        ///< Messages left out because the broker did not read.
    size_t sensors;         ///< Of Home Assistant, that were sent; 0: it is switched off,
    size_t sensors_seen;    ///< and that the broker passed on.
    uint64_t name_taken;    ///< Connections that another client with the same name at the broker has ended.
    uint64_t refused;       ///< Messages that the broker did not accept,
    const char *refusal;    ///< and topic and reason of the last; NULL or empty: none.
    const mqtt_stop_t *stop;
} mqtt_info_t;

size_t mqtt_tell_info(const mqtt_info_t *info, mqtt_buffer_t out);

/// Where all sensors of this machine are, as a subscription.
void mqtt_sensor_topics(const mqtt_settings_t *settings, char out[MQTT_TOPIC_SIZE]);

/// One sensor for Home Assistant. False: there is no such number. An unknown value stays unknown there.
bool mqtt_tell_sensor(const mqtt_settings_t *settings, size_t number, char out_topic[MQTT_TOPIC_SIZE],
                      mqtt_buffer_t out);

#endif
