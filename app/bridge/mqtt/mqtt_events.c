// SPDX-License-Identifier: MIT
// Sends messages to the broker in order, and handles messages that the broker does not accept.
#include "mqtt_bridge.h"

#include <string.h>

#define ASIDE_FIRST_US   5000000U
#define ASIDE_LONGEST_US 3600000000U
/// Shortest interval of log lines about messages that were not accepted.
#define REFUSED_US 10000000U
/// After a loss, events wait up to this time for the answer to the messages before them.
#define PROOF_US 5000000U

static const mqtt_way_t once = {.qos = 1};

/// Counts a refusal. The next log line names an event, if there is one.
static void count_refusal(mqtt_bridge_t *self, const char *topic, const char *why, bool is_event) {
    mqtt_refusals_t *refusals = &self->refusals;
    if (is_event || !refusals->has_event) {
        (void)snprintf(refusals->last, sizeof refusals->last, "%s: %s", topic, why);
        refusals->has_event = is_event;
    }
    refusals->count++;
    self->info_due = true;
}

int mqtt_bridge_publish_to(mqtt_bridge_t *self, const char *topic, size_t length, mqtt_way_t way) {
    mqtt_refusals_t *refusals = &self->refusals;
    const int message = (length > 0U) ? mqtt_broker_send(&self->broker, topic, self->payload, length, way) : MQTT_NEVER;
    if (message == MQTT_NEVER) {
        count_refusal(self, topic, (length > 0U) ? self->broker.unfit : "longer than this bridge can send", false);
    } else if (message != MQTT_NOT_NOW && way.retain) {
        mqtt_note_t *note = &refusals->notes[refusals->note];
        refusals->note = (refusals->note + 1U) % MQTT_NOTES_MAX;
        note->message = message;
        (void)snprintf(note->topic, sizeof note->topic, "%s", topic);
    }
    return message;
}

int mqtt_bridge_publish(mqtt_bridge_t *self, const char *what, const char *name, size_t length, mqtt_way_t way) {
    char topic[MQTT_TOPIC_SIZE];
    mqtt_topic(self->settings->machine.id, what, name, topic);
    return mqtt_bridge_publish_to(self, topic, length, way);
}

/// Sets an event aside, so that it does not block later events. It waits until events that are set aside are tried
/// again.
static void set_aside(mqtt_bridge_t *self, uint64_t number) {
    if (self->spool.aside == 0U) {
        self->refusals.wait_us = ASIDE_FIRST_US;
        self->refusals.due_us = self->now_us + ASIDE_FIRST_US;
    }
    mqtt_spool_set_aside(&self->spool, number);
    self->info_due = true;
}

/// Finds the next event to send. Returns false if there is none.
static bool next_event(mqtt_bridge_t *self, mqtt_spool_event_t *out_event) {
    while (mqtt_spool_after(&self->spool, self->sent_number, out_event)) {
        if (!out_event->aside || self->refusals.tries) {
            return true;
        }
        self->sent_number = out_event->number;
    }
    return false;
}

/// Sends events that the broker does not have, a few at a time: the order is preserved, and events lost with the
/// connection are sent again. After a loss they are sent one by one, after the broker has answered the messages before
/// them. This shows which event ends the connection.
void mqtt_events_send(mqtt_bridge_t *self) {
    mqtt_spool_event_t event;
    char topic[MQTT_TOPIC_SIZE];
    const size_t most = self->refusals.careful ? 1U : MQTT_INFLIGHT_MAX;
    if (self->refusals.careful && !self->refusals.works && self->now_us - self->broker.up_us < PROOF_US) {
        return;
    }
    while (self->broker.state == MQTT_UP && self->inflights < most && next_event(self, &event)) {
        mqtt_topic(self->settings->machine.id, "event", event.name, topic);
        const int message = mqtt_broker_send(&self->broker, topic, event.payload, event.length, once);
        if (message == MQTT_NOT_NOW) {
            return;
        }
        self->sent_number = event.number;
        if (message != MQTT_NEVER) {
            self->inflight[self->inflights] = (mqtt_inflight_t){message, event.number, event.aside, MQTT_WAITS};
            self->inflights++;
        } else if (!event.aside) {
            count_refusal(self, topic, self->broker.unfit, true);
            set_aside(self, event.number);
        }
    }
}

/// Begins or ends the try of events that are set aside. While nothing is under way, all waiting events up to the newest
/// sent one are set aside.
static void try_aside(mqtt_bridge_t *self) {
    mqtt_refusals_t *refusals = &self->refusals;
    mqtt_spool_event_t event;
    if (self->broker.state != MQTT_UP || self->inflights > 0U) {
        return;
    }
    if (refusals->tries && !next_event(self, &event)) {
        refusals->tries = false;
        refusals->due_us = self->now_us + refusals->wait_us;
        refusals->wait_us = (refusals->wait_us < ASIDE_LONGEST_US / 2U) ? refusals->wait_us * 2U : ASIDE_LONGEST_US;
    } else if (self->spool.aside > 0U && !refusals->tries && self->now_us >= refusals->due_us) {
        refusals->tries = true;
        self->sent_number = 0;
        mqtt_events_send(self);
    }
}

/// Settles from the oldest on, so that a restart of the process sends again the events that were under way, in order.
static void settle_events(mqtt_bridge_t *self) {
    while (self->inflights > 0U && self->inflight[0].fate != MQTT_WAITS) {
        const mqtt_inflight_t oldest = self->inflight[0];
        self->inflights--;
        memmove(self->inflight, self->inflight + 1, self->inflights * sizeof self->inflight[0]);
        if (oldest.fate == MQTT_REFUSED) {
            set_aside(self, oldest.number);
            continue;
        }
        self->refusals.losses = 0;
        self->refusals.careful = false;
        if (oldest.aside) {
            mqtt_spool_confirm_aside(&self->spool, oldest.number);
        } else {
            mqtt_spool_confirm(&self->spool, oldest.number);
        }
    }
    self->info_due = self->info_due || (self->logged_waiting > 0U && self->spool.waiting == 0U);
}

/// Returns the entry of an event under way; NULL if the message is not an event.
static mqtt_inflight_t *inflight_of(mqtt_bridge_t *self, int message) {
    for (size_t i = 0; i < self->inflights; i++) {
        if (self->inflight[i].message == message) {
            return &self->inflight[i];
        }
    }
    return NULL;
}

void mqtt_events_sent(void *context, int message) {
    mqtt_bridge_t *self = context;
    mqtt_inflight_t *event = inflight_of(self, message);
    self->refusals.works = self->refusals.works || message == self->refusals.proof;
    if (event != NULL) {
        event->fate = MQTT_CONFIRMED;
        settle_events(self);
    }
}

void mqtt_events_refused(void *context, int message, const char *why) {
    mqtt_bridge_t *self = context;
    mqtt_inflight_t *event = inflight_of(self, message);
    mqtt_spool_event_t stored;
    char topic[MQTT_TOPIC_SIZE] = "a message";
    self->refusals.works = self->refusals.works || message == self->refusals.proof;
    if (event == NULL) {
        for (size_t i = 0; i < MQTT_NOTES_MAX; i++) {
            const mqtt_note_t *note = &self->refusals.notes[i];
            if (note->message == message) {
                memcpy(topic, note->topic, sizeof topic);
            }
        }
        const bool due = self->info_due;
        count_refusal(self, topic, why, false);
        self->info_due = due || strcmp(topic + strlen(topic) - 5U, "/info") != 0; // An info would be refused again.
        return;
    }
    if (!event->aside && mqtt_spool_after(&self->spool, event->number - 1U, &stored)) {
        mqtt_topic(self->settings->machine.id, "event", stored.name, topic);
        count_refusal(self, topic, why, true);
    }
    event->fate = MQTT_REFUSED;
    settle_events(self);
}

/// Judges a connection that ended with events under way. The first of them is the cause if the broker confirmed others
/// in this connection, and if this repeats.
static void judge_loss(mqtt_bridge_t *self) {
    mqtt_refusals_t *refusals = &self->refusals;
    if (refusals->tries) {
        refusals->due_us = self->now_us + refusals->wait_us;
        refusals->wait_us = (refusals->wait_us < ASIDE_LONGEST_US / 2U) ? refusals->wait_us * 2U : ASIDE_LONGEST_US;
    } else {
        refusals->due_us = 0; // The next connection may be to a broker that accepts them.
    }
    refusals->tries = false;
    refusals->careful = refusals->careful || self->inflights > 0U;
    if (self->inflights == 0U || self->inflight[0].aside || !refusals->works) {
        return;
    }
    refusals->losses = (self->inflight[0].number == refusals->suspect) ? refusals->losses + 1U : 1U;
    refusals->suspect = self->inflight[0].number;
    if (refusals->losses >= MQTT_LOSSES_MAX) {
        char topic[MQTT_TOPIC_SIZE];
        (void)snprintf(topic, sizeof topic, "event %llu", (unsigned long long)refusals->suspect);
        count_refusal(self, topic, "the connection ended each time it was sent", true);
        set_aside(self, refusals->suspect);
        refusals->losses = 0;
        refusals->due_us = self->now_us + ASIDE_FIRST_US;
    }
}

void mqtt_events_lost(mqtt_bridge_t *self) {
    judge_loss(self);
    self->inflights = 0;
    self->sent_number = 0;
    self->refusals.works = false;
}

void mqtt_events_begin(mqtt_bridge_t *self) {
    self->refusals.proof = self->refusals.notes[(self->refusals.note + MQTT_NOTES_MAX - 1U) % MQTT_NOTES_MAX].message;
}

void mqtt_events_poll(mqtt_bridge_t *self) {
    if (self->refusals.count != self->refusals.logged && self->now_us >= self->refusals.logged_us) {
        (void)fprintf(stderr,
                      "iwheel-mqtt: messages that the broker did not accept so far: %llu, events set aside: %zu, last "
                      "%s; see the broker's rights for this user and its largest packet\n",
                      (unsigned long long)self->refusals.count, self->spool.aside, self->refusals.last);
        self->refusals.logged = self->refusals.count;
        self->refusals.has_event = false;
        self->refusals.logged_us = self->now_us + REFUSED_US;
    }
    try_aside(self);
}
