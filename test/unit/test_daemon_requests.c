// SPDX-License-Identifier: MIT
// Requests as the daemon executes them, from the line to the wheels, in virtual time.
#include "daemon_client.h"

#include "unit.h"

#include <string.h>
#include <sys/socket.h>
#include <unistd.h>

/// Returns the object `side` of the snapshot.
static const char *wheel(const char *side) {
    char name[16];
    (void)snprintf(name, sizeof name, "\"%s\":{", side);
    const char *at = strstr(daemon_rig_ask(client, "{\"cmd\":\"status\"}"), name);
    TEST_ASSERT_NOT_NULL(at);
    return at;
}

static bool contains(const char *object, const char *words) {
    const char *found = strstr(object, words);
    const char *next = strstr(object + 1, "\"right\":{");
    return found != NULL && (next == NULL || found < next);
}

TEST(test_drive_speed_reaches_the_correct_wheel) {
    daemon_rig_arm(client);
    daemon_rig_drive(client, 300, 100, 1000);
    TEST_ASSERT_EQUAL_INT(300, daemon_rig.commanded_mm_s[IW_LEFT]);
    TEST_ASSERT_EQUAL_INT(100, daemon_rig.commanded_mm_s[IW_RIGHT]);
    TEST_ASSERT_TRUE(contains(wheel("left"), "\"applied_mm_s\":300,"));
    TEST_ASSERT_TRUE(contains(wheel("right"), "\"applied_mm_s\":100,"));
}

TEST(test_drive_current_reaches_the_correct_wheel) {
    daemon_rig.daemon->wheels.core.config.asymmetric_current = true;
    daemon_rig_arm(client);
    for (unsigned i = 0; i < 50U; i++) {
        assert_reply("{\"cmd\":\"drive\",\"left_mm_s\":100,\"right_mm_s\":100,\"left_mA\":500,\"right_mA\":900}",
                     "\"ok\":true");
        daemon_rig_run(20);
    }
    TEST_ASSERT_EQUAL_INT(500, daemon_rig.commanded_mA[IW_LEFT]);
    TEST_ASSERT_EQUAL_INT(900, daemon_rig.commanded_mA[IW_RIGHT]);
}

TEST(test_twist_to_the_left_turns_the_right_wheel_faster) {
    daemon_rig_arm(client);
    for (unsigned i = 0; i < 50U; i++) {
        assert_reply("{\"cmd\":\"twist\",\"v_mm_s\":250,\"yaw_mrad_s\":200}", "\"ok\":true");
        daemon_rig_run(20);
    }
    TEST_ASSERT_EQUAL_INT(250 - 200 * daemon_rig.daemon->config.core.track_mm / 2000,
                          daemon_rig.commanded_mm_s[IW_LEFT]);
    TEST_ASSERT_EQUAL_INT(250 + 200 * daemon_rig.daemon->config.core.track_mm / 2000,
                          daemon_rig.commanded_mm_s[IW_RIGHT]);
}

TEST(test_drive_number_out_of_range_is_refused_and_never_wraps) {
    static const char *const lines[] = {
        "{\"cmd\":\"drive\",\"left_mm_s\":4294967496,\"right_mm_s\":200}",
        "{\"cmd\":\"drive\",\"left_mm_s\":200,\"right_mm_s\":-4294967096}",
        "{\"cmd\":\"drive\",\"left_mm_s\":65736,\"right_mm_s\":200}",
        "{\"cmd\":\"drive\",\"left_mm_s\":200,\"right_mm_s\":65736}",
        "{\"cmd\":\"drive\",\"left_mm_s\":200,\"right_mm_s\":200,\"left_mA\":4294967796,\"right_mA\":500}",
        "{\"cmd\":\"drive\",\"left_mm_s\":200,\"right_mm_s\":200,\"left_mA\":500,\"right_mA\":66036}",
        "{\"cmd\":\"twist\",\"v_mm_s\":4294967496,\"yaw_mrad_s\":0}",
        "{\"cmd\":\"twist\",\"v_mm_s\":200,\"yaw_mrad_s\":4294967296}",
        "{\"cmd\":\"twist\",\"v_mm_s\":9223372036854775807,\"yaw_mrad_s\":-9223372036854775807}",
    };
    daemon_rig_arm(client);
    for (size_t i = 0; i < sizeof lines / sizeof lines[0]; i++) {
        assert_reply(lines[i], "\"error\":\"out_of_range\"");
        daemon_rig_run(40);
        TEST_ASSERT_EQUAL_INT(0, daemon_rig.commanded_mm_s[IW_LEFT]);
        TEST_ASSERT_EQUAL_INT(0, daemon_rig.commanded_mm_s[IW_RIGHT]);
    }
}

TEST(test_battery_is_saturated_only_at_255) {
    daemon_rig.world.pair.battery_dV = 255;
    daemon_rig_run(100);
    TEST_ASSERT_TRUE(contains(wheel("left"), "\"saturated\":{\"battery\":true"));
    TEST_ASSERT_TRUE(contains(wheel("right"), "\"saturated\":{\"battery\":true"));
    daemon_rig.world.pair.battery_dV = 254;
    daemon_rig_run(100);
    TEST_ASSERT_TRUE(contains(wheel("left"), "\"saturated\":{\"battery\":false"));
    daemon_rig.world.pair.battery_dV = 255;
    daemon_rig_run(100);
    sim_world_power(&daemon_rig.world, daemon_rig.now_us, false); // A value of an offline wheel is unknown.
    daemon_rig_run(2000);
    TEST_ASSERT_TRUE(contains(wheel("left"), "\"saturated\":{\"battery\":false"));
    TEST_ASSERT_TRUE(contains(wheel("left"), "\"battery_dV\":null"));
}

TEST(test_tare_of_one_wheel_does_not_change_the_other) {
    daemon_rig_run(3000);
    const iw_time_us_t asked_us = daemon_rig.now_us;
    assert_reply("{\"cmd\":\"tare\",\"side\":\"left\"}", "\"left\":{");
    TEST_ASSERT_EQUAL_INT(IW_OFFSET_OPERATOR, daemon_rig.daemon->wheels.core.force[IW_LEFT].provenance);
    TEST_ASSERT_TRUE(daemon_rig.daemon->wheels.core.force[IW_LEFT].offset_us >= asked_us);
    TEST_ASSERT_TRUE(daemon_rig.daemon->wheels.core.force[IW_RIGHT].provenance != IW_OFFSET_OPERATOR);
}

TEST(test_tare_of_both_refused_for_one_changes_neither) {
    daemon_rig_run(3000);
    daemon_rig_arm(client);
    daemon_rig_drive(client, 0, 100, 500);
    assert_reply("{\"cmd\":\"stop\"}", "\"ok\":true");
    daemon_rig_run(1000);
    assert_reply("{\"cmd\":\"tare\"}", "the right wheel");
    TEST_ASSERT_TRUE(daemon_rig.daemon->wheels.core.force[IW_LEFT].provenance != IW_OFFSET_OPERATOR);
}

TEST(test_client_that_ends_during_arm_leaves_no_lease) {
    daemon_rig_send(client, "{\"cmd\":\"arm\"}\n");
    (void)close(client);
    daemon_rig_run(50);
    TEST_ASSERT_EQUAL_INT(IW_STATE_LISTENING, daemon_rig_state());
    client = daemon_rig_connect();
    daemon_rig_arm(client);
}

TEST(test_command_sent_together_with_arm_is_stale) {
    daemon_rig_send(client, "{\"cmd\":\"arm\"}\n{\"id\":9,\"cmd\":\"drive\",\"left_mm_s\":300,\"right_mm_s\":300}\n");
    for (unsigned ms = 0; ms < 500U; ms++) {
        daemon_rig_run(1);
        TEST_ASSERT_EQUAL_INT(0, daemon_rig.commanded_mm_s[IW_LEFT]);
        TEST_ASSERT_EQUAL_INT(0, daemon_rig.commanded_mm_s[IW_RIGHT]);
    }
}

/// The arm is granted, but another client stops before the wheels answer.
TEST(test_arm_followed_by_estop_of_another_client_is_refused) {
    const int other = daemon_rig_connect();
    daemon_rig_send(client, "{\"id\":7,\"cmd\":\"arm\"}\n");
    daemon_rig_send(other, "{\"cmd\":\"estop\"}\n");
    daemon_rig_run(100);
    const char *text = daemon_rig_receive(client);
    TEST_ASSERT_NOT_NULL_MESSAGE(strstr(text, "{\"id\":7,\"ok\":false,"), text);
    TEST_ASSERT_EQUAL_INT(IW_STATE_LATCHED, daemon_rig_state());
    (void)close(other);
}

/// Requests that a client sends after an arm wait for the reply to it.
TEST(test_reset_and_arm_that_waited_do_not_undo_a_stop) {
    static const char *const stops[] = {"{\"cmd\":\"stop\"}\n", "{\"cmd\":\"estop\"}\n"};
    static const iw_state_t after[] = {IW_STATE_LISTENING, IW_STATE_LATCHED};
    const int other = daemon_rig_connect();
    daemon_rig_run(20);
    for (size_t i = 0; i < sizeof stops / sizeof stops[0]; i++) {
        daemon_rig_send(client, "{\"cmd\":\"arm\"}\n{\"cmd\":\"reset\"}\n{\"id\":9,\"cmd\":\"arm\"}\n");
        daemon_rig_send(other, stops[i]);
        daemon_rig_run(100);
        TEST_ASSERT_EQUAL_INT(after[i], daemon_rig_state());
        daemon_rig_run(2000); // Zeros are held for this time.
    }
    assert_reply("{\"cmd\":\"reset\"}", "\"ok\":true"); // A reset that is sent now counts.
    daemon_rig_arm(client);
    (void)close(other);
}

TEST(test_stop_and_arm_of_one_client_are_both_executed) {
    daemon_rig_run(20);
    daemon_rig_send(client, "{\"cmd\":\"stop\"}\n{\"cmd\":\"arm\"}\n");
    daemon_rig_run(50);
    TEST_ASSERT_EQUAL_INT(IW_STATE_ARMED, daemon_rig_state());
}

TEST(test_command_that_waited_during_a_stall_renews_from_its_time) {
    static const char line[] = "{\"cmd\":\"drive\",\"left_mm_s\":300,\"right_mm_s\":300}\n";
    daemon_rig_arm(client);
    daemon_rig_drive(client, 300, 300, 500);
    daemon_rig_send(client, line);
    daemon_rig.stolen_us = 90000U; // Late, but not late enough for a stop
    const iw_time_us_t sent_us = daemon_rig.now_us;
    daemon_rig_run(1);
    while (daemon_rig_state() == IW_STATE_ARMED && daemon_rig.now_us - sent_us < MS(1000)) {
        daemon_rig_run(1);
    }
    TEST_ASSERT_TRUE(daemon_rig.now_us - sent_us <= MS(202));
}

TEST(test_takeover_is_refused_in_motion_granted_at_standstill) {
    const int other = daemon_rig_connect();
    daemon_rig_arm(client);
    daemon_rig_drive(client, 200, 200, 500);
    assert_reply_to(other, "{\"cmd\":\"arm\"}", "\"error\":\"busy\"");
    assert_reply_to(other, "{\"cmd\":\"arm\",\"takeover\":true}", "\"ok\":false");
    daemon_rig_drive(client, 0, 0, 2000);
    assert_reply_to(other, "{\"cmd\":\"arm\"}", "\"error\":\"busy\"");
    assert_reply_to(other, "{\"cmd\":\"arm\",\"takeover\":true}", "\"ok\":true");
    assert_reply("{\"cmd\":\"drive\",\"left_mm_s\":0,\"right_mm_s\":0}", "\"error\":\"not_holder\"");
    (void)close(other);
}

TEST(test_arm_while_shutting_down_is_refused) {
    daemon_rig.daemon->wheels.shutting_down = true;
    daemon_rig.daemon->wheels.core.permit.phase = IW_PHASE_HOLDING; // The loop must continue.
    daemon_rig.daemon->wheels.core.permit.hold_us = daemon_rig.now_us;
    assert_reply("{\"cmd\":\"arm\"}", "shutting down");
}

TEST(test_arm_with_contradicted_setpoint_type_is_denied) {
    iw_assumption_contradict(&daemon_rig.daemon->wheels.core.assumptions, IW_ASSUMPTION_SETPOINT_TYPE,
                             IW_SOURCE_OPERATOR, 0);
    assert_reply("{\"cmd\":\"arm\"}", "\"error\":\"denied\"");
    TEST_ASSERT_EQUAL_INT(IW_STATE_LISTENING, daemon_rig_state());
}

static unsigned events_waiting(const char *name) {
    return daemon_rig_count(daemon_rig_receive(client), name);
}

TEST(test_telemetry_has_its_rate_without_burst_after_a_stall) {
    assert_reply("{\"cmd\":\"watch\",\"topics\":[\"force\"],\"rate_hz\":50}", "\"ok\":true");
    (void)events_waiting("force");
    daemon_rig_run(1000);
    TEST_ASSERT_UINT_WITHIN(2, 50, events_waiting("\"event\":\"force\""));
    daemon_rig.stolen_us = 3000000U;
    daemon_rig_run(100);
    TEST_ASSERT_UINT_WITHIN(2, 5, events_waiting("\"event\":\"force\""));
}

TEST(test_telemetry_is_sent_in_the_cycle_in_which_it_is_due) {
    assert_reply("{\"cmd\":\"watch\",\"topics\":[\"state\"],\"rate_hz\":5}", "\"ok\":true");
    sim_world_power(&daemon_rig.world, daemon_rig.now_us, false); // Otherwise each frame wakes the loop.
    daemon_rig_run(1000);
    for (unsigned event = 0; event < 5U; event++) {
        const iw_time_us_t due_us = daemon_rig.daemon->answers.served[0].client.next_us;
        (void)daemon_rig_receive(client); // Bytes of before
        while (daemon_rig.now_us <= due_us) {
            daemon_rig_run(1);
        }
        TEST_ASSERT_TRUE(daemon_rig_receive(client)[0] != '\0');
    }
}

TEST(test_burst_of_requests_is_answered_in_one_cycle) {
    for (unsigned i = 0; i < 3U * SOCK_LINES_PER_CYCLE; i++) {
        daemon_rig_send(client, "{\"cmd\":\"why\"}\n");
    }
    daemon_rig_run(1);
    TEST_ASSERT_EQUAL_UINT(3U * SOCK_LINES_PER_CYCLE, daemon_rig_count(daemon_rig_receive(client), "\"ok\":true"));
}

TEST(test_stop_and_estop_need_no_lease) {
    const int other = daemon_rig_connect();
    daemon_rig_arm(client);
    daemon_rig_drive(client, 200, 200, 300);
    assert_reply_to(other, "{\"cmd\":\"stop\"}", "\"state\":\"stopping\"");
    TEST_ASSERT_EQUAL_INT(IW_STATE_STOPPING, daemon_rig_state());
    assert_reply_to(other, "{\"cmd\":\"estop\"}", "\"state\":\"latched\"");
    TEST_ASSERT_EQUAL_INT(0, daemon_rig.commanded_mm_s[IW_LEFT]);
    (void)close(other);
}

TEST(test_lease_runs_from_the_command_not_from_the_last_poll) {
    const iw_time_us_t lease_us = MS(daemon_rig.daemon->config.core.lease_ms);
    daemon_rig_arm(client);
    for (unsigned ms = 1; ms < 20U; ms += 6U) { // At several times between two setpoints
        daemon_rig_drive(client, 100, 100, 200);
        daemon_rig_run(ms);
        daemon_rig_send(client, "{\"cmd\":\"drive\",\"left_mm_s\":100,\"right_mm_s\":100}\n");
        daemon_rig_run((unsigned)((lease_us - 500U) / IW_US_PER_MS));
        TEST_ASSERT_EQUAL_INT(IW_STATE_ARMED, daemon_rig_state());
    }
}

TEST(test_arm_is_answered_within_3_ms) {
    const iw_time_us_t asked_us = daemon_rig.now_us;
    daemon_rig_arm(client);
    TEST_ASSERT_LESS_OR_EQUAL_UINT64(MS(3), daemon_rig.now_us - asked_us);
}

TEST(test_reader_that_ended_leaves_no_client_waiting) {
    const int others[] = {daemon_rig_connect(), daemon_rig_connect(), daemon_rig_connect()};
    sock_clients_t *clients = &daemon_rig.daemon->clients;
    int pair[2];
    TEST_ASSERT_EQUAL_INT(0, socketpair(AF_UNIX, SOCK_SEQPACKET | SOCK_NONBLOCK, 0, pair));
    daemon_rig.daemon->box.reader.fd = pair[0];
    for (unsigned i = 0; i < 4U; i++) {
        clients->client[i].owed = true;
    }
    (void)close(pair[1]);
    TEST_ASSERT_FALSE(gw_recordings_take(&daemon_rig.daemon->answers));
    for (unsigned i = 0; i < 4U; i++) {
        TEST_ASSERT_FALSE(clients->client[i].owed);
    }
    for (size_t i = 0; i < sizeof others / sizeof others[0]; i++) {
        (void)close(others[i]);
    }
}

TEST(test_confirm_of_unset_item_is_refused_short_how_is_stored) {
    daemon_rig.daemon->wheels.core.config.setpoint_type_set = false;
    daemon_rig.daemon->config.core.setpoint_type_set = false;
    assert_reply("{\"cmd\":\"confirm\",\"item\":\"setpoint_type\"}", "\"error\":\"type_not_set\"");
    const uint32_t track_mm = daemon_rig.daemon->assumptions.configured.track_mm;
    daemon_rig.daemon->assumptions.configured.track_mm = 0;
    assert_reply("{\"cmd\":\"confirm\",\"item\":\"track\",\"value\":\"540\"}", "\"error\":\"track_not_set\"");
    daemon_rig.daemon->assumptions.configured.track_mm = track_mm;
    assert_reply("{\"cmd\":\"confirm\",\"item\":\"track\",\"how\":\"x\"}", "\"ok\":true");
    assert_reply("{\"cmd\":\"status\"}", "\"how\":\"x\"");
    assert_reply("{\"cmd\":\"confirm\",\"item\":\"gear_ratio\",\"value\":\"7\"}", "\"ok\":true");
    assert_reply("{\"cmd\":\"status\"}", "\"found\":\"7\"");
    assert_reply("{\"cmd\":\"confirm\",\"item\":\"gear_ratio\"}",
                 "\"ok\":true"); // Without a description it replaces the value found before.
    const char *status = daemon_rig_ask(client, "{\"cmd\":\"status\"}");
    TEST_ASSERT_NULL_MESSAGE(strstr(status, "\"found\":\"7\""), status);
}

TEST(test_offset_change_is_sent_to_watchers_of_force) {
    daemon_rig_run(3000);
    assert_reply("{\"cmd\":\"watch\",\"topics\":[\"force\"],\"rate_hz\":1}", "\"ok\":true");
    (void)events_waiting("force");
    daemon_rig_send(client, "{\"cmd\":\"tare\",\"side\":\"right\"}\n");
    daemon_rig_run(60);
    const char *text = daemon_rig_receive(client);
    const char *offset_event = strstr(text, "\"event\":\"offset\"");
    TEST_ASSERT_NOT_NULL_MESSAGE(offset_event, text);
    TEST_ASSERT_NOT_NULL_MESSAGE(strstr(offset_event, "\"side\":\"right\",\"offset_mN\":"), offset_event);
    TEST_ASSERT_NOT_NULL_MESSAGE(strstr(offset_event, "\"provenance\":\"operator\",\"before_mN\":"), offset_event);
}

TEST(test_stop_names_the_client_that_asked_for_it) {
    assert_reply("{\"cmd\":\"arm\",\"name\":\"joystick\"}", "\"ok\":true");
    daemon_rig_drive(client, 100, 100, 200);
    assert_reply("{\"cmd\":\"stop\"}", "\"ok\":true");
    assert_reply("{\"cmd\":\"why\"}", "joystick");
}

TEST(test_still_moving_is_reported_once_as_a_complete_event) {
    gw_daemon_t *daemon = daemon_rig.daemon;
    assert_reply("{\"cmd\":\"watch\",\"topics\":[\"stop\"]}", "\"ok\":true");
    iw_snapshot_t seen = gw_wheels_snapshot(&daemon->wheels);
    seen.still_moving++;
    gw_answers_observe(&daemon->answers, &seen);
    gw_answers_observe(&daemon->answers, &seen);
    sock_service_flush(&daemon->clients, IW_CLIENT_NONE);
    const char *text = daemon_rig_receive(client);
    const char *offset_event = strstr(text, "\"cause\":\"still_moving\",\"present\":true}");
    TEST_ASSERT_NOT_NULL_MESSAGE(offset_event, text);
    TEST_ASSERT_NULL(strstr(offset_event + strlen("\"cause\":\"still_moving"), "still_moving"));
}

/// Passes the daemon a snapshot with rolling wheels or not, and counts the matching events at a watcher.
static unsigned count_reported(bool rolling, bool is_fault, const char *words) {
    gw_daemon_t *daemon = daemon_rig.daemon;
    iw_snapshot_t seen = gw_wheels_snapshot(&daemon->wheels);
    seen.rolling = rolling;
    seen.rolling_fault = is_fault;
    gw_answers_observe(&daemon->answers, &seen);
    gw_answers_observe(&daemon->answers, &seen);
    sock_service_flush(&daemon->clients, IW_CLIENT_NONE);
    return daemon_rig_count(daemon_rig_receive(client), words);
}

TEST(test_end_of_zeros_is_reported_in_advance) {
    gw_daemon_t *daemon = daemon_rig.daemon;
    iw_snapshot_t seen = gw_wheels_snapshot(&daemon->wheels);
    assert_reply("{\"cmd\":\"watch\",\"topics\":[\"stop\"]}", "\"ok\":true");
    seen.zeros_ending = true;
    gw_answers_observe(&daemon->answers, &seen);
    TEST_ASSERT_TRUE(daemon->answers.server.reported.zeros_ending);
    TEST_ASSERT_EQUAL_UINT(1, count_reported(false, false, "\"cause\":\"zeros_ending\",\"present\":true}"));
}

TEST(test_rolling_is_reported_at_its_begin_and_end) {
    assert_reply("{\"cmd\":\"watch\",\"topics\":[\"stop\"]}", "\"ok\":true");
    TEST_ASSERT_EQUAL_UINT(1, count_reported(true, false, "\"present\":true}"));
    TEST_ASSERT_EQUAL_UINT(0, count_reported(true, false, "rolling"));
    TEST_ASSERT_EQUAL_UINT(1, count_reported(false, false, "\"event\":\"rolling\","));
    TEST_ASSERT_EQUAL_UINT(1, count_reported(true, false, "\"event\":\"rolling\","));
    TEST_ASSERT_EQUAL_UINT(1, count_reported(false, false, "\"present\":false}"));
}

TEST(test_rolling_after_a_stop_is_reported_once_a_minute) {
    static const char *const fault = "\"cause\":\"rolling\"";
    assert_reply("{\"cmd\":\"watch\",\"topics\":[\"stop\"]}", "\"ok\":true");
    TEST_ASSERT_EQUAL_UINT(1, count_reported(true, true, fault));
    TEST_ASSERT_EQUAL_UINT(1, count_reported(false, false, "\"cause\":\"rolling\",\"present\":false}"));
    daemon_rig_run(1000);
    TEST_ASSERT_EQUAL_UINT(0, count_reported(true, true, fault));
    TEST_ASSERT_EQUAL_UINT(0, count_reported(false, false, fault));
    daemon_rig_run(58990);
    TEST_ASSERT_EQUAL_UINT(0, count_reported(true, true, fault));
    TEST_ASSERT_EQUAL_UINT(0, count_reported(false, false, fault));
    daemon_rig_run(20);
    TEST_ASSERT_EQUAL_UINT(1, count_reported(true, true, "\"cause\":\"rolling\",\"present\":true}"));
    TEST_ASSERT_EQUAL_UINT(1, count_reported(false, false, fault));
}

/// Returns the number of recordings that were ordered since the last call, and the last of them.
static unsigned take_orders(int writer, gw_box_order_t *out_last) {
    unsigned orders = 0;
    while (recv(writer, out_last, sizeof *out_last, MSG_DONTWAIT) == (ssize_t)sizeof *out_last) {
        orders++;
    }
    return orders;
}

TEST(test_rolling_fault_is_recorded_with_each_report) {
    static gw_box_order_t order;
    gw_box_t *box = &daemon_rig.daemon->box;
    int ends[2];
    TEST_ASSERT_EQUAL_INT(0, socketpair(AF_UNIX, SOCK_SEQPACKET | SOCK_CLOEXEC, 0, ends));
    box->config.blackbox_s = 1;
    box->writer.fd = ends[0];
    (void)count_reported(true, false, "rolling");
    TEST_ASSERT_EQUAL_UINT(0, take_orders(ends[1], &order)); // A person pushes the machine.
    (void)count_reported(true, true, "rolling");
    TEST_ASSERT_EQUAL_UINT(1, take_orders(ends[1], &order));
    TEST_ASSERT_EQUAL_STRING("rolling", order.cause);
    TEST_ASSERT_EQUAL_STRING("listening", order.from);
    TEST_ASSERT_EQUAL_UINT32(0, order.note.stop.number);
    TEST_ASSERT_NOT_NULL(strstr(order.note.sentence, "parking brake"));
    (void)count_reported(false, false, "rolling");
    daemon_rig_run(1000);
    (void)count_reported(true, true, "rolling");
    TEST_ASSERT_EQUAL_UINT(0, take_orders(ends[1], &order)); // Second fault within a minute
    (void)close(ends[1]);
    (void)count_reported(false, false, "rolling");
    daemon_rig_run(60000);
    (void)count_reported(true, true, "rolling"); // Without a writer the loop continues.
    box->config.blackbox_s = 0;
    box->writer.fd = -1;
    (void)close(ends[0]);
}
