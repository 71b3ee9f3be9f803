// SPDX-License-Identifier: MIT
#include "iwheel_linux/backend.h"

#include "socketcan_frame.h"
#include "unix_link.h"

#include <errno.h>
#include <string.h>
#include <sys/socket.h>

/// Frames taken from the kernel in one call.
#define BATCH 32U
/// Marks that the hub sets in a frame's `__res0`: an echo of ours, or an error frame that another client made.
#define MARK_ECHO   1U
#define MARK_FORGED 2U

typedef struct {
    iw_unix_link_t link;
    iw_bus_link_t told;
    struct can_frame batch[BATCH];
    uint32_t size[BATCH];
    uint32_t count;
    uint32_t next;
    iw_bus_state_t present;  ///< While the link is up.
    iw_bus_state_t unheeded; ///< A loss that `state` has yet to report: IW_BUS_DOWN or IW_BUS_OFF; else IW_BUS_ACTIVE.
    bool drained;            ///< The last batch was short: nothing more until the next wake-up.
} local_bus_t;

IW_STATIC_ASSERT(sizeof(local_bus_t) <= sizeof(iw_backend_store_t), local_bus_fits);

static int local_open(void *self, const char *name) {
    local_bus_t *bus = (local_bus_t *)self;
    *bus = (local_bus_t){.told = {.presence = IW_LINK_LOCAL, .is_virtual = true, .echo_proven = true},
                         .present = IW_BUS_ACTIVE,
                         .unheeded = IW_BUS_ACTIVE};
    return iw_unix_link_open(&bus->link, name, SOCK_SEQPACKET);
}

static void local_close(void *self) {
    iw_unix_link_close(&((local_bus_t *)self)->link);
}

static int local_watch_fd(const void *self) {
    return ((const local_bus_t *)self)->link.watch_fd;
}

static void local_tend(void *self, iw_time_us_t now_us) {
    local_bus_t *bus = (local_bus_t *)self;
    if (iw_unix_link_tend(&bus->link, now_us)) {
        bus->present = IW_BUS_ACTIVE;
    }
}

static iw_time_us_t local_next_us(const void *self) {
    return ((const local_bus_t *)self)->link.retry_us;
}

/// The hub is gone, and with it every frame of ours that it had not sent.
static void lose(local_bus_t *bus) {
    iw_unix_link_lose(&bus->link);
    bus->unheeded = IW_BUS_DOWN;
    bus->count = 0;
    bus->next = 0;
}

static int local_send(void *self, const iw_can_frame_t *frame) {
    local_bus_t *bus = (local_bus_t *)self;
    if (!iw_unix_link_is_up(&bus->link)) {
        return -1;
    }
    struct can_frame raw = {.can_id = frame->id & IW_CAN_ID_MASK, .len = frame->dlc};
    memcpy(raw.data, frame->data, sizeof raw.data);
    const ssize_t sent = send(bus->link.fd, &raw, sizeof raw, MSG_DONTWAIT | MSG_NOSIGNAL);
    if (sent == (ssize_t)sizeof raw) {
        return 1;
    }
    if (sent < 0 && (errno == EAGAIN || errno == ENOBUFS || errno == EINTR)) {
        return 0;
    }
    lose(bus);
    return -1;
}

/// As on SocketCAN, a bus-off that another client forged stops the wheels, and an end of bus-off that it forged is not
/// believed. A restart has emptied the queue, however short the loss before it and whether it was heard or not.
static void hear_error(local_bus_t *bus, const struct can_frame *raw) {
    const bool forged = raw->__res0 == MARK_FORGED;
    const iw_can_error_t error = iw_can_error_of(raw);
    if (error == IW_CAN_ERROR_BUS_OFF) {
        bus->unheeded = IW_BUS_OFF;
        bus->present = forged ? bus->present : IW_BUS_OFF;
    } else if (forged) {
        return;
    } else if (error == IW_CAN_ERROR_RESTARTED) {
        bus->unheeded = IW_BUS_OFF;
        bus->present = IW_BUS_ACTIVE;
    } else if (bus->present >= IW_BUS_PASSIVE && (error == IW_CAN_ERROR_PASSIVE || error == IW_CAN_ERROR_ACTIVE)) {
        bus->present = (error == IW_CAN_ERROR_PASSIVE) ? IW_BUS_PASSIVE : IW_BUS_ACTIVE;
    }
}

static void fill_batch(local_bus_t *bus) {
    struct mmsghdr message[BATCH];
    struct iovec part[BATCH];
    memset(message, 0, sizeof message);
    for (uint32_t i = 0; i < BATCH; i++) {
        part[i] = (struct iovec){.iov_base = &bus->batch[i], .iov_len = sizeof bus->batch[i]};
        message[i].msg_hdr.msg_iov = &part[i];
        message[i].msg_hdr.msg_iovlen = 1;
    }
    const int count = recvmmsg(bus->link.fd, message, BATCH, MSG_DONTWAIT, NULL);
    bus->next = 0;
    bus->count = (count > 0) ? (uint32_t)count : 0U;
    for (uint32_t i = 0; i < bus->count; i++) {
        const bool whole = (message[i].msg_hdr.msg_flags & MSG_TRUNC) == 0;
        bus->size[i] = whole ? message[i].msg_len : sizeof bus->batch[i] + 1U;
    }
    bus->drained = bus->count < BATCH;
    if (count < 0 && errno != EAGAIN && errno != EINTR) {
        lose(bus);
    }
}

/// Takes the next message of the batch. False: it was no frame for us.
static bool take_message(local_bus_t *bus, iw_can_frame_t *out_frame) {
    const uint32_t i = bus->next++;
    if (bus->size[i] == 0U) { // End of file: the frames before it were still good.
        lose(bus);
        return false;
    }
    if (bus->size[i] != sizeof bus->batch[i]) {
        return false;
    }
    if ((bus->batch[i].can_id & CAN_ERR_FLAG) != 0U) {
        hear_error(bus, &bus->batch[i]);
        return false;
    }
    *out_frame = iw_socketcan_translate(&bus->batch[i], (bus->batch[i].__res0 == MARK_ECHO) ? MSG_CONFIRM : 0);
    return true;
}

static int local_receive(void *self, iw_can_frame_t *out_frame) {
    local_bus_t *bus = (local_bus_t *)self;
    while (iw_unix_link_is_up(&bus->link)) {
        if (bus->next == bus->count) {
            if (bus->drained) {
                bus->drained = false;
                return 0;
            }
            fill_batch(bus);
        } else if (take_message(bus, out_frame)) {
            return 1;
        }
    }
    bus->drained = false;
    return -1;
}

static iw_bus_state_t local_state(void *self) {
    local_bus_t *bus = (local_bus_t *)self;
    const iw_bus_state_t unheeded = bus->unheeded;
    bus->unheeded = IW_BUS_ACTIVE;
    if (unheeded != IW_BUS_ACTIVE) {
        return unheeded;
    }
    return iw_unix_link_is_up(&bus->link) ? bus->present : IW_BUS_DOWN;
}

/// Unsent frames are held by the hub, which drops them with the connection. The next `tend` connects anew.
static int local_purge(void *self) {
    local_bus_t *bus = (local_bus_t *)self;
    if (iw_unix_link_is_up(&bus->link)) {
        lose(bus);
        bus->told.purge = IW_LINK_PURGE_DONE;
        bus->told.changes++;
    }
    return 0;
}

static const iw_bus_link_t *local_link(const void *self) {
    return &((const local_bus_t *)self)->told;
}

const iw_bus_ops_t iw_local_bus_ops = {
    .open = local_open,
    .close = local_close,
    .watch_fd = local_watch_fd,
    .tend = local_tend,
    .next_us = local_next_us,
    .send = local_send,
    .receive = local_receive,
    .state = local_state,
    .purge = local_purge,
    .link = local_link,
};
