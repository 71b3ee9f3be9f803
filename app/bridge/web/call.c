// SPDX-License-Identifier: MIT
// Handles one request: judges it, and answers it or passes it on to the gateway (web_ask.c).
#include "call.h"

#include <stdlib.h>
#include <string.h>
#include <strings.h>

static web_peer_t *peer_of(struct MHD_Connection *connection) {
    const union MHD_ConnectionInfo *info = MHD_get_connection_info(connection, MHD_CONNECTION_INFO_SOCKET_CONTEXT);
    return (info != NULL) ? info->socket_context : NULL;
}

static const char *header(struct MHD_Connection *connection, const char *name) {
    return MHD_lookup_connection_value(connection, MHD_HEADER_KIND, name);
}

const char *web_call_argument(const web_call_t *self, const char *name) {
    return MHD_lookup_connection_value(self->connection, MHD_GET_ARGUMENT_KIND, name);
}

void web_call_suspend(web_call_t *self) {
    self->state = WEB_CALL_SUSPENDED;
    MHD_suspend_connection(self->connection);
}

void web_call_resume(web_call_t *self) {
    if (self->state == WEB_CALL_SUSPENDED) {
        self->state = WEB_CALL_ANSWERING;
        MHD_resume_connection(self->connection);
    }
}

/// Adds headers: the page loads nothing from other sites, no site frames it, and no referrer is sent. Answers about the
/// machine are not stored. Files of the page may be stored, but the browser must revalidate them.
static void add_headers(struct MHD_Response *response, const char *type, bool is_file) {
    static const char *const headers[][2] = {
        {"Content-Security-Policy",
         "default-src 'none'; script-src 'self'; style-src 'self'; connect-src 'self'; img-src 'self' data: blob:; "
         "manifest-src 'self'; "
         "base-uri 'none'; form-action 'none'; frame-ancestors 'none'"},
        {"Cross-Origin-Opener-Policy", "same-origin"},
        {"Cross-Origin-Resource-Policy", "same-origin"},
        {"Referrer-Policy", "no-referrer"},
        {"X-Content-Type-Options", "nosniff"},
    };
    (void)MHD_add_response_header(response, "Content-Type", type);
    (void)MHD_add_response_header(response, "Cache-Control", is_file ? "no-cache" : "no-store");
    for (size_t i = 0; i < sizeof headers / sizeof headers[0]; i++) {
        (void)MHD_add_response_header(response, headers[i][0], headers[i][1]);
    }
}

static enum MHD_Result send_response(const web_call_t *self, unsigned status, struct MHD_Response *response,
                                     const char *type) {
    if (response == NULL) {
        return MHD_NO;
    }
    add_headers(response, type, self->verdict.route != NULL && self->verdict.route->verb == WEB_FILE);
    if (status == 401U) {
        (void)MHD_add_response_header(response, "WWW-Authenticate", "IWheel");
    }
    if (status == 400U || status == 413U) {
        (void)MHD_add_response_header(response, "Connection", "close"); // The bytes that follow are not a request.
    }
    const enum MHD_Result result = MHD_queue_response(self->connection, status, response);
    MHD_destroy_response(response);
    return result;
}

/// Sends `text`: the library copies it or owns it, depending on `mode`.
static enum MHD_Result send_text(const web_call_t *self, const char *text, size_t length,
                                 enum MHD_ResponseMemoryMode mode) {
    const char *type = (self->verdict.route != NULL) ? self->verdict.route->type : "application/json";
    void *bytes = NULL;
    memcpy(&bytes, &text, sizeof bytes); // The parameter of the library is not const, although it only reads.
    return send_response(self, self->status, MHD_create_response_from_buffer(length, bytes, mode), type);
}

enum MHD_Result web_call_refuse(web_call_t *self, unsigned status, const char *error, const char *message) {
    char text[512];
    const int length =
        snprintf(text, sizeof text, "{\"ok\":false,\"error\":\"%s\",\"message\":\"%s\"}\n", error, message);
    self->status = status;
    self->verdict.route = NULL;
    self->server->own.refused++;
    return send_text(self, text, (size_t)length, MHD_RESPMEM_MUST_COPY);
}

static enum MHD_Result send_file(web_call_t *self) {
    const page_file_t *file = &self->server->files[self->verdict.route - web_routes()];
    const page_body_t *body = page_file_choose(file, header(self->connection, "Accept-Encoding"));
    const bool known = page_body_is_known(body, header(self->connection, "If-None-Match"));
    if (body->text == NULL) {
        return web_call_refuse(self, 404, "not_there", "this file is not installed");
    }
    struct MHD_Response *response =
        MHD_create_response_from_buffer(known ? 0U : body->length, body->text, MHD_RESPMEM_PERSISTENT);
    if (response != NULL) {
        (void)MHD_add_response_header(response, "Vary", "Accept-Encoding");
        (void)MHD_add_response_header(response, "ETag", body->tag);
        if (body == &file->packed && !known) {
            (void)MHD_add_response_header(response, "Content-Encoding", "gzip");
        }
    }
    return send_response(self, known ? 304U : 200U, response, self->verdict.route->type);
}

static enum MHD_Result send_challenge(web_call_t *self) {
    char text[160];
    const char *nonce = web_proofs_nonce(&self->server->proofs, self->server->now_us);
    if (nonce == NULL) {
        return web_call_refuse(self, 503, "no_random", "the kernel has no random numbers; see dmesg");
    }
    const int length =
        snprintf(text, sizeof text, "{\"ok\":true,\"nonce\":\"%s\",\"boot\":\"%s\"}\n", nonce, self->server->boot);
    return send_text(self, text, (size_t)length, MHD_RESPMEM_MUST_COPY);
}

/// Answers from the newest state: a viewer causes no request to the gateway.
static enum MHD_Result send_status(web_call_t *self) {
    size_t length = 0;
    self->server->link.polled_us = self->server->now_us;
    const char *text = web_link_status(&self->server->link, self->server->now_us, &length);
    return (text != NULL) ? send_text(self, text, length, MHD_RESPMEM_MUST_FREE)
                          : web_call_refuse(self, 503, "not_delivered", web_not_there);
}

static enum MHD_Result send_health(web_call_t *self) {
    const web_server_t *server = self->server;
    const web_settings_t *settings = server->settings;
    char text[640];
    iwc_message_t state;
    const bool good = web_link_state(&server->link, server->now_us, &state);
    const int length =
        snprintf(text, sizeof text,
                 "{\"ok\":%s,\"version\":\"" IWHEEL_VERSION "\",\"gateway\":\"%s\",\"may_drive\":%s,\"may_reset\":%s,"
                 "\"max_speed_mm_s\":%u,\"ttl_ms\":%u,\"rate_hz\":%u,\"fleet\":%s,\"machine_page\":\"%s\"}\n",
                 good ? "true" : "false", (server->link.gateway.state == BRIDGE_LINK_HERE) ? "connected" : "away",
                 settings->drive.enabled ? "true" : "false",
                 (settings->drive.enabled && settings->drive.allow_reset) ? "true" : "false",
                 settings->drive.max_speed_mm_s, settings->drive.ttl_ms, settings->gateway.rate_hz,
                 web_settings_has_fleet(settings) ? "true" : "false", web_settings_machine_page(settings));
    self->status = good ? 200U : 503U;
    return send_text(self, text, (size_t)length, MHD_RESPMEM_MUST_COPY);
}

static enum MHD_Result send_stream_text(web_call_t *self, FILE *out, char **text, const size_t *length) {
    if (out == NULL || fclose(out) != 0) {
        return MHD_NO;
    }
    return send_text(self, *text, *length, MHD_RESPMEM_MUST_FREE);
}

static enum MHD_Result send_metrics(web_call_t *self) {
    char *text = NULL;
    size_t length = 0;
    iwc_message_t state;
    web_own_t own = self->server->own;
    own.dropped = self->server->driver.dropped;
    own.connections = self->server->link.gateway.connections;
    own.watchers = self->server->stream_count;
    own.crowded_out = self->server->crowded_out + self->server->backlog.crowded_out;
    FILE *out = open_memstream(&text, &length);
    if (out != NULL) {
        const bool known = web_link_state(&self->server->link, self->server->now_us, &state);
        web_metrics_write(known ? &state : NULL, &own, &self->server->link.tally, out);
    }
    return send_stream_text(self, out, &text, &length);
}

static enum MHD_Result send_stops(web_call_t *self) {
    char *text = NULL;
    size_t length = 0;
    FILE *out = open_memstream(&text, &length);
    if (out != NULL) {
        (void)fputs("{\"ok\":true,\"stops\":[", out);
        for (size_t i = 0; i < WEB_STOPS_STORED && self->server->link.stops[i] != NULL; i++) {
            (void)fprintf(out, "%s%s", (i > 0) ? "," : "", self->server->link.stops[i]);
        }
        (void)fputs("]}\n", out);
    }
    return send_stream_text(self, out, &text, &length);
}

static enum MHD_Result send_fleet(web_call_t *self) {
    size_t length = 0;
    const char *text = web_server_fleet(self->server, &length);
    return (text != NULL)
               ? send_text(self, text, length, MHD_RESPMEM_MUST_FREE)
               : web_call_refuse(self, 404, "not_there",
                                 "there are no data of a fleet; set source under [fleet], and check that iwheel-fleet "
                                 "writes that file");
}

static ssize_t read_stream(void *context, uint64_t position, char *out, size_t size) {
    web_call_t *self = context;
    static const char pulse[] = {':', '\n', '\n'};
    web_server_t *server = self->server;
    (void)position;
    if (server->ending || self->verdict.route == NULL) {
        return MHD_CONTENT_READER_END_OF_STREAM;
    }
    size_t length = web_reader_take(&self->reader, &server->link.feed, out, size);
    if (length == 0U && server->now_us - self->written_us >= WEB_PULSE_US && size >= sizeof pulse) {
        memcpy(out, pulse, sizeof pulse); // Shows both ends that the other end is online.
        length = sizeof pulse;
    }
    if (length == 0U) {
        web_call_suspend(self);
        return 0;
    }
    self->written_us = server->now_us;
    return (ssize_t)length;
}

static enum MHD_Result send_events(web_call_t *self) {
    if (self->server->stream_count >= web_server_streams_max(self->server)) {
        return web_call_refuse(self, 503, "busy",
                               "too many watch already: close a page, or raise max_connections under [web]");
    }
    web_reader_begin(&self->reader, &self->server->link.feed);
    self->next = self->server->streams;
    self->server->streams = self;
    self->server->stream_count++;
    struct MHD_Response *response = MHD_create_response_from_callback(MHD_SIZE_UNKNOWN, 8192, read_stream, self, NULL);
    return send_response(self, 200, response, self->verdict.route->type);
}

static enum MHD_Result carry_out(web_call_t *self) {
    self->state = WEB_CALL_ANSWERING;
    self->status = 200;
    switch (self->verdict.route->verb) {
    case WEB_FILE:
        return send_file(self);
    case WEB_CHALLENGE:
        return send_challenge(self);
    case WEB_STATUS:
        return send_status(self);
    case WEB_EVENTS:
        return send_events(self);
    case WEB_STOPS:
        return send_stops(self);
    case WEB_FLEET:
        return send_fleet(self);
    case WEB_METRICS:
        return send_metrics(self);
    case WEB_HEALTH:
        return send_health(self);
    default:
        return web_call_ask(self);
    }
}

/// Returns the bytes of the body; -1: any number.
static int64_t body_of(struct MHD_Connection *connection) {
    const char *length = header(connection, "Content-Length");
    int64_t bytes = 0;
    const bool known = length == NULL || web_number(length, 0, INT64_MAX, &bytes);
    return (known && header(connection, "Transfer-Encoding") == NULL) ? bytes : -1;
}

/// Counts headers that may occur only once: some programs read the first one, others the last one.
typedef struct {
    unsigned count[4];
    bool has_blank;
} header_count_t;

static enum MHD_Result count_header(void *context, enum MHD_ValueKind kind, const char *name, const char *value) {
    static const char *const once[] = {"Host", "Content-Length", "Transfer-Encoding", "Authorization"};
    header_count_t *self = context;
    (void)kind;
    (void)value;
    self->has_blank = self->has_blank || strpbrk(name, " \t") != NULL;
    for (size_t i = 0; i < sizeof once / sizeof once[0]; i++) {
        self->count[i] += (strcasecmp(name, once[i]) == 0) ? 1U : 0U;
    }
    return MHD_YES;
}

static bool is_doubled(struct MHD_Connection *connection) {
    header_count_t found = {{0}, false};
    (void)MHD_get_connection_values(connection, MHD_HEADER_KIND, count_header, &found);
    bool doubled = found.has_blank;
    for (size_t i = 0; i < sizeof found.count / sizeof found.count[0]; i++) {
        doubled = doubled || found.count[i] > 1U;
    }
    return doubled;
}

static void begin(web_call_t *self, const char *url, const char *method) {
    web_server_t *server = self->server;
    web_peer_t *peer = peer_of(self->connection);
    const web_settings_t *settings = server->settings;
    const web_rules_t rules = {web_settings_hosts(settings), settings->drive.enabled,
                               settings->drive.enabled && settings->drive.allow_reset};
    const web_claim_t claim = {method, self->target, header(self->connection, "Authorization")};
    const web_asked_t asked = {
        method,
        url,
        header(self->connection, "Host"),
        header(self->connection, "Origin"),
        header(self->connection, "Sec-Fetch-Site"),
        web_proofs_judge(&server->proofs, server->token.text, &claim, server->now_us, &self->session),
        body_of(self->connection),
        is_doubled(self->connection)};
    self->verdict = web_judge(&rules, &asked);
    self->state = WEB_CALL_JUDGED;
    if (peer != NULL) {
        if (peer->state == WEB_PEER_IDLE) {
            peer->state = WEB_PEER_ASKING;
        }
        peer->known = peer->known || asked.proof == WEB_PROOF_READ || asked.proof == WEB_PROOF_FULL;
    }
}

void *web_call_new(void *context, const char *target, struct MHD_Connection *connection) {
    web_call_t *self = calloc(1, sizeof(*self));
    if (self != NULL) {
        self->server = context;
        self->connection = connection;
        if (strlen(target) < sizeof self->target) {
            (void)snprintf(self->target, sizeof self->target, "%s", target);
        }
    }
    return self;
}

// NOLINTNEXTLINE(readability-function-size): the library defines the parameters.
enum MHD_Result web_call_handle(void *context, struct MHD_Connection *connection, const char *url, const char *method,
                                const char *version, const char *upload, size_t *upload_size, void **place) {
    web_call_t *self = *place;
    (void)context;
    (void)connection;
    (void)version;
    (void)upload;
    if (self == NULL) {
        return MHD_NO;
    }
    if (self->state == WEB_CALL_NEW) {
        begin(self, url, method);
        // Bodies are refused immediately; other requests are answered when the library calls again.
        return (self->verdict.status != 413U && self->verdict.status != 400U)
                   ? MHD_YES
                   : web_call_refuse(self, self->verdict.status, self->verdict.error, self->verdict.message);
    }
    if (*upload_size > 0U) {
        *upload_size = 0;
        return MHD_YES;
    }
    if (self->reply != NULL) {
        char *reply = self->reply;
        self->reply = NULL;
        return send_text(self, reply, self->length, MHD_RESPMEM_MUST_FREE);
    }
    if (self->verdict.status != 200U) {
        return web_call_refuse(self, self->verdict.status, self->verdict.error, self->verdict.message);
    }
    return (self->state == WEB_CALL_JUDGED) ? carry_out(self) : MHD_NO;
}

void web_call_completed(void *context, struct MHD_Connection *connection, void **place,
                        enum MHD_RequestTerminationCode why) {
    web_server_t *server = context;
    web_call_t *self = *place;
    web_peer_t *peer = peer_of(connection);
    (void)why;
    if (peer != NULL) {
        if (peer->state == WEB_PEER_ASKING) {
            peer->state = WEB_PEER_IDLE;
        }
        peer->since_us = server->now_us;
    }
    if (self == NULL) {
        return;
    }
    bridge_link_forget(&server->link.gateway, self);
    bridge_lease_forget(&server->link.lease, self);
    for (web_call_t **at = &server->streams; *at != NULL; at = &(*at)->next) {
        if (*at == self) {
            *at = self->next;
            server->stream_count--;
            break;
        }
    }
    web_reader_end(&self->reader);
    free(self->reply);
    free(self);
    *place = NULL;
}
