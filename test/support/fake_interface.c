// SPDX-License-Identifier: MIT
#include "fake_interface.h"

#include <errno.h>
#include <string.h>
#include <sys/eventfd.h>
#include <unistd.h>

fake_interface_t fake_interface;

void fake_interface_init(void) {
    memset(&fake_interface, 0, sizeof fake_interface);
    fake_interface.presence = IWL_LINK_UP;
    fake_interface.index = 3;
    fake_interface.carrier = 1;
    fake_interface.state = IW_BUS_ACTIVE;
    fake_interface.send_result = 1;
    fake_interface.restart_result = IWL_NETLINK_RESTART_RUNNING;
    fake_interface.link = (iwl_bus_link_t){.presence = IWL_LINK_UP, .echo_proven = true, .bitrate_hz = 1000000};
}

void fake_interface_put(fake_queue_t *queue, uint32_t id, uint8_t dlc, int flags) {
    const unsigned at = (queue->first + queue->count) % FAKE_QUEUE_MAX;
    queue->frame[at] = (struct can_frame){.can_id = id, .len = dlc};
    queue->flags[at] = flags;
    queue->count++;
}

void fake_interface_put_error(uint32_t what, uint8_t controller, int flags) {
    fake_queue_t *queue = &fake_interface.ours;
    fake_interface_put(queue, CAN_ERR_FLAG | what, 8, flags);
    queue->frame[(queue->first + queue->count - 1U) % FAKE_QUEUE_MAX].data[1] = controller;
}

/// Only `ours` counts lost frames; the other socket never does.
static fake_queue_t *queue_of(const iwl_socketcan_socket_t *self) {
    return (self->lost == UINT32_MAX) ? &fake_interface.others : &fake_interface.ours;
}

void iwl_socketcan_socket_init(iwl_socketcan_socket_t *self) {
    *self = (iwl_socketcan_socket_t){.fd = -1};
}

int iwl_socketcan_socket_open(iwl_socketcan_socket_t *self, int interface, iwl_socketcan_share_t share) {
    iwl_socketcan_socket_init(self);
    if (interface != fake_interface.index || fake_interface.sockets_fail) {
        return ENODEV;
    }
    fake_interface.opened += (share == IWL_SOCKETCAN_OURS) ? 1U : 0U;
    self->fd = eventfd(0, EFD_NONBLOCK | EFD_CLOEXEC);
    self->lost = (share == IWL_SOCKETCAN_OURS) ? 0U : UINT32_MAX;
    queue_of(self)->count = 0; // A new socket has an empty queue.
    return 0;
}

uint32_t iwl_socketcan_socket_room(const iwl_socketcan_socket_t *self) {
    (void)self;
    return FAKE_ROOM;
}

void iwl_socketcan_socket_close(iwl_socketcan_socket_t *self) {
    if (self->fd >= 0) {
        (void)close(self->fd);
    }
    iwl_socketcan_socket_init(self);
}

void iwl_socketcan_socket_use(iwl_socketcan_socket_t *self, int fd, bool is_hub) {
    (void)self; // There is no hub.
    (void)fd;
    (void)is_hub;
}

void iwl_socketcan_socket_forget(iwl_socketcan_socket_t *self) {
    self->count = 0;
    self->next = 0;
    self->drained = false;
}

int iwl_socketcan_socket_fill(iwl_socketcan_socket_t *self) {
    fake_queue_t *queue = queue_of(self);
    const int error = queue->error;
    fake_interface.fills++;
    queue->error = 0;
    self->next = 0;
    self->count = 0;
    while (error == 0 && queue->count > 0U && self->count < IWL_SOCKETCAN_BATCH) {
        self->frame[self->count] = queue->frame[queue->first];
        self->flags[self->count++] = queue->flags[queue->first];
        queue->first = (queue->first + 1U) % FAKE_QUEUE_MAX;
        queue->count--;
    }
    self->drained = self->count < IWL_SOCKETCAN_BATCH;
    self->lost = (queue == &fake_interface.ours) ? queue->lost : self->lost;
    return error;
}

int iwl_socketcan_socket_drop(iwl_socketcan_socket_t *self) {
    fake_queue_t *queue = queue_of(self);
    const int error = queue->error;
    queue->error = 0;
    queue->count = 0;
    iwl_socketcan_socket_forget(self);
    return error;
}

int iwl_socketcan_socket_send(const iwl_socketcan_socket_t *self, const iw_can_frame_t *frames, uint32_t count) {
    (void)self;
    (void)frames;
    return (fake_interface.send_result > 0) ? (int)count : fake_interface.send_result;
}

int iwl_netlink_open(iwl_netlink_t *self) {
    *self = (iwl_netlink_t){0};
    if (fake_interface.open_error == 0) {
        self->sequence = (uint32_t)eventfd(0, EFD_NONBLOCK | EFD_CLOEXEC) + 1U;
    }
    return fake_interface.open_error;
}

int iwl_netlink_open_events(iwl_netlink_t *self) {
    const int error = iwl_netlink_open(self);
    if (fake_interface.events_dead) {
        iwl_netlink_close(self);
    }
    return error;
}

void iwl_netlink_close(iwl_netlink_t *self) {
    if (self->sequence > 0U) {
        (void)close(iwl_netlink_fd(self));
    }
    self->sequence = 0;
}

int iwl_netlink_fd(const iwl_netlink_t *self) {
    return (int)self->sequence - 1; // A new socket expects no answer.
}

bool iwl_netlink_take_events(iwl_netlink_t *self) {
    const bool news = fake_interface.news;
    (void)self;
    fake_interface.news = false;
    return news;
}

int iwl_netlink_read(iwl_netlink_t *self, const char *name, iwl_netlink_reading_t *out_reading) {
    (void)self;
    (void)name;
    fake_interface.readings++;
    *out_reading = (iwl_netlink_reading_t){
        .link = fake_interface.link, .index = fake_interface.index, .state = fake_interface.state};
    out_reading->link.presence = fake_interface.presence;
    return fake_interface.netlink_fails ? EIO : 0;
}

int iwl_netlink_restart_start(int interface, pid_t *out_process) {
    fake_interface.restarts++;
    fake_interface.restarted = interface;
    *out_process = 1;
    return 0;
}

int iwl_netlink_restart_poll(pid_t process) {
    (void)process;
    return fake_interface.restart_result;
}

iwl_link_presence_t iwl_netdev_presence(int fd, const char *name, int *out_index) {
    (void)fd;
    (void)name;
    for (; fake_interface.late > 0U; fake_interface.late--) {
        fake_interface_put(&fake_interface.ours, 256, 4, 0);
    }
    if (fake_interface.presence != IWL_LINK_ABSENT) {
        *out_index = fake_interface.index;
    }
    return fake_interface.presence;
}

int iwl_netdev_carrier(const char *name) {
    (void)name;
    fake_interface.polls++;
    return fake_interface.carrier;
}
