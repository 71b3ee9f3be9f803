// SPDX-License-Identifier: MIT
// Events of the host code of the image: events, stops, zeros, stored values, and the commands of the relay.
#include "host_rig.inc"

static unsigned count_of(const char *words) {
    unsigned count = 0;
    for (const char *at = strstr(all, words); at != NULL; at = strstr(at + 1, words)) {
        count++;
    }
    return count;
}

static void watch_everything(void) {
    say(1, "{\"cmd\":\"watch\",\"topics\":[\"force\",\"stop\",\"bus\",\"estop\",\"lease\"],\"rate_hz\":1}");
    pass(100);
    forget();
}

TEST(test_host_reports_estop_and_each_cause_by_name_once) {
    disarm();
    watch_everything();
    estop_high = true;
    pass(200);
    TEST_ASSERT_EQUAL_UINT(1, count_of("\"event\":\"estop\",\"t_us\""));
    TEST_ASSERT_NOT_NULL_MESSAGE(strstr(all, "\"state\":\"pressed\"}"), all);
    iw_snapshot_t seen = gateway_rig_snapshot(&rig);
    seen.still_moving++;
    seen.present |= 1U << IW_CAUSE_ESTOP_LINE;
    brd_host_observe(&host, &seen);
    brd_host_observe(&host, &seen);
    seen.rolling = seen.rolling_fault = seen.zeros_ending = true;
    brd_host_observe(&host, &seen);
    brd_host_observe(&host, &seen);
    TEST_ASSERT_EQUAL_UINT(1, count_of("\"cause\":\"rolling\",\"present\":true"));
    TEST_ASSERT_EQUAL_UINT(1, count_of("\"event\":\"rolling\""));
    TEST_ASSERT_EQUAL_UINT(1, count_of("\"cause\":\"zeros_ending\",\"present\":true"));
    seen.rolling = seen.rolling_fault = seen.zeros_ending = false;
    brd_host_observe(&host, &seen);
    TEST_ASSERT_EQUAL_UINT(1, count_of("\"cause\":\"rolling\",\"present\":false"));
    TEST_ASSERT_EQUAL_UINT(2, count_of("\"event\":\"rolling\""));
    TEST_ASSERT_EQUAL_UINT(1, count_of("\"cause\":\"still_moving\",\"present\":true"));
    TEST_ASSERT_EQUAL_UINT(1, count_of("\"cause\":\"estop_line\",\"present\":true"));
    TEST_ASSERT_EQUAL_UINT(6, count_of("\"event\":\"fault\""));
}

TEST(test_host_reports_a_stop_with_its_cause_and_client) {
    char line[IWN_LINE_BOARD_MAX];
    watch_everything();
    say(0, "{\"cmd\":\"open\",\"channel\":2,\"watch\":false}");
    say(2, "{\"cmd\":\"stop\"}");
    run_ms(20);
    TEST_ASSERT_NOT_NULL_MESSAGE(strstr(all, "\"cause\":\"client_stop\""), all);
    answer[0] = '\0';
    put(line, drive_line(SLOW_MM_S, BOOT, ++seq, t_us, line));
    run_ms(20);
    TEST_ASSERT_NOT_NULL_MESSAGE(strstr(answer, "client 2"), answer);
    forget();
    say(2, "{\"cmd\":\"estop\",\"reason\":\"test\"}");
    run_ms(20);
    TEST_ASSERT_NOT_NULL_MESSAGE(strstr(all, "\"cause\":\"estop_software\""), all);
    TEST_ASSERT_NOT_NULL_MESSAGE(strstr(all, "client 2"), all);
    TEST_ASSERT_NULL_MESSAGE(strstr(all, "(gone)"), all);
}

TEST(test_host_zero_of_each_wheel_is_reported_once_per_change) {
    disarm();
    watch_everything();
    iw_snapshot_t seen = gateway_rig_snapshot(&rig);
    iw_force_t force = *seen.wheel[IW_RIGHT].force;
    force.provenance = IW_OFFSET_STORED;
    force.offset_mN = 1234;
    force.offset_us = 77;
    seen.wheel[IW_RIGHT].force = &force;
    brd_host_observe(&host, &seen);
    brd_host_observe(&host, &seen);
    TEST_ASSERT_EQUAL_UINT(1, count_of("\"event\":\"offset\""));
    TEST_ASSERT_NOT_NULL_MESSAGE(strstr(all, "\"side\":\"right\",\"offset_mN\":1234,"), all);
    TEST_ASSERT_EQUAL_UINT8(IW_OFFSET_NONE, host.zero[IW_RIGHT].from);
    force.provenance = IW_OFFSET_OPERATOR;
    force.offset_us = 99;
    forget();
    brd_host_observe(&host, &seen);
    brd_host_observe(&host, &seen);
    TEST_ASSERT_EQUAL_UINT(1, count_of("\"event\":\"offset\""));
    TEST_ASSERT_NOT_NULL_MESSAGE(strstr(all, "\"before_mN\":1234,"), all);
    host.reported.offset_us[IW_LEFT] = IW_NEVER;
    force.offset_us = 100;
    force.offset_mN = 55;
    brd_host_observe(&host, &seen);
    TEST_ASSERT_EQUAL_UINT(2, count_of("\"event\":\"offset\""));
    TEST_ASSERT_NOT_NULL_MESSAGE(strstr(all, "\"before_provenance\":\"operator\""), all);
    force.provenance = IW_OFFSET_ESTIMATED;
    force.quality.deviation_mN = 31;
    brd_host_observe(&host, &seen);
    TEST_ASSERT_EQUAL_UINT8(IW_OFFSET_ESTIMATED, host.zero[IW_RIGHT].from);
    TEST_ASSERT_EQUAL_UINT16(31, host.zero[IW_RIGHT].deviation_mN);
}

TEST(test_host_confirm_is_compared_with_the_value_in_use) {
    ask("{\"cmd\":\"confirm\",\"id\":1,\"item\":\"track\",\"value\":\"530\"}", "\"state\":\"confirmed\"");
    ask("{\"cmd\":\"confirm\",\"id\":2,\"item\":\"track\",\"value\":\"551\"}", "\"state\":\"contradicted\"");
    ask("{\"cmd\":\"confirm\",\"id\":3,\"item\":\"dlc\",\"value\":\"551\"}", "value must be yes or no");
}

TEST(test_host_line_is_stamped_every_25_ms_while_armed) {
    forget();
    for (unsigned i = 0; i < 10U; i++) {
        say(0, "{\"cmd\":\"alive\"}");
        gateway_judge_renew(&rig.judge);
        run_ms(25);
    }
    TEST_ASSERT_UINT_WITHIN(2, 10, count_of("\"event\":\"link\""));
}

TEST(test_host_stores_learned_values_once_and_restores_them) {
    iw_assumption_state_t state;
    disarm();
    assert_answer("{\"cmd\":\"confirm\",\"id\":1,\"item\":\"track\",\"value\":\"540\"}", "\"confirmed\"");
    pass(2500);
    const uint32_t writes = flash_writes;
    TEST_ASSERT_GREATER_THAN_UINT32(0, writes);
    TEST_ASSERT_EQUAL_INT(BRD_RECORDS_STORED, host.records);
    pass(5000);
    TEST_ASSERT_EQUAL_UINT32_MESSAGE(writes, flash_writes, "the flash wears");
    start();
    state = iwn_server_snapshot(&host.server)->assumed[IW_ASSUMPTION_TRACK].state;
    TEST_ASSERT_EQUAL_INT(IW_CONFIRMED, state);
    TEST_ASSERT_EQUAL_INT(BRD_RECORDS_STORED, host.records);
    has_flash = false;
    start();
    state = iwn_server_snapshot(&host.server)->assumed[IW_ASSUMPTION_TRACK].state;
    TEST_ASSERT_EQUAL_INT(IW_ASSUMED, state);
    TEST_ASSERT_EQUAL_INT(BRD_RECORDS_NEW, host.records);
    flash_fails = true;
    assert_answer("{\"cmd\":\"confirm\",\"id\":1,\"item\":\"track\",\"value\":\"540\"}", "\"confirmed\"");
    pass(5000);
    TEST_ASSERT_EQUAL_INT(BRD_RECORDS_FAILED, host.records);
}

TEST(test_host_turn_is_refused_when_the_track_is_contradicted) {
    disarm();
    assert_answer("{\"cmd\":\"confirm\",\"id\":1,\"item\":\"track\",\"value\":\"700\"}", "\"contradicted\"");
    assert_answer("{\"cmd\":\"twist\",\"v_mm_s\":0,\"yaw_mrad_s\":0,\"id\":2}", "\"error\":\"not_armed\"");
    assert_answer("{\"cmd\":\"arm\",\"id\":3}", "\"ok\":true");
    disarm();
    assert_answer("{\"cmd\":\"twist\",\"v_mm_s\":0,\"yaw_mrad_s\":10,\"id\":4}", "\"error\":\"denied\"");
    assert_answer("{\"cmd\":\"arm\",\"id\":5}", "\"error\":\"stale_command\""); // The client requests motion.
}

TEST(test_host_command_older_than_its_channel_is_stale) {
    char json[256];
    (void)snprintf(json, sizeof json,
                   "{\"boot\":\"%016llx\",\"seq\":1,\"t_us\":%llu,\"cmd\":\"drive\",\"left_mm_s\":100,"
                   "\"right_mm_s\":100}",
                   (unsigned long long)BOOT, (unsigned long long)t_us);
    run_ms(5);
    say(0, "{\"cmd\":\"open\",\"channel\":2,\"watch\":false}");
    run_ms(5);
    refused = 0;
    say(2, json);
    run_ms(5);
    TEST_ASSERT_EQUAL_UINT32(1, refused);
}

TEST(test_host_state_after_a_stall_has_no_burst) {
    disarm();
    say(1, "{\"cmd\":\"watch\",\"topics\":[\"state\"],\"rate_hz\":10}");
    pass(300);
    forget();
    gateway_rig_run(&rig, 300000); // The loop of the image stalls.
    states = 0;
    say(0, "{\"cmd\":\"alive\"}");
    run_ms(50);
    TEST_ASSERT_UINT32_WITHIN(1, 1, states); // One immediately, and one more if the 50 ms contain a point of the grid.
    TEST_ASSERT_EQUAL_UINT(0, count_of("\"event\":\"lost\""));
    states = 0;
    pass(1000);
    TEST_ASSERT_UINT32_WITHIN(1, 10, states);
}

static bool is_accepted(const iw_config_t *config) {
    const brd_settings_t settings = brd_settings_from(config);
    char text[256];
    iwn_text_t why = iwn_text_begin(text, sizeof text);
    return brd_settings_check(&settings, &why);
}

TEST(test_host_setting_out_of_its_range_is_refused) {
    iw_config_t config = rig.config;
    TEST_ASSERT_TRUE(is_accepted(&config));
    config.gear_turns = 1000;
    config.gear_per = 1;
    TEST_ASSERT_FALSE(is_accepted(&config));
    config = rig.config;
    config.lease_ms = 900;
    TEST_ASSERT_FALSE(is_accepted(&config));
    config = rig.config;
    config.radius_mm = 0;
    TEST_ASSERT_FALSE(is_accepted(&config));
    config = rig.config;
    config.rest_rpm = 3;
    TEST_ASSERT_FALSE(is_accepted(&config));
    config = rig.config;
    config.min_current_mA = 2000;
    config.max_current_mA = 1999;
    TEST_ASSERT_FALSE(is_accepted(&config));
}

TEST(test_host_executes_relay_commands_and_counts_errors) {
    static const char *const good[] = {"{\"cmd\":\"alive\"}",
                                       "{\"cmd\":\"open\",\"channel\":2,\"watch\":true}",
                                       "{\"cmd\":\"close\",\"channel\":2}",
                                       "{\"cmd\":\"link\"}",
                                       "{\"ok\":true}",
                                       "{\"event\":\"x\"}"};
    static const char *const bad[] = {"{\"cmd\":\"dance\"}",
                                      "{\"cmd\":\"close\"}",
                                      "{\"cmd\":\"close\",\"channel\":99}",
                                      "{\"x\":1}",
                                      "[]",
                                      "{\"cmd\":\"open\",\"channel\":2}"};
    for (size_t i = 0; i < sizeof good / sizeof good[0]; i++) {
        say(0, good[i]);
        run_ms(5);
        TEST_ASSERT_EQUAL_UINT32_MESSAGE(0, host.errors, good[i]);
    }
    say(1, "{\"cmd\":\"hello\"}"); // After a restart of the relay no client is connected.
    run_ms(5);
    TEST_ASSERT_EQUAL_UINT32(1, host.errors);
    for (uint32_t i = 0; i < sizeof bad / sizeof bad[0]; i++) {
        say(0, bad[i]);
        run_ms(5);
        TEST_ASSERT_EQUAL_UINT32_MESSAGE(2U + i, host.errors, bad[i]);
    }
    say(0, "{\"cmd\":\"open\",\"channel\":1,\"watch\":false}");
    forget();
    say(1, "{\"ok\":true}");
    say(1, "{\"cmd\":\"hello\",\"id\":1}");
    run_ms(5);
    TEST_ASSERT_EQUAL_UINT_MESSAGE(0, count_of("\"ok\":false"), all);
    TEST_ASSERT_EQUAL_UINT32(2U + sizeof bad / sizeof bad[0] - 1U, host.errors);
}

TEST(test_host_line_errors_are_counted_once) {
    for (unsigned i = 0; i < 3U; i++) {
        put("rubbish*00000000\n", 17);
    }
    pass(1000);
    TEST_ASSERT_EQUAL_UINT32(1, errors);
    TEST_ASSERT_NOT_NULL_MESSAGE(strstr(all, "\"count\":3}"), all);
    put("rubbish*00000000\n", 17);
    pass(1000);
    TEST_ASSERT_EQUAL_UINT32(2, errors);
    TEST_ASSERT_NOT_NULL_MESSAGE(strstr(all, "\"count\":1}"), all);
}

TEST(test_host_lost_events_are_reported_once) {
    watch_everything();
    serial_room = BRD_HOST_REPLY_ROOM;
    estop_high = true;
    pass(100);
    TEST_ASSERT_EQUAL_UINT(0, count_of("\"event\":\"estop\""));
    serial_room = BRD_SERIAL_SEND_BYTES;
    pass(500);
    TEST_ASSERT_EQUAL_UINT_MESSAGE(1, count_of("\"event\":\"lost\""), all);
}

TEST(test_host_client_closed_or_offline_for_500_ms_is_removed) {
    watch_everything();
    say(0, "{\"cmd\":\"open\",\"channel\":2,\"watch\":true}");
    say(2, "{\"cmd\":\"watch\",\"topics\":[\"stop\"]}");
    run_ms(10);
    gateway_judge_renew(&rig.judge);
    TEST_ASSERT_EQUAL_INT(IW_STATE_ARMED, iw_gateway_state(&rig.gateway));
    forget();
    say(0, "{\"cmd\":\"close\",\"channel\":1}");
    run_ms(10);
    TEST_ASSERT_TRUE(iw_gateway_state(&rig.gateway) != IW_STATE_ARMED);
    TEST_ASSERT_EQUAL_UINT32(IW_CLIENT_NONE, host.client[0].served.id);
    TEST_ASSERT_NOT_NULL_MESSAGE(strstr(all, "\"event\":\"stop\""), all);
    TEST_ASSERT_NOT_NULL_MESSAGE(strstr(all, "client 1 "), all);
    run_ms(480);
    TEST_ASSERT_TRUE(host.client[1].served.id != IW_CLIENT_NONE);
    run_ms(30);
    TEST_ASSERT_EQUAL_UINT32(IW_CLIENT_NONE, host.client[1].served.id);
}

TEST(test_host_status_has_the_estop_and_the_zero_of_each_wheel) {
    host.zero[IW_LEFT] = (brd_assumptions_zero_t){.from = IW_OFFSET_OPERATOR, .deviation_mN = 11};
    host.zero[IW_RIGHT] = (brd_assumptions_zero_t){.from = IW_OFFSET_ESTIMATED, .deviation_mN = 22};
    const iwn_surroundings_t around = iwn_target_around(&host.server, iwn_server_snapshot(&host.server));
    TEST_ASSERT_TRUE(around.estop.present);
    TEST_ASSERT_EQUAL_UINT32(11, around.zero[IW_LEFT].deviation_mN);
    TEST_ASSERT_EQUAL_UINT32(22, around.zero[IW_RIGHT].deviation_mN);
}

TEST(test_host_restarts_only_on_request) {
    disarm();
    TEST_ASSERT_FALSE(brd_host_wants_restart(&host));
    host.restart_us = 1;
    TEST_ASSERT_TRUE(brd_host_wants_restart(&host));
}

TEST(test_host_restarts_1_ms_after_the_last_bytes) {
    disarm();
    const iw_time_us_t begin_us = host.server.now_us;
    host.restart_us = begin_us + 400000U;
    serial_sends = true;
    TEST_ASSERT_FALSE(brd_host_wants_restart(&host));
    serial_sends = false;
    host.server.now_us = begin_us + BRD_HOST_LAST_BYTES_US - 1U;
    TEST_ASSERT_FALSE(brd_host_wants_restart(&host));
    host.server.now_us++;
    TEST_ASSERT_TRUE(brd_host_wants_restart(&host));
}

/// A restart would clear the latch that the reply to the estop has reported.
TEST(test_host_estop_before_a_restart_stays_latched) {
    disarm();
    host.restart_us = 1;
    TEST_ASSERT_TRUE(brd_host_wants_restart(&host));
    say(1, "{\"cmd\":\"estop\",\"id\":1}");
    run_ms(20);
    TEST_ASSERT_EQUAL_INT(IW_STATE_LATCHED, iw_gateway_state(&rig.gateway));
    TEST_ASSERT_FALSE(brd_host_wants_restart(&host));
    pass(3000);
    TEST_ASSERT_FALSE(brd_host_wants_restart(&host));
    TEST_ASSERT_EQUAL_INT(IW_REFUSE_NONE, iw_gateway_reset(&rig.gateway, rig.now_us));
    pass(100);
    TEST_ASSERT_TRUE(brd_host_wants_restart(&host));
}

TEST(test_host_restarts_late_while_bytes_do_not_leave) {
    disarm();
    serial_sends = true;
    host.restart_us = host.server.now_us + 400000U;
    host.server.now_us = host.restart_us - 1U;
    TEST_ASSERT_FALSE(brd_host_wants_restart(&host));
    host.server.now_us++;
    TEST_ASSERT_TRUE(brd_host_wants_restart(&host));
}

TEST(test_host_line_is_stamped_every_second_while_disarmed) {
    disarm();
    pass(1000);
    forget();
    pass(3000);
    TEST_ASSERT_EQUAL_UINT(3, count_of("\"event\":\"link\""));
    const iw_snapshot_t seen = gateway_rig_snapshot(&rig);
    TEST_ASSERT_EQUAL_UINT64(host.linked_us + 1000000U, brd_host_report(&host, &seen, false));
}

TEST(test_host_hello_and_force_are_complete) {
    forget();
    say(0, "{\"cmd\":\"open\",\"channel\":2,\"watch\":true}");
    say(2, "{\"cmd\":\"watch\",\"topics\":[\"force\"],\"rate_hz\":10}");
    run_ms(20);
    const char *const hello = strstr(all, "\"event\":\"hello\"");
    TEST_ASSERT_NOT_NULL_MESSAGE(hello, all);
    TEST_ASSERT_TRUE_MESSAGE(strstr(hello, "\"t_us\":") < strchr(hello, '}'), hello);
    TEST_ASSERT_NOT_NULL_MESSAGE(strstr(strstr(all, "\"event\":\"force\""), "\"left\":{"), all);
}

TEST(test_host_checks_learned_values_every_2_s_of_silence) {
    disarm();
    const iw_time_us_t silent_us = host.learn_us;
    TEST_ASSERT_TRUE(silent_us > rig.now_us - 2000000U && silent_us <= rig.now_us + 2000000U);
    while (host.learn_us == silent_us) {
        pass(100);
    }
    TEST_ASSERT_UINT64_WITHIN(110000U, rig.now_us + 2000000U, host.learn_us);
    host.learn_us = 0; // The same value as after motion.
    pass(100);
    TEST_ASSERT_UINT64_WITHIN(110000U, rig.now_us + 2000000U, host.learn_us);
}
