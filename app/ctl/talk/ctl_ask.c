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

/// Longest time for each of several gateways in the first pass. A working gateway replies within milliseconds.
#define SOON_MS  60
#define REPLY_MS (CLIENT_REPLY_US / 1000)
/// Most gateways of a machine, and the size of the list of their sockets.
#define GATEWAYS_MAX 64U
#define FOUND_SIZE   (GATEWAYS_MAX * 108U)

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

/// Reports why there is not one socket to try; `path` is what `choose` wrote. Returns an exit code.
static int report_unfound(near_t result, const char *path) {
    switch (result) {
    case NEAR_FOUND:
        return CTL_OK;
    case NEAR_SEVERAL:
        return ctl_fail(CTL_USAGE, "several gateways are running; choose one with --socket: %s", path);
    case NEAR_DENIED:
        return ctl_fail(CTL_PERMISSION, "you may not read %s; sudo usermod -aG iwheel $USER, then log in again", path);
    default:
        return ctl_fail(CTL_UNAVAILABLE, "no gateway's socket under %s; %s", IWC_DIRECTORY, START_HINT);
    }
}

/// Finds the socket and connects. Returns an exit code.
static int connect_to_one(ctl_t *self) {
    char found[512];
    const int code = report_unfound(choose(self, NULL, found, sizeof found), found);
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

static iwc_result_t stop_at(ctl_t *self, const char *path, const ctl_stop_t *stop, int timeout_ms) {
    iwc_t *gateway = self->client.gateway;
    iwc_result_t result = IWC_INTERRUPTED;
    iwc_let_in(gateway, signals_let_in());
    while (result == IWC_INTERRUPTED && signals_count() == self->client.seen_signals) {
        result = stop->latches ? iwc_estop_at(gateway, path, stop->reason, timeout_ms)
                               : iwc_stop_at(gateway, path, timeout_ms);
    }
    return result;
}

/// Reports a failed stop, or reads its reply. Returns as ctl_ask does.
static int report_stop(ctl_t *self, const char *path, iwc_result_t result, json_t **out_reply) {
    iwc_message_t message;
    if ((result != IWC_OK && result != IWC_REFUSED) || !iwc_reply(self->client.gateway, &message)) {
        return report_unopened(self, path, result);
    }
    self->client.line = message.text;
    *out_reply = json_loadb(message.text, message.length, JSON_REJECT_DUPLICATES, NULL);
    return (*out_reply != NULL) ? ctl_accept(self, out_reply) : ctl_lost(IWC_GARBLED);
}

/// Splits a list of paths under IWC_DIRECTORY. Returns their number.
static unsigned split(char *list, char *out_paths[GATEWAYS_MAX]) {
    unsigned count = 0;
    while (list != NULL && count < GATEWAYS_MAX) {
        out_paths[count] = list;
        count++;
        list = strstr(list, " " IWC_DIRECTORY "/");
        if (list != NULL) {
            *list = '\0';
            list++;
        }
    }
    return count;
}

/// Stops each gateway of the list. One that does not reply soon comes last, so that it delays no other. Returns CTL_OK
/// if one of them stopped.
static int stop_each(ctl_t *self, char *list, const ctl_stop_t *stop, ctl_stopped_t stopped) {
    char *paths[GATEWAYS_MAX];
    const unsigned count = split(list, paths);
    int failure = CTL_UNAVAILABLE;
    bool done = false;
    for (unsigned pass = 0; pass < 2U; pass++) {
        for (unsigned i = 0; i < count; i++) {
            json_t *reply = NULL;
            if (paths[i] == NULL) {
                continue;
            }
            const iwc_result_t result = stop_at(self, paths[i], stop, (pass == 0U) ? SOON_MS : REPLY_MS);
            if (pass == 0U && result != IWC_OK) {
                continue;
            }
            const int code = report_stop(self, paths[i], result, &reply);
            if (code == CTL_OK) {
                stopped(self, paths[i], reply);
                done = true;
            } else {
                failure = ctl_fail(code, "%s: the stop failed", paths[i]);
            }
            json_decref(reply);
            paths[i] = NULL;
        }
    }
    return done ? CTL_OK : failure;
}

int ctl_stop(ctl_t *self, const ctl_stop_t *stop, ctl_stopped_t stopped) {
    char found[FOUND_SIZE];
    json_t *reply = NULL;
    const near_t result = choose(self, NULL, found, sizeof found);
    if (result == NEAR_SEVERAL) {
        return stop_each(self, found, stop, stopped);
    }
    int code = report_unfound(result, found);
    if (code != CTL_OK) {
        return code;
    }
    const char *path = (self->socket != NULL) ? self->socket : found;
    code = report_stop(self, path, stop_at(self, path, stop, REPLY_MS), &reply);
    if (code == CTL_OK) {
        stopped(self, NULL, reply);
    }
    json_decref(reply);
    return code;
}

void ctl_set_time(json_t *request, const json_t *status) {
    (void)json_object_set(request, "t_us", json_object_get(status, "t_us"));
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

iwc_result_t near_stop(ctl_t *ctl, const ctl_stop_t *stop) {
    return stop_at(ctl, ctl->socket, stop, REPLY_MS);
}

static near_t ask_near(ctl_t *ctl, const char *path) {
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

void near_find(ctl_t *ctl, const char *bus, near_gateway_t *out_gateway) {
    memset(out_gateway, 0, sizeof(*out_gateway));
    near_t result = choose(ctl, bus, out_gateway->path, sizeof out_gateway->path);
    if (result == NEAR_FOUND) {
        result = ask_near(ctl, out_gateway->path);
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
