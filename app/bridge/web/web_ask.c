// SPDX-License-Identifier: MIT
// Requests to the gateway: questions, stops, and the lease of the person who drives.
#include "call.h"

#include <inttypes.h>
#include <stdlib.h>
#include <string.h>

const char *const web_not_there =
    "NOT DELIVERED: the gateway does not answer; check that it runs: systemctl status iwheel-gateway";

static void store(web_call_t *self, unsigned status, const char *before, const char *text, size_t length) {
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

/// Starts driving. The reply contains the key: that of the gateway, or that of the bridge if the gateway (a board) has
/// no random numbers.
static void begin_driving(web_call_t *self, const iwc_message_t *reply) {
    char key[BRIDGE_SECRET_SIZE];
    char before[BRIDGE_SECRET_SIZE + 16U];
    web_driver_begin(&self->server->driver, self->server->now_us);
    self->server->driver_session = self->session;
    if (iwc_text(reply, "key", key, sizeof key)) {
        store(self, 200, "", reply->text, reply->length);
        return;
    }
    (void)snprintf(before, sizeof before, "{\"key\":\"%s\",", bridge_lease_key(&self->server->link.lease));
    store(self, 200, before, reply->text + 1, reply->length - 1U);
}

static void take_answer(void *context, const iwc_message_t *reply) {
    web_call_t *self = context;
    const bool good = reply != NULL && iwc_truth(reply, "ok").value == 1;
    if (reply == NULL) {
        static const char gone[] = "{\"ok\":false,\"error\":\"not_delivered\",\"message\":\"NOT DELIVERED: the gateway "
                                   "did not answer in time\"}";
        store(self, 504, "", gone, sizeof gone - 1U);
    } else if (good && self->verdict.route->verb == WEB_ARM) {
        begin_driving(self, reply);
    } else {
        store(self, good ? 200U : 409U, "", reply->text, reply->length);
    }
    web_call_resume(self);
}

/// Ends the wait of a suspended call if the request cannot be sent to the gateway.
static enum MHD_Result went_out(web_call_t *self, bool asked) {
    static const char gone[] = "{\"ok\":false,\"error\":\"not_delivered\",\"message\":\"";
    char text[256];
    if (!asked) {
        const int length = snprintf(text, sizeof text, "%s%s\"}", gone, web_not_there);
        store(self, 503, "", text, (size_t)length);
        web_call_resume(self);
    }
    return MHD_YES;
}

static enum MHD_Result ask(web_call_t *self, const char *request) {
    web_call_suspend(self); // First, because the answer may arrive immediately.
    return went_out(self,
                    bridge_link_ask(&self->server->link.gateway, request, take_answer, self, self->server->now_us));
}

static enum MHD_Result ask_recording(web_call_t *self) {
    char request[128];
    int64_t offset = 0;
    const char *name = web_call_argument(self, "name");
    const char *from = web_call_argument(self, "offset");
    if (!web_recording_name(name) || (from != NULL && !web_number(from, 0, INT64_MAX, &offset))) {
        return web_call_refuse(
            self, 400, "bad_value",
            "name is that of a recording with .log, .jsonl or .conf behind it, offset a number of bytes");
    }
    (void)snprintf(request, sizeof request, "{\"cmd\":\"recording\",\"name\":\"%s\",\"offset\":%" PRId64 "}", name,
                   offset);
    return ask(self, request);
}

static enum MHD_Result ask_record(web_call_t *self) {
    const char *on = web_call_argument(self, "on");
    const bool begins = on != NULL && strcmp(on, "true") == 0;
    if (!begins && (on == NULL || strcmp(on, "false") != 0)) {
        return web_call_refuse(self, 400, "bad_value", "on is true, to begin the recording, or false, to end it");
    }
    return ask(self, begins ? "{\"cmd\":\"record\",\"on\":true}" : "{\"cmd\":\"record\",\"on\":false}");
}

/// Writes the name of a page for messages.
static void name_of(const web_call_t *self, char out[BRIDGE_NAME_SIZE]) {
    (void)snprintf(out, BRIDGE_NAME_SIZE, "web page %" PRIu64, self->session);
}

static int64_t ahead_us(const web_server_t *server) {
    return bridge_link_ahead_us(&server->link.gateway, server->now_us);
}

/// Returns why the age of the request is not valid; NULL if it is valid.
static const char *age_wrong(const web_call_t *self, int64_t *out_t_us) {
    const char *boot = web_call_argument(self, "boot");
    if (boot == NULL || strcmp(boot, self->server->boot) != 0) {
        return "it does not belong to this run of the bridge; quote boot of /api/challenge";
    }
    const uint64_t gateway_us = self->server->now_us + (uint64_t)ahead_us(self->server);
    return web_age_wrong(web_call_argument(self, "t_us"), gateway_us, out_t_us);
}

static enum MHD_Result refuse_stick(web_call_t *self, const char *who) {
    char text[160];
    (void)snprintf(text, sizeof text, "%s sends commands to turn the wheels; release its control first", who);
    return web_call_refuse(self, 409, "stale_command", text);
}

/// Returns the source of this bridge that sent a nonzero command just now; NULL if there is none.
static const char *who_moves(const web_call_t *self, const char *except) {
    const web_server_t *server = self->server;
    iwc_message_t state;
    int64_t lease_ms = 0;
    if (web_link_state(&server->link, server->now_us, &state)) {
        lease_ms = iwc_integer(&state, "lease.lease_ms").value;
    }
    return bridge_movers_who(&server->movers, except, (uint32_t)lease_ms, server->now_us);
}

static enum MHD_Result ask_arm(web_call_t *self) {
    bridge_lease_t *lease = &self->server->link.lease;
    char name[BRIDGE_NAME_SIZE];
    char request[160];
    int64_t t_us = 0;
    const char *why = age_wrong(self, &t_us);
    const char *who = who_moves(self, bridge_lease_name(lease));
    if (why != NULL) {
        return web_call_refuse(self, 409, "stale_command", why);
    }
    if (who != NULL) {
        return refuse_stick(self, who);
    }
    name_of(self, name);
    (void)snprintf(request, sizeof request, "{\"cmd\":\"arm\",\"name\":\"%s\",\"t_us\":%" PRId64 "}", name, t_us);
    const bridge_lease_result_t result =
        bridge_lease_arm(lease, name, request, (bridge_asker_t){take_answer, self}, self->server->now_us);
    if (result == BRIDGE_LEASE_BUSY) {
        return web_call_refuse(self, 409, "busy", "another page is asking for the lease; try again");
    }
    web_call_suspend(self); // First, because the answer may arrive immediately.
    return went_out(self, result == BRIDGE_LEASE_OK);
}

static enum MHD_Result ask_drive(web_call_t *self) {
    web_server_t *server = self->server;
    char request[96];
    char name[BRIDGE_NAME_SIZE];
    web_twist_t twist = {0, 0};
    const char *key = web_call_argument(self, "key");
    const bool is_holders = bridge_lease_is_holder(&server->link.lease, key) && self->session == server->driver_session;
    const web_command_t command = {is_holders, web_call_argument(self, "t_us"), web_call_argument(self, "sequence"),
                                   web_call_argument(self, "v_mm_s"), web_call_argument(self, "yaw_mrad_s")};
    const web_limits_t limits = {server->settings->drive.max_speed_mm_s, server->settings->drive.ttl_ms * 1000U,
                                 ahead_us(server)};
    if (web_command_moves(&command)) {
        name_of(self, name);
        bridge_movers_note(&server->movers, name, server->now_us);
    }
    const char *why = web_driver_take(&server->driver, &command, &limits, server->now_us, &twist);
    if (why != NULL) {
        return web_call_refuse(self, 409, "dropped", why);
    }
    (void)snprintf(request, sizeof request, "{\"cmd\":\"twist\",\"v_mm_s\":%d,\"yaw_mrad_s\":%d}", (int)twist.v_mm_s,
                   (int)twist.yaw_mrad_s);
    web_call_suspend(self); // First, because the answer may arrive immediately.
    return went_out(self, bridge_lease_drive(&server->link.lease, key, request, (bridge_asker_t){take_answer, self},
                                             server->now_us) == BRIDGE_LEASE_OK);
}

/// A reset clears the stop that the person saw, and no later one.
static enum MHD_Result ask_reset(web_call_t *self) {
    char request[128];
    int64_t t_us = 0;
    int64_t stop = 0;
    const char *why = age_wrong(self, &t_us);
    const char *who = who_moves(self, NULL);
    if (why == NULL && (!web_number(web_call_argument(self, "stop"), 1, INT64_MAX, &stop) ||
                        (uint64_t)stop != self->server->link.stop_number)) {
        why = "the request does not name the last stop; read the cause of that stop, then send it again";
    }
    if (why != NULL) {
        return web_call_refuse(self, 409, "stale_command", why);
    }
    if (who != NULL) {
        return refuse_stick(self, who);
    }
    (void)snprintf(request, sizeof request, "{\"cmd\":\"reset\",\"t_us\":%" PRId64 ",\"stop\":%" PRId64 "}", t_us,
                   stop);
    return ask(self, request);
}

static enum MHD_Result ask_stop(web_call_t *self) {
    const bool latches = self->verdict.route->verb == WEB_ESTOP;
    // The key is invalid from here on. The page still receives a reply: to this stop, or to a later one.
    web_driver_end(&self->server->driver);
    bridge_lease_end(&self->server->link.lease, self->server->now_us);
    return ask(self, latches ? "{\"cmd\":\"estop\",\"reason\":\"web page\"}" : "{\"cmd\":\"stop\"}");
}

enum MHD_Result web_call_ask(web_call_t *self) {
    switch (self->verdict.route->verb) {
    case WEB_RECORDINGS:
        return ask(self, "{\"cmd\":\"recordings\"}");
    case WEB_RECORDING:
        return ask_recording(self);
    case WEB_RECORD:
        return ask_record(self);
    case WEB_STOP:
    case WEB_ESTOP:
        return ask_stop(self);
    case WEB_ARM:
        return ask_arm(self);
    case WEB_DRIVE:
        return ask_drive(self);
    case WEB_RESET:
        return ask_reset(self);
    default:
        return MHD_NO;
    }
}
