// SPDX-License-Identifier: MIT
/// A peer: the kernel's broadcast manager sends both setpoints on its own. usage: bcm_period INTERFACE PERIOD_US
#include "timed.h"

#include <linux/can/bcm.h>
#include <net/if.h>
#include <stdlib.h>
#include <sys/socket.h>
#include <unistd.h>

static void repeat(int bcm, canid_t id, long period_us) {
    struct {
        struct bcm_msg_head head;
        struct can_frame frame;
    } message = {.head = {.opcode = TX_SETUP,
                          .flags = SETTIMER | STARTTIMER,
                          .ival2 = {.tv_usec = period_us},
                          .can_id = id,
                          .nframes = 1},
                 .frame = {.can_id = id, .len = 5, .data = {1, 0, 100, 7, 208}}};
    (void)timed_need((int)write(bcm, &message, sizeof message), "TX_SETUP");
}

int main(int argc, char **argv) {
    const int bcm = timed_need(socket(PF_CAN, SOCK_DGRAM, CAN_BCM), "CAN_BCM");
    const struct sockaddr_can address = {.can_family = AF_CAN,
                                         .can_ifindex = (int)if_nametoindex((argc == 3) ? argv[1] : "")};
    (void)timed_need(connect(bcm, (const struct sockaddr *)&address, sizeof address), "interface");
    repeat(bcm, TIMED_LEFT, atol(argv[2]));
    repeat(bcm, TIMED_RIGHT, atol(argv[2]));
    (void)pause();
    return 0;
}
