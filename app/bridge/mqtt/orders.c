// SPDX-License-Identifier: MIT
// Commands to the bridge: judges them, asks the gateway, and sends the answers.
#include "mqtt_bridge.h"

#include "iwheel_northbound/json_out.h"

#include <string.h>

/// Expiry of an answer: no client waits longer.
#define ANSWER_S 10U

/// Request to the gateway, and its sender.
typedef struct {
    mqtt_bridge_t *bridge;
    mqtt_order_t order;
    bool used;
} waiting_t;

/// Kinds of requests. Each kind has its own places, so that questions cannot use up the places of stops or of the
/// person who drives.
typedef enum { QUESTION, LEASE, STOP, KINDS } kind_t;
#define PLACES 64U

static waiting_t waiting[KINDS][PLACES];

static kind_t kind_of(mqtt_verb_t verb) {
    if (verb == MQTT_STOP || verb == MQTT_ESTOP) {
        return STOP;
    }
    return (verb == MQTT_ARM || verb == MQTT_DRIVE || verb == MQTT_TWIST) ? LEASE : QUESTION;
}

/// Returns a free place; NULL if all places of the kind are in use.
static waiting_t *place_for(mqtt_bridge_t *self, const mqtt_order_t *order) {
    waiting_t *places = waiting[kind_of(order->verb)];
    for (size_t i = 0; i < PLACES; i++) {
        if (!places[i].used) {
            places[i] = (waiting_t){self, *order, true};
            return &places[i];
        }
    }
    return NULL;
}

static void answer(mqtt_bridge_t *self, const mqtt_order_t *order, const iwc_message_t *reply) {
    const mqtt_way_t way = {.labels = {.expiry_s = ANSWER_S,
                                       .correlation = (order->correlation_length > 0U) ? order->correlation : NULL,
                                       .correlation_length = order->correlation_length}};
    if (order->to[0] != '\0') {
        const uint64_t gateway_us = self->now_us + (uint64_t)bridge_link_ahead_us(&self->link, self->now_us);
        const size_t length = mqtt_write_answer(self->boot, gateway_us, order, reply,
                                                (mqtt_buffer_t){self->payload, sizeof self->payload});
        (void)mqtt_bridge_publish(self, "reply", order->to, length, way);
    }
}

/// Sends a refusal in the form of a gateway reply.
static void decline(mqtt_bridge_t *self, const mqtt_order_t *order, const char *error, const char *message) {
    char text[512];
    iwn_out_t out;
    iwn_out_init(&out, text, sizeof text);
    iwn_out_open(&out, NULL, '{');
    iwn_out_int(&out, "id", 0);
    iwn_out_bool(&out, "ok", false);
    iwn_out_text(&out, "error", error);
    iwn_out_text(&out, "message", message);
    iwn_out_close(&out, '}');
    const size_t length = iwn_out_finish(&out);
    answer(self, order, &(iwc_message_t){.text = text, .length = (length > 0U) ? length - 1U : 0U});
}

static void not_delivered(mqtt_bridge_t *self, const mqtt_order_t *order) {
    decline(self, order, "not_delivered",
            "NOT DELIVERED: the gateway does not answer; check that it runs: systemctl status iwheel-gateway");
}

static void take_answer(void *context, const iwc_message_t *reply) {
    waiting_t *self = context;
    mqtt_bridge_t *bridge = self->bridge;
    self->used = false;
    if (reply == NULL && self->order.verb == MQTT_ARM && bridge->link.state == BRIDGE_LINK_HERE) {
        decline(bridge, &self->order, "stale_command",
                "the wheels were stopped meanwhile, or the gateway did not answer; arm again");
        return;
    }
    if (reply == NULL) {
        not_delivered(bridge, &self->order);
        return;
    }
    if (self->order.verb == MQTT_ARM && iwc_truth(reply, "ok").value == 1) {
        const char *key = bridge_lease_key(&bridge->lease);
        (void)snprintf(self->order.key, sizeof self->order.key, "%s", (key != NULL) ? key : "");
        bridge->silent_us = bridge->now_us + MQTT_FIRST_US;
    }
    // A stop without JSON is garbled and yet sent on. What the gateway refuses (a board that is gone) is not executed.
    const bool passes = self->order.verdict == MQTT_TAKEN || iwc_truth(reply, "ok").value != 1;
    answer(bridge, &self->order, passes ? reply : NULL);
}

static void ask(mqtt_bridge_t *self, const mqtt_order_t *order) {
    waiting_t *place = place_for(self, order);
    if (place == NULL && kind_of(order->verb) != STOP) {
        decline(self, order, "busy", "too many requests wait for the gateway; send it again later");
        return;
    }
    // A stop without a place gets no answer, but is delivered.
    if (!bridge_link_ask(&self->link, order->request, (place != NULL) ? take_answer : NULL, place, self->now_us)) {
        if (place != NULL) {
            place->used = false;
        }
        not_delivered(self, order);
    }
}

/// Returns the sender of a nonzero command, whose next command would move the wheels as soon as they are armed; NULL if
/// there is none.
static const char *mover(const mqtt_bridge_t *self, const mqtt_order_t *order) {
    iwc_message_t state;
    const char *holder = bridge_lease_name(&self->lease);
    // While another person drives, the gateway refuses the arm as busy and names that person.
    const char *except =
        (order->verb == MQTT_ARM && holder != NULL && strcmp(holder, order->from) != 0) ? holder : NULL;
    const int64_t lease_ms = mqtt_bridge_state(self, &state) ? iwc_integer(&state, "lease.lease_ms").value : 0;
    return bridge_movers_who(&self->movers, except, (uint32_t)lease_ms, self->now_us);
}

static void refuse_mover(mqtt_bridge_t *self, const mqtt_order_t *order, const char *who) {
    char message[160];
    (void)snprintf(
        message, sizeof message,
        "mqtt %s sends a nonzero command: the wheels would move; let go of the stick, wait half a second and "
        "send it again",
        who);
    decline(self, order, "stale_command", message);
}

static bridge_lease_result_t ask_lease(mqtt_bridge_t *self, const mqtt_order_t *order) {
    waiting_t *place = place_for(self, order);
    const bridge_asker_t asker = {take_answer, place};
    if (place == NULL) {
        return BRIDGE_LEASE_FULL;
    }
    const bridge_lease_result_t result =
        (order->verb == MQTT_ARM) ? bridge_lease_arm(&self->lease, order->from, order->request, asker, self->now_us)
                                  : bridge_lease_drive(&self->lease, order->key, order->request, asker, self->now_us);
    if (result != BRIDGE_LEASE_OK) {
        place->used = false;
    }
    return result;
}

static void arm(mqtt_bridge_t *self, const mqtt_order_t *order) {
    const bridge_lease_result_t result = ask_lease(self, order);
    if (result == BRIDGE_LEASE_AWAY) {
        not_delivered(self, order);
    } else if (result != BRIDGE_LEASE_OK) {
        decline(self, order, "busy", "another person requests the lease at this moment; arm again");
    }
}

static void drive(mqtt_bridge_t *self, const mqtt_order_t *order) {
    const bridge_lease_result_t result = ask_lease(self, order);
    if (result == BRIDGE_LEASE_OK) {
        self->silent_us = self->now_us + MQTT_SILENT_US;
    } else if (result == BRIDGE_LEASE_WRONG) {
        decline(self, order, "not_holder",
                "its key is not that of the lease: it has not armed, was stopped, or another person drives; arm, and "
                "send the key of the reply");
    } else {
        not_delivered(self, order);
    }
}

static void carry_out(mqtt_bridge_t *self, const mqtt_order_t *order) {
    const bool permits = order->verb == MQTT_ARM || order->verb == MQTT_RESET;
    const char *who = permits ? mover(self, order) : NULL;
    if (who != NULL) {
        refuse_mover(self, order, who);
    } else if (order->verb == MQTT_ARM) {
        arm(self, order);
    } else if (order->verb == MQTT_DRIVE || order->verb == MQTT_TWIST) {
        drive(self, order);
    } else {
        if (kind_of(order->verb) == STOP) {
            bridge_lease_end(&self->lease, self->now_us); // A later command of the former holder is refused.
        }
        ask(self, order);
    }
}

void mqtt_bridge_command(void *context, const struct mosquitto_message *message, const mqtt_labels_t *labels) {
    mqtt_bridge_t *self = context;
    static mqtt_order_t order;
    char replies[MQTT_TOPIC_SIZE];
    const mqtt_rules_t rules = {self->boot,
                                self->settings->drive.ttl_ms,
                                self->settings->drive.enabled,
                                self->settings->drive.allow_reset,
                                replies,
                                bridge_link_ahead_us(&self->link, self->now_us)};
    mqtt_topic(self->settings->machine.id, "reply", "", replies);
    const char *verb = mqtt_topic_verb(self->settings->machine.id, message->topic);
    if (verb == NULL) {
        mqtt_sensors_take(self, message);
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
    if (order.moves) {
        bridge_movers_note(&self->movers, order.from, self->now_us);
    }
    if (order.request[0] == '\0' || order.verb == MQTT_HELLO) {
        answer(self, &order, NULL);
        return;
    }
    carry_out(self, &order);
}

void mqtt_bridge_stop_if_ours(mqtt_bridge_t *self) {
    if (bridge_lease_key(&self->lease) != NULL) {
        bridge_lease_end(&self->lease, self->now_us);
        (void)bridge_link_ask(&self->link, "{\"cmd\":\"stop\"}", NULL, NULL, self->now_us);
    }
}
