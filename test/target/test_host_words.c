// SPDX-License-Identifier: MIT
// Output of the host code of the image: each reply has all members of the protocol, each change is an event of its
// topic.
#include "host_rig.inc"

#include "iwheel/codec.h"

static void watch(const char *topics) {
    char json[128];
    (void)snprintf(json, sizeof json, "{\"cmd\":\"watch\",\"topics\":[%s],\"rate_hz\":1}", topics);
    say(1, json);
    pass(100);
    forget();
}

TEST(test_host_why_names_cause_and_has_no_recording) {
    ask("{\"cmd\":\"stop\",\"id\":1}", "\"ok\":true");
    ask("{\"cmd\":\"why\",\"id\":2}", "\"cause\":\"client_stop\"");
    TEST_ASSERT_NOT_NULL_MESSAGE(strstr(answer, "\"recording\":null"), answer);
}

TEST(test_host_reset_before_its_time_is_refused) {
    ask("{\"cmd\":\"estop\",\"id\":1}", "\"ok\":true");
    ask("{\"cmd\":\"reset\",\"id\":2,\"stop\":1}", "\"id\":2,\"ok\":false");
}

TEST(test_host_confirmed_item_has_all_its_members) {
    ask("{\"cmd\":\"confirm\",\"id\":1,\"item\":\"dlc\",\"value\":\"yes\"}", "\"state\":\"confirmed\"");
    TEST_ASSERT_NOT_NULL_MESSAGE(
        strstr(answer, "\"found\":null,\"how\":null,\"since_wall_us\":null,\"reason\":null,\"disabled\":null}"),
        answer);
}

TEST(test_host_staged_keys_stay_when_they_are_read) {
    ask("{\"cmd\":\"config\",\"id\":1,\"key\":\"wheels.radius_mm\",\"value\":\"200\"}", "\"staged\":true");
    ask("{\"cmd\":\"config\",\"id\":2}", "\"staged\":true");
    TEST_ASSERT_NOT_NULL_MESSAGE(strstr(answer, "{\"key\":\"wheels.radius_mm\",\"value\":\"200\"},{\"key\":"), answer);
    ask("{\"cmd\":\"config\",\"id\":3,\"commit\":false}", "\"staged\":false");
}

TEST(test_host_role_of_the_current_is_read_as_a_string) {
    ask("{\"cmd\":\"config\",\"id\":1}", "{\"key\":\"wheels.current_role\",\"value\":\"limit\"}");
}

TEST(test_host_refused_key_and_commit_name_the_fix) {
    ask("{\"cmd\":\"config\",\"id\":1,\"key\":\"wheels.radius_mm\",\"value\":\"1\"}", " must be 60 to 400");
    ask("{\"cmd\":\"config\",\"id\":2,\"key\":\"limits.rest_rpm\",\"value\":\"9\"}", "\"staged\":true");
    ask("{\"cmd\":\"config\",\"id\":3,\"commit\":true}", "set it to 2 first");
}

TEST(test_host_lease_that_ends_is_reported_once) {
    watch("\"lease\"");
    ask("{\"cmd\":\"stop\",\"id\":1}", "\"ok\":true");
    TEST_ASSERT_NOT_NULL_MESSAGE(strstr(all, "\"event\":\"lease\""), all);
    forget();
    char line[IWN_LINE_BOARD_MAX];
    put(line, drive_line(SLOW_MM_S, BOOT, ++seq, t_us, line)); // The command is refused, and no client has the lease.
    pass(300);
    TEST_ASSERT_NOT_NULL_MESSAGE(strstr(answer, "\"ok\":false"), answer);
    TEST_ASSERT_NULL_MESSAGE(strstr(all, "\"event\":\"lease\""), all);
}

TEST(test_host_state_change_is_reported_immediately) {
    watch("\"state\"");
    pass(1100); // Periodic events have been sent by then.
    forget();
    arm();
    TEST_ASSERT_NOT_NULL_MESSAGE(strstr(all, "\"event\":\"state\""), all);
}

TEST(test_host_item_change_is_reported) {
    watch("\"state\"");
    ask("{\"cmd\":\"confirm\",\"id\":1,\"item\":\"dlc\",\"value\":\"no\"}", "\"state\":\"contradicted\"");
    TEST_ASSERT_NOT_NULL_MESSAGE(strstr(all, "\"event\":\"ledger\""), all);
}

TEST(test_host_link_line_is_sent_exactly_after_a_second) {
    ask("{\"cmd\":\"stop\",\"id\":1}", "\"ok\":true");
    pass(2500);
    iw_snapshot_t seen = gateway_rig_snapshot(&rig);
    forget();
    seen.at_us = host.linked_us + BRD_HOST_LINK_US - 1U;
    (void)brd_host_report(&host, &seen, false);
    TEST_ASSERT_NULL_MESSAGE(strstr(all, "\"event\":\"link\""), all);
    seen.at_us++;
    (void)brd_host_report(&host, &seen, false);
    TEST_ASSERT_NOT_NULL_MESSAGE(strstr(all, "\"event\":\"link\""), all);
}

/// Sends force frames of one wheel, which is at standstill.
static void press(iw_side_t side, uint32_t span_ms) {
    for (uint32_t ms = 0; ms < span_ms; ms += 50U) {
        const iw_can_frame_t frame = {
            .id = (side == IW_LEFT) ? IW_ID_LEFT_FORCE : IW_ID_RIGHT_FORCE, .dlc = IW_DLC_FORCE, .data = {0, 70}};
        fake_bus_put(&rig.bus, &frame);
        say(0, "{\"cmd\":\"alive\"}");
        run_ms(50);
    }
}

TEST(test_host_tare_of_one_wheel_sets_its_zero_only) {
    ask("{\"cmd\":\"stop\",\"id\":1}", "\"ok\":true");
    press(IW_LEFT, 4000);
    ask("{\"cmd\":\"tare\",\"id\":2,\"side\":\"left\"}", "\"left\":{");
    TEST_ASSERT_EQUAL_UINT8(IW_OFFSET_OPERATOR, host.zero[IW_LEFT].from);
    TEST_ASSERT_EQUAL_UINT8(IW_OFFSET_NONE, host.zero[IW_RIGHT].from);
    const iw_snapshot_t seen = gateway_rig_snapshot(&rig);
    const iwn_surroundings_t around = iwn_target_around(&host.server, &seen);
    TEST_ASSERT_EQUAL_UINT32(IW_FORCE_WINDOW_SAMPLES, around.zero[IW_LEFT].samples);
    TEST_ASSERT_EQUAL_UINT32(0, around.zero[IW_RIGHT].samples);
}

TEST(test_host_first_item_is_stored) {
    ask("{\"cmd\":\"confirm\",\"id\":1,\"item\":\"setpoint_type\"}", "\"state\":\"confirmed\"");
    const iw_snapshot_t seen = gateway_rig_snapshot(&rig);
    brd_assumptions_t learned;
    brd_assumptions_note(&learned, &seen, &host.settings, host.zero);
    TEST_ASSERT_EQUAL_UINT8(IW_CONFIRMED, learned.item[IW_ASSUMPTION_SETPOINT_TYPE] & 0x0FU);
}

TEST(test_host_counts_only_its_channels) {
    memset(&host.pending, 0xFF, sizeof host.pending);
    memset(&host.receiver, 0xFF, sizeof host.receiver);
    memset(host.in, 0xFF, sizeof host.in);
    const iw_snapshot_t seen = gateway_rig_snapshot(&rig);
    TEST_ASSERT_EQUAL_UINT32(1, iwn_target_around(&host.server, &seen).clients);
}

TEST(test_host_line_has_space_for_prefix_and_suffix) {
    const iwn_out_t json = iwn_server_begin_event(&host.server, "link");
    TEST_ASSERT_EQUAL_PTR(&host.scratch.small[IWN_LINE_PREFIX], json.data);
    TEST_ASSERT_EQUAL_UINT32(BRD_HOST_SMALL_BYTES - IWN_LINE_PREFIX - IWN_LINE_SUFFIX, json.size);
}
