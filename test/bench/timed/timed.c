// SPDX-License-Identifier: MIT
#include "timed.h"

#include <errno.h>
#include <fcntl.h>
#include <linux/can/raw.h>
#include <linux/gpio.h>
#include <net/if.h>
#include <poll.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/ioctl.h>
#include <sys/socket.h>
#include <sys/un.h>
#include <unistd.h>

static const char LOCAL[] = "unix:";

void timed_fail(const char *what) {
    (void)fprintf(stderr, "%s: %s\n", what, strerror(errno));
    exit(1);
}

int timed_need(int value, const char *what) {
    if (value < 0) {
        timed_fail(what);
    }
    return value;
}

int64_t timed_now_ns(clockid_t clock) {
    struct timespec now;
    (void)clock_gettime(clock, &now);
    return (int64_t)now.tv_sec * TIMED_NS_PER_S + now.tv_nsec;
}

void timed_sleep_until_ns(int64_t at_ns) {
    const struct timespec until = {.tv_sec = (time_t)(at_ns / TIMED_NS_PER_S),
                                   .tv_nsec = (long)(at_ns % TIMED_NS_PER_S)};
    while (clock_nanosleep(CLOCK_MONOTONIC, TIMER_ABSTIME, &until, NULL) == EINTR) {
    }
}

static int connect_to(const char *path, int type) {
    struct sockaddr_un address = {.sun_family = AF_UNIX};
    const int fd = timed_need(socket(AF_UNIX, type | SOCK_CLOEXEC, 0), "socket");
    (void)snprintf(address.sun_path, sizeof address.sun_path, "%s", path);
    (void)timed_need(connect(fd, (const struct sockaddr *)&address, sizeof address), path);
    return fd;
}

int timed_connect(const char *path) {
    return connect_to(path, SOCK_STREAM);
}

static void filter(int can, canid_t id) {
    const struct can_filter one = {.can_id = id, .can_mask = CAN_SFF_MASK};
    const socklen_t size = (id == CAN_INV_FILTER) ? 0U : (socklen_t)sizeof one;
    if (id != 0U) {
        (void)timed_need(setsockopt(can, SOL_CAN_RAW, CAN_RAW_FILTER, (size == 0U) ? NULL : &one, size), "filter");
    }
}

int timed_can(const char *interface, canid_t id) {
    if (strncmp(interface, LOCAL, sizeof LOCAL - 1U) == 0) {
        return connect_to(&interface[sizeof LOCAL - 1U], SOCK_SEQPACKET);
    }
    const int can = timed_need(socket(PF_CAN, SOCK_RAW | SOCK_CLOEXEC, CAN_RAW), "CAN socket");
    const struct sockaddr_can address = {.can_family = AF_CAN, .can_ifindex = (int)if_nametoindex(interface)};
    filter(can, id);
    (void)timed_need(bind(can, (const struct sockaddr *)&address, sizeof address), interface);
    return can;
}

static void put_word(uint8_t *bytes, int16_t value) {
    bytes[0] = (uint8_t)((uint16_t)value >> 8);
    bytes[1] = (uint8_t)((uint16_t)value & 0xFFU);
}

static void send_setpoint(int can, canid_t id, int16_t mm_s) {
    struct can_frame frame = {.can_id = id, .len = 5, .data = {1}};
    put_word(&frame.data[1], mm_s);
    put_word(&frame.data[3], 2000);
    (void)!write(can, &frame, sizeof frame);
}

void timed_send_pair(int can, int16_t left_mm_s, int16_t right_mm_s) {
    send_setpoint(can, TIMED_LEFT, left_mm_s);
    send_setpoint(can, TIMED_RIGHT, right_mm_s);
}

void timed_ask_for_stamps(int can) {
    const int on = 1;
    (void)timed_need(setsockopt(can, SOL_SOCKET, SO_TIMESTAMPNS, &on, sizeof on), "stamps");
}

static int receive_one(int can, struct can_frame *out_frame, int64_t *out_at_ns, int within_ms) {
    struct pollfd ready = {.fd = can, .events = POLLIN};
    _Alignas(struct cmsghdr) uint8_t control[128];
    struct iovec part = {.iov_base = out_frame, .iov_len = sizeof *out_frame};
    struct msghdr message = {
        .msg_iov = &part, .msg_iovlen = 1, .msg_control = control, .msg_controllen = sizeof control};
    struct timespec at = {0};
    if (poll(&ready, 1, within_ms) <= 0 || recvmsg(can, &message, 0) < 0) {
        return 0;
    }
    const struct cmsghdr *stamp = CMSG_FIRSTHDR(&message);
    if (stamp != NULL) {
        memcpy(&at, CMSG_DATA(stamp), sizeof at);
    }
    *out_at_ns = (int64_t)at.tv_sec * TIMED_NS_PER_S + at.tv_nsec;
    return 1;
}

int timed_receive(int can, canid_t id, struct can_frame *out_frame, int64_t *out_at_ns, int within_ms) {
    const int64_t end_ns = timed_now_ns(CLOCK_MONOTONIC) + within_ms * (TIMED_NS_PER_S / 1000);
    for (int left_ms = within_ms; left_ms > 0;) {
        if (!receive_one(can, out_frame, out_at_ns, left_ms)) {
            return 0;
        }
        if (id == 0U || out_frame->can_id == id) {
            return 1;
        }
        left_ms = (int)((end_ns - timed_now_ns(CLOCK_MONOTONIC)) / (TIMED_NS_PER_S / 1000));
    }
    return 0;
}

int timed_accept(const char *path) {
    struct sockaddr_un address = {.sun_family = AF_UNIX};
    const int listener = timed_need(socket(AF_UNIX, SOCK_STREAM | SOCK_CLOEXEC, 0), "socket");
    (void)snprintf(address.sun_path, sizeof address.sun_path, "%s", path);
    (void)timed_need(bind(listener, (const struct sockaddr *)&address, sizeof address), path);
    (void)timed_need(listen(listener, 1), path);
    return timed_need(accept(listener, NULL, NULL), path);
}

int timed_line(const char *path, uint32_t offset) {
    struct gpio_v2_line_request request = {
        .offsets = {offset},
        .consumer = "floor",
        .config = {.flags = GPIO_V2_LINE_FLAG_INPUT | GPIO_V2_LINE_FLAG_EDGE_FALLING | GPIO_V2_LINE_FLAG_BIAS_PULL_UP},
        .num_lines = 1};
    const int chip = timed_need(open(path, O_RDWR | O_CLOEXEC), path);
    (void)timed_need(ioctl(chip, GPIO_V2_GET_LINE_IOCTL, &request), "line");
    return request.fd;
}
