// SPDX-License-Identifier: MIT
#include "near.h"

#include "find_socket.h"
#include "text/text.h"

#include <errno.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

/// Finds the path of the socket; NEAR_FOUND if there is one to try.
static near_t choose(const ctl_t *ctl, const char *bus, char *out_path, size_t size) {
    const char *environment = getenv("IWHEEL_SOCKET");
    const char *named = ctl->socket != NULL ? ctl->socket : environment;
    if (named != NULL && named[0] != '\0') {
        (void)snprintf(out_path, size, "%s", named);
        return NEAR_FOUND;
    }
    switch (find_socket(FIND_SOCKET_DIRECTORY, out_path, size)) {
    case FIND_SOCKET_ONE:
        return NEAR_FOUND;
    case FIND_SOCKET_DENIED:
        (void)snprintf(out_path, size, "%s", FIND_SOCKET_DIRECTORY);
        return NEAR_DENIED;
    case FIND_SOCKET_SEVERAL:
        if (bus == NULL) {
            return NEAR_SEVERAL;
        }
        (void)snprintf(out_path, size, "%s/%s.sock", FIND_SOCKET_DIRECTORY, bus);
        return NEAR_FOUND;
    case FIND_SOCKET_NONE:
        break;
    }
    return NEAR_NONE;
}

static near_t connect_to(ctl_t *ctl, const char *path) {
    json_t *hello = NULL;
    const int64_t deadline_us = client_now_us() + CLIENT_REPLY_US;
    const int error = client_open(&ctl->client, path, deadline_us);
    if (error != 0) {
        return error == EACCES || error == EPERM ? NEAR_DENIED : error == ETIMEDOUT ? NEAR_MUTE : NEAR_NONE;
    }
    const bool greeted = client_receive(&ctl->client, deadline_us, &hello) == CLIENT_OK &&
                         strcmp(text_word(hello, "event"), "hello") == 0;
    json_decref(hello);
    return greeted ? NEAR_FOUND : NEAR_MUTE;
}

json_t *near_ask(ctl_t *ctl, json_t *request) {
    int64_t id = 0;
    json_t *reply = NULL;
    const int64_t deadline_us = client_now_us() + CLIENT_REPLY_US;
    if (client_send(&ctl->client, request, deadline_us, &id) != CLIENT_OK ||
        client_wait(&ctl->client, id, deadline_us, &reply) != CLIENT_OK) {
        return NULL;
    }
    return reply;
}

void near_look(ctl_t *ctl, const char *bus, near_gateway_t *out_gateway) {
    memset(out_gateway, 0, sizeof(*out_gateway));
    near_t result = choose(ctl, bus, out_gateway->path, sizeof(out_gateway->path));
    result = result == NEAR_FOUND ? connect_to(ctl, out_gateway->path) : result;
    if (result == NEAR_FOUND) {
        out_gateway->status = near_ask(ctl, json_pack("{s:s}", "cmd", "status"));
        result = out_gateway->status != NULL ? NEAR_FOUND : NEAR_MUTE;
        (void)snprintf(out_gateway->bus, sizeof(out_gateway->bus), "%s",
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
