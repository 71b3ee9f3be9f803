// SPDX-License-Identifier: MIT
// The daemon's loop in motion, in virtual time: the crash marker, the e-stop, the clocks, the lease, the end.
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

/// Killed now and started again: zeros and nothing else, at once, for as long as the wheels might keep their last command.
static void assert_next_start_sends_zeros(void) {
    daemon_rig_crash();
    const uint32_t before = daemon_rig.sent[IW_LEFT];
    const iw_time_us_t begin_us = daemon_rig.now_us;
    daemon_rig_start();
    while (daemon_rig.now_us - begin_us < MS(1400)) {
        daemon_rig_run(20);
        TEST_ASSERT_TRUE(daemon_rig_is_told_zero());
        TEST_ASSERT_TRUE(daemon_rig.now_us - daemon_rig.sent_us < MS(100));
    }
    TEST_ASSERT_GREATER_THAN_UINT32(before + 50U, daemon_rig.sent[IW_LEFT]);
    daemon_rig_run(2000);
    TEST_ASSERT_EQUAL_INT(IW_STATE_LISTENING, daemon_rig_state());
    TEST_ASSERT_FALSE(daemon_rig_marked());
}

TEST(test_marker_is_there_before_the_first_nonzero_setpoint_and_until_after_the_last) {
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

TEST(test_killed_before_anything_was_sent_the_next_start_sends_nothing) {
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

TEST(test_marker_that_could_not_be_set_is_tried_again) {
    char path[128];
    (void)snprintf(path, sizeof path, "%s/bus.armed", daemon_rig.folder);
    TEST_ASSERT_EQUAL_INT(0, mkdir(path, 0755)); // Not to be opened for writing, nor unlinked.
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

TEST(test_marker_outlives_a_latch_until_its_zeros_have_been_held) {
    daemon_rig_begin_driving(client);
    daemon_rig.estop = 1;
    daemon_rig_run(1000);
    TEST_ASSERT_EQUAL_INT(IW_STATE_LATCHED, daemon_rig_state());
    TEST_ASSERT_TRUE(daemon_rig_marked());
    daemon_rig_run(2000);
    TEST_ASSERT_FALSE(daemon_rig_marked());
    TEST_ASSERT_EQUAL_UINT32(0, daemon_rig.unmarked);
}

TEST(test_killed_while_armed_the_next_start_sends_zeros) {
    daemon_rig_begin_driving(client);
    assert_next_start_sends_zeros();
}

TEST(test_killed_in_the_ramp_the_next_start_sends_zeros) {
    daemon_rig_begin_driving(client);
    TEST_ASSERT_NOT_NULL(strstr(daemon_rig_ask(client, "{\"cmd\":\"stop\"}"), "\"ok\":true"));
    daemon_rig_run(60);
    TEST_ASSERT_FALSE(daemon_rig_is_told_zero());
    assert_next_start_sends_zeros();
}

TEST(test_killed_in_the_hold_the_next_start_sends_zeros) {
    daemon_rig_begin_driving(client);
    TEST_ASSERT_NOT_NULL(strstr(daemon_rig_ask(client, "{\"cmd\":\"stop\"}"), "\"ok\":true"));
    daemon_rig_run(1000);
    TEST_ASSERT_TRUE(daemon_rig_is_told_zero());
    TEST_ASSERT_EQUAL_INT(IW_STATE_STOPPING, daemon_rig_state());
    assert_next_start_sends_zeros();
}

TEST(test_killed_in_the_zeros_of_a_restart_the_next_start_sends_them_anew) {
    daemon_rig_begin_driving(client);
    daemon_rig_crash();
    daemon_rig_start();
    daemon_rig_run(700);
    assert_next_start_sends_zeros();
}

TEST(test_killed_while_listening_the_next_start_sends_nothing) {
    daemon_rig_begin_driving(client);
    TEST_ASSERT_NOT_NULL(strstr(daemon_rig_ask(client, "{\"cmd\":\"stop\"}"), "\"ok\":true"));
    daemon_rig_run(4000);
    const uint32_t before = daemon_rig.sent[IW_RIGHT];
    daemon_rig_crash();
    daemon_rig_start();
    daemon_rig_run(2000);
    TEST_ASSERT_EQUAL_UINT32(before, daemon_rig.sent[IW_RIGHT]);
}

TEST(test_estop_edge_is_answered_with_zeros_in_the_same_millisecond) {
    for (unsigned phase = 0; phase < 20U; phase++) {
        daemon_rig_begin_driving(client);
        daemon_rig_run(phase);
        daemon_rig.estop = 1;
        const iw_time_us_t pressed_us = daemon_rig.now_us;
        daemon_rig_run(1);
        TEST_ASSERT_TRUE(daemon_rig_is_told_zero());
        TEST_ASSERT_TRUE(daemon_rig.sent_us >= pressed_us);
        tearDown();
        setUp();
    }
}

TEST(test_estop_that_goes_without_a_word_is_seen_within_milliseconds) {
    daemon_rig_begin_driving(client);
    daemon_rig.estop_silent = true;
    daemon_rig.estop = -1;
    daemon_rig_run(5);
    TEST_ASSERT_EQUAL_INT(IW_STATE_LATCHED, daemon_rig_state());
    TEST_ASSERT_TRUE(daemon_rig_is_told_zero());
}

TEST(test_estop_that_goes_without_a_word_from_a_silent_bus_is_seen_within_milliseconds) {
    for (unsigned phase = 0; phase < 20U; phase += 3U) {
        daemon_rig_begin_driving(client);
        if (phase % 2U == 1U) { // Then frames do not wait to be looked at.
            (void)daemon_rig_ask(client, "{\"cmd\":\"watch\",\"topics\":[\"frame\"]}");
        }
        daemon_rig_run(phase);
        sim_world_power(&daemon_rig.world, daemon_rig.now_us, false); // No frame wakes us now.
        daemon_rig.estop_silent = true;
        daemon_rig.estop = -1;
        daemon_rig_run(5);
        TEST_ASSERT_EQUAL_INT(-1, daemon_rig.estop_told);
        TEST_ASSERT_EQUAL_INT(IW_STATE_LATCHED, daemon_rig_state());
        TEST_ASSERT_TRUE(is_cause("estop_line"));
        tearDown();
        setUp();
    }
}

TEST(test_estop_pulse_that_is_over_when_it_is_looked_at_latches) {
    daemon_rig_begin_driving(client);
    daemon_rig_run(7);
    daemon_rig.estop_pulse = true;
    daemon_rig.waits = 0;
    daemon_rig_run(1);
    TEST_ASSERT_EQUAL_UINT32_MESSAGE(1, daemon_rig.sent_waits, "zeros leave in the cycle that the edge has begun");
    TEST_ASSERT_EQUAL_INT(IW_STATE_LATCHED, daemon_rig_state());
    TEST_ASSERT_TRUE(daemon_rig_is_told_zero());
}

TEST(test_software_estop_stays_latched_when_its_client_goes_in_the_hold_and_after) {
    static const unsigned hold_ms[] = {0, 100, 1000, 3000};
    for (size_t i = 0; i < sizeof hold_ms / sizeof hold_ms[0]; i++) {
        const int other = daemon_rig_connect();
        daemon_rig_begin_driving(client);
        TEST_ASSERT_NOT_NULL(strstr(daemon_rig_ask(other, "{\"cmd\":\"estop\",\"reason\":\"test\"}"), "\"ok\":true"));
        daemon_rig_run(hold_ms[i]);
        (void)close(other);
        daemon_rig_run(3000);
        TEST_ASSERT_EQUAL_INT(IW_STATE_LATCHED, daemon_rig_state());
        TEST_ASSERT_NOT_NULL(strstr(daemon_rig_ask(client, "{\"cmd\":\"arm\"}"), "\"error\":\"latched\""));
        TEST_ASSERT_NOT_NULL(strstr(daemon_rig_ask(client, "{\"cmd\":\"reset\"}"), "\"ok\":true"));
    }
}

TEST(test_suspended_machine_latches_with_zeros_first) {
    daemon_rig_begin_driving(client);
    daemon_rig.suspended_us += 2000000U;
    const uint32_t before = daemon_rig.sent[IW_LEFT];
    daemon_rig_run(25);
    TEST_ASSERT_GREATER_THAN_UINT32(before, daemon_rig.sent[IW_LEFT]);
    TEST_ASSERT_TRUE(daemon_rig_is_told_zero());
    TEST_ASSERT_EQUAL_INT(IW_STATE_LATCHED, daemon_rig_state());
    TEST_ASSERT_TRUE(is_cause("loop_hung"));
}

TEST(test_suspension_counts_once_and_one_from_before_the_start_not_at_all) {
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
    TEST_ASSERT_TRUE(daemon_rig_is_told_zero());
    daemon_rig_run(4000);
    daemon_rig_begin_driving(client);
    TEST_ASSERT_EQUAL_INT(IW_STATE_ARMED, daemon_rig_state());
}

TEST(test_time_never_goes_back_after_a_suspension_too_short_to_count) {
    while (daemon_rig.now_us - daemon_rig.looked_us > MS(1)) {
        daemon_rig_run(1);
    }
    daemon_rig.suspended_us += 2000U;
    iw_time_us_t before_us = 0;
    bool ahead = false;
    for (unsigned ms = 0; ms < 1500U; ms++) {
        (void)daemon_rig_ask(client, "{\"cmd\":\"hello\"}"); // Wakes it before it can be late.
        const iw_time_us_t now_us = daemon_rig.daemon->wheels.now_us;
        TEST_ASSERT_TRUE(now_us >= before_us);
        ahead = ahead || now_us > daemon_rig.now_us;
        TEST_ASSERT_TRUE(ms < 1010U || now_us <= daemon_rig.now_us);
        before_us = now_us;
    }
    TEST_ASSERT_TRUE(ahead);
    TEST_ASSERT_EQUAL_UINT32(0, gw_wheels_look(&daemon_rig.daemon->wheels).counters->late_steps);
}

TEST(test_second_request_after_one_reading_of_the_clock_has_a_time_of_its_own) {
    gw_wheels_t *wheels = &daemon_rig.daemon->wheels;
    const iw_time_us_t read_us = daemon_rig.now_us;
    gw_wheels_time(wheels, read_us);
    daemon_rig.now_us += 300U;
    gw_wheels_time_request(wheels);
    TEST_ASSERT_EQUAL_UINT64(read_us, wheels->now_us);
    gw_wheels_time_request(wheels);
    TEST_ASSERT_EQUAL_UINT64(read_us + 300U, wheels->now_us);
}

TEST(test_suspension_counts_from_the_time_on_that_makes_a_step_late) {
    daemon_rig_keep_log();
    daemon_rig_begin_driving(client);
    daemon_rig.suspended_us += IW_GATEWAY_LATE_US;
    daemon_rig_run(25);
    TEST_ASSERT_EQUAL_STRING("", strstr(daemon_rig_log(), "suspended") ? daemon_rig_log() : "");
    daemon_rig.suspended_us += IW_GATEWAY_LATE_US + 1000U;
    daemon_rig_run(25);
    TEST_ASSERT_NOT_NULL(strstr(daemon_rig_log(), "the machine was suspended for 21 ms"));
}

TEST(test_loop_that_stood_still_goes_on_with_zeros) {
    daemon_rig_begin_driving(client);
    daemon_rig.stolen_us = 150000U;
    daemon_rig_run(1);
    TEST_ASSERT_TRUE(daemon_rig_is_told_zero());
    TEST_ASSERT_EQUAL_INT(IW_STATE_STOPPING, daemon_rig_state());
    daemon_rig_run(4000);
    daemon_rig_begin_driving(client);
    daemon_rig.stolen_us = 600000U;
    daemon_rig_run(1);
    TEST_ASSERT_TRUE(daemon_rig_is_told_zero());
    TEST_ASSERT_EQUAL_INT(IW_STATE_LATCHED, daemon_rig_state());
}

TEST(test_lease_is_lost_when_commands_end_although_requests_go_on) {
    daemon_rig_begin_driving(client);
    const iw_time_us_t last_us = daemon_rig.now_us;
    while (daemon_rig_state() == IW_STATE_ARMED && daemon_rig.now_us - last_us < MS(1000)) {
        (void)daemon_rig_ask(client, "{\"cmd\":\"status\"}");
        (void)daemon_rig_ask(client, "{\"cmd\":\"drive\",\"left_mm_s\":100}");
    }
    TEST_ASSERT_TRUE(daemon_rig.now_us - last_us <= MS(205));
    TEST_ASSERT_TRUE(is_cause("lease_lost"));
}

TEST(test_clients_are_served_at_the_time_of_the_cycle) {
    for (unsigned ms = 0; ms < 50U; ms++) {
        daemon_rig_run(1);
        TEST_ASSERT_EQUAL_UINT64(daemon_rig.daemon->wheels.now_us, daemon_rig.daemon->clients.now_us);
    }
}

TEST(test_lease_ends_with_the_connection_at_once) {
    daemon_rig_begin_driving(client);
    (void)close(client);
    client = -1;
    daemon_rig_run(1);
    TEST_ASSERT_EQUAL_INT(IW_STATE_STOPPING, daemon_rig_state());
}

TEST(test_lease_that_ends_with_the_connection_ends_before_anything_that_was_sent_last) {
    static const char line[] = "{\"cmd\":\"stop\"}\n";
    daemon_rig_begin_driving(client);
    TEST_ASSERT_EQUAL_INT((int)sizeof line - 1, (int)send(client, line, sizeof line - 1U, MSG_NOSIGNAL));
    (void)close(client);
    daemon_rig_run(1);
    client = daemon_rig_connect();
    TEST_ASSERT_TRUE(is_cause("client_gone"));
}

/// How often the service manager has been told that this gateway is ready.
static unsigned told_ready(int manager) {
    char word[32];
    unsigned count = 0;
    for (ssize_t n = recv(manager, word, sizeof word, MSG_DONTWAIT); n > 0;
         n = recv(manager, word, sizeof word, MSG_DONTWAIT)) {
        count += (strncmp(word, "READY=1", (size_t)n) == 0) ? 1U : 0U;
    }
    return count;
}

/// What the service manager has heard: the longest time between two words that feed its watchdog.
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

TEST(test_watchdog_is_fed_at_half_its_time_with_and_without_motion) {
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
    TEST_ASSERT_EQUAL_UINT(1U, told_ready(manager));
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

TEST(test_setpoints_keep_their_period_with_and_without_frames_of_the_wheels) {
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
    TEST_ASSERT_FALSE(daemon_rig_is_told_zero());
    const iw_time_us_t told_us = daemon_rig.now_us;
    TEST_ASSERT_NOT_NULL(strstr(daemon_rig_ask(client, "{\"cmd\":\"arm\"}"), "shutting down"));
    daemon_rig_run(10000);
    TEST_ASSERT_TRUE(daemon_rig.ended);
    TEST_ASSERT_TRUE(daemon_rig_is_told_zero());
    TEST_ASSERT_TRUE(daemon_rig.now_us - told_us >= MS(1500));
    TEST_ASSERT_FALSE(daemon_rig_marked());
}

TEST(test_signal_to_end_ramps_holds_and_ends_without_a_marker) {
    static const int numbers[] = {SIGTERM, SIGINT, SIGHUP};
    for (size_t i = 0; i < sizeof numbers / sizeof numbers[0]; i++) {
        sigset_t none;
        (void)sigemptyset(&none);
        (void)sigprocmask(SIG_SETMASK, &none, NULL); // As a process begins, before the loop is opened.
        (void)signal(numbers[i], SIG_DFL);
        tearDown();
        setUp();
        end_by(numbers[i]);
    }
}

/// Root's name on the bus is our own; only a gateway of another user looks for it.
TEST(test_gateway_that_gives_way_ramps_holds_says_why_and_ends) {
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
    TEST_ASSERT_TRUE(daemon_rig_is_told_zero());
    TEST_ASSERT_FALSE(daemon_rig_marked());
    char line[96];
    (void)snprintf(line, sizeof line, "a gateway of user 0 (process %ld) serves unix:", (long)getpid());
    TEST_ASSERT_NOT_NULL_MESSAGE(strstr(daemon_rig_log(), line), daemon_rig_log());
}

TEST(test_start_with_healthy_wheels_logs_no_fault) {
    daemon_rig_crash();
    daemon_rig_start();
    TEST_ASSERT_EQUAL_UINT32(0,
                             daemon_rig.daemon->answers.server.told.present); // The first look finds no telemetry yet.
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
    TEST_ASSERT_EQUAL_UINT32(0, daemon_rig.daemon->answers.server.told.present);
    daemon_rig_keep_log();
    daemon_rig_run(900);
    TEST_ASSERT_NULL_MESSAGE(strstr(daemon_rig_log(), "wheel_lost"), daemon_rig_log());
    daemon_rig_run(200);
    TEST_ASSERT_NOT_NULL_MESSAGE(strstr(daemon_rig_log(), "fault: wheel_lost"), daemon_rig_log());
}
