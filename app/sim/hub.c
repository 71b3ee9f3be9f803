// SPDX-License-Identifier: MIT
#include "hub.h"

#include <errno.h>
#include <linux/can.h>
#include <linux/can/error.h>
#include <string.h>
#include <sys/socket.h>

/// Maximum number of messages read from one client before the other clients have their turn.
#define BATCH 32
/// Values of `__res0`.
#define MARK_NONE   0U
#define MARK_ECHO   1U
#define MARK_FORGED 2U

_Static_assert(IW_CAN_EXTENDED == CAN_EFF_FLAG && IW_CAN_REMOTE == CAN_RTR_FLAG && IW_CAN_ERROR == CAN_ERR_FLAG,
               "the id word is that of <linux/can.h>");
_Static_assert(sizeof(struct can_frame) == 16, "a message of the local bus has 16 bytes");

iw_can_frame_t sim_hub_error_frame(sim_error_t error) {
    iw_can_frame_t frame = {.id = CAN_ERR_FLAG | CAN_ERR_CRTL, .dlc = CAN_ERR_DLC};
    if (error == SIM_ERROR_BUS_OFF) {
        frame.id = CAN_ERR_FLAG | CAN_ERR_BUSOFF;
    } else if (error == SIM_ERROR_RESTARTED) {
        frame.id = CAN_ERR_FLAG | CAN_ERR_RESTARTED;
    } else if (error == SIM_ERROR_PASSIVE) {
        frame.data[1] = CAN_ERR_CRTL_TX_PASSIVE | CAN_ERR_CRTL_RX_PASSIVE;
    } else {
        frame.data[1] = CAN_ERR_CRTL_ACTIVE;
    }
    return frame;
}

static void drop(sim_client_t *client) {
    sim_hub_t *const hub = client->hub;
    sim_loop_drop(hub->loop, &client->watch);
    hub->clients -= 1U;
    sim_world_disconnect(hub->world, *hub->now_us, client->port);
}

static void pass_on(sim_client_t *client, const iw_can_frame_t *frame, uint8_t mark) {
    struct can_frame message = {.can_id = frame->id, .can_dlc = frame->dlc, .__res0 = mark};
    memcpy(message.data, frame->data, sizeof message.data);
    if (send(client->watch.fd, &message, sizeof message, MSG_DONTWAIT | MSG_NOSIGNAL) != (ssize_t)sizeof message) {
        client->lost += 1U;
        client->hub->lost += 1U;
    }
}

void sim_hub_deliver(sim_hub_t *self, const sim_delivery_t *delivery) {
    for (unsigned i = 0U; i < SIM_WORLD_CLIENTS; i++) {
        if (self->client[i].watch.fd >= 0) {
            bool const own = self->client[i].port == delivery->port;
            pass_on(&self->client[i], &delivery->frame, own ? MARK_ECHO : MARK_NONE);
        }
    }
}

static void send_to_others(sim_hub_t *self, const sim_client_t *from, const iw_can_frame_t *frame) {
    for (unsigned i = 0U; i < SIM_WORLD_CLIENTS; i++) {
        if (self->client[i].watch.fd >= 0 && &self->client[i] != from) {
            pass_on(&self->client[i], frame, (from == NULL) ? MARK_NONE : MARK_FORGED);
        }
    }
}

void sim_hub_report(sim_hub_t *self, const iw_can_frame_t *error_frame) {
    send_to_others(self, NULL, error_frame);
}

static void forward(sim_client_t *client, const struct can_frame *message) {
    sim_hub_t *const hub = client->hub;
    iw_can_frame_t frame = {.id = message->can_id, .dlc = message->can_dlc};
    memcpy(frame.data, message->data, sizeof frame.data);
    if ((frame.id & IW_CAN_ERROR) != 0U) {
        send_to_others(hub, client, &frame);
        return;
    }
    if ((frame.id & IW_CAN_EXTENDED) == 0U) {
        frame.id &= IW_CAN_ID_MASK | IW_CAN_REMOTE;
    }
    sim_world_submit(hub->world, *hub->now_us, client->port, &frame);
}

static void client_ready(sim_watch_t *watch) {
    sim_client_t *const client = watch->owner;
    for (unsigned i = 0U; i < BATCH && watch->fd >= 0; i++) {
        unsigned char bytes[sizeof(struct can_frame) + 1U];
        struct can_frame message;
        ssize_t const length = recv(watch->fd, bytes, sizeof bytes, MSG_DONTWAIT);
        if (length < 0 && (errno == EAGAIN || errno == EINTR)) {
            return;
        }
        if (length <= 0) {
            drop(client);
            return;
        }
        memcpy(&message, bytes, sizeof message);
        if (length == (ssize_t)sizeof message && message.can_dlc <= CAN_MAX_DLEN) {
            forward(client, &message);
        } else {
            client->hub->malformed += 1U;
        }
    }
}

/// Connects the new client to a free port of the world. Returns false if the hub cannot accept it.
static bool admit(void *owner, int fd) {
    sim_hub_t *const self = owner;
    uint8_t const port = self->down ? SIM_BUS_NONE : sim_world_connect(self->world);
    if (port == SIM_BUS_NONE) {
        return false;
    }
    sim_client_t *const client = &self->client[port - SIM_PORT_CLIENT];
    *client = (sim_client_t){.watch = {client_ready, client, fd}, .hub = self, .port = port};
    if (!sim_loop_add(self->loop, &client->watch)) {
        client->watch.fd = -1;
        sim_world_disconnect(self->world, *self->now_us, port);
        return false;
    }
    self->clients += 1U;
    if (self->world->bus_off) {
        iw_can_frame_t const frame = sim_hub_error_frame(SIM_ERROR_BUS_OFF);
        pass_on(client, &frame, MARK_NONE);
    }
    return true;
}

bool sim_hub_open(sim_hub_t *self, const char *path, sim_reason_t *out_reason) {
    for (unsigned i = 0U; i < SIM_WORLD_CLIENTS; i++) {
        self->client[i].watch.fd = -1;
    }
    self->listener = (sim_listener_t){.loop = self->loop, .admit = admit, .owner = self};
    return sim_listener_open(&self->listener, path, SOCK_SEQPACKET, out_reason);
}

static void drop_all(sim_hub_t *self) {
    for (unsigned i = 0U; i < SIM_WORLD_CLIENTS; i++) {
        if (self->client[i].watch.fd >= 0) {
            drop(&self->client[i]);
        }
    }
}

void sim_hub_down(sim_hub_t *self, bool down) {
    self->down = down;
    if (down) {
        drop_all(self);
    }
}

void sim_hub_close(sim_hub_t *self) {
    drop_all(self);
    sim_listener_close(&self->listener);
}
