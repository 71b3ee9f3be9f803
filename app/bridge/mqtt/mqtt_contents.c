// SPDX-License-Identifier: MIT
#include "mqtt_contents.h"

#include "iwheel_northbound/json_out.h"

#include <inttypes.h>
#include <stdio.h>
#include <string.h>

void mqtt_topic(const char *id, const char *what, const char *name, char out[MQTT_TOPIC_SIZE]) {
    (void)snprintf(out, MQTT_TOPIC_SIZE, "iwheel/%s/%s%s%s", id, what, (name != NULL) ? "/" : "",
                   (name != NULL) ? name : "");
}

const char *mqtt_topic_verb(const char *id, const char *topic) {
    char begin[MQTT_TOPIC_SIZE];
    mqtt_topic(id, "cmd", "", begin);
    const size_t length = strlen(begin);
    return (strncmp(topic, begin, length) == 0) ? topic + length : NULL;
}

/// Joins the open object of the bridge and the members of the object `text` without its first `skip` bytes.
static size_t join(iwn_out_t *out, mqtt_buffer_t buffer, const char *text, size_t length, size_t skip) {
    const bool empty = length <= skip + 1U;
    const size_t begun = out->length;
    if (out->overflow || begun + length + 2U > buffer.size) {
        return 0;
    }
    buffer.data[begun] = empty ? '}' : ',';
    if (empty) {
        return begun + 1U;
    }
    memcpy(buffer.data + begun + 1U, text + skip, length - skip);
    return begun + 1U + length - skip;
}

static iwn_out_t begin(mqtt_buffer_t buffer) {
    iwn_out_t out;
    iwn_out_init(&out, buffer.data, buffer.size);
    iwn_out_open(&out, NULL, '{');
    return out;
}

/// Closes the object. Returns its length without a newline.
static size_t end(iwn_out_t *out) {
    iwn_out_close(out, '}');
    const size_t length = iwn_out_finish(out);
    return (length > 0U) ? length - 1U : 0U;
}

size_t mqtt_write_state(const char *boot, const iwc_message_t *state, mqtt_buffer_t buffer) {
    iwn_out_t out = begin(buffer);
    iwn_out_text(&out, "boot", boot);
    return join(&out, buffer, state->text, state->length, 1);
}

static iwn_out_t begin_event(const char *boot, uint64_t number, int64_t wall_us, mqtt_buffer_t buffer) {
    char id[40];
    iwn_out_t out = begin(buffer);
    (void)snprintf(id, sizeof id, "%s-%" PRIu64, boot, number);
    iwn_out_text(&out, "id", id);
    iwn_out_text(&out, "boot", boot);
    iwn_out_int(&out, "heard_wall_us", wall_us);
    return out;
}

size_t mqtt_write_event(const char *boot, uint64_t number, int64_t wall_us, const iwc_message_t *event,
                        mqtt_buffer_t buffer) {
    iwn_out_t out = begin_event(boot, number, wall_us, buffer);
    return join(&out, buffer, event->text, event->length, 1);
}

static void copy(const iwc_message_t *message, const char *path, const char *name, iwn_out_t *out) {
    size_t length = 0;
    const char *text = iwc_json(message, path, &length);
    if (text != NULL) {
        iwn_out_span(out, iwn_span(name), (iwn_span_t){text, length});
    } else {
        iwn_out_null(out, name);
    }
}

size_t mqtt_write_missed_stop(const char *boot, uint64_t number, int64_t wall_us, const iwc_message_t *why,
                              mqtt_buffer_t buffer) {
    static const char *const fields[] = {"number",
                                         "cause",
                                         "side",
                                         "detail",
                                         "from",
                                         "latched",
                                         "client",
                                         "client_name",
                                         "applied_left_mm_s",
                                         "applied_right_mm_s",
                                         "at_us",
                                         "wall_us",
                                         "age_ms",
                                         "sentence",
                                         "recording"};
    iwn_out_t out = begin_event(boot, number, wall_us, buffer);
    iwn_out_text(&out, "event", "stop");
    iwn_out_bool(&out, "missed", true);
    copy(why, "at_us", "t_us", &out);
    for (size_t i = 0; i < sizeof fields / sizeof fields[0]; i++) {
        copy(why, fields[i], fields[i], &out);
    }
    return end(&out);
}

size_t mqtt_write_answer(const char *boot, uint64_t gateway_us, const mqtt_order_t *order, const iwc_message_t *reply,
                         mqtt_buffer_t buffer) {
    iwn_out_t out = begin(buffer);
    iwn_out_text(&out, "boot", boot);
    iwn_out_int(&out, "t_us", (int64_t)gateway_us);
    iwn_out_text(&out, "cmd", mqtt_verb_word(order->verb));
    iwn_out_known(&out, "seq", order->seq > 0, order->seq);
    if (order->verb == MQTT_ARM && order->key[0] != '\0' && iwc_json(reply, "key", &(size_t){0}) == NULL) {
        iwn_out_text(&out, "key", order->key);
    }
    const char *comma = (reply != NULL) ? memchr(reply->text, ',', reply->length) : NULL;
    if (comma != NULL) { // After the id, which has no use for other clients.
        return join(&out, buffer, reply->text, reply->length, (size_t)(comma - reply->text) + 1U);
    }
    iwn_out_bool(&out, "ok", order->verdict == MQTT_TAKEN);
    if (order->verdict != MQTT_TAKEN) {
        iwn_out_text(&out, "error", mqtt_verdict_word(order->verdict));
        iwn_out_text(&out, "message", order->why);
    }
    return end(&out);
}

static void write_counts(const mqtt_info_t *info, iwn_out_t *out) {
    iwn_out_open(out, "commands", '{');
    for (unsigned i = 0; i < (unsigned)MQTT_VERDICTS; i++) {
        iwn_out_int(out, mqtt_verdict_word((mqtt_verdict_t)i), (int64_t)info->counts[i]);
    }
    iwn_out_close(out, '}');
    iwn_out_open(out, "events", '{');
    iwn_out_int(out, "waiting", (int64_t)info->spooled);
    iwn_out_int(out, "dropped", (int64_t)info->dropped);
    iwn_out_int(out, "last", (int64_t)info->last);
    iwn_out_int(out, "aside", (int64_t)info->aside);
    iwn_out_bool(out, "on_disk", info->on_disk);
    iwn_out_int(out, "unsent", (int64_t)info->unsent);
    iwn_out_int(out, "refused", (int64_t)info->refused);
    iwn_out_text(out, "refusal", (info->refusal != NULL && info->refusal[0] != '\0') ? info->refusal : NULL);
    iwn_out_close(out, '}');
    iwn_out_int(out, "name_taken", (int64_t)info->name_taken);
    if (info->sensors > 0U) {
        iwn_out_open(out, "home_assistant", '{');
        iwn_out_int(out, "sensors", (int64_t)info->sensors);
        iwn_out_int(out, "passed_on", (int64_t)info->sensors_seen);
        iwn_out_close(out, '}');
    }
}

static void write_stop(const mqtt_stop_t *stop, iwn_out_t *out) {
    if (stop->number <= 0) {
        iwn_out_null(out, "last_stop");
        return;
    }
    iwn_out_open(out, "last_stop", '{');
    iwn_out_int(out, "number", stop->number);
    iwn_out_text(out, "cause", stop->cause);
    iwn_out_known(out, "wall_us", stop->wall_us > 0, stop->wall_us);
    iwn_out_text(out, "sentence", stop->sentence);
    iwn_out_close(out, '}');
}

size_t mqtt_write_info(const mqtt_info_t *info, mqtt_buffer_t buffer) {
    static const iwc_message_t nothing = {.text = "{}", .length = 2};
    const iwc_message_t *state = (info->state != NULL) ? info->state : &nothing;
    const mqtt_settings_t *settings = info->settings;
    iwn_out_t out = begin(buffer);
    iwn_out_text(&out, "boot", info->boot);
    iwn_out_text(&out, "machine", settings->machine.id);
    iwn_out_text(&out, "bridge_version", IWHEEL_VERSION);
    iwn_out_text(&out, "gateway", (info->state != NULL) ? "connected" : "away");
    copy(state, "version", "version", &out);
    iwn_out_int(&out, "state_every_ms", settings->state.every_ms);
    iwn_out_bool(&out, "may_drive", settings->drive.enabled);
    iwn_out_bool(&out, "may_reset", settings->drive.allow_reset);
    iwn_out_int(&out, "drive_ttl_ms", settings->drive.ttl_ms);
    copy(state, "lease.lease_ms", "lease_ms", &out);
    copy(state, "budget", "budget", &out);
    copy(state, "listen_only", "listen_only", &out);
    copy(state, "warnings", "warnings", &out);
    write_counts(info, &out);
    write_stop(info->stop, &out);
    return end(&out);
}

typedef struct {
    const char *kind; ///< sensor or binary_sensor
    const char *key;
    const char *name;
    const char *value; ///< Jinja expression over value_json.
    const char *unit;
    const char *class;
} sensor_t;

static const sensor_t sensors[] = {
    {"sensor", "state", "State", "value_json.state", NULL, NULL},
    {"sensor", "cause", "Stopped by", "value_json.cause or 'nothing'", NULL, NULL},
    // None is unknown in Home Assistant: without an estop line the state of a button is unknown. A line that cannot be
    // read counts as pressed.
    {"binary_sensor", "estop", "Emergency stop pressed",
     "None if value_json.estop.state == 'none' else 'OFF' if value_json.estop.state == 'released' else 'ON'", NULL,
     "problem"},
    {"binary_sensor", "rolling", "Rolls without command", "'ON' if value_json.rolling else 'OFF'", NULL, "safety"},
    {"binary_sensor", "bus", "Bus down", "'OFF' if value_json.bus.state in ['active', 'passive'] else 'ON'", NULL,
     "problem"},
    {"sensor", "battery_left", "Battery left",
     "value_json.left.battery_dV / 10 if value_json.left.battery_dV is number else None", "V", "voltage"},
    {"sensor", "battery_right", "Battery right",
     "value_json.right.battery_dV / 10 if value_json.right.battery_dV is number else None", "V", "voltage"},
    {"sensor", "temperature_left", "Temperature left", "value_json.left.temperature_degC",
     "\xC2\xB0"
     "C",
     "temperature"},
    {"sensor", "temperature_right", "Temperature right", "value_json.right.temperature_degC",
     "\xC2\xB0"
     "C",
     "temperature"},
    {"sensor", "distance_left", "Distance left",
     "value_json.left.distance_mm / 1000 if value_json.left.distance_mm is number else None", "m", "distance"},
    {"sensor", "distance_right", "Distance right",
     "value_json.right.distance_mm / 1000 if value_json.right.distance_mm is number else None", "m", "distance"},
};

void mqtt_sensor_topics(const mqtt_settings_t *settings, char out[MQTT_TOPIC_SIZE]) {
    (void)snprintf(out, MQTT_TOPIC_SIZE, "%s/+/iwheel_%s/+/config", settings->home_assistant.prefix,
                   settings->machine.id);
}

/// Returns the class of long-term statistics in Home Assistant: a distance is a total, the others are measurements.
static const char *state_class_of(const sensor_t *sensor) {
    if (sensor->unit == NULL) {
        return NULL;
    }
    return (sensor->class != NULL && strcmp(sensor->class, "distance") == 0) ? "total" : "measurement";
}

static void write_origin(iwn_out_t *out) {
    iwn_out_open(out, "origin", '{');
    iwn_out_text(out, "name", "iwheel-mqtt");
    iwn_out_text(out, "sw_version", IWHEEL_VERSION);
    iwn_out_close(out, '}');
}

static void write_device(const mqtt_settings_t *settings, iwn_out_t *out) {
    char text[64];
    iwn_out_open(out, "device", '{');
    iwn_out_open(out, "identifiers", '[');
    (void)snprintf(text, sizeof text, "iwheel_%s", settings->machine.id);
    iwn_out_text(out, NULL, text);
    iwn_out_close(out, ']');
    (void)snprintf(text, sizeof text, "iWheel %s", settings->machine.id);
    iwn_out_text(out, "name", text);
    iwn_out_text(out, "sw_version", IWHEEL_VERSION);
    iwn_out_close(out, '}');
}

bool mqtt_write_sensor(const mqtt_settings_t *settings, size_t number, char out_topic[MQTT_TOPIC_SIZE],
                       mqtt_buffer_t buffer) {
    char text[MQTT_TOPIC_SIZE + 32U];
    if (number >= sizeof sensors / sizeof sensors[0]) {
        return false;
    }
    const sensor_t *sensor = &sensors[number];
    iwn_out_t out = begin(buffer);
    (void)snprintf(out_topic, MQTT_TOPIC_SIZE, "%s/%s/iwheel_%s/%s/config", settings->home_assistant.prefix,
                   sensor->kind, settings->machine.id, sensor->key);
    iwn_out_text(&out, "name", sensor->name);
    (void)snprintf(text, sizeof text, "iwheel_%s_%s", settings->machine.id, sensor->key);
    iwn_out_text(&out, "unique_id", text);
    mqtt_topic(settings->machine.id, "state", NULL, text);
    iwn_out_text(&out, "state_topic", text);
    mqtt_topic(settings->machine.id, "availability", NULL, text);
    iwn_out_text(&out, "availability_topic", text);
    (void)snprintf(text, sizeof text, "{{ %s }}", sensor->value);
    iwn_out_text(&out, "value_template", text);
    if (sensor->unit != NULL) {
        iwn_out_text(&out, "unit_of_measurement", sensor->unit);
    }
    if (sensor->class != NULL) {
        iwn_out_text(&out, "device_class", sensor->class);
    }
    if (state_class_of(sensor) != NULL) {
        iwn_out_text(&out, "state_class", state_class_of(sensor));
    }
    write_origin(&out);
    write_device(settings, &out);
    if (end(&out) == 0U) {
        return false;
    }
    buffer.data[out.length - 1U] = '\0';
    return true;
}
