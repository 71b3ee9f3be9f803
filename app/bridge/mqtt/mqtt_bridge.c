// SPDX-License-Identifier: MIT
#include "mqtt_bridge.h"

#include "common/bridge_service.h"
#include "folder.h"

#include <errno.h>
#include <string.h>
#include <sys/random.h>
#include <sysexits.h>

#define SECOND_US 1000000U
#define INFO_US   60000000U

static const mqtt_way_t retained = {.qos = 1, .retain = true};

static mqtt_buffer_t buffer(mqtt_bridge_t *self) {
    return (mqtt_buffer_t){self->payload, sizeof self->payload};
}

bool mqtt_bridge_state(const mqtt_bridge_t *self, iwc_message_t *out_state) {
    *out_state = (iwc_message_t){.text = self->state, .length = self->state_length, .is_event = true};
    return self->link.state == BRIDGE_LINK_HERE && self->state_length > 0U;
}

static void publish_info(mqtt_bridge_t *self) {
    iwc_message_t state;
    const mqtt_info_t info = {.boot = self->boot,
                              .settings = self->settings,
                              .state = mqtt_bridge_state(self, &state) ? &state : NULL,
                              .counts = self->judge.counts,
                              .spooled = self->spool.waiting,
                              .dropped = self->spool.dropped,
                              .last = self->spool.last,
                              .aside = self->spool.aside,
                              .sensors = self->sensors_sent,
                              .sensors_seen = (size_t)__builtin_popcount(self->sensors_seen),
                              .name_taken = self->broker.name_in_use,
                              .refused = self->refusals.count,
                              .refusal = self->refusals.last,
                              .on_disk = !self->spool.behind,
                              .unsent = self->broker.unsent,
                              .stop = &self->stop};
    const size_t length = mqtt_write_info(&info, buffer(self));
    self->info_due = false; // Set before publishing, so that a refusal of this message does not make it due again.
    const int message = mqtt_bridge_publish(self, "info", NULL, length, retained);
    self->info_due = message == MQTT_NOT_NOW;
    self->info_us = self->now_us;
    self->logged_waiting = self->spool.waiting;
}

/// Publishes the availability. A machine without the states of its gateway is offline.
static void publish_availability(mqtt_bridge_t *self, bool always) {
    iwc_message_t state;
    const bool online = mqtt_bridge_state(self, &state);
    if (online != self->online || always) {
        const size_t length =
            (size_t)snprintf(self->payload, sizeof self->payload, "%s", online ? "online" : "offline");
        (void)mqtt_bridge_publish(self, "availability", NULL, length, retained);
        self->online = online;
    }
}

/// Adds an event to the spool. `stop_us` is the wall clock of the newest stop; it shows later whether a stop was
/// missed.
static void store_event(mqtt_bridge_t *self, const char *name, size_t length, uint64_t stop_us) {
    if (length == 0U) {
        self->spool.dropped++;
        return;
    }
    (void)mqtt_spool_add(&self->spool, name, self->payload, length, stop_us);
}

/// Stores the last stop from an event or from a reply to `why`. A gateway that restarted knows none; the one before it
/// then stays the last stop of this machine.
static void store_stop(mqtt_bridge_t *self, const iwc_message_t *stop) {
    mqtt_stop_t *last = &self->stop;
    if (iwc_integer(stop, "number").value <= 0) {
        return;
    }
    last->number = iwc_integer(stop, "number").value;
    last->wall_us = iwc_integer(stop, "wall_us").value;
    (void)iwc_text(stop, "cause", last->cause, sizeof last->cause);
    (void)iwc_text(stop, "sentence", last->sentence, sizeof last->sentence);
    self->info_due = true;
}

static void take_stop(mqtt_bridge_t *self, const iwc_message_t *event) {
    const size_t length = mqtt_write_event(self->boot, self->spool.last + 1U, bridge_wall_us(), event, buffer(self));
    store_event(self, "stop", length, (uint64_t)iwc_integer(event, "wall_us").value);
    store_stop(self, event);
    bridge_lease_end(&self->lease, self->now_us);
}

static void take_why(void *context, const iwc_message_t *reply) {
    mqtt_bridge_t *self = context;
    const uint64_t stop_us = (reply != NULL) ? (uint64_t)iwc_integer(reply, "wall_us").value : 0U;
    if (reply != NULL) {
        store_stop(self, reply);
    }
    if (reply != NULL && iwc_integer(reply, "number").value > 0 && stop_us != self->spool.mark) {
        const size_t length =
            mqtt_write_missed_stop(self->boot, self->spool.last + 1U, bridge_wall_us(), reply, buffer(self));
        store_event(self, "stop", length, stop_us);
    }
}

/// Writes the part of a state that is not a measurement. If it changes, the state is sent immediately.
static void read_condition(const iwc_message_t *state, char *out, size_t size) {
    char machine[16];
    char cause[32];
    char estop[16];
    char bus[16];
    iwc_cursor_t cursor = {state, NULL}; // In the order of the gateway.
    const iwc_message_t machine_field = iwc_field(&cursor, "state");
    const iwc_message_t cause_field = iwc_field(&cursor, "cause");
    const iwc_message_t lease = iwc_field(&cursor, "lease");
    const iwc_message_t bus_field = iwc_field(&cursor, "bus");
    const iwc_message_t estop_field = iwc_field(&cursor, "estop");
    const iwc_message_t left = iwc_field(&cursor, "left");
    const iwc_message_t right = iwc_field(&cursor, "right");
    (void)iwc_text(&machine_field, "", machine, sizeof machine);
    (void)iwc_text(&cause_field, "", cause, sizeof cause);
    (void)iwc_text(&estop_field, "state", estop, sizeof estop);
    (void)iwc_text(&bus_field, "state", bus, sizeof bus);
    (void)snprintf(out, size, "%s %s %s %s %lld %d%d", machine, cause, estop, bus,
                   (long long)iwc_integer(&lease, "holder").value, iwc_truth(&left, "heard").value == 1,
                   iwc_truth(&right, "heard").value == 1);
}

/// Returns the rate at which the gateway must send its state.
static uint32_t rate_hz(uint32_t every_ms) {
    return (every_ms < 1000U) ? 1000U / every_ms : 1U;
}

static void publish_state(mqtt_bridge_t *self, const iwc_message_t *state, const char *condition, bool spare) {
    // MQTT 5: a state that is older than the next one is useless.
    const mqtt_way_t way = {.spare = spare, .labels = {.expiry_s = self->settings->state.every_ms / 1000U + 1U}};
    if (mqtt_bridge_publish(self, "state", NULL, mqtt_write_state(self->boot, state, buffer(self)), way) !=
        MQTT_NOT_NOW) {
        (void)snprintf(self->condition, sizeof self->condition, "%s", condition);
        self->state_us = self->now_us;
    }
}

static void take_state(mqtt_bridge_t *self, const iwc_message_t *state) {
    char condition[sizeof self->condition];
    const bool first = self->state_length == 0U;
    memcpy(self->state, state->text, state->length);
    self->state_length = state->length;
    self->heard_us = self->now_us;
    read_condition(state, condition, sizeof condition);
    // Sends half a gateway period early, so that the periods of the gateway and of the bridge do not beat, even if
    // lines arrive unevenly.
    const uint32_t every_ms = self->settings->state.every_ms;
    const uint32_t line_ms = 1000U / rate_hz(every_ms);
    if (strcmp(condition, self->condition) != 0 ||
        self->now_us - self->state_us >= ((uint64_t)every_ms * 2U - line_ms) * 500U) {
        publish_state(self, state, condition, true);
    }
    if (first) {
        publish_availability(self, false);
        publish_info(self);
    }
}

/// Ends the lease of this bridge only if another client holds it. A person of this bridge who arms holds the lease
/// before the reply arrives.
static void take_lease(mqtt_bridge_t *self, const iwc_message_t *event) {
    const iwc_value_t holder = iwc_integer(event, "holder");
    bool ours = false;
    for (size_t i = 0; i < sizeof self->lease.place / sizeof self->lease.place[0]; i++) {
        const bridge_line_t *line = &self->lease.place[i].line;
        ours = ours || (line->state == BRIDGE_HERE && holder.known && holder.value == iwc_number(line->gateway));
    }
    if (!ours && bridge_lease_key(&self->lease) != NULL) {
        bridge_lease_end(&self->lease, self->now_us);
    }
}

static void take_event(void *context, const iwc_message_t *event, uint64_t now_us) {
    mqtt_bridge_t *self = context;
    char name[32];
    self->now_us = now_us;
    if (!iwc_text(event, "event", name, sizeof name) || !mqtt_settings_is_name(name) || strcmp(name, "hello") == 0) {
        return;
    }
    if (strcmp(name, "state") == 0) {
        take_state(self, event);
        return;
    }
    if (strcmp(name, "stop") == 0) {
        take_stop(self, event);
    } else {
        if (strcmp(name, "lease") == 0) {
            take_lease(self, event);
        } else if (strcmp(name, "rolling") == 0) {
            self->condition[0] = '\0'; // The next state is sent immediately. In the state itself it is far behind.
        }
        const size_t length =
            mqtt_write_event(self->boot, self->spool.last + 1U, bridge_wall_us(), event, buffer(self));
        store_event(self, name, length, self->spool.mark);
    }
    mqtt_events_send(self);
}

static void gateway_here(void *context, uint64_t now_us) {
    mqtt_bridge_t *self = context;
    (void)bridge_link_ask(&self->link, "{\"cmd\":\"why\"}", take_why, self, now_us);
}

/// Forgets the state, so that the next one is published immediately.
static void go_offline(mqtt_bridge_t *self) {
    self->state_length = 0;
    self->condition[0] = '\0';
    publish_availability(self, false);
    publish_info(self);
}

static void gateway_gone(void *context, uint64_t now_us) {
    mqtt_bridge_t *self = context;
    bridge_lease_end(&self->lease, now_us);
    go_offline(self);
}

/// Returns the time from which the gateway counts as hung; UINT64_MAX while its state is unknown.
static uint64_t hung_us(const mqtt_bridge_t *self) {
    return (self->state_length > 0U) ? self->heard_us + MQTT_HUNG_US : UINT64_MAX;
}

/// The connection stays, and commands still use it: a stop must reach a gateway that continues.
static void judge_silence(mqtt_bridge_t *self) {
    if (self->now_us >= hung_us(self)) {
        (void)fprintf(stderr,
                      "iwheel-mqtt: offline: the gateway sends no state for %u ms; see journalctl -u iwheel-gateway\n",
                      MQTT_HUNG_US / 1000U);
        go_offline(self);
    }
}

static void broker_up(void *context) {
    mqtt_bridge_t *self = context;
    iwc_message_t state;
    char condition[sizeof self->condition];
    publish_availability(self, true);
    if (mqtt_bridge_state(self, &state)) {
        read_condition(&state, condition, sizeof condition);
        publish_state(self, &state, condition, false);
    }
    publish_info(self);
    mqtt_sensors_send(self);
    mqtt_events_begin(self);
    mqtt_events_send(self);
}

static void broker_down(void *context) {
    mqtt_bridge_t *self = context;
    mqtt_events_lost(self);
    self->sensors_us = 0;
    mqtt_bridge_stop_if_ours(self);
}

static bool make_boot(char out[MQTT_BOOT_SIZE]) {
    uint64_t number = 0;
    const bool good = getrandom(&number, sizeof number, 0) == (ssize_t)sizeof number;
    (void)snprintf(out, MQTT_BOOT_SIZE, "%016llx", (unsigned long long)number);
    return good;
}

static bool has_name(const mqtt_settings_t *settings) {
    if (!mqtt_settings_given(settings->machine.id)) {
        (void)fputs("iwheel-mqtt: this machine has no name; set id under [machine] in " MQTT_SETTINGS_PATH "\n",
                    stderr);
        return false;
    }
    return true;
}

static int no_spool(const mqtt_settings_t *settings) {
    const char *why = strerror(errno);
    if (errno == EWOULDBLOCK) {
        why = "another bridge uses it";
    } else if (errno == EPERM) {
        why = "others may write to the directory, or it or its file " MQTT_SPOOL_FILE " belongs to another user";
    } else if (errno == ELOOP || errno == ENOTDIR) {
        why = "it is a symbolic link, or not a directory";
    }
    (void)fprintf(stderr,
                  "iwheel-mqtt: %s: %s; create it for this bridge alone, or set another directory under "
                  "[spool]\n",
                  settings->spool.directory, why);
    return EX_CANTCREAT;
}

int mqtt_bridge_check(const mqtt_settings_t *settings) {
    mqtt_broker_t broker;
    const mqtt_broker_listener_t no_listener = {0};
    if (!has_name(settings)) {
        return EX_CONFIG;
    }
    int unwritten = 0;
    errno = mqtt_folder_judge(settings->spool.directory, MQTT_SPOOL_FILE, &unwritten);
    if (errno != 0) {
        return no_spool(settings);
    }
    if (unwritten != 0) {
        (void)fprintf(
            stderr,
            "iwheel-mqtt: warning: %s: %s: the bridge starts, but when it ends, it loses every event that "
            "the broker does not have yet; make the directory writable for it, or set another one under [spool]\n",
            settings->spool.directory, strerror(unwritten));
    }
    const int code = mqtt_broker_open(&broker, settings, &no_listener);
    (void)mqtt_broker_close(&broker);
    return code;
}

int mqtt_bridge_open(mqtt_bridge_t *self, const mqtt_settings_t *settings) {
    const bridge_link_terms_t terms = {.program = "iwheel-mqtt",
                                       .socket = settings->gateway.socket,
                                       .rate_hz = rate_hz(settings->state.every_ms),
                                       .drives = settings->drive.enabled};
    const bridge_listener_t gateway = {self, gateway_here, gateway_gone, take_event};
    *self = (mqtt_bridge_t){.settings = settings, .topics = {self->commands, NULL, NULL}};
    const mqtt_broker_listener_t broker = {
        "iwheel-mqtt", self->name,  self->topics,     self->will,          self,
        broker_up,     broker_down, mqtt_events_sent, mqtt_events_refused, mqtt_bridge_command};
    // A client that knows the id of the machine cannot guess the random part of the name, so it cannot use the name at
    // a broker and lock the bridge out.
    const bool random = make_boot(self->boot);
    (void)snprintf(self->name, sizeof self->name, "iwheel-%s-%s", settings->machine.id, self->boot);
    mqtt_topic(settings->machine.id, "availability", NULL, self->will);
    mqtt_topic(settings->machine.id, "cmd", "+", self->commands);
    if (settings->home_assistant.enabled) {
        mqtt_sensor_topics(settings, self->sensors);
        self->topics[1] = self->sensors;
    }
    if (!has_name(settings)) {
        return EX_CONFIG;
    }
    if (!mqtt_spool_open(&self->spool, settings->spool.directory, (size_t)settings->spool.max_kB * 1000U)) {
        return no_spool(settings);
    }
    if (!random || !bridge_link_open(&self->link, &terms, &gateway) ||
        !bridge_lease_open(&self->lease, settings->gateway.socket, self->link.epoll_fd)) {
        (void)fputs("iwheel-mqtt: no memory, or no random numbers\n", stderr);
        return EX_OSERR;
    }
    return mqtt_broker_open(&self->broker, settings, &broker);
}

static void poll_events(mqtt_bridge_t *self) {
    mqtt_spool_poll(&self->spool);
    if (self->spool.behind != self->logged_behind) {
        self->logged_behind = self->spool.behind;
        (void)fprintf(stderr, "iwheel-mqtt: %s\n",
                      self->spool.behind
                          ? "the spool's disk accepts no data; events are stored in memory only; see df, dmesg"
                          : "the spool is on its disk again");
        self->info_due = true;
    }
    if (self->spool.dropped != self->logged_dropped) {
        (void)fprintf(stderr,
                      "iwheel-mqtt: events dropped so far: %llu; the spool was full, or an event too long: see max_kB "
                      "under [spool]\n",
                      (unsigned long long)self->spool.dropped);
        self->logged_dropped = self->spool.dropped;
        self->info_due = true;
    }
    mqtt_events_poll(self);
    mqtt_sensors_poll(self);
    if (self->info_due || self->now_us - self->info_us >= INFO_US) {
        publish_info(self);
    }
}

int mqtt_bridge_step(mqtt_bridge_t *self, uint64_t now_us) {
    self->now_us = now_us;
    mqtt_broker_step(&self->broker, now_us);
    const int code = bridge_link_step(&self->link, now_us);
    judge_silence(self); // After the link has read: a bridge that was stopped itself reads what waits first.
    bridge_lease_step(&self->lease, now_us);
    if (bridge_lease_key(&self->lease) != NULL && now_us >= self->silent_us) {
        mqtt_bridge_stop_if_ours(self);
    }
    mqtt_events_send(self);
    mqtt_spool_sync(&self->spool);
    if (now_us >= self->second_us) {
        self->second_us = now_us + SECOND_US;
        poll_events(self);
    }
    return code;
}

int mqtt_bridge_wait_ms(const mqtt_bridge_t *self) {
    const uint64_t now_us = self->now_us;
    const uint64_t times[] = {bridge_link_next_us(&self->link, now_us),
                              bridge_lease_next_us(&self->lease, now_us),
                              mqtt_broker_next_us(&self->broker),
                              self->second_us,
                              hung_us(self),
                              (bridge_lease_key(&self->lease) != NULL) ? self->silent_us : UINT64_MAX};
    uint64_t next_us = times[0];
    for (size_t i = 1; i < sizeof times / sizeof times[0]; i++) {
        if (times[i] < next_us) {
            next_us = times[i];
        }
    }
    return (next_us > now_us) ? (int)((next_us - now_us) / 1000U) + 1 : 0;
}

bool mqtt_bridge_close(mqtt_bridge_t *self) {
    mqtt_bridge_stop_if_ours(self);
    bridge_lease_close(&self->lease);
    bridge_link_close(&self->link);
    const bool done = mqtt_broker_close(&self->broker); // Before the spool, which stores the confirmations.
    return mqtt_spool_close(&self->spool) && done;
}
