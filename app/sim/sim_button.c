// SPDX-License-Identifier: MIT
#include "sim_button.h"

#include <errno.h>
#include <sys/socket.h>

/// Sends the state to a client. Disconnects a client that does not read this byte, because it cannot be informed any
/// more; a lost connection means pressed.
static void send_state(const sim_button_t *self, sim_watch_t *client) {
    char const state = self->pressed ? '1' : '0';
    if (send(client->fd, &state, 1U, MSG_DONTWAIT | MSG_NOSIGNAL) != 1) {
        sim_loop_drop(self->loop, client);
    }
}

static void send_to_all(sim_button_t *self) {
    for (unsigned i = 0U; i < SIM_BUTTON_CLIENTS; i++) {
        if (self->client[i].fd >= 0) {
            send_state(self, &self->client[i]);
        }
    }
}

static void client_ready(sim_watch_t *watch) {
    const sim_button_t *const self = watch->owner;
    char ignored[64];
    ssize_t const length = (watch->fd >= 0) ? recv(watch->fd, ignored, sizeof ignored, MSG_DONTWAIT) : -1;
    if (length == 0 || (length < 0 && watch->fd >= 0 && errno != EAGAIN && errno != EINTR)) {
        sim_loop_drop(self->loop, watch);
    }
}

static bool admit(void *owner, int fd) {
    sim_button_t *const self = owner;
    for (unsigned i = 0U; i < SIM_BUTTON_CLIENTS && !self->unplugged; i++) {
        sim_watch_t *const client = &self->client[i];
        if (client->fd < 0) {
            client->fd = fd;
            if (!sim_loop_add(self->loop, client)) {
                client->fd = -1;
                return false;
            }
            send_state(self, client);
            return true;
        }
    }
    return false;
}

bool sim_button_open(sim_button_t *self, const char *path, sim_reason_t *out_reason) {
    self->release_us = IW_NEVER;
    for (unsigned i = 0U; i < SIM_BUTTON_CLIENTS; i++) {
        self->client[i] = (sim_watch_t){client_ready, self, -1};
    }
    self->listener = (sim_listener_t){.loop = self->loop, .admit = admit, .owner = self};
    return sim_listener_open(&self->listener, path, SOCK_STREAM, out_reason);
}

void sim_button_press(sim_button_t *self, bool pressed) {
    self->release_us = IW_NEVER;
    if (pressed != self->pressed) {
        self->pressed = pressed;
        send_to_all(self);
    }
}

void sim_button_pulse(sim_button_t *self, iw_time_us_t until_us) {
    sim_button_press(self, true);
    self->release_us = until_us;
}

void sim_button_unplug(sim_button_t *self, bool unplugged) {
    self->unplugged = unplugged;
    for (unsigned i = 0U; i < SIM_BUTTON_CLIENTS; i++) {
        if (unplugged && self->client[i].fd >= 0) {
            sim_loop_drop(self->loop, &self->client[i]);
        }
    }
}

bool sim_button_step(sim_button_t *self, iw_time_us_t now_us) {
    if (now_us < self->release_us) {
        return false;
    }
    sim_button_press(self, false);
    return true;
}

void sim_button_close(sim_button_t *self) {
    sim_button_unplug(self, true);
    sim_listener_close(&self->listener);
}
