// SPDX-License-Identifier: MIT
/// SocketCAN interface as the bus. It is reopened by its name, its losses are reported, and old frames are never sent.
///
///     CLOSED --interface up: sockets bound--> UP --ENETDOWN, ENODEV--> DOWN --interface up again--> UP
///       ^                                                               |
///       +------------- ENODEV, or another index by this name -----------+
///
/// CLOSED: `interface` is 0. This is the first state. An interface that was deleted or unplugged and returns has a new
/// index and needs new sockets. DOWN: `up` is false. The sockets stay open, because closing them may wait for a process
/// that configures interfaces (netlink.h); their frames are dropped. bus.h describes the states within UP.
///
///     purge: NONE --requested: a process sets the link down and up--> RESTARTING --> DONE | NOT_ALLOWED | FAILED
///
/// `restarting` is that process. While it runs, UP changes to DOWN and back as above: this loss is the result of the
/// purge for the core, and `link.purge` is only displayed. NOT_ALLOWED is final; after DONE and FAILED a purge may be
/// repeated.
#include "bus.h"
#include "netlink.h"

#include <errno.h>
#include <sys/epoll.h>
#include <sys/socket.h>
#include <unistd.h>

typedef struct {
    iwl_bus_t bus;
    const char *name;
    iwl_netlink_t netlink;
    iwl_netlink_t events; ///< Becomes readable when an interface changes.
    pid_t restarting;     ///< Process of the purge; 0 if there is none.
    int probe_fd;         ///< Socket for queries about interfaces.
    int interface;        ///< Interface of the sockets; 0 if they are closed or dead.
} socketcan_t;

IW_STATIC_ASSERT(sizeof(socketcan_t) <= sizeof(iwl_backend_store_t), socketcan_fits);

static socketcan_t *can_of(iwl_bus_t *bus) {
    return (socketcan_t *)(void *)bus;
}

static void close_sockets(socketcan_t *can) {
    iwl_socketcan_socket_close(&can->bus.ours);
    iwl_socketcan_socket_close(&can->bus.others);
    can->interface = 0;
}

/// Handles an interface that is gone or was down. The kernel emptied its queue; frames in the sockets are old.
static void can_lost(iwl_bus_t *bus, int error) {
    if (error == ENODEV) {
        can_of(bus)->interface = 0;
    }
}

/// Copies the kernel's report, but not the fields that this file counts itself.
static void note_link(iwl_bus_t *bus, const iwl_bus_link_t *reading) {
    const iwl_bus_link_t before = bus->link;
    if (iwl_bus_link_is_same(&before, reading)) {
        return;
    }
    bus->link = *reading;
    bus->link.purge = before.purge;
    bus->link.changes = before.changes + 1U;
    bus->link.lost = before.lost;
    bus->link.room_bytes = before.room_bytes;
    bus->link.load_permille = before.load_permille;
}

/// Reads the settings of the interface. If the kernel does not answer, only its presence is known.
static iw_bus_state_t read_link(socketcan_t *can) {
    iwl_netlink_reading_t reading;
    if (iwl_netlink_read(&can->netlink, can->name, &reading) != 0) {
        reading = (iwl_netlink_reading_t){.link = {.presence = IWL_LINK_UP}, .state = IW_BUS_ACTIVE};
    }
    note_link(&can->bus, &reading.link);
    return reading.state;
}

static bool open_sockets(socketcan_t *can, int interface) {
    struct epoll_event interest = {.events = EPOLLIN};
    close_sockets(can);
    if (iwl_socketcan_socket_open(&can->bus.ours, interface, IWL_SOCKETCAN_OURS) == 0 &&
        iwl_socketcan_socket_open(&can->bus.others, interface, IWL_SOCKETCAN_OTHERS) == 0 &&
        epoll_ctl(can->bus.watch_fd, EPOLL_CTL_ADD, can->bus.ours.fd, &interest) == 0) {
        can->interface = interface;
        can->bus.link.room_bytes = iwl_socketcan_socket_room(&can->bus.ours);
        return true;
    }
    close_sockets(can);
    return false;
}

/// While down: drops frames and errors in the sockets, and detects dead sockets.
static void drop_old(socketcan_t *can) {
    if (can->bus.ours.fd < 0) {
        return;
    }
    const int error = iwl_socketcan_socket_drop(&can->bus.ours);
    (void)iwl_socketcan_socket_drop(&can->bus.others);
    if (error == ENODEV) {
        can->interface = 0;
    }
}

/// Checks whether the interface is back, and continues with the sockets or opens new ones.
static void try_up(socketcan_t *can) {
    int interface = 0;
    iwl_bus_link_t link = can->bus.link;
    can->bus.poll_us = can->bus.now_us + IWL_BUS_RETRY_US;
    link.presence = iwl_netdev_presence(can->probe_fd, can->name, &interface);
    if (link.presence != IWL_LINK_UP) {
        note_link(&can->bus, &link);
        return;
    }
    drop_old(can);
    if (interface != can->interface && !open_sockets(can, interface)) {
        return;
    }
    can->bus.up = true;
    can->bus.link.lost = can->bus.ours.lost;
    iwl_bus_load_begin(&can->bus.load, can->bus.now_us);
    iwl_bus_note(&can->bus, read_link(can));
}

/// While up: checks by the carrier whether the controller is bus-off.
static void check_carrier(socketcan_t *can) {
    const int carrier = iwl_netdev_carrier(can->name);
    if (carrier == 0) {
        iwl_bus_note(&can->bus, IW_BUS_OFF);
    } else {
        iwl_bus_note(&can->bus, (can->bus.present < IW_BUS_PASSIVE) ? IW_BUS_ACTIVE : can->bus.present);
    }
}

static int open_descriptors(socketcan_t *can) {
    can->probe_fd =
        socket(PF_CAN, SOCK_RAW | SOCK_CLOEXEC, CAN_RAW); // Never bound. It also shows whether the kernel supports CAN.
    if (can->probe_fd < 0) {
        return errno;
    }
    int error = iwl_netlink_open(&can->netlink);
    if (error == 0) {
        error = iwl_netlink_open_events(&can->events);
    }
    if (error != 0) {
        return error;
    }
    struct epoll_event interest = {.events = EPOLLIN};
    can->bus.watch_fd = epoll_create1(EPOLL_CLOEXEC);
    if (can->bus.watch_fd < 0 ||
        epoll_ctl(can->bus.watch_fd, EPOLL_CTL_ADD, iwl_netlink_fd(&can->events), &interest) != 0) {
        return errno;
    }
    return 0;
}

static void can_close(iwl_bus_t *bus) {
    socketcan_t *can = can_of(bus);
    close_sockets(can);
    iwl_netlink_close(&can->netlink);
    iwl_netlink_close(&can->events);
    if (can->bus.watch_fd >= 0) {
        (void)close(can->bus.watch_fd);
    }
    if (can->probe_fd >= 0) {
        (void)close(can->probe_fd);
    }
}

static int can_open(iwl_bus_t *bus, const char *name) {
    socketcan_t *can = can_of(bus);
    can->name = name;
    can->probe_fd = -1;
    bus->link.presence = IWL_LINK_ABSENT;
    const int error = open_descriptors(can);
    if (error != 0) {
        can_close(bus);
        return error;
    }
    (void)read_link(can); // Also while down: status and doctor then show which settings are wrong.
    try_up(can);
    return 0;
}

static void follow_restart(socketcan_t *can) {
    const int result = iwl_netlink_restart_poll(can->restarting);
    if (result == IWL_NETLINK_RESTART_RUNNING) {
        return;
    }
    can->restarting = 0;
    can->bus.link.purge = (result == 0)                           ? IWL_LINK_PURGE_DONE
                          : (result == EPERM || result == EACCES) ? IWL_LINK_PURGE_NOT_ALLOWED
                                                                  : IWL_LINK_PURGE_FAILED;
    can->bus.link.changes++;
}

static void can_poll(iwl_bus_t *bus) {
    socketcan_t *can = can_of(bus);
    if (can->restarting > 0) {
        follow_restart(can);
    }
    if (!bus->up) {
        drop_old(can);
        if (iwl_netlink_take_events(&can->events) || bus->now_us >= bus->poll_us) {
            try_up(can);
        }
    }
    if (bus->up && iwl_socketcan_socket_is_empty(&bus->ours)) {
        iwl_bus_fill(bus);
        if (bus->up && bus->ours.count == 0U && !bus->quiet) {
            (void)iwl_netlink_take_events(
                &can->events); // Not needed while up, but unread events would wake the loop again and again.
        }
    }
    if (bus->up && bus->now_us >= bus->poll_us) {
        check_carrier(can);
    }
    (void)iwl_bus_load_take(&bus->load, bus->now_us, bus->link.bitrate_hz, &bus->link.load_permille);
}

/// Sets the link down and up, which empties the queue and the controller. That may need seconds, so the result is
/// "begun", and the loss of the bus reports the end. Does nothing if echoes are unproven: an slcan adapter would retain
/// its old frames, and only the zeros after them would be lost.
static int can_purge(iwl_bus_t *bus) {
    socketcan_t *can = can_of(bus);
    if (bus->link.purge == IWL_LINK_PURGE_NOT_ALLOWED || !bus->link.echo_proven) {
        return -1;
    }
    if (can->restarting == 0 && bus->up && iwl_netlink_restart_start(can->interface, &can->restarting) != 0) {
        can->restarting = 0;
        bus->link.purge = IWL_LINK_PURGE_FAILED;
        bus->link.changes++;
    }
    return 0;
}

static const iwl_bus_kind_t kind = {
    .open = can_open,
    .close = can_close,
    .poll = can_poll,
    .purge = can_purge,
    .lost = can_lost,
};

const iwl_bus_kind_t *const iwl_socketcan_kind = &kind;
