// SPDX-License-Identifier: MIT
/// A CAN interface for socketcan.c without a kernel: stands in for the sockets, netlink and the files of /sys. What is put is heard in
/// the order it came; the socket's queue stays while the interface is down, as the kernel's does.
#ifndef TEST_FAKE_INTERFACE_H
#define TEST_FAKE_INTERFACE_H

#include "netlink.h"
#include "socketcan_socket.h"

#define FAKE_QUEUE_MAX 2000U
/// That the kernel grants.
#define FAKE_ROOM 425984U

typedef struct {
    struct can_frame frame[FAKE_QUEUE_MAX];
    int flags[FAKE_QUEUE_MAX];
    unsigned first;
    unsigned count;
    int error;     ///< What the next fill answers, once.
    uint32_t lost; ///< As the kernel counts.
} fake_queue_t;

typedef struct {
    /// What a test sets.
    iwl_link_presence_t presence;
    int index;
    int carrier;
    iw_bus_state_t state; ///< As netlink tells it when it is read.
    iwl_bus_link_t link;  ///< The same of the rest.
    bool netlink_fails;
    int open_error;     ///< Of netlink's sockets.
    bool events_dead;   ///< The socket that tells of interfaces has no descriptor.
    bool sockets_fail;  ///< None can be opened on the interface.
    bool news;          ///< Some interface has changed.
    unsigned late;      ///< So many frames come while it is looked whether the interface is up.
    int send_result;    ///< 1, 0 no room, -1 lost.
    int restart_result; ///< Of `poll`; IWL_NETLINK_RESTART_RUNNING at first.
    fake_queue_t ours;
    fake_queue_t others;

    /// What happened.
    unsigned opened;   ///< Pairs of sockets.
    unsigned restarts; ///< Processes started to restart the link.
    unsigned looks;    ///< At the carrier.
    unsigned readings; ///< Of netlink.
    unsigned fills;    ///< Batches asked for, of both sockets.
    int restarted;     ///< The index given.
} fake_interface_t;

extern fake_interface_t fake_interface;

/// Up, active, with a proven echo and 1 Mbit/s.
void fake_interface_init(void);

/// A frame of either queue; `flags` as of the message.
void fake_interface_put(fake_queue_t *queue, uint32_t id, uint8_t dlc, int flags);

/// An error frame: CAN_ERR_... without the flag, and the controller's byte.
void fake_interface_put_error(uint32_t what, uint8_t controller, int flags);

#endif
