// SPDX-License-Identifier: MIT
#include "ctl.h"
#include "text/ctl_text.h"

#include <errno.h>
#include <grp.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>

#define START_HINT "is the gateway running? Start it (systemctl start iwheel-gateway), or use --socket PATH"

int ctl_fail(int code, const char *format, ...) {
    va_list list;
    (void)fputs("iwheelctl: ", stderr);
    va_start(list, format);
    text_vline(stderr, format, list);
    va_end(list);
    return code;
}

int ctl_finish(int code) {
    errno = 0;
    if ((fflush(stdout) != 0 || ferror(stdout) != 0) && errno != EPIPE && errno != 0) {
        return ctl_fail(CTL_UNAVAILABLE, "cannot write: %s; free some space", strerror(errno));
    }
    return code;
}

/// Finds the path of the socket. Returns NEAR_FOUND if there is one to try.
static near_t choose(const ctl_t *ctl, const char *bus, char *out_path, size_t size) {
    if (ctl->socket != NULL) {
        (void)snprintf(out_path, size, "%s", ctl->socket);
        return NEAR_FOUND;
    }
    switch (iwc_find(NULL, out_path, size)) {
    case IWC_OK:
        return NEAR_FOUND;
    case IWC_DENIED:
        (void)snprintf(out_path, size, "%s", IWC_DIRECTORY);
        return NEAR_DENIED;
    case IWC_SEVERAL:
        if (bus == NULL) {
            return NEAR_SEVERAL;
        }
        (void)snprintf(out_path, size, "%s/%s.sock", IWC_DIRECTORY, bus);
        if (access(out_path, W_OK) != 0) {
            (void)snprintf(out_path, size, "%s/%s/%s.sock", IWC_DIRECTORY, IWC_WATCH_DIRECTORY, bus);
        }
        return NEAR_FOUND;
    default:
        return NEAR_NONE;
    }
}

static int report_denied(const char *path) {
    struct stat status;
    const struct group *group = (stat(path, &status) == 0) ? getgrgid(status.st_gid) : NULL;
    if (group == NULL) {
        return ctl_fail(CTL_PERMISSION, "%s: permission denied; ask its owner, or use sudo", path);
    }
    return ctl_fail(CTL_PERMISSION,
                    "%s: permission denied, it belongs to group %s; sudo usermod -aG %s $USER, then log in again", path,
                    group->gr_name, group->gr_name);
}

static int report_refusal(const char *error, const char *message) {
    return ctl_fail(CTL_NO, "refused (%s): %s", (error != NULL) ? error : "no reason",
                    (message != NULL) ? message : "no message");
}

int ctl_refused(const json_t *reply) {
    return report_refusal(json_string_value(json_object_get(reply, "error")),
                          json_string_value(json_object_get(reply, "message")));
}

/// Reports why there is no connection: the error of the system, or otherwise that of the gateway.
static int report_unopened(const ctl_t *self, const char *path, iwc_result_t result) {
    switch (iwc_errno(self->client.gateway)) {
    case 0:
        break;
    case EACCES:
    case EPERM:
        return report_denied(path);
    case ENOENT:
        return ctl_fail(CTL_UNAVAILABLE, "%s does not exist; %s", path, START_HINT);
    case ECONNREFUSED:
        return ctl_fail(CTL_UNAVAILABLE, "no gateway answers on %s; %s", path, START_HINT);
    case ETIMEDOUT:
        return ctl_fail(CTL_TIMEOUT, "%s accepts no connection for 2 s; the gateway hangs or is flooded, see its log",
                        path);
    case ENAMETOOLONG:
        return ctl_fail(CTL_USAGE, "--socket %s is too long for a socket (107 characters); use a shorter path", path);
    default:
        return ctl_fail(CTL_UNAVAILABLE, "%s cannot be opened (%s); %s", path,
                        strerror(iwc_errno(self->client.gateway)), START_HINT);
    }
    if (result == IWC_REFUSED) {
        return report_refusal(iwc_error(self->client.gateway), iwc_reason(self->client.gateway));
    }
    return ctl_lost(result);
}

int ctl_lost(iwc_result_t result) {
    switch (result) {
    case IWC_TIMEOUT:
        return ctl_fail(CTL_TIMEOUT, "no answer within 2 s; the gateway hangs or this is not its socket, see its log");
    case IWC_CLOSED:
        return ctl_fail(CTL_UNAVAILABLE, "the gateway ended the connection; see its log, or: iwheelctl status");
    case IWC_GARBLED:
        return ctl_fail(CTL_INTERNAL,
                        "this socket does not use the gateway's protocol; check --socket and both versions");
    case IWC_INTERRUPTED:
        return ctl_fail(CTL_NO, "interrupted");
    case IWC_FULL:
        return ctl_fail(CTL_TIMEOUT, "the gateway accepts no request; it hangs, see its log");
    case IWC_NEWER:
        return ctl_fail(CTL_UNAVAILABLE, "%s", iwc_words(result));
    case IWC_INVALID:
        return ctl_fail(CTL_USAGE, "the request has more than %u bytes; shorten it", IWC_REQUEST_MAX);
    default:
        return CTL_OK;
    }
}

/// Finds the socket and writes it to `out_path`, unless --socket names it. Returns an exit code.
static int find_one(ctl_t *self, char *out_path, size_t size) {
    switch (choose(self, NULL, out_path, size)) {
    case NEAR_FOUND:
        return CTL_OK;
    case NEAR_SEVERAL:
        return ctl_fail(CTL_USAGE, "several gateways are running; choose one with --socket: %s", out_path);
    case NEAR_DENIED:
        return ctl_fail(CTL_PERMISSION, "you may not read %s; sudo usermod -aG iwheel $USER, then log in again",
                        out_path);
    default:
        return ctl_fail(CTL_UNAVAILABLE, "no gateway's socket under %s; %s", IWC_DIRECTORY, START_HINT);
    }
}

/// Finds the socket and connects. Returns an exit code.
static int connect_to_one(ctl_t *self) {
    char found[512];
    const int code = find_one(self, found, sizeof found);
    if (code != CTL_OK) {
        return code;
    }
    const char *path = (self->socket != NULL) ? self->socket : found;
    const iwc_result_t result = client_open(&self->client, path, client_now_us() + CLIENT_REPLY_US);
    if (result != IWC_OK) {
        return report_unopened(self, path, result);
    }
    if (iwc_watches_only(self->client.gateway)) {
        (void)ctl_fail(CTL_OK, "%s allows watch, stop and estop, but not drive", path);
    }
    return CTL_OK;
}

int ctl_exchange(ctl_t *self, json_t *request, json_t **out_reply) {
    *out_reply = NULL;
    const int code = self->client.open ? CTL_OK : connect_to_one(self);
    if (code != CTL_OK) {
        json_decref(request);
        return code;
    }
    const iwc_result_t result = client_ask(&self->client, request, out_reply);
    return (result == IWC_OK) ? CTL_OK : ctl_lost(result);
}

static iwc_result_t stop_at(ctl_t *self, const char *path, const ctl_stop_t *stop) {
    const int timeout_ms = (int)(CLIENT_REPLY_US / 1000);
    iwc_t *gateway = self->client.gateway;
    iwc_result_t result = IWC_INTERRUPTED;
    iwc_let_in(gateway, signals_let_in());
    while (result == IWC_INTERRUPTED && signals_count() == self->client.seen_signals) {
        result = stop->latches ? iwc_estop_at(gateway, path, stop->reason, timeout_ms)
                               : iwc_stop_at(gateway, path, timeout_ms);
    }
    return result;
}

/// Stops in any case: a reason that is not valid text does not prevent a stop.
static iwc_result_t stop_anyhow(ctl_t *self, const char *path, const ctl_stop_t *stop) {
    const iwc_result_t result = stop_at(self, path, stop);
    const bool spoilt = result == IWC_INVALID || result == IWC_REFUSED;
    return (stop->reason != NULL && spoilt) ? stop_at(self, path, &(ctl_stop_t){.latches = true}) : result;
}

int ctl_stop(ctl_t *self, const ctl_stop_t *stop, json_t **out_reply) {
    char found[512];
    iwc_message_t reply;
    *out_reply = NULL;
    const int code = find_one(self, found, sizeof found);
    if (code != CTL_OK) {
        return code;
    }
    const char *path = (self->socket != NULL) ? self->socket : found;
    const iwc_result_t result = stop_anyhow(self, path, stop);
    if ((result != IWC_OK && result != IWC_REFUSED) || !iwc_reply(self->client.gateway, &reply)) {
        return report_unopened(self, path, result);
    }
    self->client.line = reply.text;
    *out_reply = json_loadb(reply.text, reply.length, JSON_REJECT_DUPLICATES, NULL);
    return (*out_reply != NULL) ? ctl_accept(self, out_reply) : ctl_lost(IWC_GARBLED);
}

int ctl_ask(ctl_t *self, json_t *request, json_t **out_reply) {
    const int code = ctl_exchange(self, request, out_reply);
    return (code == CTL_OK) ? ctl_accept(self, out_reply) : code;
}

int ctl_accept(const ctl_t *self, json_t **reply) {
    if (self->json) {
        text_json(self->client.line, stdout);
    }
    if (json_is_true(json_object_get(*reply, "ok"))) {
        return CTL_OK;
    }
    const int refused = self->json ? CTL_NO : ctl_refused(*reply);
    json_decref(*reply);
    *reply = NULL;
    return refused;
}

static near_t look_at(ctl_t *ctl, const char *path) {
    switch (client_open(&ctl->client, path, client_now_us() + CLIENT_REPLY_US)) {
    case IWC_OK:
        return NEAR_FOUND;
    case IWC_DENIED:
        return NEAR_DENIED;
    case IWC_NOT_THERE:
    case IWC_INVALID:
        return NEAR_NONE;
    default:
        return NEAR_MUTE;
    }
}

json_t *near_ask(ctl_t *ctl, json_t *request) {
    json_t *reply = NULL;
    return (client_ask(&ctl->client, request, &reply) == IWC_OK) ? reply : NULL;
}

void near_look(ctl_t *ctl, const char *bus, near_gateway_t *out_gateway) {
    memset(out_gateway, 0, sizeof(*out_gateway));
    near_t result = choose(ctl, bus, out_gateway->path, sizeof out_gateway->path);
    if (result == NEAR_FOUND) {
        result = look_at(ctl, out_gateway->path);
    }
    if (result == NEAR_FOUND) {
        out_gateway->status = near_ask(ctl, json_pack("{s:s}", "cmd", "status"));
        result = (out_gateway->status != NULL) ? NEAR_FOUND : NEAR_MUTE;
        (void)snprintf(out_gateway->bus, sizeof out_gateway->bus, "%s",
                       text_word(json_object_get(out_gateway->status, "bus"), "name"));
    }
    if (result == NEAR_FOUND && bus != NULL && strcmp(bus, out_gateway->bus) != 0) {
        result = NEAR_OTHER;
        json_decref(out_gateway->status);
        out_gateway->status = NULL;
    }
    if (result != NEAR_FOUND) {
        client_close(&ctl->client);
    }
    out_gateway->result = result;
}
