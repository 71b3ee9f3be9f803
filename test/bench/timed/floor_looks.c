// SPDX-License-Identifier: MIT
/// The floor of a program that reads everything before it sends, as the gateway must: waits for all sources together, reads the clock, received data, the
/// bus, edges and level of the e-stop, then acts. A command of two numbers becomes both setpoints, a frame becomes a line.
/// usage: floor_looks INTERFACE CHIP OFFSET [SOCKET]   without a socket: lines of frames on standard output
#include "timed.h"

#include <fcntl.h>
#include <linux/gpio.h>
#include <stdio.h>
#include <stdlib.h>
#include <sys/epoll.h>
#include <sys/ioctl.h>
#include <sys/socket.h>
#include <unistd.h>

#define PERIOD_ms 20

/// Returns 1 while the e-stop is not pressed; reads edges if the wait reported any.
static int may_act(int line, int edges) {
    struct gpio_v2_line_event event;
    struct gpio_v2_line_values values = {.mask = 1};
    const ssize_t size = (edges != 0) ? read(line, &event, sizeof event) : -1;
    return size < 0 && ioctl(line, GPIO_V2_LINE_GET_VALUES_IOCTL, &values) == 0 && values.bits != 0U;
}

static void write_line(const struct can_frame *frame) {
    char line[64];
    int length = snprintf(line, sizeof line, "%03X#", frame->can_id);
    for (unsigned i = 0; i < frame->len && i < sizeof frame->data; i++) {
        length += snprintf(&line[length], sizeof line - (size_t)length, "%02X", frame->data[i]);
    }
    line[length++] = '\n';
    (void)!write(STDOUT_FILENO, line, (size_t)length);
}

static void command(int can, const char *words) {
    char *rest;
    const long left = strtol(words, &rest, 10);
    timed_send_pair(can, (int16_t)left, (int16_t)strtol(rest, NULL, 10));
}

static void serve(int can, int line, int client) {
    char words[256];
    struct can_frame frame;
    (void)timed_now_ns(CLOCK_MONOTONIC);
    const ssize_t length = (client >= 0) ? recv(client, words, sizeof words - 1U, MSG_DONTWAIT) : -1;
    const int received = recv(can, &frame, sizeof frame, MSG_DONTWAIT) == (ssize_t)sizeof frame;
    if (length == 0 || !may_act(line, length > 0)) {
        exit(0);
    }
    if (length > 0) {
        words[length] = '\0';
        command(can, words);
    } else if (received && client < 0) {
        write_line(&frame);
    }
}

int main(int argc, char **argv) {
    const int can = timed_can((argc >= 4) ? argv[1] : "", 0);
    const int line = timed_line(argv[2], (uint32_t)atol(argv[3]));
    const int client = (argc > 4) ? timed_accept(argv[4]) : -1;
    const int all = timed_need(epoll_create1(EPOLL_CLOEXEC), "epoll");
    const int fds[] = {line, can, client};
    struct epoll_event event = {.events = EPOLLIN};
    (void)timed_need(fcntl(line, F_SETFL, O_NONBLOCK), "line");
    for (unsigned i = 0; i < ((client < 0) ? 2U : 3U); i++) {
        (void)timed_need(epoll_ctl(all, EPOLL_CTL_ADD, fds[i], &event), "watch");
    }
    while (epoll_wait(all, &event, 1, PERIOD_ms) >= 0) {
        serve(can, line, client);
    }
    return 0;
}
