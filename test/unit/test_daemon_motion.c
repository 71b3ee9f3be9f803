// SPDX-License-Identifier: MIT
// Loop of the daemon in motion, in virtual time: crash marker, e-stop, clocks, lease, end of the process.
#include "daemon_client.h"

#include "unit.h"

#include <signal.h>
#include <stdlib.h>
#include <string.h>
#include <sys/socket.h>
#include <sys/stat.h>
#include <sys/un.h>
#include <unistd.h>

static const char *cause(void) {
    const char *at = strstr(daemon_rig_ask(client, "{\"cmd\":\"why\"}"), "\"cause\":\"");
    return (at != NULL) ? at + strlen("\"cause\":\"") : "";
}

static bool is_cause(const char *name) {
    const char *is = cause();
    return strncmp(is, name, strlen(name)) == 0 && is[strlen(name)] == '"';
}

/// Kills the gateway and starts it again: it must send zeros immediately, and nothing else, as long as the wheels may
/// retain their last setpoint.
static void assert_next_start_sends_zeros(void) {
    daemon_rig_crash();
    const uint32_t before = daemon_rig.sent[IW_LEFT];
    const iw_time_us_t begin_us = daemon_rig.now_us;
    daemon_rig_start();
    while (daemon_rig.now_us - begin_us < MS(1400)) {
        daemon_rig_run(20);
        TEST_ASSERT_TRUE(daemon_rig_commands_zero());
        TEST_ASSERT_TRUE(daemon_rig.now_us - daemon_rig.sent_us < MS(100));
    }
    TEST_ASSERT_GREATER_THAN_UINT32(before + 50U, daemon_rig.sent[IW_LEFT]);
    daemon_rig_run(2000);
    TEST_ASSERT_EQUAL_INT(IW_STATE_LISTENING, daemon_rig_state());
    TEST_ASSERT_FALSE(daemon_rig_marked());
}

TEST(test_marker_exists_from_first_to_last_nonzero_setpoint) {
    TEST_ASSERT_FALSE(daemon_rig_marked());
    daemon_rig_begin_driving(client);
    (void)close(client);
    client = -1;
    for (unsigned ms = 0; ms < 5000U; ms++) {
        daemon_rig_run(1);
        TEST_ASSERT_EQUAL_INT(daemon_rig_state() == IW_STATE_STOPPING, daemon_rig_marked());
    }
    TEST_ASSERT_EQUAL_INT(IW_STATE_LISTENING, daemon_rig_state());
    TEST_ASSERT_EQUAL_UINT32(0, daemon_rig.unmarked);
}

TEST(test_killed_before_any_setpoint_next_start_sends_nothing) {
    daemon_rig.full = true;
    (void)daemon_rig_ask(client, "{\"cmd\":\"arm\"}");
    TEST_ASSERT_FALSE(daemon_rig_marked());
    daemon_rig_crash();
    daemon_rig.full = false;
    const uint32_t before = daemon_rig.sent[IW_LEFT];
    daemon_rig_start();
    daemon_rig_run(1000);
    TEST_ASSERT_EQUAL_UINT32(before, daemon_rig.sent[IW_LEFT]);
}

TEST(test_marker_that_cannot_be_set_is_tried_again) {
    char path[128];
    (void)snprintf(path, sizeof path, "%s/bus.armed", daemon_rig.folder);
    TEST_ASSERT_EQUAL_INT(0, mkdir(path, 0755)); // A directory can neither be opened for writing nor unlinked.
    daemon_rig_begin_driving(client);
    TEST_ASSERT_GREATER_OR_EQUAL_UINT64_MESSAGE(daemon_rig.now_us, daemon_rig.daemon->loop.mark_us,
                                                "not in each cycle");
    const iw_time_us_t failed_us = daemon_rig.daemon->loop.mark_us;
    while (daemon_rig.daemon->loop.mark_us == failed_us) {
        daemon_rig_run(1);
    }
    const iw_time_us_t again_us = daemon_rig.now_us + MS(100);
    TEST_ASSERT_EQUAL_INT(0, rmdir(path));
    while (daemon_rig.now_us < again_us - MS(2)) {
        TEST_ASSERT_FALSE(daemon_rig_marked());
        daemon_rig_run(1);
    }
    daemon_rig_run(21);
    TEST_ASSERT_TRUE(daemon_rig_marked());
}

TEST(test_marker_of_a_latch_remains_until_the_zeros_end) {
    daemon_rig_begin_driving(client);
    daemon_rig.estop = 1;
    daemon_rig_run(1000);
    TEST_ASSERT_EQUAL_INT(IW_STATE_LATCHED, daemon_rig_state());
    TEST_ASSERT_TRUE(daemon_rig_marked());
    daemon_rig_run(2000);
    TEST_ASSERT_FALSE(daemon_rig_marked());
    TEST_ASSERT_EQUAL_UINT32(0, daemon_rig.unmarked);
}

TEST(test_killed_while_armed_next_start_sends_zeros) {
    daemon_rig_begin_driving(client);
    assert_next_start_sends_zeros();
}

TEST(test_killed_in_the_ramp_next_start_sends_zeros) {
    daemon_rig_begin_driving(client);
    assert_reply("{\"cmd\":\"stop\"}", "\"ok\":true");
    daemon_rig_run(60);
    TEST_ASSERT_FALSE(daemon_rig_commands_zero());
    assert_next_start_sends_zeros();
}

TEST(test_killed_in_the_hold_next_start_sends_zeros) {
    daemon_rig_begin_driving(client);
    assert_reply("{\"cmd\":\"stop\"}", "\"ok\":true");
    daemon_rig_run(1000);
    TEST_ASSERT_TRUE(daemon_rig_commands_zero());
    TEST_ASSERT_EQUAL_INT(IW_STATE_STOPPING, daemon_rig_state());
    assert_next_start_sends_zeros();
}

TEST(test_killed_in_zeros_of_restart_next_start_sends_zeros) {
    daemon_rig_begin_driving(client);
    daemon_rig_crash();
    daemon_rig_start();
    daemon_rig_run(700);
    assert_next_start_sends_zeros();
}

TEST(test_killed_while_listening_next_start_sends_nothing) {
    daemon_rig_begin_driving(client);
    assert_reply("{\"cmd\":\"stop\"}", "\"ok\":true");
    daemon_rig_run(4000);
    const uint32_t before = daemon_rig.sent[IW_RIGHT];
    daemon_rig_crash();
    daemon_rig_start();
    daemon_rig_run(2000);
    TEST_ASSERT_EQUAL_UINT32(before, daemon_rig.sent[IW_RIGHT]);
}

TEST(test_estop_edge_sends_zeros_in_the_same_millisecond) {
    for (unsigned phase = 0; phase < 20U; phase++) {
        daemon_rig_begin_driving(client);
        daemon_rig_run(phase);
        daemon_rig.estop = 1;
        const iw_time_us_t pressed_us = daemon_rig.now_us;
        daemon_rig_run(1);
        TEST_ASSERT_TRUE(daemon_rig_commands_zero());
        TEST_ASSERT_TRUE(daemon_rig.sent_us >= pressed_us);
        tearDown();
        setUp();
    }
}

TEST(test_estop_unreadable_without_event_latches_within_5_ms) {
    daemon_rig_begin_driving(client);
    daemon_rig.estop_silent = true;
    daemon_rig.estop = -1;
    daemon_rig_run(5);
    TEST_ASSERT_EQUAL_INT(IW_STATE_LATCHED, daemon_rig_state());
    TEST_ASSERT_TRUE(daemon_rig_commands_zero());
}

TEST(test_estop_unreadable_on_silent_bus_latches_within_5_ms) {
    for (unsigned phase = 0; phase < 20U; phase += 3U) {
        daemon_rig_begin_driving(client);
        if (phase % 2U == 1U) { // With this topic frames are read one by one.
            (void)daemon_rig_ask(client, "{\"cmd\":\"watch\",\"topics\":[\"frame\"]}");
        }
        daemon_rig_run(phase);
        sim_world_power(&daemon_rig.world, daemon_rig.now_us, false); // No frame wakes the loop now.
        daemon_rig.estop_silent = true;
        daemon_rig.estop = -1;
        daemon_rig_run(5);
        TEST_ASSERT_EQUAL_INT(-1, daemon_rig.estop_reported);
        TEST_ASSERT_EQUAL_INT(IW_STATE_LATCHED, daemon_rig_state());
        TEST_ASSERT_TRUE(is_cause("estop_line"));
        tearDown();
        setUp();
    }
}

TEST(test_estop_pulse_that_ends_before_the_poll_latches) {
    daemon_rig_begin_driving(client);
    daemon_rig_run(7);
    daemon_rig.estop_pulse = true;
    daemon_rig.waits = 0;
    daemon_rig_run(1);
    TEST_ASSERT_EQUAL_UINT32_MESSAGE(1, daemon_rig.sent_waits, "zeros leave in the cycle that the edge has begun");
    TEST_ASSERT_EQUAL_INT(IW_STATE_LATCHED, daemon_rig_state());
    TEST_ASSERT_TRUE(daemon_rig_commands_zero());
}

TEST(test_software_estop_stays_latched_after_its_client_ends) {
    static const unsigned hold_ms[] = {0, 100, 1000, 3000};
    for (size_t i = 0; i < sizeof hold_ms / sizeof hold_ms[0]; i++) {
        const int other = daemon_rig_connect();
        daemon_rig_begin_driving(client);
        assert_reply_to(other, "{\"cmd\":\"estop\",\"reason\":\"test\"}", "\"ok\":true");
        daemon_rig_run(hold_ms[i]);
        (void)close(other);
        daemon_rig_run(3000);
        TEST_ASSERT_EQUAL_INT(IW_STATE_LATCHED, daemon_rig_state());
        assert_reply("{\"cmd\":\"arm\"}", "\"error\":\"latched\"");
        assert_reply("{\"cmd\":\"reset\"}", "\"ok\":true");
    }
}

TEST(test_suspension_in_motion_latches_with_zeros_first) {
    daemon_rig_begin_driving(client);
    daemon_rig.suspended_us += 2000000U;
    const uint32_t before = daemon_rig.sent[IW_LEFT];
    daemon_rig_run(25);
    TEST_ASSERT_GREATER_THAN_UINT32(before, daemon_rig.sent[IW_LEFT]);
    TEST_ASSERT_TRUE(daemon_rig_commands_zero());
    TEST_ASSERT_EQUAL_INT(IW_STATE_LATCHED, daemon_rig_state());
    TEST_ASSERT_TRUE(is_cause("loop_hung"));
}

TEST(test_suspension_counts_once_and_not_from_before_the_start) {
    daemon_rig_crash();
    daemon_rig.suspended_us += 3600000000U;
    daemon_rig_start();
    daemon_rig_run(1100);
    (void)close(client);
    client = daemon_rig_connect();
    daemon_rig_begin_driving(client);
    daemon_rig.suspended_us += 200000U;
    daemon_rig_run(25);
    TEST_ASSERT_EQUAL_INT(IW_STATE_STOPPING, daemon_rig_state());
    TEST_ASSERT_TRUE(daemon_rig_commands_zero());
    daemon_rig_run(4000);
    daemon_rig_begin_driving(client);
    TEST_ASSERT_EQUAL_INT(IW_STATE_ARMED, daemon_rig_state());
}

TEST(test_time_never_decreases_after_a_short_suspension) {
    while (daemon_rig.now_us - daemon_rig.polled_us > MS(1)) {
        daemon_rig_run(1);
    }
    daemon_rig.suspended_us += 2000U;
    iw_time_us_t before_us = 0;
    bool ahead = false;
    for (unsigned ms = 0; ms < 1500U; ms++) {
        (void)daemon_rig_ask(client, "{\"cmd\":\"hello\"}"); // The request wakes the loop before it can be late.
        const iw_time_us_t now_us = daemon_rig.daemon->wheels.now_us;
        TEST_ASSERT_TRUE(now_us >= before_us);
        ahead = ahead || now_us > daemon_rig.now_us;
        TEST_ASSERT_TRUE(ms < 1010U || now_us <= daemon_rig.now_us);
        before_us = now_us;
    }
    TEST_ASSERT_TRUE(ahead);
    TEST_ASSERT_EQUAL_UINT32(0, gw_wheels_snapshot(&daemon_rig.daemon->wheels).counters->late_steps);
}

TEST(test_second_request_of_a_cycle_reads_the_clock_again) {
    gw_wheels_t *wheels = &daemon_rig.daemon->wheels;
    const iw_time_us_t read_us = daemon_rig.now_us;
    gw_wheels_time(wheels, read_us);
    daemon_rig.now_us += 300U;
    gw_wheels_time_request(wheels);
    TEST_ASSERT_EQUAL_UINT64(read_us, wheels->now_us);
    gw_wheels_time_request(wheels);
    TEST_ASSERT_EQUAL_UINT64(read_us + 300U, wheels->now_us);
}

TEST(test_suspension_counts_if_longer_than_a_late_step) {
    daemon_rig_keep_log();
    daemon_rig_begin_driving(client);
    daemon_rig.suspended_us += IW_GATEWAY_LATE_US;
    daemon_rig_run(25);
    TEST_ASSERT_EQUAL_STRING("", strstr(daemon_rig_log(), "suspended") ? daemon_rig_log() : "");
    daemon_rig.suspended_us += IW_GATEWAY_LATE_US + 1000U;
    daemon_rig_run(25);
    TEST_ASSERT_NOT_NULL(strstr(daemon_rig_log(), "the machine was suspended for 21 ms"));
}

TEST(test_loop_after_a_stall_continues_with_zeros) {
    daemon_rig_begin_driving(client);
    daemon_rig.stolen_us = 150000U;
    daemon_rig_run(1);
    TEST_ASSERT_TRUE(daemon_rig_commands_zero());
    TEST_ASSERT_EQUAL_INT(IW_STATE_STOPPING, daemon_rig_state());
    daemon_rig_run(4000);
    daemon_rig_begin_driving(client);
    daemon_rig.stolen_us = 600000U;
    daemon_rig_run(1);
    TEST_ASSERT_TRUE(daemon_rig_commands_zero());
    TEST_ASSERT_EQUAL_INT(IW_STATE_LATCHED, daemon_rig_state());
}

TEST(test_lease_is_lost_without_commands_despite_other_requests) {
    daemon_rig_begin_driving(client);
    const iw_time_us_t last_us = daemon_rig.now_us;
    while (daemon_rig_state() == IW_STATE_ARMED && daemon_rig.now_us - last_us < MS(1000)) {
        (void)daemon_rig_ask(client, "{\"cmd\":\"status\"}");
        (void)daemon_rig_ask(client, "{\"cmd\":\"drive\",\"left_mm_s\":100}");
    }
    TEST_ASSERT_TRUE(daemon_rig.now_us - last_us <= MS(205));
    TEST_ASSERT_TRUE(is_cause("lease_lost"));
}

TEST(test_clients_are_served_with_the_time_of_the_cycle) {
    for (unsigned ms = 0; ms < 50U; ms++) {
        daemon_rig_run(1);
        TEST_ASSERT_EQUAL_UINT64(daemon_rig.daemon->wheels.now_us, daemon_rig.daemon->clients.now_us);
    }
}

TEST(test_lease_ends_immediately_with_the_connection) {
    daemon_rig_begin_driving(client);
    (void)close(client);
    client = -1;
    daemon_rig_run(1);
    TEST_ASSERT_EQUAL_INT(IW_STATE_STOPPING, daemon_rig_state());
}

TEST(test_lease_end_by_hangup_precedes_the_last_request) {
    daemon_rig_begin_driving(client);
    daemon_rig_send(client, "{\"cmd\":\"stop\"}\n");
    (void)close(client);
    daemon_rig_run(1);
    client = daemon_rig_connect();
    TEST_ASSERT_TRUE(is_cause("client_gone"));
}

/// Counts the messages READY=1 to the service manager.
static unsigned ready_reports(int manager) {
    char word[32];
    unsigned count = 0;
    for (ssize_t n = recv(manager, word, sizeof word, MSG_DONTWAIT); n > 0;
         n = recv(manager, word, sizeof word, MSG_DONTWAIT)) {
        count += (strncmp(word, "READY=1", (size_t)n) == 0) ? 1U : 0U;
    }
    return count;
}

/// Returns the longest time between two messages to the watchdog of the service manager.
static iw_time_us_t longest_unfed_us(int manager, unsigned for_ms) {
    char word[32];
    iw_time_us_t fed_us = daemon_rig.now_us;
    iw_time_us_t longest_us = 0;
    for (unsigned ms = 0; ms < for_ms; ms++) {
        daemon_rig_run(1);
        for (ssize_t n = recv(manager, word, sizeof word, MSG_DONTWAIT); n > 0;
             n = recv(manager, word, sizeof word, MSG_DONTWAIT)) {
            fed_us = (strncmp(word, "WATCHDOG=1", (size_t)n) == 0) ? daemon_rig.now_us : fed_us;
        }
        longest_us = (daemon_rig.now_us - fed_us > longest_us) ? daemon_rig.now_us - fed_us : longest_us;
    }
    return longest_us;
}

TEST(test_watchdog_is_fed_at_half_its_time_in_every_state) {
    struct sockaddr_un address = {.sun_family = AF_UNIX};
    const int manager = socket(AF_UNIX, SOCK_DGRAM | SOCK_NONBLOCK, 0);
    (void)snprintf(address.sun_path, sizeof address.sun_path, "%s/notify", daemon_rig.folder);
    TEST_ASSERT_EQUAL_INT(0, bind(manager, (const struct sockaddr *)&address, sizeof address));
    (void)setenv("NOTIFY_SOCKET", address.sun_path, 1);
    (void)setenv("WATCHDOG_USEC", "400000", 1);
    daemon_rig_crash();
    daemon_rig_start();
    (void)unsetenv("NOTIFY_SOCKET");
    (void)unsetenv("WATCHDOG_USEC");
    daemon_rig_run(500);
    TEST_ASSERT_EQUAL_UINT(1U, ready_reports(manager));
    const iw_time_us_t at_rest_us = longest_unfed_us(manager, 2000);
    (void)close(client);
    client = daemon_rig_connect();
    daemon_rig_arm(client);
    const iw_time_us_t armed_us = longest_unfed_us(manager, 900);
    (void)close(manager);
    (void)unlink(address.sun_path);
    TEST_ASSERT_TRUE(at_rest_us <= MS(220));
    TEST_ASSERT_TRUE(armed_us <= MS(220));
}

TEST(test_setpoints_are_at_most_21_ms_apart) {
    daemon_rig_begin_driving(client);
    for (unsigned ms = 0; ms < 2000U; ms++) {
        (void)((ms % 50U == 0U) ? daemon_rig_ask(client, "{\"cmd\":\"drive\",\"left_mm_s\":300,\"right_mm_s\":300}")
                                : "");
        daemon_rig_run(1);
        TEST_ASSERT_TRUE(daemon_rig.now_us - daemon_rig.sent_us <= MS(21));
    }
}

static void end_by(int number) {
    daemon_rig_begin_driving(client);
    TEST_ASSERT_EQUAL_INT(0, kill(getpid(), number));
    daemon_rig_run(1);
    TEST_ASSERT_EQUAL_INT(IW_STATE_STOPPING, daemon_rig_state());
    TEST_ASSERT_FALSE(daemon_rig_commands_zero());
    const iw_time_us_t commanded_us = daemon_rig.now_us;
    assert_reply("{\"cmd\":\"arm\"}", "shutting down");
    daemon_rig_run(10000);
    TEST_ASSERT_TRUE(daemon_rig.ended);
    TEST_ASSERT_TRUE(daemon_rig_commands_zero());
    TEST_ASSERT_TRUE(daemon_rig.now_us - commanded_us >= MS(1500));
    TEST_ASSERT_FALSE(daemon_rig_marked());
}

TEST(test_signal_to_end_ramps_holds_and_removes_the_marker) {
    static const int numbers[] = {SIGTERM, SIGINT, SIGHUP};
    for (size_t i = 0; i < sizeof numbers / sizeof numbers[0]; i++) {
        sigset_t none;
        (void)sigemptyset(&none);
        (void)sigprocmask(SIG_SETMASK, &none, NULL); // Signal mask of a new process, before the loop is opened
        (void)signal(numbers[i], SIG_DFL);
        tearDown();
        setUp();
        end_by(numbers[i]);
    }
}

/// The test itself has the name of root on the bus; only a gateway of another user checks this name.
TEST(test_stop_of_the_gateway_itself_requests_a_step_in_this_cycle) {
    daemon_rig_begin_driving(client);
    gw_wheels_t *wheels = &daemon_rig.daemon->wheels;
    TEST_ASSERT_FALSE(wheels->requested);
    gw_wheels_stop(wheels, IW_CLIENT_NONE, IW_CAUSE_SHUTDOWN);
    TEST_ASSERT_TRUE(wheels->requested);
}

TEST(test_gateway_that_gives_way_ramps_logs_why_and_ends) {
    if (geteuid() != 0) {
        return;
    }
    daemon_rig_keep_log();
    daemon_rig_begin_driving(client);
    TEST_ASSERT_EQUAL_INT(GW_LOOP_SERVES, daemon_rig.daemon->loop.phase);
    daemon_rig.daemon->runtime.lock.names.owners.own = 65534;
    daemon_rig.daemon->runtime.lock.names.place = 1;
    daemon_rig_run(10000);
    TEST_ASSERT_TRUE(daemon_rig.ended);
    TEST_ASSERT_EQUAL_INT(GW_LOOP_GIVES_WAY, daemon_rig.daemon->loop.phase);
    TEST_ASSERT_TRUE(daemon_rig_commands_zero());
    TEST_ASSERT_FALSE(daemon_rig_marked());
    char line[96];
    (void)snprintf(line, sizeof line, "a gateway of user 0 (process %ld) serves unix:", (long)getpid());
    TEST_ASSERT_NOT_NULL_MESSAGE(strstr(daemon_rig_log(), line), daemon_rig_log());
}

TEST(test_start_with_healthy_wheels_logs_no_fault) {
    daemon_rig_crash();
    daemon_rig_start();
    TEST_ASSERT_EQUAL_UINT32(
        0,
        daemon_rig.daemon->answers.server.reported.present); // The first poll finds no telemetry yet.
    daemon_rig_keep_log();
    daemon_rig_run(2000);
    TEST_ASSERT_NULL_MESSAGE(strstr(daemon_rig_log(), "wheel_lost"), daemon_rig_log());
    sim_world_power(&daemon_rig.world, daemon_rig.now_us, false);
    daemon_rig_run(200);
    TEST_ASSERT_NOT_NULL_MESSAGE(strstr(daemon_rig_log(), "fault: wheel_lost"), daemon_rig_log());
}

TEST(test_start_without_wheels_logs_the_fault_after_a_second) {
    sim_world_power(&daemon_rig.world, daemon_rig.now_us, false);
    daemon_rig_crash();
    daemon_rig_start();
    TEST_ASSERT_EQUAL_UINT32(0, daemon_rig.daemon->answers.server.reported.present);
    daemon_rig_keep_log();
    daemon_rig_run(900);
    TEST_ASSERT_NULL_MESSAGE(strstr(daemon_rig_log(), "wheel_lost"), daemon_rig_log());
    daemon_rig_run(200);
    TEST_ASSERT_NOT_NULL_MESSAGE(strstr(daemon_rig_log(), "fault: wheel_lost"), daemon_rig_log());
}
