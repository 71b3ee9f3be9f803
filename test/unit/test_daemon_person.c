// SPDX-License-Identifier: MIT
// A lease belongs to one person, and a request that permits motion or clears a latch states its age: in virtual time.
#include "daemon_client.h"

#include "unit.h"

#include <string.h>
#include <unistd.h>

#define KEY_DIGITS 32U

static char line_[256];

static const char *aged(const char *cmd, int64_t age_ms) {
    const long long t_us = (long long)daemon_rig.now_us - age_ms * 1000;
    (void)snprintf(line_, sizeof line_, "{\"cmd\":\"%s\",\"t_us\":%lld%s}", cmd, t_us,
                   (strcmp(cmd, "confirm") == 0) ? ",\"item\":\"track\"" : "");
    return line_;
}

static void latch(void) {
    assert_reply("{\"cmd\":\"estop\"}", "\"ok\":true");
    daemon_rig_run(3000);
}

static unsigned stop_number(void) {
    return gw_wheels_snapshot(&daemon_rig.daemon->wheels).stop->number;
}

/// Copies the key from a reply to arm.
static void read_key(const char *reply, char out_key[KEY_DIGITS + 1U]) {
    const char *at = strstr(reply, "\"key\":\"");
    TEST_ASSERT_NOT_NULL_MESSAGE(at, reply);
    memcpy(out_key, at + strlen("\"key\":\""), KEY_DIGITS);
    out_key[KEY_DIGITS] = '\0';
    TEST_ASSERT_EQUAL_size_t(KEY_DIGITS, strspn(out_key, "0123456789abcdef"));
    TEST_ASSERT_EQUAL_CHAR('"', at[strlen("\"key\":\"") + KEY_DIGITS]);
}

static void arm_with_key(int who, char out_key[KEY_DIGITS + 1U]) {
    const char *reply = daemon_rig_ask(who, "{\"cmd\":\"arm\"}");
    TEST_ASSERT_NOT_NULL_MESSAGE(strstr(reply, "\"ok\":true"), reply);
    read_key(reply, out_key);
}

static const char *drive_with(const char *key, int speed_mm_s) {
    (void)snprintf(line_, sizeof line_, "{\"cmd\":\"drive\",\"left_mm_s\":%d,\"right_mm_s\":%d,\"key\":\"%s\"}",
                   speed_mm_s, speed_mm_s, key);
    return line_;
}

// Age -----------------------------------------------------------------------------------------------------------------

/// Ages in ms beyond the default limit of 1000.
static const int64_t late_ms[] = {1001, 1100, 2000, 10000, 60000};

TEST(test_one_person_arm_too_old_changes_nothing) {
    for (size_t i = 0; i < sizeof late_ms / sizeof late_ms[0]; i++) {
        assert_reply(aged("arm", late_ms[i]), "\"error\":\"stale_command\"");
        TEST_ASSERT_EQUAL_INT(IW_STATE_LISTENING, daemon_rig_state());
        TEST_ASSERT_EQUAL_UINT(0, daemon_rig.sent[IW_LEFT]);
    }
    assert_reply(aged("arm", 900), "\"ok\":true");
    TEST_ASSERT_EQUAL_INT(IW_STATE_ARMED, daemon_rig_state());
}

TEST(test_one_person_reset_too_old_does_not_clear_the_latch) {
    latch();
    for (size_t i = 0; i < sizeof late_ms / sizeof late_ms[0]; i++) {
        assert_reply(aged("reset", late_ms[i]), "\"error\":\"stale_command\"");
        TEST_ASSERT_EQUAL_INT(IW_STATE_LATCHED, daemon_rig_state());
    }
    assert_reply(aged("reset", 900), "\"ok\":true");
    TEST_ASSERT_EQUAL_INT(IW_STATE_LISTENING, daemon_rig_state());
}

TEST(test_one_person_confirm_too_old_is_refused) {
    iw_assumption_store_t *assumptions = &daemon_rig.daemon->wheels.core.assumptions;
    iw_assumption_contradict(assumptions, IW_ASSUMPTION_TRACK, IW_SOURCE_OPERATOR, 0);
    for (size_t i = 0; i < sizeof late_ms / sizeof late_ms[0]; i++) {
        assert_reply(aged("confirm", late_ms[i]), "\"error\":\"stale_command\"");
        assert_reply("{\"cmd\":\"status\"}", "\"track\":{\"state\":\"contradicted\"");
    }
    assert_reply(aged("confirm", 900), "\"ok\":true");
    assert_reply("{\"cmd\":\"status\"}", "\"track\":{\"state\":\"confirmed\"");
}

/// Requests that a network has delayed arrive together.
TEST(test_one_person_burst_of_old_requests_changes_nothing) {
    static const char *const cmds[] = {"reset", "arm", "confirm"};
    static const unsigned counts[] = {2, 10, 100};
    latch();
    const int late = daemon_rig_connect();
    for (size_t i = 0; i < sizeof counts / sizeof counts[0]; i++) {
        for (unsigned n = 0; n < counts[i]; n++) {
            daemon_rig_send(late, aged(cmds[n % 3U], late_ms[n % 5U]));
            daemon_rig_send(late, "\n");
        }
        daemon_rig_run(300);
        TEST_ASSERT_EQUAL_INT(IW_STATE_LATCHED, daemon_rig_state());
    }
    (void)close(late);
}

TEST(test_one_person_request_ahead_of_the_clock_is_refused) {
    assert_reply(aged("arm", -101), "\"error\":\"stale_command\"");
    assert_reply("{\"cmd\":\"arm\",\"t_us\":9223372036854775807}", "\"error\":\"stale_command\"");
    assert_reply("{\"cmd\":\"arm\",\"t_us\":-9223372036854775808}", "\"error\":\"stale_command\"");
    TEST_ASSERT_EQUAL_INT(IW_STATE_LISTENING, daemon_rig_state());
    assert_reply(aged("arm", -90), "\"ok\":true");
}

TEST(test_one_person_limit_of_the_age_is_configured) {
    daemon_rig.daemon->answers.server.max_age_ms = 200;
    assert_reply(aged("arm", 250), "more than 200 ms");
    assert_reply(aged("arm", 150), "\"ok\":true");
}

TEST(test_one_person_arm_from_before_a_stop_is_refused) {
    const int other = daemon_rig_connect();
    daemon_rig_run(2000);
    (void)daemon_rig_ask(other, "{\"cmd\":\"stop\"}"); // Without motion no stop is recorded, but one was requested.
    daemon_rig_run(100);
    (void)close(client);
    client = daemon_rig_connect(); // The new connection has not waited.
    assert_reply(aged("arm", 500), "\"error\":\"stale_command\"");
    assert_reply(aged("arm", 50), "\"ok\":true");
    (void)close(other);
}

// Stop number of a reset ----------------------------------------------------------------------------------------------

static void reset_of(unsigned stop, const char *part) {
    (void)snprintf(line_, sizeof line_, "{\"cmd\":\"reset\",\"stop\":%u}", stop);
    assert_reply(line_, part);
}

TEST(test_one_person_reset_of_another_stop_does_not_clear_latch) {
    latch();
    const unsigned first = stop_number();
    reset_of(first, "\"ok\":true");
    latch();
    TEST_ASSERT_NOT_EQUAL_UINT(first, stop_number());
    reset_of(first, "\"error\":\"stale_command\"");
    reset_of(stop_number() + 1U, "\"error\":\"stale_command\"");
    reset_of(0, "\"error\":\"stale_command\"");
    assert_reply("{\"cmd\":\"reset\",\"stop\":4294967297}", "\"error\":\"stale_command\"");
    assert_reply("{\"cmd\":\"reset\",\"stop\":-1}", "\"error\":\"stale_command\"");
    TEST_ASSERT_EQUAL_INT(IW_STATE_LATCHED, daemon_rig_state());
    reset_of(stop_number(), "\"ok\":true");
    TEST_ASSERT_EQUAL_INT(IW_STATE_LISTENING, daemon_rig_state());
}

/// B's e-stop while already latched: C knows only the stop before it.
TEST(test_one_person_reset_of_the_stop_before_another_estop_is_refused) {
    const int other = daemon_rig_connect();
    latch();
    const unsigned first = stop_number();
    daemon_rig_run(1200);
    (void)daemon_rig_ask(other, "{\"cmd\":\"estop\",\"reason\":\"child on the ramp\"}");
    daemon_rig_run(1200); // The cause is no longer present.
    reset_of(first, "\"error\":\"stale_command\"");
    assert_reply("{\"cmd\":\"why\"}", "(\\\"child on the ramp\\\") while latched: software e-stop by a client; still");
    reset_of(first + 1U, "\"ok\":true");
    (void)close(other);
}

static void press_for(unsigned ms) {
    daemon_rig.estop = 1;
    daemon_rig_run(ms);
    daemon_rig.estop = 0;
    daemon_rig_run(100); // Longer than the debounce time.
}

/// A person presses the button after a fault: the fault remains what the machine reports, with its frames.
TEST(test_one_person_button_after_a_latch_does_not_hide_its_cause) {
    static char before[4096];
    char key[KEY_DIGITS + 1U];
    arm_with_key(client, key);
    assert_reply(drive_with(key, 200), "\"ok\":true");
    daemon_rig_run(100);
    latch();
    (void)daemon_rig_ask(client, "{\"cmd\":\"why\"}");
    const char *frames = strstr(daemon_rig.reply, "\"frames_before\":[{");
    TEST_ASSERT_NOT_NULL(frames);
    (void)snprintf(before, sizeof before, "%.300s", frames);
    const unsigned first = stop_number();
    press_for(200);
    TEST_ASSERT_EQUAL_UINT(first + 1U, stop_number());
    assert_reply("{\"cmd\":\"status\"}", "\"cause\":\"estop_software\"");
    assert_reply("{\"cmd\":\"why\"}", "\"cause\":\"estop_line\"");
    TEST_ASSERT_NOT_NULL(strstr(daemon_rig.reply, before));
}

/// The button is pressed again within the time of an event, so the number is the same: the time decides.
TEST(test_one_person_reset_from_before_the_button_was_pressed_is_late) {
    press_for(200);
    const iw_time_us_t asked_us = daemon_rig.now_us;
    press_for(500);
    daemon_rig_run(200);
    (void)snprintf(line_, sizeof line_, "{\"cmd\":\"reset\",\"stop\":%u,\"t_us\":%llu}", stop_number(),
                   (unsigned long long)asked_us);
    assert_reply(line_, "\"error\":\"stale_command\"");
    TEST_ASSERT_EQUAL_INT(IW_STATE_LATCHED, daemon_rig_state());
    assert_reply(aged("reset", 100), "\"ok\":true");
}

/// The button is the reason that a person can see, so a request of after the press is not late.
TEST(test_one_person_request_while_the_button_is_pressed_names_it) {
    daemon_rig.estop = 1;
    daemon_rig_run(500);
    assert_reply(aged("arm", 100), "\"error\":\"estop_pressed\"");
    assert_reply(aged("reset", 100), "\"error\":\"estop_pressed\"");
    assert_reply(aged("reset", 600), "\"error\":\"stale_command\"");
}

/// Within the time of an event it is the same stop. An older reset is late by its time.
TEST(test_one_person_reset_from_before_a_second_estop_is_late) {
    const int other = daemon_rig_connect();
    latch();
    const iw_time_us_t pressed_us = daemon_rig.now_us;
    (void)daemon_rig_ask(other, "{\"cmd\":\"estop\"}");
    daemon_rig.daemon->answers.server.max_age_ms = 2000;
    daemon_rig_run(1200); // The cause is no longer present.
    (void)snprintf(line_, sizeof line_, "{\"cmd\":\"reset\",\"stop\":%u,\"t_us\":%llu}", stop_number(),
                   (unsigned long long)pressed_us - 1000U);
    assert_reply(line_, "\"error\":\"stale_command\"");
    TEST_ASSERT_EQUAL_INT(IW_STATE_LATCHED, daemon_rig_state());
    (void)close(other);
}

// The key -------------------------------------------------------------------------------------------------------------

TEST(test_one_person_key_is_new_for_every_grant) {
    char key[4][KEY_DIGITS + 1U];
    for (unsigned i = 0; i < 4U; i++) {
        arm_with_key(client, key[i]); // The second of each pair is a repeated arm of the holder.
        for (unsigned before = 0; before < i; before++) {
            TEST_ASSERT_NOT_EQUAL_INT(0, strcmp(key[before], key[i]));
        }
        if (i == 1U) {
            assert_reply("{\"cmd\":\"stop\"}", "\"ok\":true");
            daemon_rig_run(3000);
        }
    }
    assert_reply(drive_with(key[2], 100), "\"error\":\"not_holder\"");
    assert_reply(drive_with(key[3], 100), "\"ok\":true");
}

TEST(test_one_person_refused_arm_does_not_change_the_key) {
    char key[KEY_DIGITS + 1U];
    arm_with_key(client, key);
    assert_reply(aged("arm", 5000), "\"error\":\"stale_command\"");
    assert_reply(drive_with(key, 100), "\"ok\":true");
    TEST_ASSERT_NULL(strstr(daemon_rig.reply, "key"));
}

TEST(test_one_person_drive_with_another_key_feeds_nothing) {
    char key[KEY_DIGITS + 1U];
    arm_with_key(client, key);
    char other[KEY_DIGITS + 1U];
    memcpy(other, key, sizeof other);
    other[KEY_DIGITS - 1U] = (key[KEY_DIGITS - 1U] == '0') ? '1' : '0';
    const iw_time_us_t armed_us = daemon_rig.now_us;
    while (daemon_rig_state() == IW_STATE_ARMED && daemon_rig.now_us - armed_us < MS(3000)) {
        assert_reply(drive_with(other, 300), "\"error\":\"not_holder\"");
        assert_reply(drive_with("0", 300), "\"error\":\"not_holder\"");
        assert_reply(drive_with(other, 0), "\"error\":\"not_holder\"");
        TEST_ASSERT_TRUE(daemon_rig_commands_zero());
        daemon_rig_run(20);
    }
    TEST_ASSERT_LESS_OR_EQUAL_UINT64(MS(1100), daemon_rig.now_us - armed_us); // The first lease, not longer
    TEST_ASSERT_EQUAL_INT(0, daemon_rig.most_mm_s);
}

TEST(test_one_person_twist_with_another_key_feeds_nothing) {
    char key[KEY_DIGITS + 1U];
    arm_with_key(client, key);
    assert_reply("{\"cmd\":\"twist\",\"v_mm_s\":100,\"yaw_mrad_s\":0,\"key\":\"0123456789abcdef0123456789abcdef\"}",
                 "\"error\":\"not_holder\"");
    (void)snprintf(line_, sizeof line_, "{\"cmd\":\"twist\",\"v_mm_s\":100,\"yaw_mrad_s\":0,\"key\":\"%s\"}", key);
    assert_reply(line_, "\"ok\":true");
}

/// Row 7 applies to every command, accepted or refused.
TEST(test_one_person_drive_with_another_key_is_a_deflected_stick) {
    char key[KEY_DIGITS + 1U];
    const int other = daemon_rig_connect();
    arm_with_key(client, key);
    assert_reply(drive_with("wrong", 300), "\"error\":\"not_holder\"");
    assert_reply("{\"cmd\":\"stop\"}", "\"ok\":true");
    assert_reply_to(other, "{\"cmd\":\"arm\"}", "\"error\":\"stale_command\"");
    daemon_rig_run(3000);
    arm_with_key(client, key);
    assert_reply(drive_with("wrong", 0), "\"error\":\"not_holder\"");
    assert_reply("{\"cmd\":\"stop\"}", "\"ok\":true");
    TEST_ASSERT_NULL(strstr(daemon_rig_ask(other, "{\"cmd\":\"arm\"}"), "\"error\":\"stale_command\""));
    (void)close(other);
}

/// One wheel is sufficient; with the role of a setpoint also a current.
TEST(test_one_person_other_key_is_a_stick_by_any_value) {
    static const char *const fields[] = {"\"left_mm_s\":300,\"right_mm_s\":0", "\"left_mm_s\":0,\"right_mm_s\":-300",
                                         "\"left_mm_s\":0,\"right_mm_s\":0,\"left_mA\":500,\"right_mA\":0",
                                         "\"left_mm_s\":0,\"right_mm_s\":0,\"left_mA\":0,\"right_mA\":500"};
    char key[KEY_DIGITS + 1U];
    const int other = daemon_rig_connect();
    for (size_t i = 0; i < sizeof fields / sizeof fields[0]; i++) {
        arm_with_key(client, key);
        daemon_rig.daemon->wheels.core.config.current_role = (i < 2U) ? IW_ROLE_LIMIT : IW_ROLE_SETPOINT;
        (void)snprintf(line_, sizeof line_, "{\"cmd\":\"drive\",%s,\"key\":\"wrong\"}", fields[i]);
        assert_reply(line_, "\"error\":\"not_holder\"");
        assert_reply("{\"cmd\":\"stop\"}", "\"ok\":true");
        assert_reply_to(other, "{\"cmd\":\"arm\"}", "\"error\":\"stale_command\"");
        daemon_rig_run(3000);
    }
    (void)close(other);
}

TEST(test_one_person_without_lease_is_not_armed_with_any_key) {
    assert_reply(drive_with("wrong", 300), "\"error\":\"not_armed\"");
}

TEST(test_one_person_turn_by_wrong_track_is_a_stick) {
    const int other = daemon_rig_connect();
    daemon_rig_arm(client);
    iw_assumption_contradict(&daemon_rig.daemon->wheels.core.assumptions, IW_ASSUMPTION_TRACK, IW_SOURCE_OPERATOR, 0);
    assert_reply("{\"cmd\":\"twist\",\"v_mm_s\":0,\"yaw_mrad_s\":200}", "\"error\":\"denied\"");
    assert_reply("{\"cmd\":\"stop\"}", "\"ok\":true");
    assert_reply_to(other, "{\"cmd\":\"arm\"}", "\"error\":\"stale_command\"");
    (void)close(other);
}

TEST(test_one_person_key_is_in_no_other_line) {
    static const char *const asked[] = {"{\"cmd\":\"hello\"}", "{\"cmd\":\"status\"}", "{\"cmd\":\"why\"}",
                                        "{\"cmd\":\"stop\"}"};
    char key[KEY_DIGITS + 1U];
    const int other = daemon_rig_connect();
    daemon_rig_keep_log();
    daemon_rig.daemon->log.level = SOCK_LOG_DEBUG;
    (void)daemon_rig_ask(other,
                         "{\"cmd\":\"watch\",\"topics\":[\"state\",\"lease\",\"stop\",\"frame\"],\"rate_hz\":100}");
    arm_with_key(client, key);
    assert_reply(drive_with(key, 100), "\"ok\":true");
    assert_reply(drive_with("0123456789abcdef0123456789abcdef", 100), "\"error\":\"not_holder\"");
    TEST_ASSERT_NULL(strstr(daemon_rig.reply, key));
    for (size_t i = 0; i < sizeof asked / sizeof asked[0]; i++) {
        assert_reply(asked[i], "\"ok\":true");
        TEST_ASSERT_NULL(strstr(daemon_rig.reply, key));
        daemon_rig_run(20);
    }
    const char *text = daemon_rig_receive(other);
    TEST_ASSERT_GREATER_THAN_size_t(1000, strlen(text));
    TEST_ASSERT_NULL(strstr(text, key));
    TEST_ASSERT_NULL(strstr(daemon_rig_log(), key));
    (void)close(other);
}

// Two people at the gateway -------------------------------------------------------------------------------------------

TEST(test_one_person_arm_without_takeover_is_busy) {
    char key[KEY_DIGITS + 1U];
    const int other = daemon_rig_connect();
    assert_reply("{\"cmd\":\"arm\",\"name\":\"Ann\"}", "\"ok\":true");
    for (unsigned i = 0; i < 3U; i++) {
        const char *reply = daemon_rig_ask(other, "{\"cmd\":\"arm\",\"name\":\"Ann\"}"); // A name grants no right.
        TEST_ASSERT_NOT_NULL_MESSAGE(strstr(reply, "\"error\":\"busy\""), reply);
        TEST_ASSERT_NOT_NULL_MESSAGE(strstr(reply, "Ann"), reply);
        TEST_ASSERT_NULL(strstr(reply, "key"));
        reply = daemon_rig_ask(other, "{\"cmd\":\"drive\",\"left_mm_s\":300,\"right_mm_s\":-300}");
        TEST_ASSERT_NOT_NULL_MESSAGE(strstr(reply, "\"error\":\"not_holder\""), reply);
    }
    arm_with_key(client, key); // The holder may arm again.
    const iw_time_us_t until_us = gw_wheels_snapshot(&daemon_rig.daemon->wheels).lease_until_us;
    arm_with_key(client, key);
    TEST_ASSERT_EQUAL_UINT64(until_us,
                             gw_wheels_snapshot(&daemon_rig.daemon->wheels).lease_until_us); // The lease is the same.
    assert_reply(drive_with(key, 300), "\"ok\":true");
    (void)close(other);
}

TEST(test_one_person_key_of_another_connection_is_no_right) {
    char key[KEY_DIGITS + 1U];
    const int other = daemon_rig_connect();
    arm_with_key(client, key);
    assert_reply_to(other, drive_with(key, 300), "\"error\":\"not_holder\"");
    (void)close(other);
}
