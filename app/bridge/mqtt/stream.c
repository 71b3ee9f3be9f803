// SPDX-License-Identifier: MIT
#include "stream.h"

#include <nats/nats.h>

#include <arpa/inet.h>
#include <stdarg.h>
#include <stdlib.h>
#include <string.h>
#include <sysexits.h>

#define TRY_MS     2000
#define SILENCE_MS 5000
#define TRIES      10U
#define TOPIC_SIZE 256U

/// Open objects of the library, in the order of opening.
typedef struct {
    natsOptions *options;
    natsConnection *connection;
    jsCtx *stream;
    natsSubscription *events;
} reader_t;

__attribute__((format(printf, 3, 4))) static int fail(char out_why[STREAM_WHY_SIZE], int code, const char *format,
                                                      ...) {
    va_list list;
    va_start(list, format);
    (void)vsnprintf(out_why, STREAM_WHY_SIZE, format, list);
    va_end(list);
    return code;
}

static void end(reader_t *self) {
    natsSubscription_Destroy(self->events); // Its consumer ends with it.
    jsCtx_Destroy(self->stream);
    natsConnection_Destroy(self->connection);
    natsOptions_Destroy(self->options);
    *self = (reader_t){.options = NULL};
}

static bool is_address(const char *host) {
    uint8_t bytes[16];
    return inet_pton(AF_INET, host, bytes) == 1 || inet_pton(AF_INET6, host, bytes) == 1;
}

/// Certificates distinguish names and addresses, but libnats compares only names. For an address the signer of the
/// certificate decides: the certificates of a fleet state which hosts are servers.
static natsStatus use_tls(natsOptions *options, const mqtt_settings_t *settings, const char *host) {
    natsStatus status = natsOptions_SetSecure(options, true);
    if (status == NATS_OK) {
        status = natsOptions_LoadCATrustedCertificates(options, settings->broker.ca);
    }
    if (status == NATS_OK && mqtt_settings_given(settings->broker.certificate)) {
        status = natsOptions_LoadCertificatesChain(options, settings->broker.certificate, settings->broker.key);
    }
    return (status == NATS_OK && !is_address(host)) ? natsOptions_SetExpectedHostname(options, host) : status;
}

static natsStatus connect_to(reader_t *self, const mqtt_settings_t *settings, const char *host) {
    char url[MQTT_HOST_SIZE + 32U];
    const bool colons = strchr(host, ':') != NULL;
    (void)snprintf(url, sizeof url, "nats://%s%s%s:%u", colons ? "[" : "", host, colons ? "]" : "",
                   (unsigned)settings->broker.stream_port);
    natsStatus status = natsOptions_Create(&self->options);
    if (status == NATS_OK) {
        status = natsOptions_SetURL(self->options, url);
    }
    if (status == NATS_OK) {
        status = natsOptions_SetTimeout(self->options, TRY_MS);
    }
    if (status == NATS_OK) {
        status = natsOptions_SetAllowReconnect(self->options, false);
    }
    if (status == NATS_OK && mqtt_settings_given(settings->broker.ca)) {
        status = use_tls(self->options, settings, host);
    }
    if (status == NATS_OK) {
        status = natsConnection_Connect(&self->connection, self->options);
    }
    jsOptions asking;
    (void)jsOptions_Init(&asking);
    asking.Wait = TRY_MS;
    return (status == NATS_OK) ? natsConnection_JetStream(&self->stream, self->connection, &asking) : status;
}

/// Connects to the first host that answers.
static int find_server(reader_t *self, const mqtt_settings_t *settings, char out_host[MQTT_HOST_SIZE],
                       char out_why[STREAM_WHY_SIZE]) {
    char causes[STREAM_WHY_SIZE / 2U] = "";
    for (size_t i = 0; mqtt_settings_host(settings, i, out_host); i++) {
        const natsStatus status = connect_to(self, settings, out_host);
        if (status == NATS_OK) {
            return 0;
        }
        const size_t used = strlen(causes);
        (void)snprintf(causes + used, sizeof causes - used, "%s%s: %s", (used > 0U) ? ", " : "", out_host,
                       natsStatus_GetText(status));
        end(self);
    }
    return fail(
        out_why, EX_UNAVAILABLE,
        "no nats-server answers on port %u (%s); check that one runs, and stream_port, ca and certificate under "
        "[broker]",
        (unsigned)settings->broker.stream_port, causes);
}

/// Subscribes with an ephemeral consumer: the servers store nothing for it, and messages are not confirmed.
static natsStatus subscribe(reader_t *self, const stream_config_t *config, jsErrCode *out_code) {
    char subject[TOPIC_SIZE];
    jsSubOptions options;
    (void)snprintf(subject, sizeof subject, "iwheel.%s.event.%s", (config->machine != NULL) ? config->machine : "*",
                   (config->event != NULL) ? config->event : "*");
    (void)jsSubOptions_Init(&options);
    options.Stream = STREAM_NAME;
    options.Ordered = true;
    options.Config.DeliverPolicy = config->last ? js_DeliverLastPerSubject : js_DeliverByStartTime;
    options.Config.OptStartTime = config->last ? 0 : config->since_us * 1000;
    return js_SubscribeSync(&self->events, self->stream, subject, NULL, &options, out_code);
}

/// Counts the events that wait.
static natsStatus count(const reader_t *self, uint64_t *out_events) {
    jsConsumerInfo *info = NULL;
    const natsStatus status = natsSubscription_GetConsumerInfo(&info, self->events, NULL, NULL);
    if (status == NATS_OK) {
        *out_events = info->Delivered.Consumer + info->NumPending;
        jsConsumerInfo_Destroy(info);
    }
    return status;
}

/// Passes one event on; sets `*out_left` to the number of events after it.
static natsStatus read_one(natsMsg *message, stream_visit_t visit, void *context, uint64_t *out_left) {
    char topic[TOPIC_SIZE];
    jsMsgMetaData *place = NULL;
    const natsStatus status = natsMsg_GetMetaData(&place, message);
    if (status != NATS_OK) {
        return status;
    }
    (void)snprintf(topic, sizeof topic, "%s", natsMsg_GetSubject(message));
    for (char *dot = strchr(topic, '.'); dot != NULL; dot = strchr(dot, '.')) {
        *dot = '/';
    }
    const char *payload = natsMsg_GetData(message); // NULL: it is empty.
    const bool goes_on = visit(context, topic, (payload != NULL) ? payload : "", (size_t)natsMsg_GetDataLength(message),
                               place->Timestamp / 1000);
    *out_left = goes_on ? place->NumPending : 0U;
    jsMsgMetaData_Destroy(place);
    return NATS_OK;
}

static natsStatus read_all(const reader_t *self, stream_visit_t visit, void *context) {
    uint64_t left = 0;
    natsStatus status = count(self, &left);
    while (status == NATS_OK && left > 0U) {
        natsMsg *message = NULL;
        status = natsSubscription_NextMsg(&message, self->events, SILENCE_MS);
        if (status == NATS_OK) {
            status = read_one(message, visit, context, &left);
        }
        natsMsg_Destroy(message);
    }
    return status;
}

/// Tries once to read. `*trouble` is the error code of the servers, if they sent one.
static natsStatus try_to_read(reader_t *self, const stream_config_t *config, stream_visit_t visit, void *context,
                              jsErrCode *trouble) {
    const char *words = NULL;
    natsStatus status = subscribe(self, config, trouble);
    if (status == NATS_OK) {
        status = read_all(self, visit, context);
    }
    const bool forbidden =
        status != NATS_OK && natsConnection_GetLastError(self->connection, &words) == NATS_NOT_PERMITTED;
    return forbidden ? NATS_NOT_PERMITTED : status; // Without this, a client without the right would see a timeout.
}

/// Counts the events that are passed on: a read that has passed on events is not repeated.
typedef struct {
    stream_visit_t visit;
    void *context;
    uint64_t events;
} counted_t;

static bool take_counted(void *context, const char *topic, const char *payload, size_t length, int64_t stored_us) {
    counted_t *self = context;
    self->events++;
    return self->visit(self->context, topic, payload, length, stored_us);
}

/// Returns true for a temporary error: servers that have just lost one of them still ask it for a while.
static bool may_pass(natsStatus status, jsErrCode trouble) {
    return status != NATS_OK && status != NATS_NOT_PERMITTED && trouble != JSStreamNotFoundErr;
}

int stream_read(const mqtt_settings_t *settings, const stream_config_t *config, char out_host[MQTT_HOST_SIZE],
                char out_why[STREAM_WHY_SIZE]) {
    reader_t reader = {.options = NULL};
    counted_t counted = {config->visit, config->context, 0};
    jsErrCode trouble = 0;
    natsStatus status = NATS_ERR;
    if (settings->broker.stream_port == 0U) {
        return fail(
            out_why, EX_CONFIG,
            "this broker stores no history: stream_port is 0; a cluster of nats-servers stores it (share/fleet), "
            "and each machine stores its recordings: iwheel-fleet recordings ID");
    }
    for (unsigned i = 0; i < TRIES && may_pass(status, trouble) && counted.events == 0U; i++) {
        const int code = find_server(&reader, settings, out_host, out_why);
        if (code != 0) {
            return code;
        }
        status = try_to_read(&reader, config, take_counted, &counted, &trouble);
        end(&reader);
    }
    if (status == NATS_OK) {
        return 0;
    }
    return (trouble == JSStreamNotFoundErr)
               ? fail(out_why, EX_UNAVAILABLE,
                      "%s has no stream " STREAM_NAME "; create it: share/fleet/stream %s:%u FOLDER create", out_host,
                      out_host, (unsigned)settings->broker.stream_port)
               : fail(
                     out_why, EX_UNAVAILABLE,
                     "the stream at %s cannot be read (%s); check that two of its three servers run, and the rights of "
                     "the console in users.conf",
                     out_host, natsStatus_GetText(status));
}
