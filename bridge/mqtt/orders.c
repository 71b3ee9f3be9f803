// SPDX-License-Identifier: MIT
// Commands of the bridge: judged, asked of the gateway, answered.
#include "bridge.h"

#include <string.h>

/// Nobody waits longer for an answer.
#define ANSWER_S 10U

/// What was asked of the gateway, and for whom.
typedef struct {
    mqtt_bridge_t *bridge;
    mqtt_order_t order;
    bool used;
} waiting_t;

static waiting_t waiting[BRIDGE_ASKED_MAX];

static void answer(mqtt_bridge_t *self, const mqtt_order_t *order, const iwc_message_t *reply) {
    const mqtt_way_t way = {.labels = {.expiry_s = ANSWER_S,
                                       .correlation = (order->correlation_length > 0U) ? order->correlation : NULL,
                                       .correlation_length = order->correlation_length}};
    if (order->to[0] != '\0') {
        const size_t length = mqtt_tell_answer(self->boot, self->now_us, order, reply,
                                               (mqtt_buffer_t){self->payload, sizeof self->payload});
        (void)mqtt_bridge_publish(self, "reply", order->to, length, way);
    }
}

static void refuse(mqtt_bridge_t *self, mqtt_order_t *order, mqtt_verdict_t verdict, const char *why) {
    self->judge.counts[MQTT_TAKEN]--;
    self->judge.counts[verdict]++;
    order->verdict = verdict;
    (void)snprintf(order->why, sizeof order->why, "%s", why);
    answer(self, order, NULL);
}

static void not_delivered(mqtt_bridge_t *self, mqtt_order_t *order) {
    static const char gone[] = "{\"id\":0,\"ok\":false,\"error\":\"not_delivered\",\"message\":\"NOT DELIVERED: the "
                               "gateway does not answer; see that it runs: systemctl status iwheel-gateway\"}";
    const iwc_message_t reply = {.text = gone, .length = sizeof gone - 1U};
    answer(self, order, &reply);
}

static void take_answer(void *context, const iwc_message_t *reply) {
    waiting_t *self = context;
    mqtt_bridge_t *bridge = self->bridge;
    self->used = false;
    if (reply == NULL) {
        not_delivered(bridge, &self->order);
        return;
    }
    if (self->order.verb == MQTT_ARM && iwc_truth(reply, "ok").value == 1) {
        memcpy(bridge->driver, self->order.from, sizeof bridge->driver);
        bridge->silent_us = bridge->now_us + MQTT_FIRST_US;
    }
    answer(bridge, &self->order, reply);
}

static void ask(mqtt_bridge_t *self, mqtt_order_t *order) {
    for (size_t i = 0; i < BRIDGE_ASKED_MAX; i++) {
        if (waiting[i].used) {
            continue;
        }
        waiting[i] = (waiting_t){self, *order, true};
        if (!bridge_link_ask(&self->link, order->request, take_answer, &waiting[i], self->now_us)) {
            waiting[i].used = false;
            break;
        }
        return;
    }
    not_delivered(self, order);
}

void mqtt_bridge_command(void *context, const struct mosquitto_message *message, const mqtt_labels_t *labels) {
    mqtt_bridge_t *self = context;
    static mqtt_order_t order;
    char replies[MQTT_TOPIC_SIZE];
    const mqtt_rules_t rules = {self->boot, self->settings->drive.ttl_ms, self->settings->drive.enabled,
                                self->settings->drive.allow_reset, replies};
    mqtt_topic(self->settings->machine.id, "reply", "", replies);
    const char *verb = mqtt_topic_verb(self->settings->machine.id, message->topic);
    if (verb == NULL) {
        mqtt_bridge_sensor(self, message);
        return;
    }
    const mqtt_command_t command = {.verb = verb,
                                    .payload = message->payload,
                                    .length = (size_t)message->payloadlen,
                                    .retained = message->retain,
                                    .answer_to = labels->answer_to,
                                    .correlation = labels->correlation,
                                    .correlation_length = labels->correlation_length};
    mqtt_judge(&self->judge, &rules, &command, self->now_us, &order);
    self->info_due = self->info_due || order.verdict != MQTT_TAKEN;
    if (order.verdict != MQTT_TAKEN || order.verb == MQTT_HELLO) {
        answer(self, &order, NULL);
        return;
    }
    const bool drives = order.verb == MQTT_DRIVE || order.verb == MQTT_TWIST;
    if (drives && strcmp(self->driver, order.from) != 0) {
        refuse(self, &order, MQTT_DENIED, "it has not armed, or was stopped; arm first");
        return;
    }
    if (drives) {
        self->silent_us = self->now_us + MQTT_SILENT_US;
    } else if (order.verb == MQTT_STOP || order.verb == MQTT_ESTOP) {
        self->driver[0] = '\0'; // What still comes of who drove is too late.
    }
    ask(self, &order);
}

void mqtt_bridge_stop_if_ours(mqtt_bridge_t *self) {
    if (self->driver[0] != '\0') {
        self->driver[0] = '\0';
        (void)bridge_link_ask(&self->link, "{\"cmd\":\"stop\"}", NULL, NULL, self->now_us);
    }
}
