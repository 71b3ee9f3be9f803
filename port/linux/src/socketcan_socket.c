// SPDX-License-Identifier: MIT
#include "socketcan_socket.h"

#include <errno.h>
#include <linux/can/raw.h>
#include <string.h>
#include <sys/socket.h>
#include <unistd.h>

/// More batches than fit the requested receive buffer, at half a kilobyte per frame.
#define DROP_BATCHES_MAX 512
/// Marks of the hub in `__res0` of a frame: an echo of this client, or an error frame from another client.
#define MARK_ECHO   1U
#define MARK_FORGED 2U

void iwl_socketcan_socket_init(iwl_socketcan_socket_t *self) {
    memset(self, 0, sizeof *self);
    self->fd = -1;
}

/// All messages share one control buffer: the kernel's count is a running total, so the last one is enough.
void iwl_socketcan_socket_use(iwl_socketcan_socket_t *self, int fd, bool is_hub) {
    iwl_socketcan_socket_init(self);
    self->fd = fd;
    self->is_hub = is_hub;
    for (uint32_t i = 0; i < IWL_SOCKETCAN_BATCH; i++) {
        self->part[i] = (struct iovec){.iov_base = &self->frame[i], .iov_len = sizeof self->frame[i]};
        self->message[i].msg_hdr = (struct msghdr){.msg_iov = &self->part[i],
                                                   .msg_iovlen = 1,
                                                   .msg_control = self->drops,
                                                   .msg_controllen = sizeof self->drops};
    }
}

static bool set(int fd, int level, int name, int value) {
    return setsockopt(fd, level, name, &value, sizeof value) == 0;
}

/// Loopback stays on (the default): it returns the echoes and shows the frames to other programs.
static bool ask_for(int fd, iwl_socketcan_share_t share) {
    const can_err_mask_t errors = iwl_can_error_mask();
    struct can_filter filters[IWL_SOCKETCAN_IDS];
    iwl_socketcan_filters(share, filters);
    if (share == IWL_SOCKETCAN_OTHERS && !set(fd, SOL_CAN_RAW, CAN_RAW_JOIN_FILTERS, 1)) {
        return false;
    }
    if (setsockopt(fd, SOL_CAN_RAW, CAN_RAW_FILTER, filters, sizeof filters) != 0) {
        return false;
    }
    if (share == IWL_SOCKETCAN_OTHERS) {
        return true;
    }
    return setsockopt(fd, SOL_CAN_RAW, CAN_RAW_ERR_FILTER, &errors, sizeof errors) == 0 &&
           set(fd, SOL_CAN_RAW, CAN_RAW_RECV_OWN_MSGS, 1) && set(fd, SOL_SOCKET, SO_RXQ_OVFL, 1);
}

int iwl_socketcan_socket_open(iwl_socketcan_socket_t *self, int interface, iwl_socketcan_share_t share) {
    const struct sockaddr_can address = {.can_family = AF_CAN, .can_ifindex = interface};
    iwl_socketcan_socket_init(self);
    const int fd = socket(PF_CAN, SOCK_RAW | SOCK_NONBLOCK | SOCK_CLOEXEC, CAN_RAW);
    if (fd < 0) {
        return errno;
    }
    (void)set(fd, SOL_CAN_RAW, CAN_RAW_FD_FRAMES, 1); // Without it FD frames are not received, and not counted.
    (void)set(fd, SOL_SOCKET, SO_RCVBUF, (int)IWL_LINK_ROOM_BYTES);
    (void)set(fd, SOL_SOCKET, SO_RCVBUFFORCE, (int)IWL_LINK_ROOM_BYTES); // As root: beyond net.core.rmem_max.
    if (!ask_for(fd, share) || bind(fd, (const struct sockaddr *)&address, sizeof address) != 0) {
        const int error = errno;
        (void)close(fd);
        return error;
    }
    iwl_socketcan_socket_use(self, fd, false);
    return 0;
}

uint32_t iwl_socketcan_socket_room(const iwl_socketcan_socket_t *self) {
    int size = 0;
    socklen_t length = sizeof size;
    return (getsockopt(self->fd, SOL_SOCKET, SO_RCVBUF, &size, &length) == 0) ? (uint32_t)size : 0U;
}

void iwl_socketcan_socket_close(iwl_socketcan_socket_t *self) {
    if (self->fd >= 0) {
        (void)close(self->fd);
    }
    iwl_socketcan_socket_init(self);
}

/// Reads the count from the last message, which has the newest one.
static void note_drops(iwl_socketcan_socket_t *self, struct msghdr *message) {
    const struct cmsghdr *part = CMSG_FIRSTHDR(message);
    if (part != NULL && part->cmsg_level == SOL_SOCKET && part->cmsg_type == SO_RXQ_OVFL) {
        memcpy(&self->lost, CMSG_DATA(part), sizeof self->lost);
    }
}

/// Removes entries that are not frames, and converts the hub's marks to flags. ENOTCONN: the hub is gone. Frames before
/// the end are valid; the next call finds the end again.
static int sieve(iwl_socketcan_socket_t *self) {
    uint32_t good = 0;
    for (uint32_t i = 0; i < self->count; i++) {
        const struct can_frame *raw = &self->frame[i];
        const uint8_t mark = raw->__res0;
        if (self->message[i].msg_len == 0U) {
            self->count = good;
            self->drained = false;
            return (i == 0U) ? ENOTCONN : 0;
        }
        if (self->message[i].msg_len == sizeof *raw && (self->flags[i] & MSG_TRUNC) == 0) {
            self->flags[good] = (mark == MARK_ECHO) ? MSG_CONFIRM : (mark == MARK_FORGED) ? MSG_DONTROUTE : 0;
            self->frame[good++] = *raw;
        }
    }
    self->count = good;
    return 0;
}

int iwl_socketcan_socket_fill(iwl_socketcan_socket_t *self) {
    const int count = recvmmsg(self->fd, self->message, IWL_SOCKETCAN_BATCH, MSG_DONTWAIT, NULL);
    const int error = (count < 0) ? errno : 0;
    self->next = 0;
    self->count = (count > 0) ? (uint32_t)count : 0U;
    self->drained = self->count < IWL_SOCKETCAN_BATCH;
    if (count > 0) {
        note_drops(self, &self->message[count - 1].msg_hdr);
    }
    for (uint32_t i = 0; i < self->count; i++) {
        self->flags[i] = self->message[i].msg_hdr.msg_flags;
        self->message[i].msg_hdr.msg_controllen = sizeof self->drops; // The kernel has written how much of it was used.
    }
    if (self->is_hub && count > 0) {
        return sieve(self);
    }
    return (error == EAGAIN || error == EINTR) ? 0 : error; // ENETDOWN, ENODEV: the interface is down or gone.
}

void iwl_socketcan_socket_forget(iwl_socketcan_socket_t *self) {
    self->count = 0;
    self->next = 0;
    self->drained = false;
}

int iwl_socketcan_socket_drop(iwl_socketcan_socket_t *self) {
    int last = 0;
    for (int i = 0; i < DROP_BATCHES_MAX; i++) {
        const int error = iwl_socketcan_socket_fill(self);
        if (error != 0) {
            last = error;
        }
        if (error == 0 && self->drained) {
            break;
        }
    }
    iwl_socketcan_socket_forget(self);
    return last;
}

/// ENOBUFS: the queue of the interface is full. The port does not retry, because a newer setpoint replaces this one
/// (R6).
int iwl_socketcan_socket_send(const iwl_socketcan_socket_t *self, const iw_can_frame_t *frames, uint32_t count) {
    struct can_frame raw[IW_SIDES];
    struct iovec part[IW_SIDES];
    struct mmsghdr message[IW_SIDES];
    const uint32_t asked = (count < IW_SIDES) ? count : IW_SIDES;
    for (uint32_t i = 0; i < asked; i++) {
        raw[i] = (struct can_frame){.can_id = frames[i].id & ~IW_CAN_FD, .len = frames[i].dlc};
        memcpy(raw[i].data, frames[i].data, sizeof raw[i].data);
        part[i] = (struct iovec){.iov_base = &raw[i], .iov_len = sizeof raw[i]};
        message[i] = (struct mmsghdr){.msg_hdr = {.msg_iov = &part[i], .msg_iovlen = 1}};
    }
    const int sent = sendmmsg(self->fd, message, asked, MSG_DONTWAIT | MSG_NOSIGNAL);
    if (sent < 0) {
        return (errno == EAGAIN || errno == ENOBUFS || errno == EINTR) ? 0 : -1;
    }
    int whole = 0;
    while (whole < sent && message[whole].msg_len == sizeof raw[0]) {
        whole++;
    }
    return (whole > 0) ? whole : -1; // A part of a frame is not a frame.
}
