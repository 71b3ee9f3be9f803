// SPDX-License-Identifier: MIT
// One request: judged, asked of the gateway if it must be, answered.
#include "server.h"

#include <inttypes.h>
#include <stdlib.h>
#include <string.h>

static web_peer_t *peer_of(struct MHD_Connection *connection) {
    const union MHD_ConnectionInfo *info = MHD_get_connection_info(connection, MHD_CONNECTION_INFO_SOCKET_CONTEXT);
    return (info != NULL) ? info->socket_context : NULL;
}

static const char *header(struct MHD_Connection *connection, const char *name) {
    return MHD_lookup_connection_value(connection, MHD_HEADER_KIND, name);
}

static const char *argument(const web_call_t *self, const char *name) {
    return MHD_lookup_connection_value(self->connection, MHD_GET_ARGUMENT_KIND, name);
}

void web_call_resume(web_call_t *self) {
    if (self->suspended) {
        self->suspended = false;
        MHD_resume_connection(self->connection);
    }
}

// ---- answering ----------------------------------------------------------------------------------------------------

/// Nothing is loaded from elsewhere, nothing frames the page, nothing is kept, and nobody is told where a reader came from.
static void add_headers(struct MHD_Response *response, const char *type) {
    static const char *const headers[][2] = {
        {"Cache-Control", "no-store"},
        {"Content-Security-Policy",
         "default-src 'none'; script-src 'self'; style-src 'self'; connect-src 'self'; img-src 'self' data: blob:; "
         "base-uri 'none'; form-action 'none'; frame-ancestors 'none'"},
        {"Cross-Origin-Opener-Policy", "same-origin"},
        {"Cross-Origin-Resource-Policy", "same-origin"},
        {"Referrer-Policy", "no-referrer"},
        {"X-Content-Type-Options", "nosniff"},
    };
    (void)MHD_add_response_header(response, "Content-Type", type);
    for (size_t i = 0; i < sizeof headers / sizeof headers[0]; i++) {
        (void)MHD_add_response_header(response, headers[i][0], headers[i][1]);
    }
}

static enum MHD_Result send_response(const web_call_t *self, unsigned status, struct MHD_Response *response,
                                     const char *type) {
    if (response == NULL) {
        return MHD_NO;
    }
    add_headers(response, type);
    if (status == 401U) {
        (void)MHD_add_response_header(response, "WWW-Authenticate", "Bearer");
    }
    const enum MHD_Result result = MHD_queue_response(self->connection, status, response);
    MHD_destroy_response(response);
    return result;
}

/// `text` may be changed by others afterwards, or belongs to the answer.
static enum MHD_Result send_text(const web_call_t *self, const char *text, size_t length,
                                 enum MHD_ResponseMemoryMode mode) {
    const char *type = (self->verdict.route != NULL) ? self->verdict.route->type : "application/json";
    void *bytes = NULL;
    memcpy(&bytes, &text, sizeof bytes); // The library takes what it only reads without const.
    return send_response(self, self->status, MHD_create_response_from_buffer(length, bytes, mode), type);
}

static enum MHD_Result refuse(web_call_t *self, unsigned status, const char *error, const char *message) {
    char text[512];
    const int length =
        snprintf(text, sizeof text, "{\"ok\":false,\"error\":\"%s\",\"message\":\"%s\"}\n", error, message);
    self->status = status;
    self->verdict.route = NULL;
    self->server->own.refused++;
    return send_text(self, text, (size_t)length, MHD_RESPMEM_MUST_COPY);
}

static const char *const not_there =
    "NOT DELIVERED: the gateway does not answer; see that it runs: systemctl status iwheel-gateway";

// ---- asking the gateway ---------------------------------------------------------------------------------------------

static void keep(web_call_t *self, unsigned status, const char *before, const char *text, size_t length) {
    const size_t head = strlen(before);
    self->reply = malloc(head + length + 1U);
    self->status = (self->reply != NULL) ? status : 500U;
    if (self->reply != NULL) {
        memcpy(self->reply, before, head);
        memcpy(self->reply + head, text, length);
        memcpy(self->reply + head + length, "\n", 1);
        self->length = head + length + 1U;
    }
}

static void begin_driving(web_call_t *self, const iwc_message_t *reply) {
    char key[WEB_TOKEN_SIZE];
    char before[WEB_TOKEN_SIZE + 16U];
    if (!web_token_random(key)) {
        return;
    }
    web_driver_begin(&self->server->driver, key, self->server->now_us);
    (void)snprintf(before, sizeof before, "{\"key\":\"%s\",", key);
    keep(self, 200, before, reply->text + 1, reply->length - 1U);
}

static void take_answer(void *context, const iwc_message_t *reply) {
    web_call_t *self = context;
    const bool good = reply != NULL && iwc_truth(reply, "ok").value == 1;
    if (reply == NULL) {
        static const char gone[] = "{\"ok\":false,\"error\":\"not_delivered\",\"message\":\"NOT DELIVERED: the gateway "
                                   "did not answer in time\"}";
        keep(self, 504, "", gone, sizeof gone - 1U);
    } else if (good && self->verdict.route->verb == WEB_ARM) {
        begin_driving(self, reply);
    } else {
        keep(self, good ? 200U : 409U, "", reply->text, reply->length);
    }
    web_call_resume(self);
}

static enum MHD_Result ask(web_call_t *self, const char *request) {
    self->suspended = true;
    MHD_suspend_connection(self->connection); // First: the answer may be there at once.
    if (!bridge_link_ask(&self->server->link.gateway, request, take_answer, self, self->server->now_us)) {
        static const char gone[] = "{\"ok\":false,\"error\":\"not_delivered\",\"message\":\"";
        char text[256];
        const int length = snprintf(text, sizeof text, "%s%s\"}", gone, not_there);
        keep(self, 503, "", text, (size_t)length);
        web_call_resume(self);
    }
    return MHD_YES;
}

static enum MHD_Result ask_recording(web_call_t *self) {
    char request[128];
    int64_t offset = 0;
    const char *name = argument(self, "name");
    const char *from = argument(self, "offset");
    if (!web_recording_name(name) || (from != NULL && !web_number(from, 0, INT64_MAX, &offset))) {
        return refuse(self, 400, "bad_value",
                      "name is that of a recording with .log, .jsonl or .conf behind it, offset a number of bytes");
    }
    (void)snprintf(request, sizeof request, "{\"cmd\":\"recording\",\"name\":\"%s\",\"offset\":%" PRId64 "}", name,
                   offset);
    return ask(self, request);
}

static enum MHD_Result ask_arm(web_call_t *self) {
    if (self->server->driver.key[0] != '\0') {
        return refuse(self, 409, "busy", "another page drives; stop it first");
    }
    return ask(self, "{\"cmd\":\"arm\",\"name\":\"web page\"}");
}

static enum MHD_Result ask_drive(web_call_t *self) {
    web_server_t *server = self->server;
    char request[96];
    web_twist_t twist = {0, 0};
    const web_command_t command = {argument(self, "key"), argument(self, "t_us"), argument(self, "sequence"),
                                   argument(self, "v_mm_s"), argument(self, "yaw_mrad_s")};
    const web_limits_t limits = {server->settings->drive.max_speed_mm_s, server->settings->drive.ttl_ms * 1000U};
    const char *why = web_driver_take(&server->driver, &command, &limits, server->now_us, &twist);
    if (why != NULL) {
        return refuse(self, 409, "dropped", why);
    }
    (void)snprintf(request, sizeof request, "{\"cmd\":\"twist\",\"v_mm_s\":%d,\"yaw_mrad_s\":%d}", (int)twist.v_mm_s,
                   (int)twist.yaw_mrad_s);
    return ask(self, request);
}

static enum MHD_Result ask_stop(web_call_t *self, const char *request) {
    web_driver_end(&self->server->driver); // What still comes from the page that drove is too late.
    return ask(self, request);
}

// ---- the bridge's own answers ---------------------------------------------------------------------------------------

static enum MHD_Result send_file(web_call_t *self) {
    const web_file_t *file = &self->server->files[self->verdict.route - web_routes()];
    if (file->text == NULL) {
        return refuse(self, 404, "not_there", "this file is not installed");
    }
    return send_text(self, file->text, file->length, MHD_RESPMEM_PERSISTENT);
}

static enum MHD_Result send_health(web_call_t *self) {
    const web_server_t *server = self->server;
    const web_settings_t *settings = server->settings;
    char text[384];
    iwc_message_t state;
    const bool good = web_link_state(&server->link, server->now_us, &state);
    const int length = snprintf(
        text, sizeof text,
        "{\"ok\":%s,\"version\":\"" IWHEEL_VERSION "\",\"gateway\":\"%s\",\"may_drive\":%s,\"may_reset\":%s,"
        "\"max_speed_mm_s\":%u,\"ttl_ms\":%u,\"rate_hz\":%u,\"fleet\":%s}\n",
        good ? "true" : "false", server->link.gateway.is_here ? "connected" : "away",
        settings->drive.enabled ? "true" : "false",
        (settings->drive.enabled && settings->drive.allow_reset) ? "true" : "false", settings->drive.max_speed_mm_s,
        settings->drive.ttl_ms, settings->gateway.rate_hz, web_settings_has_fleet(settings) ? "true" : "false");
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
    own.crowded_out = self->server->crowded_out + self->server->door.crowded_out;
    FILE *out = open_memstream(&text, &length);
    if (out != NULL) {
        const bool known = web_link_state(&self->server->link, self->server->now_us, &state);
        web_metrics_write(known ? &state : NULL, &own, out);
    }
    return send_stream_text(self, out, &text, &length);
}

static enum MHD_Result send_stops(web_call_t *self) {
    char *text = NULL;
    size_t length = 0;
    FILE *out = open_memstream(&text, &length);
    if (out != NULL) {
        (void)fputs("{\"ok\":true,\"stops\":[", out);
        for (size_t i = 0; i < WEB_STOPS_KEPT && self->server->link.stops[i] != NULL; i++) {
            (void)fprintf(out, "%s%s", (i > 0) ? "," : "", self->server->link.stops[i]);
        }
        (void)fputs("]}\n", out);
    }
    return send_stream_text(self, out, &text, &length);
}

static enum MHD_Result send_fleet(web_call_t *self) {
    size_t length = 0;
    const char *text = web_server_fleet(self->server, &length);
    return (text != NULL) ? send_text(self, text, length, MHD_RESPMEM_MUST_FREE)
                          : refuse(self, 404, "not_there",
                                   "there are no rows of a fleet; set source under [fleet], and see that iwheel-fleet "
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
    size_t taken = web_reader_take(&self->reader, &server->link.feed, out, size);
    if (taken == 0U && server->now_us - self->told_us >= WEB_PULSE_US && size >= sizeof pulse) {
        memcpy(out, pulse, sizeof pulse); // Shows both ends that the other is there.
        taken = sizeof pulse;
    }
    if (taken == 0U) {
        self->suspended = true;
        MHD_suspend_connection(self->connection);
        return 0;
    }
    self->told_us = server->now_us;
    return (ssize_t)taken;
}

static enum MHD_Result send_events(web_call_t *self) {
    if (self->server->stream_count >= web_server_streams_max(self->server)) {
        return refuse(self, 503, "busy", "too many watch already: close a page, or raise max_connections under [web]");
    }
    web_reader_begin(&self->reader, &self->server->link.feed);
    self->next = self->server->streams;
    self->server->streams = self;
    self->server->stream_count++;
    struct MHD_Response *response = MHD_create_response_from_callback(MHD_SIZE_UNKNOWN, 8192, read_stream, self, NULL);
    return send_response(self, 200, response, self->verdict.route->type);
}

static enum MHD_Result carry_out(web_call_t *self) {
    self->status = 200;
    switch (self->verdict.route->verb) {
    case WEB_FILE:
        return send_file(self);
    case WEB_STATUS:
        return ask(self, "{\"cmd\":\"status\"}");
    case WEB_EVENTS:
        return send_events(self);
    case WEB_STOPS:
        return send_stops(self);
    case WEB_RECORDINGS:
        return ask(self, "{\"cmd\":\"recordings\"}");
    case WEB_RECORDING:
        return ask_recording(self);
    case WEB_FLEET:
        return send_fleet(self);
    case WEB_METRICS:
        return send_metrics(self);
    case WEB_HEALTH:
        return send_health(self);
    case WEB_STOP:
        return ask_stop(self, "{\"cmd\":\"stop\"}");
    case WEB_ESTOP:
        return ask_stop(self, "{\"cmd\":\"estop\",\"reason\":\"web page\"}");
    case WEB_ARM:
        return ask_arm(self);
    case WEB_DRIVE:
        return ask_drive(self);
    case WEB_RESET:
        return ask(self, "{\"cmd\":\"reset\"}");
    default:
        return MHD_NO;
    }
}

// ---- from and to the library ----------------------------------------------------------------------------------------

static bool has_body(struct MHD_Connection *connection) {
    const char *length = header(connection, "Content-Length");
    return header(connection, "Transfer-Encoding") != NULL || (length != NULL && strcmp(length, "0") != 0);
}

static web_call_t *begin(web_server_t *server, struct MHD_Connection *connection, const char *url, const char *method) {
    web_call_t *self = calloc(1, sizeof(*self));
    web_peer_t *peer = peer_of(connection);
    if (self != NULL) {
        const web_settings_t *settings = server->settings;
        const web_rules_t rules = {server->token.text, web_settings_hosts(settings), settings->drive.enabled,
                                   settings->drive.enabled && settings->drive.allow_reset};
        const web_asked_t asked = {method,
                                   url,
                                   header(connection, "Host"),
                                   header(connection, "Origin"),
                                   header(connection, "Sec-Fetch-Site"),
                                   header(connection, "Authorization"),
                                   has_body(connection)};
        *self = (web_call_t){.server = server, .connection = connection, .verdict = web_judge(&rules, &asked)};
    }
    if (peer != NULL) {
        peer->asking = true;
        peer->known =
            peer->known || (self != NULL && self->verdict.route != NULL && self->verdict.route->verb != WEB_FILE);
    }
    return self;
}

enum MHD_Result web_call_handle(void *context, struct MHD_Connection *connection, const char *url, const char *method,
                                const char *version, const char *upload, size_t *upload_size, void **place) {
    web_call_t *self = *place;
    (void)version;
    (void)upload;
    if (self == NULL) {
        self = begin(context, connection, url, method);
        *place = self;
        // A body is not awaited; all else is answered when the library asks again.
        return (self == NULL)                   ? MHD_NO
               : (self->verdict.status != 413U) ? MHD_YES
                                                : refuse(self, 413, self->verdict.error, self->verdict.message);
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
        return refuse(self, self->verdict.status, self->verdict.error, self->verdict.message);
    }
    return (self->status == 0U) ? carry_out(self) : MHD_NO;
}

void web_call_completed(void *context, struct MHD_Connection *connection, void **place,
                        enum MHD_RequestTerminationCode why) {
    web_server_t *server = context;
    web_call_t *self = *place;
    web_peer_t *peer = peer_of(connection);
    (void)why;
    if (peer != NULL) {
        peer->asking = false;
        peer->since_us = server->now_us;
    }
    if (self == NULL) {
        return;
    }
    bridge_link_forget(&server->link.gateway, self);
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
