// SPDX-License-Identifier: MIT
/// The floor of a stop: waits for an edge of a line and writes two zeros. usage: floor_estop INTERFACE CHIP OFFSET
#include "timed.h"

#include <linux/gpio.h>
#include <stdlib.h>
#include <unistd.h>

int main(int argc, char **argv) {
    const int can = timed_can((argc == 4) ? argv[1] : "", CAN_INV_FILTER);
    const int line = timed_line(argv[2], (uint32_t)atol(argv[3]));
    struct gpio_v2_line_event event;
    while (read(line, &event, sizeof event) == (ssize_t)sizeof event) {
        timed_send_pair(can, 0, 0);
    }
    return 0;
}
