// SPDX-License-Identifier: MIT
#include "observe.h"

#include "box/box.h"
#include "bus/bus_facts.h"
#include "ledger/knowledge.h"
#include "sockets/clients.h"
#include "sockets/log.h"
#include "sockets/owners.h"
#include "wheels/wheels.h"

#include "inspect.h"

#include "iwheel_linux/clock.h"
#include "iwheel_northbound/json_out.h"

#include <stdio.h>
#include <string.h>

/// A wheel that has power is received within this time.
#define FIRST_TELEMETRY_US 1000000U
/// Of rolling at most one fault is reported in this time: clients store faults, and people push a walker by hand.
#define ROLLING_FAULT_US 60000000U

static iwn_out_t begin_event(gw_status_t *self, const char *name) {
    iwn_out_t json = gw_clients_begin_event(self->clients, name);
    iwn_out_int(&json, "t_us", (int64_t)self->wheels->now_us);
    return json;
}

static void observe_state(gw_status_t *self, const iw_snapshot_t *seen, bool first) {
    const iw_state_t state = seen->state;
    const bool changed = state != self->observed.state || first;
    if (!changed && seen->holding == self->observed.holding) {
        return;
    }
    if (changed) {
        gw_log(self->log, GW_LOG_INFO, "state: %s", iwn_state_name(state));
        gw_wheels_note_state(self->wheels, seen, first ? state : self->observed.state);
    }
    if (seen->holding != self->observed.holding) {
        gw_log(self->log, GW_LOG_INFO, seen->holding ? "holding: zeros until release or arm" : "holding: no longer");
    }
    self->observed.state = state;
    self->observed.holding = seen->holding;
    iwn_out_t json = gw_clients_begin_event(self->clients, "state");
    gw_snapshot_write(self, &json);
    gw_clients_send_event(self->clients, &json, IWN_TOPIC_STATE);
}

/// Who asked for it or held the lease, while that is still known.
static void note_client(gw_status_t *self, iwn_stop_note_t *note, char *out_text, size_t size) {
    const gw_observed_t *observed = &self->observed;
    if (note->stop.cause == IW_CAUSE_ESTOP_SOFTWARE) {
        note->stop.client = note->stop.detail;
    }
    const gw_client_t *client = gw_clients_find(self->clients, note->stop.client);
    if (client != NULL) {
        gw_client_describe(client, out_text, size);
        memcpy(note->client_name, client->name, sizeof client->name);
    } else if (note->stop.client == observed->holder && observed->holder != IW_CLIENT_NONE) {
        (void)snprintf(out_text, size, "%s", observed->holder_text);
        memcpy(note->client_name, observed->holder_name, sizeof observed->holder_name);
    } else {
        (void)snprintf(out_text, size, "a client");
    }
}

static void observe_stop(gw_status_t *self, const iw_stop_t *stop) {
    if (stop->number == self->observed.stop_number) {
        return;
    }
    self->observed.stop_number = stop->number;
    char who[GW_CLIENT_TEXT_SIZE];
    iwn_stop_note_t *note = &self->last_stop;
    *note = (iwn_stop_note_t){.stop = *stop, .wall_us = iw_clock_wall_us()};
    note_client(self, note, who, sizeof who);
    const iwn_why_context_t context = {
        .client = who, .reason = self->estop_reason, .estop = self->wheels->estop, .bus = self->wheels->bus.name};
    iwn_why_sentence(&note->stop, &context, note->sentence, sizeof note->sentence);
    gw_log(self->log, GW_LOG_WARNING, "stop %u: %s", (unsigned)stop->number, note->sentence);
    gw_wheels_note_stop(self->wheels, stop);
    if (stop->latched) {
        gw_record_stop(self->box, self->log, note, self->wheels->now_us);
    }
    iwn_out_t json = begin_event(self, "stop");
    iwn_tell_stop(note, self->wheels->now_us, &json);
    gw_clients_send_event(self->clients, &json, IWN_TOPIC_STOP);
}

static void observe_lease(gw_status_t *self, const iw_snapshot_t *seen) {
    gw_observed_t *observed = &self->observed;
    const iw_client_t holder = (seen->state == IW_STATE_ARMED) ? seen->holder : IW_CLIENT_NONE;
    if (holder == observed->holder) {
        return;
    }
    const iw_client_t former = observed->holder;
    const gw_client_t *client = gw_clients_find(self->clients, holder);
    observed->holder = holder;
    if (client != NULL) {
        gw_client_describe(client, observed->holder_text, sizeof observed->holder_text);
        memcpy(observed->holder_name, client->name, sizeof client->name);
    }
    gw_log(self->log, GW_LOG_INFO, "lease %s: %s", iwn_tell_change(holder, former),
           (holder == IW_CLIENT_NONE) ? "nobody" : observed->holder_text);
    iwn_out_t json = begin_event(self, "lease");
    iwn_tell_lease(&(iwn_holder_t){.client = holder, .name = (client != NULL) ? client->name : NULL}, former, &json);
    gw_clients_send_event(self->clients, &json, IWN_TOPIC_LEASE);
}

static void observe_bus(gw_status_t *self, iw_bus_state_t bus, bool first) {
    if (bus == self->observed.bus && !first) {
        return;
    }
    self->observed.bus = bus;
    gw_log(self->log, (bus == IW_BUS_ACTIVE) ? GW_LOG_INFO : GW_LOG_WARNING, "bus %s: %s", self->wheels->bus.name,
           iwn_bus_state_name(bus));
    iwn_out_t json = begin_event(self, "bus");
    iwn_out_text(&json, "state", iwn_bus_state_name(bus));
    gw_clients_send_event(self->clients, &json, IWN_TOPIC_BUS);
}

static void observe_estop(gw_status_t *self, bool first) {
    const iw_linux_hal_t *hal = &self->wheels->hal;
    const int answer = hal->estop_last;
    const char *where = hal->two_contacts ? inspect_pressed_at(hal) : NULL;
    if (answer == self->observed.estop && where == self->observed.pressed_at && !first) {
        return;
    }
    self->observed.estop = answer;
    self->observed.pressed_at = where;
    const char *name = iwn_estop_name(answer, self->wheels->hal.estop_ops->present);
    const char *trouble = inspect_estop_trouble(&self->wheels->hal);
    gw_log(self->log, (answer == 0) ? GW_LOG_INFO : GW_LOG_WARNING, "e-stop %s: %s%s%s%s%s", self->wheels->estop, name,
           (where == NULL) ? "" : ", pressed at ", (where == NULL) ? "" : where, (trouble[0] == '\0') ? "" : ": ",
           trouble);
    iwn_out_t json = begin_event(self, "estop");
    iwn_out_text(&json, "state", name);
    if (where != NULL) {
        iwn_out_text(&json, "pressed_at", where);
    }
    gw_clients_send_event(self->clients, &json, IWN_TOPIC_ESTOP);
}

static void tell_fault(gw_status_t *self, const char *cause, bool present) {
    gw_log(self->log, present ? GW_LOG_WARNING : GW_LOG_INFO, "%s: %s", present ? "fault" : "fault gone", cause);
    iwn_out_t json = begin_event(self, "fault");
    iwn_out_text(&json, "cause", cause);
    iwn_out_bool(&json, "present", present);
    gw_clients_send_event(self->clients, &json, IWN_TOPIC_STOP);
}

/// Once when it begins: who may empty the queue is asked to, as far as that is set up.
static void tell_left_behind(gw_status_t *self) {
    const iw_bus_link_t *link = iw_linux_hal_link(&self->wheels->hal);
    char sentence[GW_WARNING_SIZE];
    gw_bus_left_sentence(link, self->wheels->bus.name, sentence, sizeof sentence);
    gw_log(self->log, GW_LOG_WARNING, "%s", sentence);
    if (link->presence != IW_LINK_LOCAL) { // Where nobody could be asked, the sentence says what to do.
        (void)gw_bus_left_ask(GW_RUNTIME_DIRECTORY, self->wheels->bus.name);
    }
}

/// The first telemetry comes a moment after the start: until then a wheel without any is not a fault.
static uint32_t faults_of(const gw_status_t *self, const iw_snapshot_t *seen) {
    const uint32_t lost = 1U << IW_CAUSE_WHEEL_LOST;
    if ((seen->present & lost) == 0U || self->wheels->now_us >= self->observed.started_us + FIRST_TELEMETRY_US) {
        return seen->present;
    }
    return seen->present & ~lost;
}

static bool is_any_unwell(const gw_health_t *health, gw_ailment_t ailment) {
    return health->present[IW_LEFT][ailment] || health->present[IW_RIGHT][ailment];
}

/// A fault while any wheel has it; the log and the warnings name the wheel.
static void tell_ailment(gw_status_t *self, const iw_snapshot_t *seen, const gw_health_t *before, gw_ailment_t ailment,
                         const char *name) {
    const gw_health_t *health = &self->wheels->health;
    char sentence[GW_HEALTH_TEXT_SIZE];
    for (unsigned side = 0; side < IW_SIDES; side++) {
        if (health->present[side][ailment] && !before->present[side][ailment]) {
            gw_health_sentence(health, seen, (iw_side_t)side, ailment, sentence);
            gw_log(self->log, GW_LOG_WARNING, "%s", sentence);
        }
    }
    if (is_any_unwell(health, ailment) != is_any_unwell(before, ailment)) {
        tell_fault(self, name, is_any_unwell(health, ailment));
    }
}

/// False, without a threshold: a frame costs nothing here then.
static bool look_at_health(gw_status_t *self, const iw_snapshot_t *seen, gw_health_t *out_before) {
    gw_health_t *health = &self->wheels->health;
    if (health->limits.battery_low_dV == 0U && health->limits.temperature_high_degC == 0U) {
        return false;
    }
    *out_before = *health;
    gw_health_look(health, seen);
    return true;
}

static void observe_rolling(gw_status_t *self, bool rolling) {
    if (rolling == self->observed.rolling) {
        return;
    }
    self->observed.rolling = rolling;
    gw_log(self->log, GW_LOG_INFO, "%s",
           rolling ? "rolling: a wheel turns although nothing is sent to it" : "rolling: no longer");
    iwn_out_t json = begin_event(self, "rolling");
    iwn_out_bool(&json, "present", rolling);
    gw_clients_send_event(self->clients, &json, IWN_TOPIC_STOP);
}

/// Whether a fault of rolling is reported, or its end: not one that begins too soon after the last one.
static bool take_rolling_fault(gw_observed_t *observed, bool is_fault, iw_time_us_t now_us) {
    const bool again = observed->rolling_us != 0U && now_us - observed->rolling_us < ROLLING_FAULT_US;
    if (is_fault == observed->rolling_fault || (is_fault && again)) {
        return false;
    }
    observed->rolling_fault = is_fault;
    observed->rolling_us = is_fault ? now_us : observed->rolling_us;
    return true;
}

/// While armed or stopping a cause makes a stop, which is reported as such; these are the others.
static void observe_faults(gw_status_t *self, const iw_snapshot_t *seen) {
    gw_observed_t *observed = &self->observed;
    const uint32_t present = faults_of(self, seen);
    const uint32_t changed = present ^ observed->present;
    gw_health_t before;
    for (unsigned cause = 0; cause < IW_CAUSES && changed != 0U; cause++) {
        if ((changed & (1U << cause)) != 0U) {
            tell_fault(self, iwn_cause_name((iw_cause_t)cause), (present & (1U << cause)) != 0U);
        }
    }
    observed->present = present;
    if (seen->still_moving != observed->still_moving) {
        observed->still_moving = seen->still_moving;
        tell_fault(self, "still_moving", true);
    }
    if (seen->zeros_ending != observed->zeros_ending) {
        observed->zeros_ending = seen->zeros_ending;
        tell_fault(self, "zeros_ending", seen->zeros_ending);
    }
    if (take_rolling_fault(observed, seen->rolling_fault, self->wheels->now_us)) {
        tell_fault(self, "rolling", seen->rolling_fault);
        if (seen->rolling_fault) {
            gw_record_rolling(self->box, self->log, seen);
        }
    }
    if (seen->left_behind != observed->left_behind) {
        observed->left_behind = seen->left_behind;
        if (seen->left_behind) {
            tell_left_behind(self);
        }
        tell_fault(self, "setpoint_left", seen->left_behind);
    }
    if (look_at_health(self, seen, &before)) {
        tell_ailment(self, seen, &before, GW_BATTERY_LOW, "battery_low");
        tell_ailment(self, seen, &before, GW_TEMPERATURE_HIGH, "temperature_high");
    }
}

static void observe_purge(gw_status_t *self) {
    const iw_link_purge_t purge = iw_linux_hal_link(&self->wheels->hal)->purge;
    const char *bus = self->wheels->bus.name;
    if (purge == self->observed.purge) {
        return;
    }
    self->observed.purge = purge;
    if (purge == IW_LINK_PURGE_DONE) {
        gw_log(self->log, GW_LOG_WARNING, "bus %s: taken down and up again, so that no old setpoint waits in it", bus);
    } else if (purge == IW_LINK_PURGE_NOT_ALLOWED) {
        gw_log(self->log, GW_LOG_WARNING,
               "bus %s: an old setpoint may still wait in its queue, and this process may not empty it; do: ip link "
               "set %s down; ip link set %s up (or, once and for all: systemctl enable --now "
               "iwheel-can-restart@%s.path)",
               bus, bus, bus, bus);
    } else if (purge == IW_LINK_PURGE_FAILED) {
        gw_log(self->log, GW_LOG_ERROR, "bus %s: its queue could not be emptied; look with: ip -details link show %s",
               bus, bus);
    }
}

void gw_observe_begin(gw_status_t *self) {
    iwn_stop_note_t *note = &self->last_stop;
    iwn_why_sentence(&note->stop, &(iwn_why_context_t){0}, note->sentence, sizeof note->sentence);
}

void gw_observe(gw_status_t *self, const iw_snapshot_t *seen) {
    const bool first = !self->observed.started;
    if (first) {
        self->observed.started = true;
        self->observed.started_us = self->wheels->now_us;
    }
    observe_bus(self, seen->bus, first);
    observe_purge(self);
    observe_estop(self, first);
    observe_faults(self, seen);
    observe_rolling(self, seen->rolling);
    observe_stop(self, seen->stop);
    observe_lease(self, seen);
    observe_state(self, seen, first);
    gw_knowledge_observe(self->knowledge, seen);
    gw_wheels_note_again(self->wheels);
    atomic_store(&self->box->ring->sending, gw_wheels_are_sent_to(self->wheels));
}

static bool wants_periodic(const gw_client_t *client) {
    return !client->closing && !client->ended &&
           (client->topics & ((1U << IWN_TOPIC_STATE) | (1U << IWN_TOPIC_FORCE))) != 0U;
}

/// Written once, for all who are due and watch the topic.
static void send_periodic(gw_status_t *self, iwn_topic_t topic) {
    size_t length = 0;
    const gw_clients_t *clients = self->clients;
    for (uint32_t i = gw_clients_from(clients, 0U); i < GW_CLIENTS_MAX; i = gw_clients_from(clients, i + 1U)) {
        if (!self->clients->client[i].due || (self->clients->client[i].topics & (1U << topic)) == 0U) {
            continue;
        }
        if (length == 0U) {
            iwn_out_t json = gw_clients_begin_event(self->clients, iwn_topic_name(topic));
            if (topic == IWN_TOPIC_STATE) {
                gw_snapshot_write(self, &json);
            } else {
                gw_snapshot_write_force(self, &json);
            }
            iwn_out_close(&json, '}');
            length = iwn_out_finish(&json);
        }
        gw_client_event(&self->clients->client[i], self->clients->line, length);
    }
}

void gw_observe_periodic(gw_status_t *self) {
    const gw_clients_t *clients = self->clients;
    bool any = false;
    for (uint32_t i = gw_clients_from(clients, 0U); i < GW_CLIENTS_MAX; i = gw_clients_from(clients, i + 1U)) {
        gw_client_t *client = &self->clients->client[i];
        client->due = wants_periodic(client) && self->wheels->now_us >= client->next_us;
        if (client->due) {
            // On a grid that all have in common, so that an event is written once for many; and after a stall no burst.
            const iw_time_us_t period_us = 1000000U / client->rate_hz;
            client->next_us = self->wheels->now_us - self->wheels->now_us % period_us + period_us;
            any = true;
        }
    }
    if (any) {
        send_periodic(self, IWN_TOPIC_STATE);
        send_periodic(self, IWN_TOPIC_FORCE);
    }
}

iw_time_us_t gw_observe_next_us(const gw_clients_t *clients) {
    iw_time_us_t next_us = IW_NEVER;
    for (uint32_t i = gw_clients_from(clients, 0U); i < GW_CLIENTS_MAX; i = gw_clients_from(clients, i + 1U)) {
        const gw_client_t *client = &clients->client[i];
        if (wants_periodic(client) && client->next_us < next_us) {
            next_us = client->next_us;
        }
    }
    return next_us;
}

static void tell_frame(gw_status_t *self, const gw_tapped_t *tapped) {
    iwn_out_t json = gw_clients_begin_event(self->clients, "frame");
    iwn_out_frame(&tapped->frame, tapped->at_us, &json);
    gw_clients_send_event(self->clients, &json, IWN_TOPIC_FRAME);
}

void gw_observe_frames(gw_status_t *self) {
    gw_tape_t *tape = &self->wheels->tape;
    const iw_time_us_t now_us = self->wheels->now_us;
    const uint32_t watching = gw_clients_watching(self->clients, IWN_TOPIC_FRAME);
    if (watching > GW_FRAMES_ONE_BY_ONE && now_us < self->frames_us && tape->tapped <= GW_FRAMES / 2U) {
        return;
    }
    for (uint32_t i = 0; i < tape->tapped && watching > 0U; i++) {
        tell_frame(self, &tape->tap[i]);
    }
    tape->tapped = 0;
    self->frames_us = now_us - now_us % GW_FRAMES_TOGETHER_US + GW_FRAMES_TOGETHER_US;
}

iw_time_us_t gw_observe_frames_us(const gw_status_t *self) {
    return (self->wheels->tape.tapped > 0U) ? self->frames_us : IW_NEVER;
}

void gw_observe_write_hello(const gw_wheels_t *wheels, const gw_client_t *client, iwn_out_t *json) {
    iwn_tell_hello(&(iwn_hello_t){.version = IWHEEL_VERSION,
                                  .bus = wheels->bus.name,
                                  .state = iw_gateway_state(&wheels->core),
                                  .client = client->id,
                                  .watches_only = client->right == GW_WATCH},
                   json);
}

void gw_observe_hello(gw_status_t *self, gw_client_t *client) {
    iwn_out_t json = gw_clients_begin_event(self->clients, "hello");
    gw_observe_write_hello(self->wheels, client, &json);
    iwn_out_int(&json, "t_us", (int64_t)self->wheels->now_us);
    iwn_out_close(&json, '}');
    gw_client_event(client, self->clients->line, iwn_out_finish(&json));
}
