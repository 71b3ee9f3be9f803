// SPDX-License-Identifier: MIT
/// The floor of a stop: waits for an edge of a line and writes two zeros. usage: floor_estop INTERFACE CHIP OFFSET
#include "timed.h"

#include <fcntl.h>
#include <linux/gpio.h>
#include <stdlib.h>
#include <sys/ioctl.h>
#include <unistd.h>

static int open_line(const char *path, uint32_t offset) {
    struct gpio_v2_line_request request = {
        .offsets = {offset},
        .consumer = "floor",
        .config = {.flags = GPIO_V2_LINE_FLAG_INPUT | GPIO_V2_LINE_FLAG_EDGE_FALLING | GPIO_V2_LINE_FLAG_BIAS_PULL_UP},
        .num_lines = 1};
    const int chip = timed_need(open(path, O_RDWR | O_CLOEXEC), path);
    (void)timed_need(ioctl(chip, GPIO_V2_GET_LINE_IOCTL, &request), "line");
    return request.fd;
}

int main(int argc, char **argv) {
    const int can = timed_can((argc == 4) ? argv[1] : "", CAN_INV_FILTER);
    const int line = open_line(argv[2], (uint32_t)atol(argv[3]));
    struct gpio_v2_line_event event;
    while (read(line, &event, sizeof event) == (ssize_t)sizeof event) {
        timed_send_pair(can, 0, 0);
    }
    return 0;
}
