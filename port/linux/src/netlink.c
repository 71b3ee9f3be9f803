// SPDX-License-Identifier: MIT
#include "netlink.h"

#include <errno.h>
#include <libmnl/libmnl.h>
#include <limits.h>
#include <linux/can/netlink.h>
#include <linux/if.h>
#include <linux/if_arp.h>
#include <linux/if_link.h>
#include <linux/rtnetlink.h>
#include <string.h>
#include <sys/socket.h>
#include <sys/wait.h>
#include <unistd.h>

/// Largest number of replies read per request. Earlier ones answer an earlier request.
#define REPLIES_MAX 8
/// Largest number of events read in one call.
#define EVENTS_MAX 64
/// The description of a CAN interface needs about 2 KiB.
#define REPLY_SIZE 16384U
/// Number and interval of attempts to bring an interface up.
#define TRIES_MAX 60
#define PAUSE_S   1U

static int open_for(iwl_netlink_t *self, unsigned groups) {
    *self = (iwl_netlink_t){.socket = mnl_socket_open2(NETLINK_ROUTE, SOCK_NONBLOCK | SOCK_CLOEXEC)};
    if (self->socket == NULL) {
        return errno;
    }
    if (mnl_socket_bind(self->socket, groups, MNL_SOCKET_AUTOPID) != 0) {
        const int error = errno;
        iwl_netlink_close(self);
        return error;
    }
    return 0;
}

int iwl_netlink_open(iwl_netlink_t *self) {
    return open_for(self, 0);
}

int iwl_netlink_open_events(iwl_netlink_t *self) {
    return open_for(self, RTMGRP_LINK);
}

int iwl_netlink_fd(const iwl_netlink_t *self) {
    return mnl_socket_get_fd(self->socket);
}

bool iwl_netlink_take_events(iwl_netlink_t *self) {
    char first[64]; // Only the presence of an event counts; the rest of the message is dropped.
    bool any = false;
    for (int i = 0; i < EVENTS_MAX; i++) {
        if (recv(iwl_netlink_fd(self), first, sizeof first, 0) < 0 && errno != ENOBUFS) {
            break;
        }
        any = true;
    }
    return any;
}

void iwl_netlink_close(iwl_netlink_t *self) {
    if (self->socket != NULL) {
        (void)mnl_socket_close(self->socket);
        self->socket = NULL;
    }
}

static struct nlmsghdr *begin(iwl_netlink_t *self, void *buffer, uint16_t type, uint16_t flags) {
    struct nlmsghdr *message = mnl_nlmsg_put_header(buffer);
    message->nlmsg_type = type;
    message->nlmsg_flags = (uint16_t)(NLM_F_REQUEST | flags);
    message->nlmsg_seq = ++self->sequence;
    return message;
}

/// Classifies a reply to the request `sequence`: -1 it is not its reply, 0 it was read, otherwise an errno.
static int parse(const iwl_netlink_t *self, const struct nlmsghdr *reply, iwl_netlink_reading_t *out_reading) {
    if (reply->nlmsg_seq != self->sequence) {
        return -1;
    }
    if (reply->nlmsg_type == NLMSG_ERROR) {
        const struct nlmsgerr *verdict = (const struct nlmsgerr *)mnl_nlmsg_get_payload(reply);
        return (mnl_nlmsg_get_payload_len(reply) < sizeof *verdict) ? EBADMSG : -verdict->error;
    }
    return (out_reading != NULL && iwl_netlink_parse(reply, out_reading)) ? 0 : EBADMSG;
}

/// Sends the request and reads its reply. The reply is there as soon as the kernel has accepted the request.
static int ask(iwl_netlink_t *self, const struct nlmsghdr *request, iwl_netlink_reading_t *out_reading) {
    static _Alignas(struct nlmsghdr) char buffer[REPLY_SIZE]; // Too large for a stack.
    if (mnl_socket_sendto(self->socket, request, request->nlmsg_len) < 0) {
        return errno;
    }
    for (int i = 0; i < REPLIES_MAX; i++) {
        const ssize_t size = mnl_socket_recvfrom(self->socket, buffer, sizeof buffer);
        if (size < 0) {
            return errno;
        }
        const struct nlmsghdr *reply = (const struct nlmsghdr *)buffer;
        const int result = mnl_nlmsg_ok(reply, (int)size) ? parse(self, reply, out_reading) : -1;
        if (result >= 0) {
            return result;
        }
    }
    return EBADMSG;
}

int iwl_netlink_read(iwl_netlink_t *self, const char *name, iwl_netlink_reading_t *out_reading) {
    _Alignas(struct nlmsghdr) char buffer[256];
    struct nlmsghdr *request = begin(self, buffer, RTM_GETLINK, 0);
    struct ifinfomsg *interface = (struct ifinfomsg *)mnl_nlmsg_put_extra_header(request, sizeof *interface);
    interface->ifi_family = AF_UNSPEC;
    mnl_attr_put_strz(request, IFLA_IFNAME, name);
    const int error = ask(self, request, out_reading);
    if (error != 0) {
        *out_reading = (iwl_netlink_reading_t){.link = {.presence = IWL_LINK_ABSENT}, .state = IW_BUS_DOWN};
    }
    return (error == ENODEV) ? 0 : error;
}

int iwl_netlink_set_up(iwl_netlink_t *self, int index, bool up) {
    _Alignas(struct nlmsghdr) char buffer[128];
    struct nlmsghdr *request = begin(self, buffer, RTM_NEWLINK, NLM_F_ACK);
    struct ifinfomsg *interface = (struct ifinfomsg *)mnl_nlmsg_put_extra_header(request, sizeof *interface);
    interface->ifi_family = AF_UNSPEC;
    interface->ifi_index = index;
    interface->ifi_change = IFF_UP;
    interface->ifi_flags = up ? IFF_UP : 0U;
    return ask(self, request, NULL);
}

/// An interface that this process set down must not stay down because its adapter answers slowly, so it tries again.
/// ENODEV: the interface is gone.
static int restart(int interface) {
    iwl_netlink_t netlink;
    int error = iwl_netlink_open(&netlink);
    if (error == 0) {
        error = iwl_netlink_set_up(&netlink, interface, false);
    }
    if (error != 0) {
        return error;
    }
    error = iwl_netlink_set_up(&netlink, interface, true);
    for (int i = 1; i < TRIES_MAX && error != 0 && error != ENODEV; i++) {
        (void)sleep(PAUSE_S);
        error = iwl_netlink_set_up(&netlink, interface, true);
    }
    return error;
}

/// Uses a process and not a thread. The kernel's lock on interface configuration can block it for seconds, and it must
/// survive a gateway that is killed between down and up.
int iwl_netlink_restart_start(int interface, pid_t *out_process) {
    const pid_t process = fork();
    if (process < 0) {
        return errno;
    }
    if (process == 0) {
        closefrom(STDERR_FILENO + 1); // Otherwise clients and the lock file would stay open in it.
        const int error = restart(interface);
        _exit((error <= UCHAR_MAX) ? error : EIO);
    }
    *out_process = process;
    return 0;
}

int iwl_netlink_restart_poll(pid_t process) {
    int status = 0;
    const pid_t ended = waitpid(process, &status, WNOHANG);
    if (ended == 0) {
        return IWL_NETLINK_RESTART_RUNNING;
    }
    if (ended < 0) {
        return 0; // Another call has read its status. The state of the interface shows the result.
    }
    return WIFEXITED(status) ? WEXITSTATUS(status) : EIO;
}

IW_STATIC_ASSERT(sizeof(struct ifinfomsg) % NLMSG_ALIGNTO == 0, netlink_attributes_follow_without_a_gap);

/// List of attributes on one level.
typedef struct {
    const void *first;
    uint32_t size;
} attributes_t;

static attributes_t within(const struct nlattr *nest) {
    return (attributes_t){mnl_attr_get_payload(nest), mnl_attr_get_payload_len(nest)};
}

static const struct nlattr *find(attributes_t among, uint16_t type) {
    const uint8_t *const first = (const uint8_t *)among.first;
    const struct nlattr *attribute = (const struct nlattr *)among.first;
    int left = (int)among.size;
    while (mnl_attr_ok(attribute, left)) {
        if (mnl_attr_get_type(attribute) == type) {
            return attribute;
        }
        attribute = mnl_attr_next(attribute);
        left = (int)among.size - (int)((const uint8_t *)attribute - first);
    }
    return NULL;
}

/// Copies a payload of at least this size; newer kernels may append to it. Returns false if there is none.
static bool get(attributes_t among, uint16_t type, void *out, size_t size) {
    const struct nlattr *attribute = find(among, type);
    if (attribute == NULL || mnl_attr_get_payload_len(attribute) < size) {
        return false;
    }
    memcpy(out, mnl_attr_get_payload(attribute), size);
    return true;
}

static iw_bus_state_t state_of(uint32_t state) {
    switch (state) {
    case CAN_STATE_ERROR_ACTIVE:
    case CAN_STATE_ERROR_WARNING:
        return IW_BUS_ACTIVE;
    case CAN_STATE_ERROR_PASSIVE:
        return IW_BUS_PASSIVE;
    case CAN_STATE_BUS_OFF:
        return IW_BUS_OFF;
    default:
        return IW_BUS_DOWN;
    }
}

/// Parses the data of an interface of kind "can": a real controller.
static void parse_controller(attributes_t data, iwl_netlink_reading_t *reading) {
    struct can_bittiming timing;
    struct can_ctrlmode mode;
    uint32_t state;
    iwl_bus_link_t *link = &reading->link;
    if (get(data, IFLA_CAN_BITTIMING, &timing, sizeof timing)) {
        link->bitrate_hz = timing.bitrate;
        link->sample_point_permille = (uint16_t)((timing.sample_point <= 1000U) ? timing.sample_point : 0U);
    }
    if (get(data, IFLA_CAN_CTRLMODE, &mode, sizeof mode)) {
        link->is_mute = (mode.flags & CAN_CTRLMODE_LISTENONLY) != 0U;
        // Loopback echoes without the bus, and presume-ack sends without acknowledgement, so an echo proves nothing.
        link->echo_proven =
            link->echo_proven && (mode.flags & (CAN_CTRLMODE_LOOPBACK | CAN_CTRLMODE_PRESUME_ACK)) == 0U;
    }
    if (get(data, IFLA_CAN_STATE, &state, sizeof state) && link->presence == IWL_LINK_UP) {
        reading->state = state_of(state);
    }
    (void)get(data, IFLA_CAN_RESTART_MS, &link->restart_ms, sizeof link->restart_ms);
}

/// vcan is another kind: without a controller it has no bit timing and no error states.
static void parse_kind(attributes_t info, iwl_netlink_reading_t *reading) {
    static const char controller[] = "can";
    char kind[sizeof controller] = "";
    const struct nlattr *data = find(info, IFLA_INFO_DATA);
    if (!get(info, IFLA_INFO_KIND, kind, sizeof kind) || memcmp(kind, controller, sizeof controller) != 0) {
        reading->link.is_virtual = true;
    } else if (data != NULL) {
        parse_controller(within(data), reading);
    }
}

bool iwl_netlink_parse(const struct nlmsghdr *message, iwl_netlink_reading_t *out_reading) {
    if (message->nlmsg_type != RTM_NEWLINK || mnl_nlmsg_get_payload_len(message) < sizeof(struct ifinfomsg)) {
        return false;
    }
    const struct ifinfomsg *interface = (const struct ifinfomsg *)mnl_nlmsg_get_payload(message);
    const attributes_t all = {mnl_nlmsg_get_payload_offset(message, sizeof *interface),
                              (uint32_t)(mnl_nlmsg_get_payload_len(message) - sizeof *interface)};
    iwl_bus_link_t *link = &out_reading->link;
    *out_reading = (iwl_netlink_reading_t){.index = interface->ifi_index, .state = IW_BUS_DOWN};
    link->presence = ((interface->ifi_flags & IFF_UP) != 0U) ? IWL_LINK_UP : IWL_LINK_DOWN;
    if (interface->ifi_type != ARPHRD_CAN) {
        link->presence = IWL_LINK_NOT_CAN;
        return true;
    }
    link->echo_proven = (interface->ifi_flags & IFF_ECHO) != 0U;
    out_reading->state = (link->presence == IWL_LINK_UP) ? IW_BUS_ACTIVE : IW_BUS_DOWN;
    (void)get(all, IFLA_TXQLEN, &link->queue_length, sizeof link->queue_length);
    const struct nlattr *info = find(all, IFLA_LINKINFO);
    if (info != NULL) {
        parse_kind(within(info), out_reading);
    }
    return true;
}
