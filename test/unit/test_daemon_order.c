// SPDX-License-Identifier: MIT
// Several clients in one wake-up of the gateway: the outcome does not depend on the order in which the gateway serves
// them.
#include "daemon_client.h"

#include "unity.h"

#include <signal.h>
#include <string.h>
#include <unistd.h>

#define CROWD 3U

static int crowd[CROWD];

static void crowd_comes(void) {
    for (unsigned i = 0; i < CROWD; i++) {
        crowd[i] = daemon_rig_connect();
    }
    daemon_rig_run(20);
}

static void crowd_goes(void) {
    for (unsigned i = 0; i < CROWD; i++) {
        (void)close(crowd[i]);
    }
}

static void test_two_takeovers_in_one_wake_up_grant_one_lease(void) {
    unsigned granted = 0;
    unsigned refused = 0;
    daemon_rig_arm(client);
    crowd_comes();
    for (unsigned i = 0; i < CROWD; i++) {
        (void)daemon_rig_receive(crowd[i]);
        daemon_rig_send(crowd[i], "{\"cmd\":\"arm\",\"takeover\":true,\"id\":7}\n");
    }
    daemon_rig_run(60);
    for (unsigned i = 0; i < CROWD; i++) {
        const char *text = daemon_rig_receive(crowd[i]);
        granted += (strstr(text, "\"ok\":true") != NULL) ? 1U : 0U;
        refused += (strstr(text, "\"ok\":false") != NULL) ? 1U : 0U;
    }
    TEST_ASSERT_EQUAL_UINT(1, granted);
    TEST_ASSERT_EQUAL_UINT(CROWD - 1U, refused);
    TEST_ASSERT_EQUAL_INT(IW_STATE_ARMED, daemon_rig_state());
    crowd_goes();
}

static void test_stop_and_command_in_one_wake_up_stop(void) {
    crowd_comes();
    daemon_rig_begin_driving(client);
    daemon_rig_send(client, "{\"cmd\":\"drive\",\"left_mm_s\":500,\"right_mm_s\":500}\n");
    daemon_rig_send(crowd[0], "{\"cmd\":\"stop\"}\n");
    daemon_rig_send(client, "{\"cmd\":\"drive\",\"left_mm_s\":500,\"right_mm_s\":500}\n");
    daemon_rig_run(20);
    TEST_ASSERT_NOT_EQUAL_INT(IW_STATE_ARMED, daemon_rig_state());
    daemon_rig_run(3000);
    TEST_ASSERT_TRUE(daemon_rig_commands_zero());
    crowd_goes();
}

static void test_estop_and_reset_in_one_wake_up_stay_latched(void) {
    crowd_comes();
    daemon_rig_send(crowd[0], "{\"cmd\":\"reset\"}\n");
    daemon_rig_send(crowd[1], "{\"cmd\":\"estop\"}\n");
    daemon_rig_send(crowd[2], "{\"cmd\":\"reset\"}\n");
    daemon_rig_run(20);
    TEST_ASSERT_EQUAL_INT(IW_STATE_LATCHED, daemon_rig_state());
    crowd_goes();
}

static void test_log_to_a_closed_pipe_does_not_end_the_gateway(void) {
    int ends[2];
    TEST_ASSERT_EQUAL_INT(0, pipe(ends));
    (void)close(ends[0]);
    daemon_rig_keep_log();
    const int saved = daemon_rig.daemon->log.fd;
    daemon_rig.daemon->log.fd = ends[1];
    daemon_rig_arm(client);
    daemon_rig_run(50);
    daemon_rig.daemon->log.fd = saved;
    (void)close(ends[1]);
    TEST_ASSERT_FALSE(daemon_rig.ended);
    TEST_ASSERT_EQUAL_INT(IW_STATE_ARMED, daemon_rig_state());
}

int main(void) {
    (void)signal(SIGPIPE, SIG_DFL); // The gateway ignores it; the parent process may ignore it as well.
    UNITY_BEGIN();
    RUN_TEST(test_two_takeovers_in_one_wake_up_grant_one_lease);
    RUN_TEST(test_stop_and_command_in_one_wake_up_stop);
    RUN_TEST(test_estop_and_reset_in_one_wake_up_stay_latched);
    RUN_TEST(test_log_to_a_closed_pipe_does_not_end_the_gateway);
    return UNITY_END();
}
