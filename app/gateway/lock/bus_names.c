// SPDX-License-Identifier: MIT
#include "bus_names.h"

#include "iwheel_linux/clock.h"

#include <assert.h>
#include <errno.h>
#include <linux/netlink.h>
#include <linux/sock_diag.h>
#include <linux/unix_diag.h>
#include <stddef.h>
#include <stdio.h>
#include <string.h>
#include <sys/socket.h>
#include <sys/un.h>
#include <time.h>
#include <unistd.h>

#define ASKERS_MAX 64
#define NO_USER    ((uid_t)-1)
#define AGAIN_NS   10000000L
/// Foreign processes can make the kernel's list long.
#define LIST_US 50000U
/// Size of the head of an attribute.
#define HEAD ((size_t)4U)
static_assert(HEAD == sizeof(struct nlattr), "values follow the head directly");
static_assert(sizeof(struct nlmsghdr) % HEAD == 0 && sizeof(struct unix_diag_msg) % HEAD == 0, "nothing is between");

static void name_of(const gw_bus_names_t *self, uid_t uid, unsigned place, char out_name[GW_BUS_NAME_SIZE]) {
    if (place == 0U) {
        (void)snprintf(out_name, GW_BUS_NAME_SIZE, "%s", self->key);
    } else {
        (void)snprintf(out_name, GW_BUS_NAME_SIZE, "%s/%u/%u", self->key, (unsigned)uid, place);
    }
}

static socklen_t address_of(const char *name, struct sockaddr_un *out_address) {
    *out_address = (struct sockaddr_un){.sun_family = AF_UNIX};
    memcpy(out_address->sun_path + 1, name + 1, strlen(name + 1)); // A zero byte replaces the `@`.
    return (socklen_t)(offsetof(struct sockaddr_un, sun_path) + strlen(name));
}

// List of the kernel -------------------------------------------------------------------------------------------------

/// Returns the owner of a socket with that name from one message of the list; NO_USER if the message is about another
/// socket.
static uid_t owner_in(const struct nlmsghdr *message, const char *name) {
    const char *at = (const char *)message + sizeof(struct nlmsghdr) + sizeof(struct unix_diag_msg);
    const char *end = (const char *)message + message->nlmsg_len;
    struct nlattr head;
    uid_t uid = NO_USER;
    bool ours = false;
    while (at + HEAD <= end) {
        memcpy(&head, at, sizeof head);
        const size_t length = (head.nla_len < HEAD) ? 0U : head.nla_len - HEAD;
        const char *value = at + HEAD;
        if (head.nla_len < HEAD || value + length > end) {
            break;
        }
        if (head.nla_type == UNIX_DIAG_NAME) {
            ours = length == strlen(name) && value[0] == '\0' && memcmp(value + 1, name + 1, length - 1U) == 0;
        } else if (head.nla_type == UNIX_DIAG_UID && length == sizeof uid) {
            memcpy(&uid, value, sizeof uid);
        }
        at += (head.nla_len + HEAD - 1U) / HEAD * HEAD;
    }
    return ours ? uid : NO_USER;
}

/// Reads the list up to the name, or to its end.
static uid_t search_list(int fd, const char *name) {
    static _Alignas(struct nlmsghdr) char buffer[16384]; // Too large for a stack.
    const iw_time_us_t until_us = iwl_clock_now_us() + LIST_US;
    const struct timeval patience = {.tv_usec = LIST_US};
    (void)setsockopt(fd, SOL_SOCKET, SO_RCVTIMEO, &patience, sizeof patience);
    while (iwl_clock_now_us() < until_us) {
        const ssize_t got = recv(fd, buffer, sizeof buffer, 0);
        struct nlmsghdr *message = (struct nlmsghdr *)buffer;
        for (ssize_t left = got; left > 0 && NLMSG_OK(message, (size_t)left); message = NLMSG_NEXT(message, left)) {
            const uid_t uid = (message->nlmsg_type == SOCK_DIAG_BY_FAMILY) ? owner_in(message, name) : NO_USER;
            if (uid != NO_USER || message->nlmsg_type == NLMSG_DONE || message->nlmsg_type == NLMSG_ERROR) {
                return uid;
            }
        }
        if (got <= 0) {
            break;
        }
    }
    return NO_USER;
}

/// Returns the owner of a socket that does not listen, or accepts no connection.
static uid_t owner_listed(const char *name) {
    const struct {
        struct nlmsghdr head;
        struct unix_diag_req body;
    } request = {
        .head = {.nlmsg_len = sizeof request,
                 .nlmsg_type = SOCK_DIAG_BY_FAMILY,
                 .nlmsg_flags = NLM_F_REQUEST | NLM_F_DUMP},
        .body = {.sdiag_family = AF_UNIX, .udiag_states = UINT32_MAX, .udiag_show = UDIAG_SHOW_NAME | UDIAG_SHOW_UID},
    };
    uid_t uid = NO_USER;
    const int fd = socket(AF_NETLINK, SOCK_RAW | SOCK_CLOEXEC, NETLINK_SOCK_DIAG);
    if (fd >= 0 && send(fd, &request, sizeof request, 0) == (ssize_t)sizeof request) {
        uid = search_list(fd, name);
    }
    if (fd >= 0) {
        (void)close(fd);
    }
    return uid;
}

// Identity of a holder -----------------------------------------------------------------------------------------------

/// One of the two ways to identify a holder. Returns false if no socket listens at the name.
typedef bool (*ask_fn)(const char *name, gw_holder_t *out_holder);

/// Connects to the name and reads the holder's identity from the kernel, at the time when it began to listen. A holder
/// that accepts no connection is unknown. Never waits.
static bool ask(const char *name, gw_holder_t *out_holder) {
    struct sockaddr_un address;
    struct ucred peer = {.uid = NO_USER};
    socklen_t size = sizeof peer;
    const socklen_t length = address_of(name, &address);
    const int fd = socket(AF_UNIX, SOCK_STREAM | SOCK_NONBLOCK | SOCK_CLOEXEC, 0);
    if (fd < 0) {
        return false;
    }
    const bool answers = connect(fd, (const struct sockaddr *)&address, length) == 0;
    const bool bound =
        answers || errno != ECONNREFUSED; // The socket listens but accepts no connection: its queue is full.
    if (answers && getsockopt(fd, SOL_SOCKET, SO_PEERCRED, &peer, &size) != 0) {
        peer = (struct ucred){.uid = NO_USER};
    }
    (void)close(fd);
    if (bound) {
        *out_holder = (gw_holder_t){.uid = peer.uid, .pid = peer.pid};
        (void)snprintf(out_holder->name, sizeof out_holder->name, "%s", name);
    }
    return bound;
}

/// Searches the kernel's list for a holder that accepts no connection. Waits for LIST_US at most: only for a process
/// that sends nothing.
static bool ask_or_list(const char *name, gw_holder_t *out_holder) {
    const bool bound = ask(name, out_holder);
    if (bound && out_holder->uid == NO_USER) {
        out_holder->uid = owner_listed(name);
    }
    return bound;
}

static int bind_name(const char *name, int *out_fd) {
    struct sockaddr_un address;
    const socklen_t length = address_of(name, &address);
    const int fd = socket(AF_UNIX, SOCK_STREAM | SOCK_NONBLOCK | SOCK_CLOEXEC, 0);
    if (fd < 0) {
        return errno;
    }
    if (bind(fd, (const struct sockaddr *)&address, length) != 0 || listen(fd, ASKERS_MAX) != 0) {
        const int error = errno;
        (void)close(fd);
        return error;
    }
    *out_fd = fd;
    return 0;
}

/// Acquires the first free place. The holders of the places before it are checked later.
static int take_place(gw_bus_names_t *self, gw_holder_t *out_stranger) {
    char name[GW_BUS_NAME_SIZE];
    int error = EADDRINUSE;
    self->fd = -1;
    for (self->place = 0; self->place < GW_BUS_PLACES; self->place++) {
        name_of(self, self->owners.own, self->place, name);
        error = bind_name(name, &self->fd);
        if (error != EADDRINUSE) {
            return error;
        }
        gw_holder_t holder;
        if (!ask_or_list(name, &holder)) { // A socket that does not listen has the name.
            holder = (gw_holder_t){.uid = owner_listed(name)};
            (void)snprintf(holder.name, sizeof holder.name, "%s", name);
        }
        const bool stranger = holder.uid == NO_USER || !sock_owners_have(&self->owners, holder.uid);
        if (stranger && (out_stranger->name[0] == '\0' || (out_stranger->pid == 0 && holder.pid > 0))) {
            *out_stranger = holder; // One is reported: the first one with the most information.
        }
    }
    return 0;
}

typedef enum { SEEN_NONE = 0, SEEN_UNKNOWN, SEEN_LATER, SEEN_EARLIER } seen_t;

/// Order of all gateways, so that two never wait for each other.
static bool comes_first(const gw_bus_names_t *self, uid_t uid, unsigned place) {
    return place < self->place || (place == self->place && uid < self->owners.own);
}

static seen_t check_place(const gw_bus_names_t *self, ask_fn identify, uid_t uid, unsigned place,
                          gw_holder_t *out_holder) {
    char name[GW_BUS_NAME_SIZE];
    gw_holder_t holder;
    const bool ours = place == self->place && self->fd >= 0 && (place == 0U || uid == self->owners.own);
    name_of(self, uid, place, name);
    if (ours || !identify(name, &holder)) {
        return SEEN_NONE;
    }
    if (holder.uid == NO_USER) {
        return SEEN_UNKNOWN;
    }
    if (!sock_owners_have(&self->owners, holder.uid)) {
        return SEEN_NONE;
    }
    *out_holder = holder;
    return comes_first(self, holder.uid, place) ? SEEN_EARLIER : SEEN_LATER;
}

/// Checks the places of all users who may run a gateway, and returns the most important result.
static seen_t survey(const gw_bus_names_t *self, ask_fn identify, gw_holder_t *out_holder) {
    const uid_t users[] = {0, self->owners.service, self->owners.own};
    seen_t seen = check_place(self, identify, self->owners.own, 0U, out_holder);
    for (size_t i = 0; i < sizeof users / sizeof users[0]; i++) {
        for (unsigned place = 1; place < GW_BUS_PLACES && seen != SEEN_EARLIER; place++) {
            const seen_t one = check_place(self, identify, users[i], place, out_holder);
            if (one > seen) {
                seen = one;
            }
        }
    }
    return seen;
}

int gw_bus_names_take(gw_bus_names_t *self, gw_holder_t *out_holder, gw_holder_t *out_stranger) {
    const struct timespec again = {.tv_nsec = AGAIN_NS};
    const int error = take_place(self, out_stranger);
    if (error != 0) {
        return error;
    }
    const iw_time_us_t until_us = iwl_clock_now_us() + GW_BUS_PATIENCE_US;
    seen_t seen = survey(self, ask_or_list, out_holder);
    while (seen != SEEN_NONE && seen != SEEN_EARLIER && iwl_clock_now_us() < until_us) {
        (void)nanosleep(&again, NULL);
        seen = survey(self, ask_or_list, out_holder);
    }
    if (seen == SEEN_EARLIER || seen == SEEN_LATER) {
        gw_bus_names_release(self);
        return EWOULDBLOCK;
    }
    return 0;
}

bool gw_bus_names_poll(gw_bus_names_t *self, gw_holder_t *out_holder) {
    const bool first = self->owners.own == 0U || self->owners.own == self->owners.service;
    for (unsigned i = 0; i < ASKERS_MAX && self->fd >= 0; i++) {
        const int fd = accept4(self->fd, NULL, NULL, SOCK_CLOEXEC);
        if (fd < 0) {
            break;
        }
        (void)close(fd);
    }
    const seen_t seen = first ? SEEN_NONE : survey(self, ask, out_holder);
    return (seen == SEEN_EARLIER || seen == SEEN_LATER) && out_holder->uid != self->owners.own;
}

void gw_bus_names_release(gw_bus_names_t *self) {
    if (self->fd >= 0) {
        (void)close(self->fd);
        self->fd = -1;
    }
}
