// SPDX-License-Identifier: MIT
/// A CAN interface for socketcan.c without a kernel: it replaces the sockets, netlink and the files of /sys. Frames are received in the
/// order in which a test put them; the socket's queue stays while the interface is down, as the kernel's does.
#ifndef TEST_FAKE_INTERFACE_H
#define TEST_FAKE_INTERFACE_H

#include "netlink.h"
#include "socketcan_socket.h"

#define FAKE_QUEUE_MAX 2000U
/// Receive buffer that the kernel grants.
#define FAKE_ROOM 425984U

typedef struct {
    struct can_frame frame[FAKE_QUEUE_MAX];
    int flags[FAKE_QUEUE_MAX];
    unsigned first;
    unsigned count;
    int error;     ///< Result of the next fill, once.
    uint32_t lost; ///< Lost frames that the kernel counts.
} fake_queue_t;

typedef struct {
    /// Set by a test.
    iwl_link_presence_t presence;
    int index;
    int carrier;
    iw_bus_state_t state; ///< State that netlink reports when it is read.
    iwl_bus_link_t link;  ///< Other facts that netlink reports.
    bool netlink_fails;
    int open_error;     ///< Error of opening netlink's sockets.
    bool events_dead;   ///< The socket for changes of interfaces has no descriptor.
    bool sockets_fail;  ///< No socket can be opened on the interface.
    bool news;          ///< An interface has changed.
    unsigned late;      ///< Number of frames that come while the port checks whether the interface is up.
    int send_result;    ///< 1: sent, 0: queue full, -1: lost.
    int restart_result; ///< Result of `poll`; IWL_NETLINK_RESTART_RUNNING at first.
    fake_queue_t ours;
    fake_queue_t others;

    /// Recorded by the fake.
    unsigned opened;   ///< Pairs of sockets opened.
    unsigned restarts; ///< Processes started to restart the link.
    unsigned polls;    ///< Polls of the carrier.
    unsigned readings; ///< Reads of netlink.
    unsigned fills;    ///< Batches requested from both sockets.
    int restarted;     ///< Interface index of the last restart.
} fake_interface_t;

extern fake_interface_t fake_interface;

/// Begins with an interface that is up and active, with a proven echo and 1 Mbit/s.
void fake_interface_init(void);

/// Adds a frame to either queue; `flags` are those of the message.
void fake_interface_put(fake_queue_t *queue, uint32_t id, uint8_t dlc, int flags);

/// Adds an error frame: CAN_ERR_... without the flag, and the controller's byte.
void fake_interface_put_error(uint32_t what, uint8_t controller, int flags);

#endif
