// SPDX-License-Identifier: MIT
#include "near.h"

#include "text/text.h"

#include <stdio.h>
#include <string.h>
#include <unistd.h>

/// Finds the path of the socket; NEAR_FOUND if there is one to try.
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

static near_t connect_to(ctl_t *ctl, const char *path) {
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
    int64_t id = 0;
    json_t *reply = NULL;
    const int64_t deadline_us = client_now_us() + CLIENT_REPLY_US;
    if (client_send(&ctl->client, request, deadline_us, &id) != IWC_OK ||
        client_wait(&ctl->client, id, deadline_us, &reply) != IWC_OK) {
        return NULL;
    }
    return reply;
}

void near_look(ctl_t *ctl, const char *bus, near_gateway_t *out_gateway) {
    memset(out_gateway, 0, sizeof(*out_gateway));
    near_t result = choose(ctl, bus, out_gateway->path, sizeof out_gateway->path);
    result = (result == NEAR_FOUND) ? connect_to(ctl, out_gateway->path) : result;
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
