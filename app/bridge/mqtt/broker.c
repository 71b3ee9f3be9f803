// SPDX-License-Identifier: MIT
#include "broker.h"

#include "credentials.h"
#include "reasons.h"

#include "common/bridge_link.h"

#include <errno.h>
#include <mqtt_protocol.h>
#include <poll.h>
#include <stdlib.h>
#include <string.h>
#include <sys/eventfd.h>
#include <sysexits.h>
#include <unistd.h>

#define SHORTEST_US 500000U
#define LONGEST_US  30000000U
/// A connection that ends earlier than SHORT_US after its acceptance is short. SHORT_MAX short ones in a row are
/// logged, at most once a minute.
#define SHORT_US     2000000U
#define SHORT_MAX    3U
#define SHORT_LOG_US 60000000U
#define POLL_US      500000U
/// Packets that are read in one call, so that a flood does not delay messages of the gateway.
#define PACKETS 32
/// Messages that may wait in the library for a broker that does not read. The messages of the spool are among them.
#define BEHIND_MAX 64U
#define GOODBYE_MS 200

static void on_log(struct mosquitto *client, void *context, int level, const char *words) {
    mqtt_broker_t *self = context;
    (void)client;
    if ((level & (MOSQ_LOG_ERR | MOSQ_LOG_WARNING)) != 0) {
        (void)snprintf(self->words, sizeof self->words, "%s", words);
    }
}

static void on_connect(struct mosquitto *client, void *context, int code) {
    mqtt_broker_t *self = context;
    int result = MOSQ_ERR_SUCCESS;
    self->refusal = code;
    if (code != 0) {
        self->lost = true;
        return;
    }
    self->state = MQTT_UP;
    self->up_us = self->now_us;
    self->wait_us = SHORTEST_US;
    // QoS 0: the broker does not send a message again that was under way when the connection ended.
    for (size_t i = 0; self->listener.topics[i] != NULL && result == MOSQ_ERR_SUCCESS; i++) {
        result = mosquitto_subscribe(client, &self->subscriptions[i], self->listener.topics[i], 0);
    }
    if (result != MOSQ_ERR_SUCCESS) {
        self->lost = true;
        return;
    }
    if (self->short_ones < SHORT_MAX) {
        (void)fprintf(stderr, "%s: connected to the broker at %s port %u\n", self->listener.program, self->host,
                      self->settings->broker.port);
        self->logged_away = false;
    }
    self->listener.up(self->listener.context);
}

/// `code` is the reason of the broker, if it sent one (MQTT 5: from 0x80 on); otherwise it is a code of the library.
static void on_disconnect(struct mosquitto *client, void *context, int code, const mosquitto_property *properties) {
    mqtt_broker_t *self = context;
    (void)client;
    (void)properties;
    if (code >= MQTT_RC_UNSPECIFIED) {
        self->refusal = code;
    }
    self->lost = true;
}

static void on_subscribe(struct mosquitto *client, void *context, int message, int count, const int *granted) {
    const mqtt_broker_t *self = context;
    (void)client;
    for (size_t i = 0; count > 0 && granted[0] >= MQTT_RC_UNSPECIFIED && self->listener.topics[i] != NULL; i++) {
        if (self->subscriptions[i] == message) {
            (void)fprintf(
                stderr,
                "%s: the broker refuses to deliver %s: nothing arrives from there; see its rights for this user\n",
                self->listener.program, self->listener.topics[i]);
        }
    }
}

static void on_publish(struct mosquitto *client, void *context, int message, int code,
                       const mosquitto_property *properties) {
    mqtt_broker_t *self = context;
    (void)client;
    (void)properties;
    if (code >= MQTT_RC_UNSPECIFIED) {
        self->listener.refused(self->listener.context, message, mosquitto_reason_string(code));
        return;
    }
    self->listener.sent(self->listener.context, message);
}

static void on_message(struct mosquitto *client, void *context, const struct mosquitto_message *message,
                       const mosquitto_property *properties) {
    mqtt_broker_t *self = context;
    mqtt_labels_t labels = {.expiry_s = 0};
    char *answer_to = NULL;
    void *correlation = NULL;
    (void)client;
    (void)mosquitto_property_read_string(properties, MQTT_PROP_RESPONSE_TOPIC, &answer_to, false);
    (void)mosquitto_property_read_binary(properties, MQTT_PROP_CORRELATION_DATA, &correlation,
                                         &labels.correlation_length, false);
    labels.answer_to = answer_to;
    labels.correlation = correlation;
    self->listener.came(self->listener.context, message, &labels);
    free(answer_to);
    free(correlation);
}

int mqtt_broker_open(mqtt_broker_t *self, const mqtt_settings_t *settings, const mqtt_broker_listener_t *listener) {
    *self = (mqtt_broker_t){.settings = settings,
                            .listener = *listener,
                            .wait_us = SHORTEST_US,
                            .random = (uint64_t)getpid(),
                            .caller = {.wake = eventfd(0, EFD_CLOEXEC | EFD_NONBLOCK),
                                       .allowed = mqtt_peers_of(settings->broker.process_user)}};
    if (self->caller.wake < 0 || mosquitto_lib_init() != MOSQ_ERR_SUCCESS) {
        (void)fprintf(stderr, "iwheel: libmosquitto: %s\n", strerror(errno));
        return EX_OSERR;
    }
    return mqtt_credentials_read(settings, &self->user, &self->password);
}

/// Counts short connections. If the broker ends several connections just after it accepted them, another client usually
/// has the same name. MQTT 3.1.1 has no code for that.
static void judge_end(mqtt_broker_t *self) {
    const bool name_in_use = self->refusal == MQTT_RC_SESSION_TAKEN_OVER;
    const bool was_short = self->state == MQTT_UP && self->now_us - self->up_us < SHORT_US;
    self->short_ones = (was_short || self->state != MQTT_UP) ? self->short_ones + (was_short ? 1U : 0U) : 0U;
    if (!name_in_use && self->short_ones < SHORT_MAX) {
        return;
    }
    self->name_in_use++;
    if (self->now_us >= self->short_us) {
        (void)fprintf(
            stderr,
            "%s: the broker at %s ended the connection %s; the name %s or the user is used by another client: "
            "configure a separate name for each machine and each console%s\n",
            self->listener.program, self->host,
            name_in_use ? "because another client used its name" : "repeatedly, shortly after accepting it",
            self->listener.name, name_in_use ? "" : ", or see the broker's log for a message that it does not accept");
        self->short_us = self->now_us + SHORT_LOG_US;
    }
}

static void lose(mqtt_broker_t *self, const char *why) {
    const bool was_up = self->state == MQTT_UP;
    judge_end(self);
    if (!self->logged_away) {
        (void)fprintf(stderr, "%s: no broker at %s port %u (%s%s%s); retrying\n", self->listener.program, self->host,
                      self->settings->broker.port, why, (self->words[0] != '\0') ? "; " : "", self->words);
    }
    self->logged_away = true;
    mosquitto_destroy(self->client);
    self->client = NULL;
    self->state = MQTT_AWAY;
    self->behind = 0;
    self->try_us = bridge_backoff_us(&self->wait_us, LONGEST_US, &self->random, self->now_us);
    if (was_up) {
        self->listener.down(self->listener.context);
    }
}

/// Opens the files of TLS, which may wait for their disk.
static bool set_tls(struct mosquitto *client, const mqtt_settings_t *settings) {
    const bool certificate = mqtt_settings_given(settings->broker.certificate);
    return !mqtt_settings_given(settings->broker.ca) ||
           mosquitto_tls_set(client, settings->broker.ca, NULL, certificate ? settings->broker.certificate : NULL,
                             certificate ? settings->broker.key : NULL, NULL) == MOSQ_ERR_SUCCESS;
}

/// Thread that connects. libmosquitto requires that no other thread uses the same client.
static void *call(void *context) {
    mqtt_caller_t *caller = context;
    const uint64_t one = 1;
    char address[MQTT_ADDRESS_SIZE];
    const int port = (caller->host[0] == '/') ? 0 : caller->port; // A unix socket has no port.
    (void)snprintf(address, sizeof address, "%s", caller->host);
    caller->peer = MQTT_PEER_ALLOWED;
    caller->result = MOSQ_ERR_ERRNO;
    if (caller->guarded) { // Before any secret is sent.
        caller->peer = mqtt_peer_probe(caller->host, port, &caller->allowed, address, &caller->uid);
    }
    caller->no_tls = caller->peer == MQTT_PEER_ALLOWED && !set_tls(caller->client, caller->settings);
    if (caller->peer == MQTT_PEER_ALLOWED && !caller->no_tls) {
        caller->result = mosquitto_connect(caller->client, address, port, caller->keepalive_s);
    }
    caller->error = errno;
    if (caller->guarded && caller->result == MOSQ_ERR_SUCCESS) { // The connection that is used is judged, too.
        caller->peer = mqtt_peer_judge(mosquitto_socket(caller->client), &caller->allowed, &caller->uid);
        if (caller->peer == MQTT_PEER_UNKNOWN && mqtt_reason_is_refusal(mosquitto_socket(caller->client))) {
            caller->peer = MQTT_PEER_ALLOWED; // The broker has already ended the connection.
        }
    }
    atomic_store(&caller->ended, true);
    (void)!write(caller->wake, &one, sizeof one);
    return NULL;
}

static bool is_5(const mqtt_broker_t *self) {
    return self->settings->broker.protocol == MQTT_PROTOCOL_5;
}

static bool set_up(mqtt_broker_t *self) {
    const char *will = self->listener.will;
    self->client = mosquitto_new(self->listener.name, true, self);
    if (self->client == NULL) {
        return false;
    }
    mosquitto_log_callback_set(self->client, on_log);
    mosquitto_connect_callback_set(self->client, on_connect);
    mosquitto_disconnect_v5_callback_set(self->client, on_disconnect);
    mosquitto_subscribe_callback_set(self->client, on_subscribe);
    mosquitto_publish_v5_callback_set(self->client, on_publish);
    mosquitto_message_v5_callback_set(self->client, on_message);
    // MQTT 5 without a session expiry means an expiry of 0.
    return mosquitto_int_option(self->client, MOSQ_OPT_PROTOCOL_VERSION,
                                is_5(self) ? MQTT_PROTOCOL_V5 : MQTT_PROTOCOL_V311) == MOSQ_ERR_SUCCESS &&
           (will == NULL || mosquitto_will_set(self->client, will, 7, "offline", 1, true) == MOSQ_ERR_SUCCESS) &&
           (self->user == NULL ||
            mosquitto_username_pw_set(self->client, self->user, self->password) == MOSQ_ERR_SUCCESS);
}

static void begin_connecting(mqtt_broker_t *self) {
    pthread_t thread;
    pthread_attr_t attributes;
    if (!mqtt_settings_host(self->settings, self->next, self->host)) {
        self->next = 0;
        (void)mqtt_settings_host(self->settings, 0, self->host);
    }
    self->next++;
    self->words[0] = '\0';
    self->lost = false;
    self->refusal = 0;
    if (!set_up(self)) {
        lose(self, "cannot create the MQTT client; check the free memory");
        return;
    }
    self->caller.client = self->client;
    self->caller.settings = self->settings;
    self->caller.host = self->host;
    self->caller.guarded = mqtt_settings_guarded(self->settings) && mqtt_settings_is_local(self->host);
    self->caller.port = (int)self->settings->broker.port;
    self->caller.keepalive_s = (int)self->settings->broker.keepalive_s;
    atomic_store(&self->caller.ended, false);
    (void)pthread_attr_init(&attributes);
    (void)pthread_attr_setdetachstate(&attributes, PTHREAD_CREATE_DETACHED);
    const int code = pthread_create(&thread, &attributes, call, &self->caller);
    (void)pthread_attr_destroy(&attributes);
    if (code != 0) {
        lose(self, strerror(code));
        return;
    }
    self->state = MQTT_CONNECTING;
}

static void end_connecting(mqtt_broker_t *self) {
    uint64_t count = 0;
    char why[160];
    (void)!read(self->caller.wake, &count, sizeof count);
    if (self->caller.peer == MQTT_PEER_STRANGER) {
        (void)snprintf(
            why, sizeof why,
            "its process belongs to user %u, not to root, this program's user or process_user; without TLS it "
            "gets no secret and no right to drive",
            (unsigned)self->caller.uid);
        lose(self, why);
        return;
    }
    if (self->caller.peer == MQTT_PEER_UNKNOWN) {
        lose(self, "the kernel names no owner of its process: it may be in a container; use TLS, with ca");
        return;
    }
    if (self->caller.no_tls) {
        lose(self, "cannot use the files of TLS; check ca, certificate and key");
        return;
    }
    if (self->caller.result != MOSQ_ERR_SUCCESS) {
        lose(self, (self->caller.result == MOSQ_ERR_ERRNO) ? strerror(self->caller.error)
                                                           : mosquitto_strerror(self->caller.result));
        return;
    }
    self->state = MQTT_GREETING;
    self->until_us = self->now_us + MQTT_GREETING_US;
}

static void work(mqtt_broker_t *self) {
    int result = mosquitto_loop_read(self->client, PACKETS);
    if (result == MOSQ_ERR_SUCCESS && mosquitto_want_write(self->client)) {
        result = mosquitto_loop_write(self->client, 1);
    }
    if (result == MOSQ_ERR_SUCCESS && self->now_us >= self->poll_us) {
        self->poll_us = self->now_us + POLL_US;
        result = mosquitto_loop_misc(self->client);
    }
    if (!mosquitto_want_write(self->client)) {
        self->behind = 0;
    }
    if (self->refusal != 0) {
        lose(self, mqtt_reason_of(self->refusal, is_5(self)));
    } else if (result != MOSQ_ERR_SUCCESS) {
        lose(self, (result == MOSQ_ERR_ERRNO) ? strerror(errno) : mosquitto_strerror(result));
    } else if (self->lost) {
        lose(self, "the connection has ended");
    } else if (self->state == MQTT_GREETING && self->now_us >= self->until_us) {
        lose(self, "it does not answer");
    }
}

void mqtt_broker_step(mqtt_broker_t *self, uint64_t now_us) {
    self->now_us = now_us;
    if (self->state == MQTT_AWAY && now_us >= self->try_us) {
        begin_connecting(self);
    }
    if (self->state == MQTT_CONNECTING && atomic_load(&self->caller.ended)) {
        end_connecting(self);
    }
    if (self->state == MQTT_GREETING || self->state == MQTT_UP) {
        work(self);
    }
}

uint64_t mqtt_broker_next_us(const mqtt_broker_t *self) {
    switch (self->state) {
    case MQTT_AWAY:
        return self->try_us;
    case MQTT_CONNECTING:
        return UINT64_MAX;
    default:
        return self->poll_us;
    }
}

int mqtt_broker_fd(const mqtt_broker_t *self, bool *out_writes) {
    *out_writes = false;
    if (self->state == MQTT_AWAY || self->state == MQTT_CONNECTING) {
        return (self->state == MQTT_CONNECTING) ? self->caller.wake : -1;
    }
    *out_writes = mosquitto_want_write(self->client);
    return mosquitto_socket(self->client);
}

/// Returns false if there is no memory or a text is not valid.
static bool add_labels(const mqtt_labels_t *labels, mosquitto_property **out) {
    return (labels->expiry_s == 0U || mosquitto_property_add_int32(out, MQTT_PROP_MESSAGE_EXPIRY_INTERVAL,
                                                                   labels->expiry_s) == MOSQ_ERR_SUCCESS) &&
           (labels->answer_to == NULL ||
            mosquitto_property_add_string(out, MQTT_PROP_RESPONSE_TOPIC, labels->answer_to) == MOSQ_ERR_SUCCESS) &&
           (labels->correlation == NULL ||
            mosquitto_property_add_binary(out, MQTT_PROP_CORRELATION_DATA, labels->correlation,
                                          labels->correlation_length) == MOSQ_ERR_SUCCESS);
}

int mqtt_broker_send(mqtt_broker_t *self, const char *topic, const char *payload, size_t length, mqtt_way_t way) {
    int number = MQTT_NOT_NOW;
    mosquitto_property *properties = NULL;
    int result = MOSQ_ERR_NO_CONN;
    if (self->state == MQTT_UP && self->behind < (way.spare ? 1U : BEHIND_MAX) &&
        (!is_5(self) || add_labels(&way.labels, &properties))) {
        result =
            mosquitto_publish_v5(self->client, &number, topic, (int)length, payload, way.qos, way.retain, properties);
    }
    mosquitto_property_free_all(&properties);
    if (result == MOSQ_ERR_SUCCESS) {
        self->behind += mosquitto_want_write(self->client) ? 1U : 0U;
        return number;
    }
    self->unsent += (self->state == MQTT_UP) ? 1U : 0U;
    if (mqtt_reason_may_pass(result)) {
        return MQTT_NOT_NOW;
    }
    self->unfit = mosquitto_strerror(result);
    return MQTT_NEVER;
}

bool mqtt_broker_close(mqtt_broker_t *self) {
    if (self->state == MQTT_CONNECTING && !atomic_load(&self->caller.ended)) {
        return false;
    }
    if (self->state == MQTT_UP) {
        struct pollfd wait = {.fd = mosquitto_socket(self->client), .events = POLLOUT};
        if (self->listener.will != NULL) {
            (void)mosquitto_publish(self->client, NULL, self->listener.will, 7, "offline", 0, true);
        }
        (void)mosquitto_disconnect(self->client);
        for (int i = 0; i < 10 && mosquitto_want_write(self->client); i++) {
            (void)poll(&wait, 1, GOODBYE_MS / 10);
            (void)mosquitto_loop_write(self->client, 1);
        }
    }
    mosquitto_destroy(self->client);
    (void)mosquitto_lib_cleanup();
    (void)close(self->caller.wake);
    free(self->user);
    free(self->password);
    return true;
}
