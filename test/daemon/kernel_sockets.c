// SPDX-License-Identifier: MIT
// Sockets of the virtual kernel: clients' connections, the CAN interface with its netlink, the sockets to child processes.
#include "kernel.h"

#include "daemon_world.h"
#include "wrapped.h"

#include "disk/file_store.h"
#include "iwheel/codec.h"

#include <errno.h>
#include <libmnl/libmnl.h>
#include <linux/can/error.h>
#include <linux/can/netlink.h>
#include <linux/can/raw.h>
#include <linux/if.h>
#include <linux/if_arp.h>
#include <linux/if_link.h>
#include <linux/rtnetlink.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdlib.h>
#include <string.h>
#include <sys/ioctl.h>
#include <sys/un.h>

#define CAN_ROOM   400U ///< Frames that wait at a socket.
#define OURS       0
#define OTHERS     1
#define NETLINKS   4
#define NAME_ROLE  2 ///< A listener with an abstract name, besides those of VK_GATEWAY and VK_WATCHERS.
#define BITRATE_HZ 1000000U
#define SAMPLE     625U
#define QUEUE      4U

typedef struct {
    bool bound;
    int error; ///< Reported once: the interface went down, or disappeared.
    int index;
    uint32_t dropped;
    unsigned first;
    unsigned count;
    struct can_frame frame[CAN_ROOM];
    bool echo[CAN_ROOM];
} can_queue_t;

struct mnl_socket {
    int fd; ///< 0: free.
    size_t size;
    _Alignas(struct nlmsghdr) char reply[1024];
};

static can_queue_t queues[2];
static struct mnl_socket netlinks[NETLINKS];
static unsigned pairs; ///< Pairs to child processes, in this life.

void vk_forget_sockets(void) {
    memset(queues, 0, sizeof queues);
    memset(netlinks, 0, sizeof netlinks);
    pairs = 0;
    vk.bound_drive = vk.bound_watch = false;
    for (unsigned i = 0; i < VK_STREAMS; i++) {
        vk.stream[i].closed = true; // Waiting connections too.
    }
}

// ---- clients -------------------------------------------------------------------------------------------------------

int vk_connect(bool watches) {
    if (!(watches ? vk.bound_watch : vk.bound_drive)) {
        return -1;
    }
    for (int i = 0; i < (int)VK_STREAMS; i++) {
        vk_stream_t *stream = &vk.stream[i];
        if (!stream->used) {
            memset(stream, 0, offsetof(vk_stream_t, in));
            stream->used = stream->waiting = true;
            stream->watches = watches;
            return i;
        }
    }
    return -1;
}

static uint32_t ready_stream(const vk_stream_t *stream) {
    const bool end = stream->shut || stream->client_end;
    return ((stream->in_length > 0U || end) ? (uint32_t)EPOLLIN : 0U) | (end ? (uint32_t)EPOLLRDHUP : 0U) |
           ((stream->out_length < VK_OUT_SIZE || stream->client_end) ? (uint32_t)EPOLLOUT : 0U) |
           (stream->client_end ? (uint32_t)EPOLLHUP : 0U);
}

static vk_stream_t *next_waiting(bool watches) {
    for (unsigned i = 0; i < VK_STREAMS; i++) {
        vk_stream_t *stream = &vk.stream[i];
        if (stream->used && stream->waiting && !stream->closed && stream->watches == watches) {
            return stream;
        }
    }
    return NULL;
}

uint32_t vk_ready_socket(const vk_fd_t *entry) {
    const can_queue_t *queue = &queues[entry->number & 1];
    switch (entry->kind) {
    case VK_STREAM:
        return ready_stream(&vk.stream[entry->number]);
    case VK_LISTENER:
        return (entry->number < NAME_ROLE && next_waiting(entry->number == 1) != NULL) ? EPOLLIN : 0U;
    case VK_CAN:
        return (queue->count > 0U || queue->error != 0) ? (uint32_t)(EPOLLIN | EPOLLOUT) : 0U;
    case VK_NETLINK:
        return (entry->events && vk.link.news > 0) ? EPOLLIN : 0U;
    case VK_CHILD:
        return (entry->offset > 0U) ? EPOLLIN : 0U;
    default:
        return 0;
    }
}

void vk_close_socket(const vk_fd_t *entry) {
    if (entry->kind == VK_STREAM) {
        vk.stream[entry->number].closed = true;
    } else if (entry->kind == VK_LISTENER && entry->number < NAME_ROLE) {
        *((entry->number == 1) ? &vk.bound_watch : &vk.bound_drive) = false;
    } else if (entry->kind == VK_CAN) {
        queues[entry->number] = (can_queue_t){.bound = false};
    }
}

static ssize_t give_stream(vk_stream_t *stream, const void *bytes, size_t size) {
    static const int errors[] = {EINTR, EAGAIN, ENOBUFS, ENOMEM, 0};
    if (!vk_call("send", errors)) {
        return -1;
    }
    if (stream->client_end) {
        errno = EPIPE;
        return -1;
    }
    const size_t space = VK_OUT_SIZE - stream->out_length;
    size_t count = (size < space) ? size : space;
    if (vk.fail_permille > 0U && count > 1U && sim_random_below(&vk.random, 8U) == 0U) {
        count = 1U + sim_random_below(&vk.random, (uint32_t)count - 1U);
    }
    memcpy(&stream->out[stream->out_length], bytes, count);
    stream->out_length += count;
    errno = EAGAIN;
    return vk_done((count > 0U) ? (long)count : -1);
}

static ssize_t take_stream(int number, void *out, size_t size) {
    static const int errors[] = {EINTR, EAGAIN, ENOMEM, 0};
    vk_stream_t *stream = &vk.stream[number];
    if (!vk_call("recv", errors)) {
        return -1;
    }
    if (stream->in_length == 0U) {
        errno = EAGAIN;
        return vk_done((stream->shut || stream->client_end) ? 0 : -1);
    }
    size_t count = (size < stream->in_length) ? size : stream->in_length;
    if (vk.fail_permille > 0U && count > 1U && sim_random_below(&vk.random, 8U) == 0U) {
        count = 1U + sim_random_below(&vk.random, (uint32_t)count - 1U);
    }
    memcpy(out, stream->in, count);
    stream->in_length -= count;
    memmove(stream->in, &stream->in[count], stream->in_length);
    stream->in_total += count;
    world_taken(number);
    return vk_done((long)count);
}

int __wrap_listen(int fd, int backlog) {
    (void)vk_call("listen", NULL);
    (void)backlog;
    vk_fd_t *entry = vk_fd(fd);
    entry->kind = VK_LISTENER;
    if (entry->number < NAME_ROLE) {
        *((entry->number == 1) ? &vk.bound_watch : &vk.bound_drive) = true;
    }
    return (int)vk_done(0);
}

int __wrap_accept4(int fd, struct sockaddr *address, socklen_t *length, int flags) {
    static const int errors[] = {ENOBUFS, ENOMEM, ECONNABORTED, EINTR, 0};
    const vk_fd_t *entry = vk_fd(fd);
    (void)address;
    (void)length;
    (void)flags;
    if (!vk_call("accept4", errors)) {
        return -1;
    }
    vk_stream_t *stream = (entry->number < NAME_ROLE) ? next_waiting(entry->number == 1) : NULL;
    if (stream == NULL) {
        errno = EAGAIN;
        return -1;
    }
    const int accepted = vk_open_fd("accept4", VK_STREAM, (int)(stream - vk.stream));
    stream->waiting = accepted < 0;
    return (int)vk_done(accepted);
}

// ---- sockets -------------------------------------------------------------------------------------------------------

int __wrap_socket(int domain, int type, int protocol) {
    (void)type;
    (void)protocol;
    return (int)vk_done(vk_open_fd("socket", VK_SOCKET, domain));
}

/// The first pair belongs to the store process, which finds no file.
int __wrap_socketpair(int domain, int type, int protocol, int ends[2]) {
    (void)domain;
    (void)type;
    (void)protocol;
    ends[0] = vk_open_fd("socketpair", VK_CHILD, 0);
    if (ends[0] < 0) {
        return -1;
    }
    ends[1] = vk_open_fd("socketpair", VK_CHILD, 0);
    if (ends[1] < 0) {
        (void)__wrap_close(ends[0]);
        errno = EMFILE;
        return -1;
    }
    vk_fd(ends[0])->locked = pairs == 0U;
    vk_fd(ends[0])->offset = (pairs == 0U) ? (size_t)GW_FILE_STORE_ABSENT : 0U;
    pairs++;
    return (int)vk_done(0);
}

static int bind_can(vk_fd_t *entry, int index) {
    if (!vk.link.exists || index != vk.link.index) {
        errno = ENODEV;
        return -1;
    }
    entry->kind = VK_CAN;
    entry->number = (entry->offset == 1U) ? OTHERS : OURS;
    queues[entry->number] = (can_queue_t){.bound = true, .index = index};
    return (int)vk_done(0);
}

int __wrap_bind(int fd, const struct sockaddr *address, socklen_t length) {
    vk_fd_t *entry = vk_fd(fd);
    const struct sockaddr_un *name = (const struct sockaddr_un *)(const void *)address;
    (void)length;
    (void)vk_call("bind", NULL);
    if (address->sa_family == AF_CAN) {
        return bind_can(entry, ((const struct sockaddr_can *)(const void *)address)->can_ifindex);
    }
    entry->number = NAME_ROLE;
    if (name->sun_path[0] == '\0') {
        return (int)vk_done(0);
    }
    const int file = vk_make_socket_file(name->sun_path);
    if (file >= 0) {
        entry->number = (strcmp(vk_path_of(file), VK_WATCHERS) == 0) ? 1 : 0;
    }
    return (int)vk_done((file < 0) ? -1 : 0);
}

/// No receiver exists.
int __wrap_connect(int fd, const struct sockaddr *address, socklen_t length) {
    (void)vk_call("connect", NULL);
    (void)vk_fd(fd);
    (void)address;
    (void)length;
    errno = ECONNREFUSED;
    return (int)vk_done(-1);
}

int __wrap_getsockopt(int fd, int level, int name, void *out_value, socklen_t *length) {
    (void)vk_call("getsockopt", NULL);
    (void)level;
    (void)length;
    if (name == SO_PEERCRED) {
        const struct ucred peer = {.pid = 2000 + vk_fd(fd)->number, .uid = VK_USER, .gid = VK_USER};
        memcpy(out_value, &peer, sizeof peer);
    } else {
        const int space = (int)(CAN_ROOM * 780U);
        memcpy(out_value, &space, sizeof space);
    }
    return (int)vk_done(0);
}

int __wrap_setsockopt(int fd, int level, int name, const void *value, socklen_t length) {
    (void)vk_call("setsockopt", NULL);
    (void)length;
    if (level == SOL_CAN_RAW && name == CAN_RAW_JOIN_FILTERS) {
        vk_fd(fd)->offset = 1U;
    }
    (void)value;
    return (int)vk_done(0);
}

/// The next call returns the pending error of a socket, before the frames that wait; a send then sends nothing.
static int take_error(can_queue_t *queue) {
    const int error = queue->error;
    queue->error = 0;
    return error;
}

int vk_take_can_error(int fd) {
    return take_error(&queues[vk_fd(fd)->number & 1]);
}

ssize_t __wrap_send(int fd, const void *bytes, size_t size, int flags) {
    vk_fd_t *entry = vk_fd(fd);
    (void)flags;
    switch (entry->kind) {
    case VK_STREAM:
        return give_stream(&vk.stream[entry->number], bytes, size);
    case VK_CHILD:
        (void)vk_call("send", NULL);
        entry->offset =
            (entry->locked && ((const char *)bytes)[0] == 'w') ? (size_t)GW_FILE_STORE_WRITTEN : entry->offset;
        return vk_done((long)size);
    default:
        (void)vk_call("send", NULL);
        errno = (entry->kind == VK_FREE) ? EBADF : ENOTCONN;
        return -1;
    }
}

ssize_t __wrap_sendto(int fd, const void *bytes, size_t size, int flags, const struct sockaddr *to, socklen_t length) {
    static const int errors[] = {EAGAIN, ENOBUFS, EINTR, 0};
    (void)vk_fd(fd);
    (void)flags;
    (void)to;
    (void)length;
    if (!vk_call("sendto", errors)) {
        return -1;
    }
    world_notified((const char *)bytes, size);
    return vk_done((long)size);
}

static ssize_t take_child(vk_fd_t *entry, char *out) {
    static const int errors[] = {EINTR, ECONNRESET, 0};
    if (!vk_call("recv", errors)) {
        return -1;
    }
    const int error = (entry->offset == (size_t)GW_FILE_STORE_ABSENT) ? ENOENT : 0;
    errno = EAGAIN;
    if (entry->offset == 0U) {
        return vk_done(-1);
    }
    out[0] = (char)entry->offset;
    memcpy(&out[1], &error, sizeof error);
    entry->offset = 0;
    return vk_done(1 + (long)sizeof error);
}

ssize_t __wrap_recv(int fd, void *out, size_t size, int flags) {
    vk_fd_t *entry = vk_fd(fd);
    (void)flags;
    if (entry->kind == VK_STREAM) {
        return take_stream(entry->number, out, size);
    }
    if (entry->kind == VK_CHILD) {
        return take_child(entry, (char *)out);
    }
    (void)vk_call("recv", NULL);
    errno = EAGAIN;
    if (entry->kind != VK_NETLINK || vk.link.news == 0) {
        return vk_done(-1);
    }
    vk.link.news--;
    return vk_done(1);
}

int __wrap_ioctl(int fd, unsigned long request, ...) {
    va_list arguments;
    va_start(arguments, request);
    void *argument = va_arg(arguments, void *);
    va_end(arguments);
    (void)vk_call("ioctl", NULL);
    struct ifreq *asked = (struct ifreq *)argument;
    if (request == FIONREAD) {
        *(int *)argument = (int)vk.stream[vk_fd(fd)->number].in_length;
        return (int)vk_done(0);
    }
    if (!vk.link.exists || strcmp(asked->ifr_name, VK_INTERFACE) != 0) {
        errno = ENODEV;
        return -1;
    }
    if (request == SIOCGIFINDEX) {
        asked->ifr_ifindex = vk.link.index;
    } else if (request == SIOCGIFHWADDR) {
        asked->ifr_hwaddr.sa_family = ARPHRD_CAN;
    } else {
        asked->ifr_flags = (short)(vk.link.up ? IFF_UP : 0);
    }
    return (int)vk_done(0);
}

// ---- CAN -----------------------------------------------------------------------------------------------------------

static void put(can_queue_t *queue, const struct can_frame *raw, bool echo) {
    if (!queue->bound || !vk.link.up || queue->index != vk.link.index) {
        return;
    }
    if (queue->count == CAN_ROOM) {
        queue->dropped++;
        return;
    }
    const unsigned at = (queue->first + queue->count++) % CAN_ROOM;
    queue->frame[at] = *raw;
    queue->echo[at] = echo;
}

static bool is_known(uint32_t id) {
    for (unsigned i = 0; i < IW_CODEC_ROWS; i++) {
        if (iw_codec_rows[i].id == (id & CAN_EFF_MASK)) {
            return true;
        }
    }
    return false;
}

void vk_deliver(const iw_can_frame_t *frame, bool echo) {
    struct can_frame raw = {.can_id = frame->id & ~IW_CAN_FD, .len = frame->dlc};
    memcpy(raw.data, frame->data, sizeof raw.data);
    put(&queues[is_known(frame->id) ? OURS : OTHERS], &raw, echo);
}

void vk_deliver_error(uint32_t classes, uint8_t state) {
    const struct can_frame raw = {.can_id = CAN_ERR_FLAG | classes, .len = 8, .data = {[1] = state}};
    put(&queues[OURS], &raw, false);
}

void vk_link_up(bool up) {
    up = up && vk.link.exists;
    if (up == vk.link.up) {
        return;
    }
    vk.link.up = up;
    vk.link.off = vk.link.off && !up;
    vk.link.news++;
    vk_set_carrier();
    for (unsigned i = 0; i < 2U; i++) {
        queues[i].error = (queues[i].bound && !up) ? ENETDOWN : queues[i].error;
    }
    world_link_changed(up);
}

void vk_link_exist(bool exists) {
    if (exists == vk.link.exists) {
        return;
    }
    if (!exists) {
        vk_link_up(false);
        queues[OURS].error = queues[OURS].bound ? ENODEV : 0;
        queues[OTHERS].error = queues[OTHERS].bound ? ENODEV : 0;
    }
    vk.link.exists = exists;
    vk.link.index += exists ? 1 : 0;
    vk.link.news++;
}

static void hand_over(can_queue_t *queue, struct mmsghdr *message) {
    const unsigned at = queue->first;
    struct msghdr *head = &message->msg_hdr;
    memcpy(head->msg_iov->iov_base, &queue->frame[at], sizeof queue->frame[at]);
    message->msg_len = sizeof queue->frame[at];
    head->msg_flags = queue->echo[at] ? MSG_CONFIRM : 0;
    if (queue->dropped > 0U && head->msg_controllen >= CMSG_SPACE(sizeof queue->dropped)) {
        struct cmsghdr *part = (struct cmsghdr *)head->msg_control;
        *part = (struct cmsghdr){
            .cmsg_len = CMSG_LEN(sizeof queue->dropped), .cmsg_level = SOL_SOCKET, .cmsg_type = SO_RXQ_OVFL};
        memcpy(CMSG_DATA(part), &queue->dropped, sizeof queue->dropped);
    } else {
        head->msg_controllen = 0;
    }
    if (queue == &queues[OURS]) {
        world_received(&queue->frame[at], queue->echo[at]);
    }
    queue->first = (queue->first + 1U) % CAN_ROOM;
    queue->count--;
}

int __wrap_recvmmsg(int fd, struct mmsghdr *messages, unsigned count, int flags, struct timespec *timeout) {
    static const int errors[] = {EINTR, EAGAIN, 0};
    (void)flags;
    (void)timeout;
    can_queue_t *queue = &queues[vk_fd(fd)->number];
    if (!vk_call("recvmmsg", errors)) {
        return -1;
    }
    const int pending = take_error(queue);
    const int error = (pending != 0) ? pending : (queue->count == 0U) ? EAGAIN : 0;
    if (error != 0) {
        errno = error;
        return (int)vk_done(-1);
    }
    unsigned done = 0;
    while (done < count && queue->count > 0U) {
        hand_over(queue, &messages[done++]);
    }
    return (int)vk_done((long)done);
}

// ---- netlink -------------------------------------------------------------------------------------------------------

struct mnl_socket *__wrap_mnl_socket_open2(int bus, int flags) {
    (void)bus;
    (void)flags;
    for (unsigned i = 0; i < NETLINKS; i++) {
        if (netlinks[i].fd == 0) {
            const int fd = vk_open_fd("socket(netlink)", VK_NETLINK, (int)i);
            netlinks[i] = (struct mnl_socket){.fd = (fd > 0) ? fd : 0};
            (void)vk_done(0);
            return (fd > 0) ? &netlinks[i] : NULL;
        }
    }
    abort();
}

int __wrap_mnl_socket_bind(struct mnl_socket *socket, unsigned groups, pid_t pid) {
    (void)vk_call("bind", NULL);
    (void)pid;
    vk_fd(socket->fd)->events = groups != 0U;
    return (int)vk_done(0);
}

int __wrap_mnl_socket_get_fd(const struct mnl_socket *socket) {
    return socket->fd;
}

int __wrap_mnl_socket_close(struct mnl_socket *socket) {
    const int result = __wrap_close(socket->fd);
    *socket = (struct mnl_socket){.fd = 0};
    return result;
}

static uint32_t controller_state(void) {
    return !vk.link.up ? CAN_STATE_STOPPED : vk.link.off ? CAN_STATE_BUS_OFF : CAN_STATE_ERROR_ACTIVE;
}

static void describe_link(struct nlmsghdr *reply) {
    const struct can_bittiming timing = {.bitrate = BITRATE_HZ, .sample_point = SAMPLE};
    const struct can_ctrlmode mode = {.flags = 0};
    struct ifinfomsg *interface = (struct ifinfomsg *)mnl_nlmsg_put_extra_header(reply, sizeof *interface);
    interface->ifi_type = ARPHRD_CAN;
    interface->ifi_index = vk.link.index;
    interface->ifi_flags = (unsigned)IFF_ECHO | (vk.link.up ? (unsigned)IFF_UP : 0U);
    mnl_attr_put_u32(reply, IFLA_TXQLEN, QUEUE);
    struct nlattr *info = mnl_attr_nest_start(reply, IFLA_LINKINFO);
    mnl_attr_put_strz(reply, IFLA_INFO_KIND, "can");
    struct nlattr *data = mnl_attr_nest_start(reply, IFLA_INFO_DATA);
    mnl_attr_put(reply, IFLA_CAN_BITTIMING, sizeof timing, &timing);
    mnl_attr_put(reply, IFLA_CAN_CTRLMODE, sizeof mode, &mode);
    mnl_attr_put_u32(reply, IFLA_CAN_STATE, controller_state());
    mnl_attr_put_u32(reply, IFLA_CAN_RESTART_MS, 0);
    mnl_attr_nest_end(reply, data);
    mnl_attr_nest_end(reply, info);
}

ssize_t __wrap_mnl_socket_sendto(const struct mnl_socket *socket, const void *request, size_t size) {
    static const int errors[] = {ENOBUFS, ENOMEM, EINTR, 0};
    struct mnl_socket *self = &netlinks[vk_fd(socket->fd)->number];
    if (!vk_call("sendto(netlink)", errors)) {
        return -1;
    }
    struct nlmsghdr *reply = mnl_nlmsg_put_header(self->reply);
    reply->nlmsg_seq = ((const struct nlmsghdr *)request)->nlmsg_seq;
    reply->nlmsg_type = vk.link.exists ? RTM_NEWLINK : NLMSG_ERROR;
    if (vk.link.exists) {
        describe_link(reply);
    } else {
        struct nlmsgerr *verdict = (struct nlmsgerr *)mnl_nlmsg_put_extra_header(reply, sizeof *verdict);
        verdict->error = -ENODEV;
    }
    self->size = reply->nlmsg_len;
    return vk_done((long)size);
}

ssize_t __wrap_mnl_socket_recvfrom(const struct mnl_socket *socket, void *out, size_t size) {
    static const int errors[] = {EINTR, ENOBUFS, 0};
    struct mnl_socket *self = &netlinks[vk_fd(socket->fd)->number];
    if (!vk_call("recvfrom(netlink)", errors)) {
        return -1;
    }
    const size_t count = (self->size < size) ? self->size : size;
    errno = EAGAIN;
    if (count == 0U) {
        return vk_done(-1);
    }
    memcpy(out, self->reply, count);
    self->size = 0;
    return vk_done((long)count);
}
