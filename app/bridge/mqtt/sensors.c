// SPDX-License-Identifier: MIT
// Publishes sensors for Home Assistant, and checks whether the broker returns them.
#include "mqtt_bridge.h"

#include <string.h>

/// Time in which all sensors must return from the broker.
#define SENSORS_US 5000000U

void mqtt_sensors_send(mqtt_bridge_t *self) {
    char topic[MQTT_TOPIC_SIZE];
    size_t i = 0;
    for (; self->settings->home_assistant.enabled &&
           mqtt_write_sensor(self->settings, i, topic, (mqtt_buffer_t){self->payload, sizeof self->payload});
         i++) {
        (void)mqtt_bridge_publish_to(self, topic, strlen(self->payload), (mqtt_way_t){.qos = 1, .retain = true});
    }
    self->sensors_sent = i;
    self->sensors_seen = 0;
    self->sensors_us = (i > 0U) ? self->now_us + SENSORS_US : 0U;
}

void mqtt_sensors_take(mqtt_bridge_t *self, const struct mosquitto_message *message) {
    char topic[MQTT_TOPIC_SIZE];
    for (size_t i = 0;
         i < self->sensors_sent &&
         mqtt_write_sensor(self->settings, i, topic, (mqtt_buffer_t){self->payload, sizeof self->payload});
         i++) {
        // A retained message is from an earlier time, when the broker may have had other rights.
        if (strcmp(topic, message->topic) == 0 && !message->retain) {
            self->sensors_seen |= UINT32_C(1) << i;
        }
    }
}

/// Reports sensors that did not return. With MQTT 3.1.1 a broker confirms a message that its rights forbid, and drops
/// it; only a returned message was accepted.
void mqtt_sensors_poll(mqtt_bridge_t *self) {
    const size_t seen = (size_t)__builtin_popcount(self->sensors_seen);
    if (self->sensors_us == 0U || self->now_us < self->sensors_us) {
        return;
    }
    self->sensors_us = 0;
    self->info_due = true;
    if (seen < self->sensors_sent) {
        (void)fprintf(
            stderr,
            "iwheel-mqtt: Home Assistant sensors that the broker forwarded: %zu of %zu; permit this user to write "
            "and read %s\n",
            seen, self->sensors_sent, self->sensors);
    }
}
