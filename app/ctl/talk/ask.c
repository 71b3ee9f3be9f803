// SPDX-License-Identifier: MIT
#include "ctl.h"
#include "text/text.h"

#include <errno.h>
#include <grp.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>

#define START_HINT "is the gateway running? Start it (systemctl start iwheel-gateway), or give --socket PATH"

int ctl_fail(int code, const char *format, ...) {
    char text[2048];
    va_list list;
    va_start(list, format);
    (void)vsnprintf(text, sizeof text, format, list);
    va_end(list);
    (void)fputs("iwheelctl: ", stderr);
    text_safe(text, stderr);
    (void)fputc('\n', stderr);
    return code;
}

bool ctl_words_at_most(const char *verb, int count, int most, char **words) {
    if (count > most) {
        (void)ctl_fail(CTL_USAGE, "%s does not understand \"%s\"; see: iwheelctl %s --help", verb, words[most], verb);
        return false;
    }
    return true;
}

/// The path to use, in `found` if it was looked for; null after telling why there is none, with the exit code.
static const char *choose_socket(const ctl_t *self, char *found, size_t size, int *out_code) {
    if (self->socket != NULL) {
        return self->socket;
    }
    switch (iwc_find(NULL, found, size)) {
    case IWC_OK:
        return found;
    case IWC_SEVERAL:
        *out_code = ctl_fail(CTL_USAGE, "several gateways are running; choose one with --socket: %s", found);
        break;
    case IWC_DENIED:
        *out_code =
            ctl_fail(CTL_PERMISSION, "%s may not be read by you; sudo usermod -aG iwheel $USER, then log in again",
                     IWC_DIRECTORY);
        break;
    default:
        *out_code = ctl_fail(CTL_UNAVAILABLE, "no gateway's socket under %s; %s", IWC_DIRECTORY, START_HINT);
        break;
    }
    return NULL;
}

static int tell_denied(const char *path) {
    struct stat status;
    const struct group *group = (stat(path, &status) == 0) ? getgrgid(status.st_gid) : NULL;
    if (group == NULL) {
        return ctl_fail(CTL_PERMISSION, "%s: permission denied; ask its owner, or use sudo", path);
    }
    return ctl_fail(CTL_PERMISSION,
                    "%s: permission denied, it belongs to group %s; sudo usermod -aG %s $USER, then log in again", path,
                    group->gr_name, group->gr_name);
}

static int tell_refusal(const char *error, const char *message) {
    return ctl_fail(CTL_NO, "refused (%s): %s", (error != NULL) ? error : "no reason given",
                    (message != NULL) ? message : "no message");
}

int ctl_refused(const json_t *reply) {
    return tell_refusal(json_string_value(json_object_get(reply, "error")),
                        json_string_value(json_object_get(reply, "message")));
}

/// Why there is no connection: what the system said, or else the gateway.
static int tell_unopened(const ctl_t *self, const char *path, iwc_result_t result) {
    switch (iwc_errno(self->client.gateway)) {
    case 0:
        break;
    case EACCES:
    case EPERM:
        return tell_denied(path);
    case ENOENT:
        return ctl_fail(CTL_UNAVAILABLE, "%s does not exist; %s", path, START_HINT);
    case ECONNREFUSED:
        return ctl_fail(CTL_UNAVAILABLE, "nobody answers on %s; %s", path, START_HINT);
    case ETIMEDOUT:
        return ctl_fail(CTL_TIMEOUT, "%s takes no connection for 2 s; the gateway hangs or is flooded, see its log",
                        path);
    case ENAMETOOLONG:
        return ctl_fail(CTL_USAGE, "--socket %s is too long for a socket (107 characters); use a shorter path", path);
    default:
        return ctl_fail(CTL_UNAVAILABLE, "%s cannot be opened (%s); %s", path,
                        strerror(iwc_errno(self->client.gateway)), START_HINT);
    }
    if (result == IWC_REFUSED) {
        return tell_refusal(iwc_error(self->client.gateway), iwc_reason(self->client.gateway));
    }
    return ctl_lost(self, result);
}

int ctl_lost(const ctl_t *self, iwc_result_t result) {
    (void)self;
    switch (result) {
    case IWC_TIMEOUT:
        return ctl_fail(CTL_TIMEOUT, "no answer within 2 s; the gateway hangs or this is not its socket, see its log");
    case IWC_CLOSED:
        return ctl_fail(CTL_UNAVAILABLE, "the gateway ended the connection; see its log, or: iwheelctl status");
    case IWC_GARBLED:
        return ctl_fail(CTL_INTERNAL,
                        "not the gateway's language on this socket; check --socket, or versions that differ");
    case IWC_INTERRUPTED:
        return ctl_fail(CTL_NO, "interrupted");
    case IWC_FULL:
        return ctl_fail(CTL_TIMEOUT, "the gateway takes no request; it hangs, see its log");
    case IWC_NEWER:
        return ctl_fail(CTL_UNAVAILABLE, "%s", iwc_words(result));
    case IWC_INVALID:
        return ctl_fail(CTL_USAGE, "a request of more than %u bytes; write less", IWC_REQUEST_MAX);
    default:
        return CTL_OK;
    }
}

int ctl_connect(ctl_t *self) {
    char found[512];
    int code = CTL_OK;
    const char *path = choose_socket(self, found, sizeof found, &code);
    if (path == NULL) {
        return code;
    }
    const iwc_result_t result = client_open(&self->client, path, client_now_us() + CLIENT_REPLY_US);
    if (result != IWC_OK) {
        return tell_unopened(self, path, result);
    }
    if (iwc_watches_only(self->client.gateway)) {
        (void)ctl_fail(CTL_OK, "by %s you may watch, stop and estop, but not drive", path);
    }
    return CTL_OK;
}

int ctl_exchange(ctl_t *self, json_t *request, json_t **out_reply) {
    int64_t id = 0;
    const int64_t deadline_us = client_now_us() + CLIENT_REPLY_US;
    *out_reply = NULL;
    const int code = self->client.open ? CTL_OK : ctl_connect(self);
    if (code != CTL_OK) {
        json_decref(request);
        return code;
    }
    iwc_result_t result = client_send(&self->client, request, deadline_us, &id);
    if (result == IWC_OK) {
        result = client_wait(&self->client, id, deadline_us, out_reply);
    }
    return (result == IWC_OK) ? CTL_OK : ctl_lost(self, result);
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
