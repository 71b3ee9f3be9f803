// SPDX-License-Identifier: MIT
/// A SocketCAN interface as the bus: reopened by its name, its losses reported, old frames never sent again.
///
///     CLOSED --interface up: sockets bound--> UP --ENETDOWN, ENODEV--> DOWN --interface up again--> UP
///       ^                                                               |
///       +------------- ENODEV, or another index by this name -----------+
///
///     within UP, by error frames: ACTIVE <--> PASSIVE --bus-off--> BUS_OFF --restarted, or carrier back--> ACTIVE
///
/// CLOSED: `interface` is 0. The first UP comes from it; an interface that was deleted or unplugged and comes back has
/// a new index and needs new sockets. DOWN: `up` is false, the sockets are kept, since closing them may wait for
/// whoever configures interfaces (netdev.h), and what they still hold is dropped. `present` holds the state within UP.
///
/// Every way into DOWN or BUS_OFF, and a restart whose bus-off was not heard, sets `unheeded`: `state` reports that
/// loss once, even if the bus is back already, because the kernel's queue is empty then and no echo is owed any more
/// (hal.h).
///
///     purge: NONE --asked: child process takes the link down and up--> RESTARTING --> DONE | NOT_ALLOWED | FAILED
///
/// `restarting` is that process. While it works UP goes to DOWN and back as above: that loss is the purge's answer to
/// the core, `link.purge` only what is shown to people. NOT_ALLOWED stays, DONE and FAILED may be asked again.
#include "iwheel_linux/backend.h"

#include "bus_load.h"
#include "netdev.h"
#include "netlink.h"
#include "netlink_restart.h"
#include "socketcan_socket.h"

#include <errno.h>
#include <sys/epoll.h>
#include <sys/socket.h>
#include <unistd.h>

/// An interface that is gone or down, and a controller that is bus-off, are looked at at least this often.
#define RETRY_US 200000U
/// Frames of unknown ids taken at once, after those of known ids, and how often: a full bus brings fewer in that time.
#define OTHERS_AT_ONCE  256U
#define OTHERS_EVERY_US 10000U
/// So soon after a setpoint, and thus not right before the next one, which would come later than the one before.
#define OTHERS_AFTER_SEND_US 3000U
/// Batches of nothing but error frames taken in one step: a flood of them must not hold up the loop.
#define ERROR_BATCHES_PER_STEP 8U

typedef struct {
    const char *name;
    iw_netlink_t netlink;
    iw_netlink_t events; ///< Wakes us when an interface comes.
    iw_bus_link_t link;
    iw_socketcan_socket_t ours;   ///< The eleven ids: what the wheels depend on.
    iw_socketcan_socket_t others; ///< Everything else, drained last. Not watched: any step will do.
    iw_time_us_t now_us;          ///< Of the last `tend`.
    iw_time_us_t look_us;         ///< When to look at the interface or its carrier again; IW_NEVER: no need.
    iw_time_us_t others_us;       ///< When to look at `others` again.
    iw_bus_load_t load;
    iw_bus_state_t present;  ///< While up.
    iw_bus_state_t unheeded; ///< A loss that `state` has yet to report: IW_BUS_DOWN or IW_BUS_OFF; else IW_BUS_ACTIVE.
    uint32_t others_left;    ///< Until `others_us`.
    uint32_t errors_left;
    pid_t restarting; ///< The process that purges; 0: none.
    int probe_fd;     ///< For looking at interfaces.
    int interface;    ///< That the sockets are bound to; 0: none, they are closed or dead.
    int watch_fd;
    bool up; ///< Frames can pass. While down the sockets stay as they are: closing them may take long (netdev.h).
} socketcan_t;

IW_STATIC_ASSERT(sizeof(socketcan_t) <= sizeof(iw_backend_store_t), socketcan_fits);

static void close_sockets(socketcan_t *bus) {
    iw_socketcan_socket_close(&bus->ours);
    iw_socketcan_socket_close(&bus->others);
    bus->interface = 0;
}

/// The interface is gone or was down. Going down, the kernel emptied its queue; what our sockets still hold is old.
static void lose(socketcan_t *bus, int error) {
    bus->up = false;
    bus->unheeded = IW_BUS_DOWN;
    bus->look_us = bus->now_us;
    bus->interface = (error == ENODEV) ? 0 : bus->interface;
    iw_socketcan_socket_forget(&bus->ours);
    iw_socketcan_socket_forget(&bus->others);
}

/// Takes over what the kernel reports; what this file counts itself stays.
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

/// The kernel's answer to how the interface is set; unanswered, only that it is there is known.
static iw_bus_state_t read_link(socketcan_t *bus) {
    iw_netlink_reading_t reading;
    if (iw_netlink_read(&bus->netlink, bus->name, &reading) != 0) {
        reading = (iw_netlink_reading_t){.link = {.presence = IW_LINK_UP}, .state = IW_BUS_ACTIVE};
    }
    note_link(bus, &reading.link);
    return reading.state;
}

static bool open_sockets(socketcan_t *bus, int interface) {
    struct epoll_event interest = {.events = EPOLLIN};
    close_sockets(bus);
    if (iw_socketcan_socket_open(&bus->ours, interface, IW_SOCKETCAN_OURS) == 0 &&
        iw_socketcan_socket_open(&bus->others, interface, IW_SOCKETCAN_OTHERS) == 0 &&
        epoll_ctl(bus->watch_fd, EPOLL_CTL_ADD, bus->ours.fd, &interest) == 0) {
        bus->interface = interface;
        return true;
    }
    close_sockets(bus);
    return false;
}

/// While down: drops what the sockets still hold, frames and errors, and finds out whether they are dead.
static void drop_old(socketcan_t *bus) {
    if (bus->ours.fd < 0) {
        return;
    }
    const int error = iw_socketcan_socket_drop(&bus->ours);
    (void)iw_socketcan_socket_drop(&bus->others);
    bus->interface = (error == ENODEV) ? 0 : bus->interface;
}

/// The carrier is looked at again while bus-off: with a forged or a lost error frame nothing else would end it.
static void note_state(socketcan_t *bus, iw_bus_state_t state) {
    bus->present = state;
    bus->unheeded = (state < IW_BUS_PASSIVE) ? state : bus->unheeded;
    bus->look_us = (state < IW_BUS_PASSIVE) ? bus->now_us + RETRY_US : IW_NEVER;
}

/// Looks whether the interface is back, and if so goes on with the sockets there are, or opens new ones.
static void try_up(socketcan_t *bus) {
    int interface = 0;
    iw_bus_link_t link = bus->link;
    bus->look_us = bus->now_us + RETRY_US;
    link.presence = iw_netdev_presence(bus->probe_fd, bus->name, &interface);
    if (link.presence != IW_LINK_UP) {
        note_link(bus, &link);
        return;
    }
    drop_old(bus);
    if (interface != bus->interface && !open_sockets(bus, interface)) {
        return;
    }
    bus->up = true;
    bus->link.lost = bus->ours.lost;
    iw_bus_load_begin(&bus->load, bus->now_us);
    note_state(bus, read_link(bus));
}

/// While up: is the controller really bus-off, or no longer?
static void look_at_carrier(socketcan_t *bus) {
    const int carrier = iw_netdev_carrier(bus->name);
    if (carrier == 0) {
        note_state(bus, IW_BUS_OFF);
    } else {
        note_state(bus, (bus->present < IW_BUS_PASSIVE) ? IW_BUS_ACTIVE : bus->present);
    }
}

/// `forged`: sent by a process of this machine (MSG_DONTROUTE), which any user may do (fault 19). A bus-off stops the
/// wheels all the same; an end of bus-off is then not believed, and the carrier shows how long it really lasts.
static void hear_error(socketcan_t *bus, iw_can_error_t error, bool forged) {
    if (error == IW_CAN_ERROR_BUS_OFF) {
        bus->unheeded = IW_BUS_OFF;
        bus->present = forged ? bus->present : IW_BUS_OFF;
        bus->look_us = bus->now_us + (forged ? 0U : RETRY_US);
    } else if (forged) {
        return;
    } else if (error == IW_CAN_ERROR_RESTARTED) {
        bus->unheeded = IW_BUS_OFF; // Also if that was not heard: the restart has emptied the queue.
        bus->present = IW_BUS_ACTIVE;
    } else if (error == IW_CAN_ERROR_PASSIVE) {
        bus->present = IW_BUS_PASSIVE;
    } else if (error == IW_CAN_ERROR_ACTIVE && bus->present == IW_BUS_PASSIVE) {
        bus->present = IW_BUS_ACTIVE;
    }
}

/// Takes a batch and looks at its error frames at once, so that the state is known before anything is sent.
static void fill_ours(socketcan_t *bus) {
    iw_socketcan_socket_t *ours = &bus->ours;
    const uint32_t lost = ours->lost;
    uint32_t errors = 0;
    const int error = iw_socketcan_socket_fill(ours);
    if (error != 0) {
        lose(bus, error);
        return;
    }
    for (uint32_t i = 0; i < ours->count; i++) {
        const struct can_frame *raw = &ours->frame[i];
        if ((raw->can_id & CAN_ERR_FLAG) != 0U) {
            hear_error(bus, iw_can_error_of(raw), (ours->flags[i] & MSG_DONTROUTE) != 0);
            errors++;
        } else {
            bus->load.bits += iw_socketcan_bits(raw);
        }
    }
    if (ours->count == 0U) {
        (void)iw_netlink_take_events(&bus->events); // Not needed while up, but unread they would wake us for ever.
    } else if (errors == ours->count && bus->errors_left > 0U) {
        bus->errors_left--;
    }
    if (ours->lost != lost) {
        bus->link.lost = ours->lost;
        bus->look_us = bus->now_us; // An error frame may be among them.
    }
}

static int open_descriptors(socketcan_t *bus) {
    bus->probe_fd = socket(PF_CAN, SOCK_RAW | SOCK_CLOEXEC, CAN_RAW); // Never bound. Also: can this kernel do CAN?
    if (bus->probe_fd < 0) {
        return errno;
    }
    int error = iw_netlink_open(&bus->netlink);
    error = (error != 0) ? error : iw_netlink_open_events(&bus->events);
    if (error != 0) {
        return error;
    }
    struct epoll_event interest = {.events = EPOLLIN};
    bus->watch_fd = epoll_create1(EPOLL_CLOEXEC);
    if (bus->watch_fd < 0 || epoll_ctl(bus->watch_fd, EPOLL_CTL_ADD, iw_netlink_fd(&bus->events), &interest) != 0) {
        return errno;
    }
    return 0;
}

static void can_close(void *self) {
    socketcan_t *bus = (socketcan_t *)self;
    close_sockets(bus);
    iw_netlink_close(&bus->netlink);
    iw_netlink_close(&bus->events);
    if (bus->watch_fd >= 0) {
        (void)close(bus->watch_fd);
    }
    if (bus->probe_fd >= 0) {
        (void)close(bus->probe_fd);
    }
}

static int can_open(void *self, const char *name) {
    socketcan_t *bus = (socketcan_t *)self;
    *bus = (socketcan_t){.name = name,
                         .link = {.presence = IW_LINK_ABSENT},
                         .look_us = 0,
                         .present = IW_BUS_ACTIVE,
                         .unheeded = IW_BUS_ACTIVE,
                         .probe_fd = -1,
                         .watch_fd = -1};
    iw_socketcan_socket_init(&bus->ours);
    iw_socketcan_socket_init(&bus->others);
    const int error = open_descriptors(bus);
    if (error != 0) {
        can_close(bus);
        return error;
    }
    (void)read_link(bus); // Also while it is down: status and doctor then say which settings are wrong.
    try_up(bus);
    return 0;
}

static int can_watch_fd(const void *self) {
    return ((const socketcan_t *)self)->watch_fd;
}

static void follow_restart(socketcan_t *bus) {
    const int result = iw_netlink_restart_poll(bus->restarting);
    if (result == IW_NETLINK_RESTART_RUNNING) {
        return;
    }
    bus->restarting = 0;
    bus->link.purge = (result == 0)                           ? IW_LINK_PURGE_DONE
                      : (result == EPERM || result == EACCES) ? IW_LINK_PURGE_NOT_ALLOWED
                                                              : IW_LINK_PURGE_FAILED;
    bus->link.changes++;
}

static void can_tend(void *self, iw_time_us_t now_us) {
    socketcan_t *bus = (socketcan_t *)self;
    bus->now_us = now_us;
    bus->errors_left = ERROR_BATCHES_PER_STEP;
    if (now_us >= bus->others_us) {
        bus->others_us = now_us + OTHERS_EVERY_US;
        bus->others_left = OTHERS_AT_ONCE;
    }
    if (bus->restarting > 0) {
        follow_restart(bus);
    }
    if (!bus->up) {
        drop_old(bus);
        if (iw_netlink_take_events(&bus->events) || now_us >= bus->look_us) {
            try_up(bus);
        }
    }
    if (bus->up && iw_socketcan_socket_is_empty(&bus->ours)) {
        fill_ours(bus);
    }
    if (bus->up && now_us >= bus->look_us) {
        look_at_carrier(bus);
    }
    (void)iw_bus_load_take(&bus->load, now_us, bus->link.bitrate_hz, &bus->link.load_permille);
}

static iw_time_us_t can_next_us(const void *self) {
    return ((const socketcan_t *)self)->look_us;
}

/// Success proves nothing: `send` also succeeds while bus-off. Only the echo does (hal.h).
static int can_send(void *self, const iw_can_frame_t *frame) {
    socketcan_t *bus = (socketcan_t *)self;
    const int result = bus->up ? iw_socketcan_socket_send(&bus->ours, frame) : -1;
    if (result < 0 && bus->up) {
        lose(bus, ENETDOWN);
    }
    if (bus->others_us > bus->now_us + OTHERS_AFTER_SEND_US) {
        bus->others_us = bus->now_us + OTHERS_AFTER_SEND_US;
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

/// `drained` ends the step's loop without one more call of the kernel; it counts once, so that the next step looks
/// again.
static bool take_ours(socketcan_t *bus, iw_can_frame_t *out_frame) {
    while (!take(&bus->ours, out_frame)) {
        if (!bus->up || bus->ours.drained || bus->errors_left == 0U) {
            bus->ours.drained = false;
            return false;
        }
        fill_ours(bus);
    }
    return true;
}

static bool take_others(socketcan_t *bus, iw_can_frame_t *out_frame) {
    iw_socketcan_socket_t *others = &bus->others;
    if (!bus->up || bus->others_left == 0U) {
        return false;
    }
    if (iw_socketcan_socket_is_empty(others) && !others->drained) {
        (void)iw_socketcan_socket_fill(others); // An error of the interface shows at the other socket too.
    }
    if (!take(others, out_frame)) {
        others->drained = false;
        bus->others_left = 0;
        return false;
    }
    bus->load.bits += iw_socketcan_bits(&others->frame[others->next - 1U]);
    bus->others_left--;
    return true;
}

static int can_receive(void *self, iw_can_frame_t *out_frame) {
    socketcan_t *bus = (socketcan_t *)self;
    if (take_ours(bus, out_frame) || take_others(bus, out_frame)) {
        return 1;
    }
    return bus->up ? 0 : -1;
}

static iw_bus_state_t can_state(void *self) {
    socketcan_t *bus = (socketcan_t *)self;
    const iw_bus_state_t unheeded = bus->unheeded;
    const iw_bus_state_t now = bus->up ? bus->present : IW_BUS_DOWN;
    bus->unheeded = IW_BUS_ACTIVE;
    return (unheeded != IW_BUS_ACTIVE) ? unheeded : now;
}

/// Has the link taken down and up: that empties the queue and the controller. It may take seconds, so the answer is
/// "begun"; the loss of the bus tells the core that it is done. Not where the echo is unproven: an slcan adapter keeps
/// the old frames that it has, and only the zeros in the queue behind them would be lost.
static int can_purge(void *self) {
    socketcan_t *bus = (socketcan_t *)self;
    if (bus->link.purge == IW_LINK_PURGE_NOT_ALLOWED || !bus->link.echo_proven) {
        return -1;
    }
    if (bus->restarting == 0 && bus->up && iw_netlink_restart_start(bus->interface, &bus->restarting) != 0) {
        bus->restarting = 0;
        bus->link.purge = IW_LINK_PURGE_FAILED;
        bus->link.changes++;
    }
    return 0;
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
