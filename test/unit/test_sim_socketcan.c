// SPDX-License-Identifier: MIT
// Commands that the simulator refuses when it is a node on a CAN interface.
#include "sim_socketcan.h"

#include "unit.h"

#include <string.h>

TEST(test_sim_socketcan_commands_of_the_hub_are_refused) {
    static const char *const refused[] = {"ack off", "stall on", "busoff", "passive\ton", "bus down", "queue 4"};
    for (size_t i = 0; i < sizeof refused / sizeof refused[0]; i++) {
        TEST_ASSERT_TRUE_MESSAGE(sim_socketcan_refuses(refused[i]), refused[i]);
    }
}

TEST(test_sim_socketcan_commands_of_wheels_and_nodes_are_accepted) {
    static const char *const allowed[] = {"power off",   "mute left", "foreign once", "frame 100#", "babble 1 100 on",
                                          "estop press", "status",    "normal",       "busy",       "",
                                          "acknowledge", "b"};
    for (size_t i = 0; i < sizeof allowed / sizeof allowed[0]; i++) {
        TEST_ASSERT_FALSE_MESSAGE(sim_socketcan_refuses(allowed[i]), allowed[i]);
    }
}

TEST(test_sim_socketcan_open_of_an_invalid_name_reports_the_fix) {
    static sim_socketcan_t can;
    static sim_world_t world;
    static sim_loop_t loop;
    sim_reason_t reason = {""};
    TEST_ASSERT_FALSE(sim_socketcan_open(&can, "an_interface_of_17", &loop, &world, &reason));
    TEST_ASSERT_NOT_NULL(strstr(reason.text, "an_interface_of_17"));
    TEST_ASSERT_NOT_NULL(strstr(reason.text, "unix:PATH"));
}
