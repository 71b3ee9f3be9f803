// SPDX-License-Identifier: MIT
/// Bus of the simulator: a connection to its hub. The hub sends the echo when the simulated wheels have acknowledged
/// the frame, so the echo is a proof.
#include "bus.h"
#include "unix_link.h"

#include <errno.h>

typedef struct {
    iwl_bus_t bus;
    iwl_unix_link_t hub;
} local_bus_t;

IW_STATIC_ASSERT(sizeof(local_bus_t) <= sizeof(iwl_backend_store_t), local_bus_fits);

/// Updates the state from the connection.
static void follow(local_bus_t *local) {
    local->bus.up = iwl_unix_link_is_up(&local->hub);
    local->bus.poll_us = local->hub.retry_us;
    local->bus.ours.fd = local->hub.fd;
}

static int local_open(iwl_bus_t *self, const char *name) {
    local_bus_t *local = (local_bus_t *)(void *)self;
    self->link = (iwl_bus_link_t){.presence = IWL_LINK_LOCAL, .is_virtual = true, .echo_proven = true};
    const int error = iwl_unix_link_open(&local->hub, name, SOCK_SEQPACKET);
    if (error == 0) {
        self->watch_fd = local->hub.watch_fd;
        iwl_socketcan_socket_use(&self->ours, -1, true);
        follow(local);
    }
    return error;
}

static void local_close(iwl_bus_t *self) {
    iwl_unix_link_close(&((local_bus_t *)(void *)self)->hub);
}

static void local_poll(iwl_bus_t *self) {
    local_bus_t *local = (local_bus_t *)(void *)self;
    if (iwl_unix_link_poll(&local->hub, self->now_us)) {
        self->present = IW_BUS_ACTIVE;
    }
    follow(local);
}

/// The hub is gone, with every frame that it had not sent.
static void local_lost(iwl_bus_t *self, int error) {
    local_bus_t *local = (local_bus_t *)(void *)self;
    (void)error;
    iwl_unix_link_lose(&local->hub);
    follow(local);
}

/// The hub holds frames that are not sent, and drops them with the connection. The next `poll` connects again.
static int local_purge(iwl_bus_t *self) {
    if (self->up) {
        iwl_bus_lose(self, ENOTCONN);
        self->link.purge = IWL_LINK_PURGE_DONE;
        self->link.changes++;
    }
    return 0;
}

const iwl_bus_kind_t iwl_local_bus_kind = {
    .open = local_open,
    .close = local_close,
    .poll = local_poll,
    .purge = local_purge,
    .lost = local_lost,
};
