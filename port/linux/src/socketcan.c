// SPDX-License-Identifier: MIT
#include "iwheel_linux/backend.h"

#include "netlink.h"
#include "socketcan_socket.h"

#include <errno.h>
#include <string.h>
#include <sys/epoll.h>
#include <sys/socket.h>
#include <unistd.h>

/// An interface that is gone or down, and a controller that is bus-off, are looked at this often.
#define RETRY_US 200000U
/// Frames of unknown ids taken in one step; those of known ids go first.
#define OTHERS_PER_STEP 128U
/// Batches of nothing but error frames taken in one step: a flood of them must not hold up the loop.
#define ERROR_BATCHES_PER_STEP 8U
#define LOAD_WINDOW_US         1000000U
/// Where the kernel does not report the bit rate, load is told as if it were the wheels'.
#define BITRATE_ASSUMED_HZ 1000000U

typedef struct {
    const char *name;
    iw_netlink_t netlink;
    iw_bus_link_t link;
    iw_socketcan_socket_t ours;   ///< The eleven ids: what the wheels depend on.
    iw_socketcan_socket_t others; ///< Everything else, drained last. Not watched: any step will do.
    iw_time_us_t now_us;          ///< Of the last `tend`.
    iw_time_us_t retry_us;        ///< When to open again; IW_NEVER while open.
    iw_time_us_t ask_us;          ///< When to ask the kernel for the state again; IW_NEVER: no need.
    iw_time_us_t asked_us;
    iw_time_us_t load_since_us;
    uint64_t load_bits;
    iw_bus_state_t present;  ///< While open.
    iw_bus_state_t unheeded; ///< A loss that `state` has not told yet: IW_BUS_DOWN or IW_BUS_OFF; else IW_BUS_ACTIVE.
    uint32_t others_left;    ///< Of this step.
    uint32_t errors_left;
    int interface;
    int watch_fd;
} socketcan_t;

IW_STATIC_ASSERT(sizeof(socketcan_t) <= sizeof(iw_backend_store_t), socketcan_fits);

static bool is_open(const socketcan_t *bus) {
    return bus->ours.fd >= 0;
}

static void close_sockets(socketcan_t *bus) {
    iw_socketcan_socket_close(&bus->ours);
    iw_socketcan_socket_close(&bus->others);
}

/// The interface is gone or was down. Going down, the kernel emptied its queue; what our sockets still hold is old.
static void lose(socketcan_t *bus) {
    close_sockets(bus);
    bus->unheeded = IW_BUS_DOWN;
    bus->retry_us = bus->now_us;
    bus->ask_us = IW_NEVER;
}

static void note_link(socketcan_t *bus, const iw_bus_link_t *reading) {
    const iw_bus_link_t before = bus->link;
    if (iw_bus_link_is_same(&before, reading)) {
        return;
    }
    bus->link = *reading;
    bus->link.purge = before.purge;
    bus->link.changes = before.changes + 1U;
    bus->link.lost = before.lost;
    bus->link.load_permille = before.load_permille;
}

static void note_state(socketcan_t *bus, iw_bus_state_t state) {
    bus->present = state;
    if (state < IW_BUS_PASSIVE) {
        bus->unheeded = state;
        bus->ask_us = bus->now_us + RETRY_US;
    } else {
        bus->ask_us = IW_NEVER;
    }
}

/// Asks the kernel what the interface and its controller are. False if it did not answer.
static bool ask(socketcan_t *bus, iw_netlink_reading_t *out_reading) {
    bus->asked_us = bus->now_us;
    if (iw_netlink_read(&bus->netlink, bus->name, out_reading) != 0) {
        return false;
    }
    note_link(bus, &out_reading->link);
    return true;
}

static bool open_sockets(socketcan_t *bus, int interface) {
    struct epoll_event interest = {.events = EPOLLIN};
    if (iw_socketcan_socket_open(&bus->ours, interface, IW_SOCKETCAN_OURS) == 0 &&
        iw_socketcan_socket_open(&bus->others, interface, IW_SOCKETCAN_OTHERS) == 0 &&
        epoll_ctl(bus->watch_fd, EPOLL_CTL_ADD, bus->ours.fd, &interest) == 0) {
        return true;
    }
    close_sockets(bus);
    return false;
}

static void try_open(socketcan_t *bus) {
    iw_netlink_reading_t reading;
    bus->retry_us = bus->now_us + RETRY_US;
    if (ask(bus, &reading) && reading.link.presence == IW_LINK_UP && open_sockets(bus, reading.index)) {
        bus->retry_us = IW_NEVER;
        bus->interface = reading.index;
        bus->link.lost = 0;
        bus->load_bits = 0;
        bus->load_since_us = bus->now_us;
        note_state(bus, reading.state);
    }
}

/// The state has changed without an error frame that could be trusted, or one may have been lost.
static void doubt_state(socketcan_t *bus) {
    const iw_time_us_t soonest_us = bus->asked_us + RETRY_US;
    const iw_time_us_t due_us = bus->now_us > soonest_us ? bus->now_us : soonest_us;
    bus->ask_us = due_us < bus->ask_us ? due_us : bus->ask_us;
}

/// `forged`: a process of this machine sent it, which any may do. Bad news stop the wheels all the same; but what is
/// true now is then asked of the kernel, and good news are not believed.
static void hear_error(socketcan_t *bus, iw_can_error_t error, bool forged) {
    if (error == IW_CAN_ERROR_BUS_OFF) {
        bus->unheeded = IW_BUS_OFF;
        bus->present = forged ? bus->present : IW_BUS_OFF;
        doubt_state(bus);
    } else if (forged) {
        return;
    } else if (error == IW_CAN_ERROR_PASSIVE) {
        bus->present = IW_BUS_PASSIVE;
    } else if (error == IW_CAN_ERROR_RESTARTED || (error == IW_CAN_ERROR_ACTIVE && bus->present == IW_BUS_PASSIVE)) {
        bus->present = IW_BUS_ACTIVE;
    }
}

/// Takes a batch and looks at its error frames at once, so that the state is known before anything is sent.
static void fill_ours(socketcan_t *bus) {
    iw_socketcan_socket_t *ours = &bus->ours;
    const uint32_t lost = ours->lost;
    uint32_t errors = 0;
    if (iw_socketcan_socket_fill(ours) != 0) {
        lose(bus);
        return;
    }
    for (uint32_t i = 0; i < ours->count; ++i) {
        const struct can_frame *raw = &ours->frame[i];
        if ((raw->can_id & CAN_ERR_FLAG) != 0U) {
            hear_error(bus, iw_can_error_of(raw), (ours->flags[i] & MSG_DONTROUTE) != 0);
            ++errors;
        } else {
            bus->load_bits += iw_socketcan_bits(raw);
        }
    }
    if (errors == ours->count && errors > 0U) {
        bus->errors_left -= bus->errors_left > 0U ? 1U : 0U;
    }
    if (ours->lost != lost) {
        bus->link.lost = ours->lost;
        doubt_state(bus);
    }
}

static void measure_load(socketcan_t *bus) {
    const iw_time_us_t span_us = bus->now_us - bus->load_since_us;
    if (span_us >= LOAD_WINDOW_US) {
        const uint64_t rate_hz = bus->link.bitrate_hz != 0U ? bus->link.bitrate_hz : BITRATE_ASSUMED_HZ;
        bus->link.load_permille = (uint32_t)(bus->load_bits * 1000000U / rate_hz * 1000U / span_us);
        bus->load_bits = 0;
        bus->load_since_us = bus->now_us;
    }
}

static int can_open(void *self, const char *name) {
    socketcan_t *bus = (socketcan_t *)self;
    iw_socketcan_socket_t probe;
    (void)memset(bus, 0, sizeof *bus);
    bus->name = name;
    bus->present = IW_BUS_ACTIVE;
    bus->unheeded = IW_BUS_ACTIVE;
    bus->ask_us = IW_NEVER;
    bus->link.presence = IW_LINK_ABSENT;
    iw_socketcan_socket_init(&bus->ours);
    iw_socketcan_socket_init(&bus->others);
    int error = iw_socketcan_socket_open(&probe, 0, IW_SOCKETCAN_OURS); // On any interface: can this kernel do CAN?
    if (error == 0) {
        iw_socketcan_socket_close(&probe);
        error = iw_netlink_open(&bus->netlink);
    }
    if (error != 0) {
        return error;
    }
    bus->watch_fd = epoll_create1(EPOLL_CLOEXEC);
    if (bus->watch_fd < 0) {
        error = errno;
        iw_netlink_close(&bus->netlink);
        return error;
    }
    try_open(bus);
    return 0;
}

static void can_close(void *self) {
    socketcan_t *bus = (socketcan_t *)self;
    close_sockets(bus);
    iw_netlink_close(&bus->netlink);
    (void)close(bus->watch_fd);
}

static int can_watch_fd(const void *self) {
    return ((const socketcan_t *)self)->watch_fd;
}

static void can_tend(void *self, iw_time_us_t now_us) {
    socketcan_t *bus = (socketcan_t *)self;
    bus->now_us = now_us;
    bus->others_left = OTHERS_PER_STEP;
    bus->errors_left = ERROR_BATCHES_PER_STEP;
    if (!is_open(bus) && now_us >= bus->retry_us) {
        try_open(bus);
    }
    if (!is_open(bus)) {
        return;
    }
    if (iw_socketcan_socket_is_empty(&bus->ours)) {
        fill_ours(bus);
    }
    if (is_open(bus) && now_us >= bus->ask_us) {
        iw_netlink_reading_t reading;
        bus->ask_us = now_us + RETRY_US;
        if (ask(bus, &reading)) {
            note_state(bus, reading.state);
        }
    }
    measure_load(bus);
}

static iw_time_us_t can_next_us(const void *self) {
    const socketcan_t *bus = (const socketcan_t *)self;
    return bus->retry_us < bus->ask_us ? bus->retry_us : bus->ask_us;
}

static int can_send(void *self, const iw_can_frame_t *frame) {
    socketcan_t *bus = (socketcan_t *)self;
    const int result = is_open(bus) ? iw_socketcan_socket_send(&bus->ours, frame) : -1;
    if (result < 0 && is_open(bus)) {
        lose(bus);
    }
    return result;
}

/// The next frame of the batch that is no error frame. False if there is none.
static bool take(iw_socketcan_socket_t *from, iw_can_frame_t *out_frame) {
    while (!iw_socketcan_socket_is_empty(from)) {
        const uint32_t i = from->next++;
        if ((from->frame[i].can_id & CAN_ERR_FLAG) == 0U) {
            *out_frame = iw_socketcan_translate(&from->frame[i], from->flags[i]);
            return true;
        }
    }
    return false;
}

static bool take_ours(socketcan_t *bus, iw_can_frame_t *out_frame) {
    while (!take(&bus->ours, out_frame)) {
        if (!is_open(bus) || bus->ours.drained || bus->errors_left == 0U) {
            bus->ours.drained = false;
            return false;
        }
        fill_ours(bus);
    }
    return true;
}

static bool take_others(socketcan_t *bus, iw_can_frame_t *out_frame) {
    iw_socketcan_socket_t *others = &bus->others;
    if (!is_open(bus) || bus->others_left == 0U) {
        return false;
    }
    if (iw_socketcan_socket_is_empty(others) && !others->drained && iw_socketcan_socket_fill(others) != 0) {
        lose(bus);
        return false;
    }
    if (!take(others, out_frame)) {
        others->drained = false;
        return false;
    }
    bus->load_bits += iw_socketcan_bits(&others->frame[others->next - 1U]);
    --bus->others_left;
    return true;
}

static int can_receive(void *self, iw_can_frame_t *out_frame) {
    socketcan_t *bus = (socketcan_t *)self;
    if (take_ours(bus, out_frame) || take_others(bus, out_frame)) {
        return 1;
    }
    return is_open(bus) ? 0 : -1;
}

static iw_bus_state_t can_state(void *self) {
    socketcan_t *bus = (socketcan_t *)self;
    const iw_bus_state_t unheeded = bus->unheeded;
    bus->unheeded = IW_BUS_ACTIVE;
    if (unheeded != IW_BUS_ACTIVE) {
        return unheeded;
    }
    return is_open(bus) ? bus->present : IW_BUS_DOWN;
}

/// Takes the link down, which empties the queue and the controller, and up again.
static int can_purge(void *self) {
    socketcan_t *bus = (socketcan_t *)self;
    const bool proves = bus->link.echo_proven;
    int error = is_open(bus) ? iw_netlink_set_up(&bus->netlink, bus->interface, false) : ENETDOWN;
    if (error == 0) {
        lose(bus);
        error = iw_netlink_set_up(&bus->netlink, bus->interface, true);
        error = error == 0 ? 0 : iw_netlink_set_up(&bus->netlink, bus->interface, true);
        try_open(bus);
    }
    bus->link.purge = error == 0                          ? IW_LINK_PURGE_DONE
                      : error == EPERM || error == EACCES ? IW_LINK_PURGE_NOT_ALLOWED
                                                          : IW_LINK_PURGE_FAILED;
    ++bus->link.changes;
    return error == 0 && proves ? 1 : 0;
}

static const iw_bus_link_t *can_link(const void *self) {
    return &((const socketcan_t *)self)->link;
}

static const iw_bus_ops_t ops = {
    .open = can_open,
    .close = can_close,
    .watch_fd = can_watch_fd,
    .tend = can_tend,
    .next_us = can_next_us,
    .send = can_send,
    .receive = can_receive,
    .state = can_state,
    .purge = can_purge,
    .link = can_link,
};

const iw_bus_ops_t *const iw_socketcan_ops = &ops;
