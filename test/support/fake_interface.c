// SPDX-License-Identifier: MIT
#include "fake_interface.h"

#include <errno.h>
#include <string.h>
#include <sys/eventfd.h>
#include <unistd.h>

fake_interface_t fake_interface;

void fake_interface_init(void) {
    memset(&fake_interface, 0, sizeof fake_interface);
    fake_interface.presence = IW_LINK_UP;
    fake_interface.index = 3;
    fake_interface.carrier = 1;
    fake_interface.state = IW_BUS_ACTIVE;
    fake_interface.send_result = 1;
    fake_interface.restart_result = IW_NETLINK_RESTART_RUNNING;
    fake_interface.link = (iw_bus_link_t){.presence = IW_LINK_UP, .echo_proven = true, .bitrate_hz = 1000000};
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

/// The other socket never counts what it has lost; that tells the two apart.
static fake_queue_t *queue_of(const iw_socketcan_socket_t *self) {
    return (self->lost == UINT32_MAX) ? &fake_interface.others : &fake_interface.ours;
}

void iw_socketcan_socket_init(iw_socketcan_socket_t *self) {
    *self = (iw_socketcan_socket_t){.fd = -1};
}

int iw_socketcan_socket_open(iw_socketcan_socket_t *self, int interface, iw_socketcan_share_t share) {
    iw_socketcan_socket_init(self);
    if (interface != fake_interface.index || fake_interface.sockets_fail) {
        return ENODEV;
    }
    fake_interface.opened += (share == IW_SOCKETCAN_OURS) ? 1U : 0U;
    self->fd = eventfd(0, EFD_NONBLOCK | EFD_CLOEXEC);
    self->lost = (share == IW_SOCKETCAN_OURS) ? 0U : UINT32_MAX;
    queue_of(self)->count = 0; // A new socket has an empty queue.
    return 0;
}

uint32_t iw_socketcan_socket_room(const iw_socketcan_socket_t *self) {
    (void)self;
    return FAKE_ROOM;
}

void iw_socketcan_socket_close(iw_socketcan_socket_t *self) {
    if (self->fd >= 0) {
        (void)close(self->fd);
    }
    iw_socketcan_socket_init(self);
}

void iw_socketcan_socket_use(iw_socketcan_socket_t *self, int fd, bool is_hub) {
    (void)self; // There is no hub.
    (void)fd;
    (void)is_hub;
}

void iw_socketcan_socket_forget(iw_socketcan_socket_t *self) {
    self->count = 0;
    self->next = 0;
    self->drained = false;
}

int iw_socketcan_socket_fill(iw_socketcan_socket_t *self) {
    fake_queue_t *queue = queue_of(self);
    const int error = queue->error;
    fake_interface.fills++;
    queue->error = 0;
    self->next = 0;
    self->count = 0;
    while (error == 0 && queue->count > 0U && self->count < IW_SOCKETCAN_BATCH) {
        self->frame[self->count] = queue->frame[queue->first];
        self->flags[self->count++] = queue->flags[queue->first];
        queue->first = (queue->first + 1U) % FAKE_QUEUE_MAX;
        queue->count--;
    }
    self->drained = self->count < IW_SOCKETCAN_BATCH;
    self->lost = (queue == &fake_interface.ours) ? queue->lost : self->lost;
    return error;
}

int iw_socketcan_socket_drop(iw_socketcan_socket_t *self) {
    fake_queue_t *queue = queue_of(self);
    const int error = queue->error;
    queue->error = 0;
    queue->count = 0;
    iw_socketcan_socket_forget(self);
    return error;
}

int iw_socketcan_socket_send(const iw_socketcan_socket_t *self, const iw_can_frame_t *frames, uint32_t count) {
    (void)self;
    (void)frames;
    return (fake_interface.send_result > 0) ? (int)count : fake_interface.send_result;
}

int iw_netlink_open(iw_netlink_t *self) {
    *self = (iw_netlink_t){0};
    if (fake_interface.open_error == 0) {
        self->sequence = (uint32_t)eventfd(0, EFD_NONBLOCK | EFD_CLOEXEC) + 1U;
    }
    return fake_interface.open_error;
}

int iw_netlink_open_events(iw_netlink_t *self) {
    const int error = iw_netlink_open(self);
    if (fake_interface.events_dead) {
        iw_netlink_close(self);
    }
    return error;
}

void iw_netlink_close(iw_netlink_t *self) {
    if (self->sequence > 0U) {
        (void)close(iw_netlink_fd(self));
    }
    self->sequence = 0;
}

int iw_netlink_fd(const iw_netlink_t *self) {
    return (int)self->sequence - 1; // As a new one has it: none.
}

bool iw_netlink_take_events(iw_netlink_t *self) {
    const bool news = fake_interface.news;
    (void)self;
    fake_interface.news = false;
    return news;
}

int iw_netlink_read(iw_netlink_t *self, const char *name, iw_netlink_reading_t *out_reading) {
    (void)self;
    (void)name;
    fake_interface.readings++;
    *out_reading = (iw_netlink_reading_t){
        .link = fake_interface.link, .index = fake_interface.index, .state = fake_interface.state};
    out_reading->link.presence = fake_interface.presence;
    return fake_interface.netlink_fails ? EIO : 0;
}

int iw_netlink_restart_start(int interface, pid_t *out_process) {
    fake_interface.restarts++;
    fake_interface.restarted = interface;
    *out_process = 1;
    return 0;
}

int iw_netlink_restart_poll(pid_t process) {
    (void)process;
    return fake_interface.restart_result;
}

iw_link_presence_t iw_netdev_presence(int fd, const char *name, int *out_index) {
    (void)fd;
    (void)name;
    for (; fake_interface.late > 0U; fake_interface.late--) {
        fake_interface_put(&fake_interface.ours, 256, 4, 0);
    }
    if (fake_interface.presence != IW_LINK_ABSENT) {
        *out_index = fake_interface.index;
    }
    return fake_interface.presence;
}

int iw_netdev_carrier(const char *name) {
    (void)name;
    fake_interface.looks++;
    return fake_interface.carrier;
}
