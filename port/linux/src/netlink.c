// SPDX-License-Identifier: MIT
#include "netlink.h"

#include <errno.h>
#include <libmnl/libmnl.h>
#include <linux/if.h>
#include <linux/if_link.h>
#include <linux/rtnetlink.h>
#include <sys/socket.h>
#include <unistd.h>

/// Replies read for one request at the most: what came before is an answer to an earlier one.
#define REPLIES_MAX 8
/// News taken in one call at the most; more are taken by the next.
#define EVENTS_MAX 64
/// A CAN interface with everything that kernels tell of it takes about 2 KiB.
#define REPLY_SIZE 16384U

static int open_for(iw_netlink_t *self, unsigned groups) {
    *self = (iw_netlink_t){.socket = mnl_socket_open2(NETLINK_ROUTE, SOCK_NONBLOCK | SOCK_CLOEXEC)};
    if (self->socket == NULL) {
        return errno;
    }
    if (mnl_socket_bind(self->socket, groups, MNL_SOCKET_AUTOPID) != 0) {
        const int error = errno;
        iw_netlink_close(self);
        return error;
    }
    return 0;
}

int iw_netlink_open(iw_netlink_t *self) {
    return open_for(self, 0);
}

int iw_netlink_open_events(iw_netlink_t *self) {
    return open_for(self, RTMGRP_LINK);
}

int iw_netlink_fd(const iw_netlink_t *self) {
    return mnl_socket_get_fd(self->socket);
}

bool iw_netlink_take_events(iw_netlink_t *self) {
    char first[64]; // Only that there is one counts; the rest of the message is dropped.
    bool any = false;
    for (int i = 0; i < EVENTS_MAX; i++) {
        if (recv(iw_netlink_fd(self), first, sizeof first, 0) < 0 && errno != ENOBUFS) {
            break;
        }
        any = true;
    }
    return any;
}

void iw_netlink_close(iw_netlink_t *self) {
    if (self->socket != NULL) {
        (void)mnl_socket_close(self->socket);
        self->socket = NULL;
    }
}

static struct nlmsghdr *begin(iw_netlink_t *self, void *buffer, uint16_t type, uint16_t flags) {
    struct nlmsghdr *message = mnl_nlmsg_put_header(buffer);
    message->nlmsg_type = type;
    message->nlmsg_flags = (uint16_t)(NLM_F_REQUEST | flags);
    message->nlmsg_seq = ++self->sequence;
    return message;
}

/// What the reply to our request `sequence` is: -1 not an answer to it, 0 taken, else an errno.
static int take(const iw_netlink_t *self, const struct nlmsghdr *reply, iw_netlink_reading_t *out_reading) {
    if (reply->nlmsg_seq != self->sequence) {
        return -1;
    }
    if (reply->nlmsg_type == NLMSG_ERROR) {
        const struct nlmsgerr *verdict = (const struct nlmsgerr *)mnl_nlmsg_get_payload(reply);
        return (mnl_nlmsg_get_payload_len(reply) < sizeof *verdict) ? EBADMSG : -verdict->error;
    }
    return (out_reading != NULL && iw_netlink_parse(reply, out_reading)) ? 0 : EBADMSG;
}

/// Sends the request and takes its reply, which is there as soon as the kernel has taken the request.
static int ask(iw_netlink_t *self, const struct nlmsghdr *request, iw_netlink_reading_t *out_reading) {
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
        const int result = mnl_nlmsg_ok(reply, (int)size) ? take(self, reply, out_reading) : -1;
        if (result >= 0) {
            return result;
        }
    }
    return EBADMSG;
}

int iw_netlink_read(iw_netlink_t *self, const char *name, iw_netlink_reading_t *out_reading) {
    _Alignas(struct nlmsghdr) char buffer[256];
    struct nlmsghdr *request = begin(self, buffer, RTM_GETLINK, 0);
    struct ifinfomsg *interface = (struct ifinfomsg *)mnl_nlmsg_put_extra_header(request, sizeof *interface);
    interface->ifi_family = AF_UNSPEC;
    mnl_attr_put_strz(request, IFLA_IFNAME, name);
    const int error = ask(self, request, out_reading);
    if (error != 0) {
        *out_reading = (iw_netlink_reading_t){.link = {.presence = IW_LINK_ABSENT}, .state = IW_BUS_DOWN};
    }
    return (error == ENODEV) ? 0 : error;
}

int iw_netlink_set_up(iw_netlink_t *self, int index, bool up) {
    _Alignas(struct nlmsghdr) char buffer[128];
    struct nlmsghdr *request = begin(self, buffer, RTM_NEWLINK, NLM_F_ACK);
    struct ifinfomsg *interface = (struct ifinfomsg *)mnl_nlmsg_put_extra_header(request, sizeof *interface);
    interface->ifi_family = AF_UNSPEC;
    interface->ifi_index = index;
    interface->ifi_change = IFF_UP;
    interface->ifi_flags = up ? IFF_UP : 0U;
    return ask(self, request, NULL);
}
