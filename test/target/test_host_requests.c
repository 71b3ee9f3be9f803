// SPDX-License-Identifier: MIT
// Requests that the board itself answers, and requests that it refuses.
#include "host_rig.inc"

TEST(test_host_arm_of_another_client_names_the_holder) {
    char holder[64];
    char line[IWN_LINE_BOARD_MAX];
    put(line, drive_line(0, BOOT, ++seq, t_us, line));
    (void)snprintf(host.client[0].served.name, sizeof host.client[0].served.name, "pendant");
    (void)snprintf(holder, sizeof holder, "\\\"pendant\\\" (client %u)", (unsigned)host.client[0].served.id);
    say(0, "{\"cmd\":\"open\",\"channel\":2,\"watch\":false}");
    say(2, "{\"cmd\":\"arm\",\"id\":8}");
    run_ms(20);
    TEST_ASSERT_NOT_NULL_MESSAGE(strstr(answer, holder), answer);
}

TEST(test_stop_never_refused_by_a_board_in_a_bad_line) {
    assert_answer("{\"cmd\":\"stop\",\"reason\":\"\\ud83d\"}", "\"ok\":false,\"error\":\"bad_json\"");
    TEST_ASSERT_NOT_NULL_MESSAGE(strstr(answer, "; its stop is executed"), answer);
    TEST_ASSERT_EQUAL_INT(IW_STATE_STOPPING, iw_gateway_state(&rig.gateway));
    pass(2400);
    arm();
    assert_answer("{\"id\":1,\"id\":1,\"cmd\":\"estop\"}", "its stop is executed");
    TEST_ASSERT_EQUAL_INT(IW_STATE_LATCHED, iw_gateway_state(&rig.gateway));
    TEST_ASSERT_EQUAL_STRING("", host.server.estop_reason);
}

TEST(test_host_bad_line_without_a_stop_stops_nothing) {
    assert_answer("{\"cmd\":\"stop,\"reason\":\"\\ud83d\"}", "\"ok\":false,\"error\":\"bad_json\"");
    TEST_ASSERT_NULL_MESSAGE(strstr(answer, "stop is executed"), answer);
    TEST_ASSERT_EQUAL_INT(IW_STATE_ARMED, iw_gateway_state(&rig.gateway));
}

TEST(test_host_that_restarts_refuses_arm_and_accepts_reset) {
    host.restart_us = 1;
    assert_answer("{\"cmd\":\"reset\",\"id\":1}", "\"id\":1");
    TEST_ASSERT_NULL_MESSAGE(strstr(answer, "was committed"), answer);
    assert_answer("{\"cmd\":\"arm\",\"id\":2}", "a configuration was committed");
}

TEST(test_host_second_status_before_the_first_reply_is_busy) {
    forget();
    say(1, "{\"cmd\":\"status\",\"id\":1}");
    say(1, "{\"cmd\":\"status\",\"id\":2}");
    run_ms(60);
    TEST_ASSERT_NOT_NULL_MESSAGE(strstr(all, "\"id\":1,\"ok\":true"), all);
    TEST_ASSERT_NOT_NULL_MESSAGE(strstr(all, "\"id\":2,\"ok\":false,\"error\":\"busy\""), all);
}

/// The serial line has no capacity for the events of all clients at the same time.
TEST(test_host_periodic_events_of_clients_have_different_times) {
    say(0, "{\"cmd\":\"open\",\"channel\":2,\"watch\":true}");
    say(1, "{\"cmd\":\"watch\",\"topics\":[\"force\"],\"rate_hz\":10}");
    run_ms(30);
    say(2, "{\"cmd\":\"watch\",\"topics\":[\"force\"],\"rate_hz\":10}");
    run_ms(300);
    TEST_ASSERT_TRUE(host.client[0].served.next_us % 100000U != host.client[1].served.next_us % 100000U);
}

TEST(test_host_tare_is_stored_for_its_wheel_only) {
    const iw_force_quality_t window = {.deviation_mN = 31};
    rig.gateway.force[IW_LEFT].offset_mN = 11;
    rig.gateway.force[IW_RIGHT].offset_mN = 22;
    rig.gateway.force[IW_RIGHT].provenance = IW_OFFSET_OPERATOR;
    (void)iwn_server_snapshot(&host.server);
    iwn_target_tared(&host.server, &host.client[0].served, IW_RIGHT, &window);
    TEST_ASSERT_EQUAL_UINT8(IW_OFFSET_OPERATOR, host.zero[IW_RIGHT].from);
    TEST_ASSERT_EQUAL_INT32(22, host.zero[IW_RIGHT].offset_mN);
    TEST_ASSERT_EQUAL_UINT16(31, host.zero[IW_RIGHT].deviation_mN);
    TEST_ASSERT_EQUAL_UINT16(0, host.zero[IW_LEFT].deviation_mN);
}

TEST(test_host_why_and_the_reply_to_confirm_are_complete) {
    assert_answer("{\"cmd\":\"why\",\"id\":1}", "\"directory\":null,\"recording\":null,\"recording_error\":null,"
                                                "\"frames_before\":[],\"frames_after\":[]}");
    assert_answer("{\"cmd\":\"confirm\",\"id\":2,\"item\":\"track\"}",
                  "\"found\":null,\"how\":null,\"since_wall_us\":null,\"reason\":null,\"disabled\":null}");
}

TEST(test_host_config_read_stays_staged_and_flash_errors_show) {
    disarm();
    assert_answer("{\"cmd\":\"config\",\"key\":\"wheels.track_mm\",\"value\":541,\"id\":1}", "\"staged\":true");
    assert_answer("{\"cmd\":\"config\",\"id\":2}", "\"staged\":true");
    TEST_ASSERT_NOT_NULL_MESSAGE(strstr(answer, "\"key\":\"wheels.current_role\",\"value\":\"limit\""), answer);
    settings_fail = true;
    assert_answer("{\"cmd\":\"config\",\"commit\":true,\"id\":3}", "the flash did not accept it");
    settings_fail = false;
    TEST_ASSERT_EQUAL_UINT64(0, host.restart_us);
    assert_answer("{\"cmd\":\"config\",\"commit\":false,\"id\":4}", "\"staged\":false");
}

TEST(test_host_replies_of_closed_clients_use_no_place) {
    for (unsigned i = 0; i < 2U * IWN_LINE_CHANNELS; i++) {
        say(0, "{\"cmd\":\"open\",\"channel\":2,\"watch\":true}");
        say(2, "{\"cmd\":\"status\",\"id\":50}");
        say(0, "{\"cmd\":\"close\",\"channel\":2}");
        while (brd_host_receive(&host, rig.now_us)) {
        }
        wire_length = wire_taken = 0;
    }
    assert_answer("{\"cmd\":\"status\",\"id\":51}", "\"id\":51,\"ok\":true");
}

TEST(test_host_request_is_late_after_exactly_a_second) {
    char json[96];
    disarm();
    (void)snprintf(json, sizeof json, "{\"cmd\":\"reset\",\"id\":1,\"t_us\":%llu}",
                   (unsigned long long)(rig.now_us - IWN_MAX_AGE_MS * 800U));
    assert_answer(json, "\"id\":1");
    TEST_ASSERT_NULL_MESSAGE(strstr(answer, "stale_command"), answer);
    (void)snprintf(json, sizeof json, "{\"cmd\":\"reset\",\"id\":2,\"t_us\":%llu}",
                   (unsigned long long)(rig.now_us - IWN_MAX_AGE_MS * 1100U));
    assert_answer(json, "\"error\":\"stale_command\"");
}

/// The close was lost: commands of the previous client do not count for the new one.
TEST(test_host_channel_opened_again_refuses_earlier_commands) {
    char json[256];
    char part[64];
    say(0, "{\"cmd\":\"open\",\"channel\":2,\"watch\":false}");
    run_ms(5);
    (void)snprintf(json, sizeof json,
                   "{\"boot\":\"%016llx\",\"seq\":1,\"t_us\":%llu,\"cmd\":\"drive\",\"left_mm_s\":0,\"right_mm_s\":0}",
                   (unsigned long long)BOOT, (unsigned long long)t_us);
    run_ms(5);
    forget();
    say(0, "{\"cmd\":\"open\",\"channel\":2,\"watch\":false}");
    run_ms(5);
    (void)snprintf(part, sizeof part, "\"client\":%u,\"rights\":\"drive\"", (unsigned)host.client[1].served.id);
    TEST_ASSERT_NOT_NULL_MESSAGE(strstr(all, part), all);
    refused = 0;
    say(2, json);
    run_ms(5);
    TEST_ASSERT_EQUAL_UINT32(1, refused);
}

TEST(test_host_reports_the_button_and_returns_the_next_event_time) {
    disarm();
    say(1, "{\"cmd\":\"watch\",\"topics\":[\"state\"],\"rate_hz\":10}");
    run_ms(20);
    const iw_snapshot_t seen = gateway_rig_snapshot(&rig);
    const iw_time_us_t next_us = brd_host_report(&host, &seen, true);
    TEST_ASSERT_EQUAL_INT(1, host.server.reported.estop);
    TEST_ASSERT_EQUAL_UINT64(host.client[0].served.next_us, next_us);
    TEST_ASSERT_TRUE(next_us > rig.now_us && next_us < host.linked_us + 1000000U);
}

TEST(test_host_change_of_assumptions_is_reported_and_stored) {
    disarm();
    say(1, "{\"cmd\":\"watch\",\"topics\":[\"state\"],\"rate_hz\":1}");
    run_ms(20);
    forget();
    assert_answer("{\"cmd\":\"confirm\",\"id\":1,\"item\":\"setpoint_type\"}", "\"ok\":true");
    TEST_ASSERT_NOT_NULL_MESSAGE(strstr(all, "\"event\":\"ledger\""), all);
    brd_assumptions_t now;
    memset(&now, 0, sizeof now);
    iw_assumption_entry_t entry[IW_ASSUMPTION_ITEMS];
    iw_snapshot_t seen = gateway_rig_snapshot(&rig);
    seen.assumed = entry;
    for (unsigned item = 0; item < IW_ASSUMPTION_ITEMS; item++) {
        entry[item] = (iw_assumption_entry_t){IW_CONFIRMED, IW_SOURCE_OPERATOR, 0};
    }
    brd_assumptions_note(&now, &seen, &host.settings, host.zero);
    for (unsigned item = 0; item < IW_ASSUMPTION_ITEMS; item++) {
        TEST_ASSERT_NOT_EQUAL_UINT8(0, now.item[item]);
    }
}

TEST(test_host_without_a_track_refuses_arm_and_has_null) {
    disarm();
    rig.gateway.config.track_mm = 0;
    host.settings = host.staged = brd_settings_from(&rig.gateway.config);
    assert_answer("{\"cmd\":\"config\",\"id\":1}", "{\"key\":\"wheels.track_mm\",\"value\":null}");
    assert_answer("{\"cmd\":\"arm\",\"id\":2}", "\"error\":\"track_not_set\"");
    TEST_ASSERT_NOT_NULL_MESSAGE(strstr(answer, "track_mm not configured"), answer);
    TEST_ASSERT_NOT_NULL_MESSAGE(strstr(answer, "by the request config"), answer);
    assert_answer("{\"cmd\":\"confirm\",\"id\":3,\"item\":\"track\",\"value\":\"540\"}", "\"error\":\"track_not_set\"");
}

TEST(test_host_with_refused_stored_settings_names_the_fix) {
    disarm();
    rig.gateway.config.rest_rpm = 3;
    rig.gateway.config.invert[IW_RIGHT] = true;
    place.settings = brd_settings_from(&rig.gateway.config);
    brd_host_init(&host, &place, rig.now_us);
    assert_answer("{\"cmd\":\"arm\",\"id\":1}", "\"error\":\"denied\",\"message\":\"stored settings not in force: ");
    TEST_ASSERT_NOT_NULL_MESSAGE(strstr(answer, "rest_rpm"), answer);
    TEST_ASSERT_NOT_NULL_MESSAGE(strstr(answer, "set it to 2 first"), answer);
    assert_answer("{\"cmd\":\"reset\",\"id\":2}", "\"id\":2");
    TEST_ASSERT_NULL_MESSAGE(strstr(answer, "not in force"), answer);
    assert_answer("{\"cmd\":\"config\",\"key\":\"limits.rest_rpm\",\"value\":2,\"id\":3}",
                  "{\"key\":\"right.invert\",\"value\":\"yes\"}");
    assert_answer("{\"cmd\":\"config\",\"commit\":true,\"id\":4}", "\"restarts\":true");
}

/// With defaults in force an observation of the bus does not apply to the stored values.
TEST(test_host_with_refused_stored_settings_learns_nothing) {
    disarm();
    rig.gateway.config.rest_rpm = 3;
    place.settings = brd_settings_from(&rig.gateway.config);
    brd_host_init(&host, &place, rig.now_us);
    flash_writes = 0;
    say(1, "{\"cmd\":\"confirm\",\"item\":\"dlc\",\"value\":\"yes\"}");
    pass(5000);
    TEST_ASSERT_EQUAL_UINT32(0, flash_writes);
}

TEST(test_host_refused_setting_names_its_range) {
    assert_answer("{\"cmd\":\"config\",\"id\":1,\"key\":\"wheels.track_mm\",\"value\":\"0\"}",
                  "\"error\":\"bad_value\"");
    const char *const to = strstr(answer, " to ");
    TEST_ASSERT_NOT_NULL_MESSAGE(to, answer);
    TEST_ASSERT_TRUE_MESSAGE(to[4] >= '1' && to[4] <= '9', answer);
    iw_config_t config = rig.config;
    config.rest_rpm = 3;
    const brd_settings_t settings = brd_settings_from(&config);
    char text[256];
    iwn_text_t why = iwn_text_begin(text, sizeof text);
    TEST_ASSERT_FALSE(brd_settings_check(&settings, &why));
    TEST_ASSERT_NOT_NULL_MESSAGE(strstr(text, "set it to 2 first"), text);
}
