// SPDX-License-Identifier: MIT
#include "control.h"

#include <errno.h>
#include <string.h>
#include <sys/socket.h>

static void drop(sim_control_client_t *client) {
    sim_loop_drop(client->control->loop, &client->watch);
}

static void answer(sim_control_client_t *client, const char *text) {
    size_t const length = strlen(text);
    if (send(client->watch.fd, text, length, MSG_DONTWAIT | MSG_NOSIGNAL) != (ssize_t)length) {
        drop(client);
    }
}

static void execute_line(sim_control_client_t *client, size_t length) {
    char line[SIM_LINE_BYTES];
    memcpy(line, client->line, length);
    line[length] = '\0';
    client->used -= length + 1U;
    memmove(client->line, &client->line[length + 1U], client->used);
    bool const hidden_end = memchr(line, '\0', length) != NULL;
    answer(client, hidden_end ? "error the line contains a NUL byte\n"
                              : client->control->execute(client->control->context, line));
}

static void execute_lines(sim_control_client_t *client) {
    while (client->watch.fd >= 0) {
        const char *const end = memchr(client->line, '\n', client->used);
        if (end == NULL) {
            break;
        }
        execute_line(client, (size_t)(end - client->line));
    }
    if (client->watch.fd >= 0 && client->used == sizeof client->line) {
        answer(client, "error the line is longer than 255 bytes\n");
        if (client->watch.fd >= 0) {
            drop(client);
        }
    }
}

static void client_ready(sim_watch_t *watch) {
    sim_control_client_t *const client = watch->owner;
    if (watch->fd < 0) {
        return;
    }
    ssize_t const length =
        recv(watch->fd, &client->line[client->used], sizeof client->line - client->used, MSG_DONTWAIT);
    if (length > 0) {
        client->used += (size_t)length;
        execute_lines(client);
    } else if (length == 0 || (errno != EAGAIN && errno != EINTR)) {
        drop(client);
    }
}

static bool admit(void *owner, int fd) {
    sim_control_t *const self = owner;
    for (unsigned i = 0U; i < SIM_CONTROL_CLIENTS; i++) {
        sim_control_client_t *const client = &self->client[i];
        if (client->watch.fd < 0) {
            client->watch.fd = fd;
            client->used = 0U;
            if (sim_loop_add(self->loop, &client->watch)) {
                return true;
            }
            client->watch.fd = -1;
            return false;
        }
    }
    return false;
}

bool sim_control_open(sim_control_t *self, const char *path, sim_reason_t *out_reason) {
    for (unsigned i = 0U; i < SIM_CONTROL_CLIENTS; i++) {
        self->client[i].control = self;
        self->client[i].watch = (sim_watch_t){client_ready, &self->client[i], -1};
    }
    self->listener = (sim_listener_t){.loop = self->loop, .admit = admit, .owner = self};
    return sim_listener_open(&self->listener, path, SOCK_STREAM, out_reason);
}

void sim_control_close(sim_control_t *self) {
    for (unsigned i = 0U; i < SIM_CONTROL_CLIENTS; i++) {
        if (self->client[i].watch.fd >= 0) {
            drop(&self->client[i]);
        }
    }
    sim_listener_close(&self->listener);
}
