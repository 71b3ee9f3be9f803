// SPDX-License-Identifier: MIT
/// The floor of reporting a frame: reads it and writes it as a line to standard output. usage: floor_print INTERFACE
#include "timed.h"

#include <stdio.h>
#include <unistd.h>

int main(int argc, char **argv) {
    static const char digit[] = "0123456789ABCDEF";
    const int can = timed_can((argc == 2) ? argv[1] : "", 0);
    struct can_frame frame;
    while (read(can, &frame, sizeof frame) == (ssize_t)sizeof frame) {
        char line[64];
        int length = snprintf(line, sizeof line, "%03X#", frame.can_id);
        for (unsigned i = 0; i < frame.len && i < sizeof frame.data; i++) {
            line[length++] = digit[frame.data[i] >> 4];
            line[length++] = digit[frame.data[i] & 15U];
        }
        line[length++] = '\n';
        (void)!write(STDOUT_FILENO, line, (size_t)length);
    }
    return 0;
}
