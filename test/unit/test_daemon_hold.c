// SPDX-License-Identifier: MIT
// after_stop = hold through the daemon, in virtual time: zeros, crash marker, the request that ends the hold, end of
// the process.
#include "daemon_client.h"

#include "unit.h"

#include <signal.h>
#include <stdio.h>
#include <string.h>
#include <unistd.h>

static void begin_again(void) {
    daemon_rig.hold = true;
    (void)close(client);
    daemon_rig_crash();
    daemon_rig_start();
    daemon_rig_run(1000);
    client = daemon_rig_connect();
}

static bool holds(void) {
    return strstr(daemon_rig_ask(client, "{\"cmd\":\"status\"}"), "\"holding\":true,") != NULL;
}

static void drive_and_stop(void) {
    begin_again();
    daemon_rig_begin_driving(client);
    assert_reply("{\"cmd\":\"stop\"}", "\"ok\":true");
    daemon_rig_run(5000);
}

static void assert_held(iw_state_t state, unsigned for_ms) {
    for (unsigned ms = 0; ms < for_ms; ms += 50U) {
        daemon_rig_run(50);
        TEST_ASSERT_TRUE(daemon_rig_commands_zero());
        TEST_ASSERT_TRUE(daemon_rig.now_us - daemon_rig.sent_us < MS(100));
        TEST_ASSERT_TRUE(daemon_rig_marked());
    }
    TEST_ASSERT_EQUAL_INT(state, daemon_rig_state());
    TEST_ASSERT_TRUE(holds());
}

static void assert_silent(iw_state_t state) {
    daemon_rig_run(200);
    const uint32_t before = daemon_rig.sent[IW_LEFT];
    daemon_rig_run(2000);
    TEST_ASSERT_EQUAL_UINT32(before, daemon_rig.sent[IW_LEFT]);
    TEST_ASSERT_EQUAL_INT(state, daemon_rig_state());
    TEST_ASSERT_FALSE(holds());
    TEST_ASSERT_FALSE(daemon_rig_marked());
}

static const char *aged_release(int64_t age_ms) {
    static char line[96];
    (void)snprintf(line, sizeof line, "{\"cmd\":\"release\",\"t_us\":%lld}",
                   (long long)daemon_rig.now_us - (long long)age_ms * 1000);
    return line;
}

TEST(test_hold_and_its_marker_last_until_release) {
    drive_and_stop();
    assert_held(IW_STATE_STOPPING, 120000);
    assert_reply("{\"cmd\":\"status\"}", "\"zeros hold the wheels until release (iwheelctl release) or arm;");
    assert_reply("{\"cmd\":\"release\"}", "\"ok\":true");
    assert_silent(IW_STATE_LISTENING);
}

TEST(test_hold_of_a_latch_continues_after_reset) {
    begin_again();
    daemon_rig_begin_driving(client);
    daemon_rig.estop = 1;
    daemon_rig_run(5000);
    assert_held(IW_STATE_LATCHED, 10000);
    daemon_rig.estop = 0;
    daemon_rig_run(2000);
    assert_reply("{\"cmd\":\"reset\"}", "\"ok\":true");
    assert_held(IW_STATE_STOPPING, 10000);
    assert_reply("{\"cmd\":\"release\"}", "\"ok\":true");
    assert_silent(IW_STATE_LISTENING);
}

TEST(test_hold_is_resumed_by_the_next_start) {
    drive_and_stop();
    daemon_rig_crash();
    daemon_rig_start();
    daemon_rig_run(2000);
    (void)close(client);
    client = daemon_rig_connect();
    assert_held(IW_STATE_STOPPING, 60000);
    daemon_rig_arm(client);
    TEST_ASSERT_EQUAL_INT(IW_STATE_ARMED, daemon_rig_state());
}

TEST(test_hold_ends_with_the_process_after_a_warning) {
    drive_and_stop();
    daemon_rig_keep_log();
    TEST_ASSERT_EQUAL_INT(0, kill(getpid(), SIGTERM));
    daemon_rig_run(200);
    TEST_ASSERT_TRUE(daemon_rig.ended);
    TEST_ASSERT_NOT_NULL(strstr(daemon_rig_log(), "use its parking brake"));
    TEST_ASSERT_FALSE(daemon_rig_marked());
}

TEST(test_hold_before_its_begin_ends_with_a_warning) {
    for (unsigned crashed = 0; crashed < 2U; crashed++) {
        if (crashed != 0U) {
            drive_and_stop();
            daemon_rig_crash();
            daemon_rig_start();
            daemon_rig_run(100);
        } else {
            begin_again();
            daemon_rig_arm(client);
        }
        TEST_ASSERT_FALSE(gw_wheels_snapshot(&daemon_rig.daemon->wheels).holding);
        daemon_rig_keep_log();
        TEST_ASSERT_EQUAL_INT(0, kill(getpid(), SIGTERM));
        daemon_rig_run(3000);
        TEST_ASSERT_TRUE(daemon_rig.ended);
        TEST_ASSERT_NOT_NULL(strstr(daemon_rig_log(), "use its parking brake"));
        tearDown();
        setUp();
    }
}

TEST(test_process_without_setpoints_ends_without_a_warning) {
    daemon_rig_keep_log();
    TEST_ASSERT_EQUAL_INT(0, kill(getpid(), SIGTERM));
    daemon_rig_run(200);
    TEST_ASSERT_TRUE(daemon_rig.ended);
    TEST_ASSERT_NULL(strstr(daemon_rig_log(), "use its parking brake"));
}

TEST(test_release_too_old_changes_nothing) {
    static const int64_t late_ms[] = {1001, 1100, 60000};
    drive_and_stop();
    for (size_t i = 0; i < sizeof late_ms / sizeof late_ms[0]; i++) {
        assert_reply(aged_release(late_ms[i]), "\"error\":\"stale_command\"");
    }
    assert_held(IW_STATE_STOPPING, 5000);
    assert_reply(aged_release(999), "\"ok\":true");
    assert_silent(IW_STATE_LISTENING);
}

TEST(test_release_older_than_a_stop_of_another_changes_nothing) {
    drive_and_stop();
    const int other = daemon_rig_connect();
    daemon_rig_run(20);
    (void)daemon_rig_ask(other, "{\"cmd\":\"stop\"}");
    daemon_rig_run(100);
    assert_reply(aged_release(500), "\"error\":\"stale_command\"");
    assert_held(IW_STATE_STOPPING, 5000);
    (void)close(other);
}

TEST(test_release_by_watcher_or_while_driving_is_refused) {
    drive_and_stop();
    const int watcher = daemon_rig_connect_with(SOCK_WATCH);
    daemon_rig_run(20);
    assert_reply_to(watcher, "{\"cmd\":\"release\"}", "\"error\":\"denied\"");
    assert_held(IW_STATE_STOPPING, 5000);
    daemon_rig_arm(client);
    assert_reply("{\"cmd\":\"release\"}", "\"error\":\"not_at_rest\"");
    assert_reply("{\"cmd\":\"release\"}", " holds the lease for another ");
    assert_reply("{\"cmd\":\"release\"}", " ms at least; let it stop first\"");
    (void)close(watcher);
}

TEST(test_release_during_the_ramp_is_refused) {
    drive_and_stop();
    daemon_rig_arm(client);
    (void)daemon_rig_ask(client, "{\"cmd\":\"drive\",\"left_mm_s\":300,\"right_mm_s\":300}");
    daemon_rig_run(150);
    (void)daemon_rig_ask(client, "{\"cmd\":\"stop\"}");
    assert_reply("{\"cmd\":\"release\"}",
                 "\"error\":\"not_at_rest\",\"message\":\"the wheels turn or are commanded to: left ");
}
