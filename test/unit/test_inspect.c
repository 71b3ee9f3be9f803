// SPDX-License-Identifier: MIT
#include "inspect.h"

#include "unit.h"
#include <errno.h>
#include <string.h>

static inspect_findings_t findings;
static inspect_traffic_t received;
static const iwl_bus_link_t local = {.presence = IWL_LINK_LOCAL, .is_virtual = true, .echo_proven = true};
static const inspect_config_t config = {
    .name = "can0", .bitrate_hz = 1000000, .sample_point_permille = 625, .refuses = true};

void setUp(void) {
    inspect_begin(&findings);
    inspect_traffic_begin(&received);
}

/// Receives two seconds of a healthy pair.
static void receive_healthy(void) {
    received.was_up = true;
    received.span_us = 2000000U;
    for (unsigned i = 0; i < IW_CODEC_ROWS; i++) {
        received.count[i] =
            inspect_always(&iw_codec_rows[i]) ? inspect_nominal_mHz(&iw_codec_rows[i]) * 2U / 1000U : 0U;
    }
    received.bits = 120000U;
}

static const inspect_finding_t *find(const char *check) {
    for (unsigned i = 0; i < findings.count; i++) {
        if (strcmp(findings.finding[i].check, check) == 0) {
            return &findings.finding[i];
        }
    }
    return NULL;
}

static void expect(const char *check, inspect_verdict_t verdict, const char *text, const char *fix) {
    const inspect_finding_t *finding = find(check);
    TEST_ASSERT_NOT_NULL_MESSAGE(finding, check);
    TEST_ASSERT_EQUAL_MESSAGE(verdict, finding->verdict, finding->text);
    TEST_ASSERT_NOT_NULL_MESSAGE(strstr(finding->text, text), finding->text);
    TEST_ASSERT_NOT_NULL_MESSAGE(strstr(finding->fix, fix), finding->fix);
    TEST_ASSERT_EQUAL_MESSAGE(verdict == INSPECT_OK, finding->fix[0] == '\0', "every finding has a fix");
}

TEST(test_inspect_healthy_bus_has_no_finding) {
    receive_healthy();
    inspect_bus(&local, &received, &config, &findings);
    expect("left_wheel", INSPECT_OK, "speed 250.0/s, status 25.0/s, force 20.0/s", "");
    expect("right_wheel", INSPECT_OK, "pose 25.0/s", "");
    expect("load", INSPECT_OK, "6.0 %", "");
    TEST_ASSERT_EQUAL(findings.count, findings.total[INSPECT_OK]);
}

TEST(test_inspect_offline_wheel_fails_without_finding_of_rates) {
    receive_healthy();
    for (unsigned i = 0; i < IW_CODEC_ROWS; i++) {
        received.count[i] = (iw_codec_rows[i].side == IW_RIGHT) ? 0U : received.count[i];
    }
    inspect_bus(&local, &received, &config, &findings);
    expect("right_wheel", INSPECT_FAIL, "right wheel: no telemetry for 2000 ms", "power, cable");
    TEST_ASSERT_NULL(find("rates"));
    expect("left_wheel", INSPECT_OK, "left wheel", "");
}

TEST(test_inspect_rate_off_by_over_10_percent_warns_with_numbers) {
    receive_healthy();
    received.count[inspect_message_of(IW_ID_LEFT_SPEED)] = 236U;
    inspect_bus(&local, &received, &config, &findings);
    expect("rates", INSPECT_WARN, "left speed 256 (0x100): 118.0 a second; the document has 250.0", "termination");
    TEST_ASSERT_EQUAL_UINT(1U, findings.total[INSPECT_WARN]);
}

TEST(test_inspect_rate_within_10_percent_or_two_frames_is_ok) {
    receive_healthy();
    received.count[inspect_message_of(IW_ID_LEFT_SPEED)] = 450U;
    received.count[inspect_message_of(IW_ID_RIGHT_FORCE)] = 34U;
    inspect_bus(&local, &received, &config, &findings);
    TEST_ASSERT_NULL(find("rates"));
    received.count[inspect_message_of(IW_ID_LEFT_SPEED)] = 447U;
    inspect_bus(&local, &received, &config, &findings);
    TEST_ASSERT_NOT_NULL(find("rates"));
}

TEST(test_inspect_missing_message_is_named) {
    receive_healthy();
    received.count[inspect_message_of(IW_ID_RIGHT_POSE)] = 0U;
    inspect_bus(&local, &received, &config, &findings);
    expect("rates", INSPECT_WARN, "right pose 290 (0x122): none received", "firmware");
}

TEST(test_inspect_offsets_may_be_missing_after_a_minute) {
    receive_healthy();
    TEST_ASSERT_EQUAL_UINT32(0U, received.count[inspect_message_of(IW_ID_LEFT_OFFSET)]);
    inspect_bus(&local, &received, &config, &findings);
    TEST_ASSERT_NULL(find("rates"));
}

TEST(test_inspect_foreign_setpoints_fail_without_a_gateway) {
    inspect_config_t beside_gateway = config;
    beside_gateway.others_may_send = true;
    receive_healthy();
    received.count[inspect_message_of(IW_ID_RIGHT_SETPOINT)] = 3U;
    inspect_bus(&local, &received, &beside_gateway, &findings);
    TEST_ASSERT_NULL(find("second_master"));
    inspect_bus(&local, &received, &config, &findings);
    expect("second_master", INSPECT_FAIL, "3 frames with id 266 (0x10A) or 298 (0x12A)", "switch it off");
}

TEST(test_inspect_unknown_ids_are_listed_up_to_a_limit) {
    iw_can_frame_t frame = {.id = 0x266U};
    receive_healthy();
    inspect_traffic_count(&received, &frame);
    inspect_traffic_count(&received, &frame);
    frame.id = 0x1ABCDEF0U | IW_CAN_EXTENDED;
    inspect_traffic_count(&received, &frame);
    inspect_bus(&local, &received, &config, &findings);
    expect("unknown_ids", INSPECT_WARN, "3 frames do not belong to the wheels: 0x266 0x1ABCDEF0",
           "iwheelctl record - --can can0 --for 2s | iwheelctl decode");
    for (uint32_t id = 1; id <= 20U; id++) {
        frame.id = id;
        inspect_traffic_count(&received, &frame);
    }
    inspect_begin(&findings);
    inspect_bus(&local, &received, &config, &findings);
    expect("unknown_ids", INSPECT_WARN, "23 frames", "");
    TEST_ASSERT_NOT_NULL(strstr(find("unknown_ids")->text, " ..."));
}

TEST(test_inspect_damaged_frames_have_their_own_counts) {
    const iw_can_frame_t brief = {.id = IW_ID_LEFT_SPEED, .dlc = 3};
    const iw_can_frame_t remote = {.id = IW_ID_LEFT_SPEED | IW_CAN_REMOTE, .dlc = 4};
    const iw_can_frame_t echo = {.id = IW_ID_LEFT_SETPOINT, .dlc = 5, .kind = IW_CAN_ECHO};
    inspect_traffic_count(&received, &brief);
    inspect_traffic_count(&received, &remote);
    inspect_traffic_count(&received, &echo);
    TEST_ASSERT_EQUAL_UINT32(1U, received.bad_length);
    TEST_ASSERT_EQUAL_UINT32(1U, received.bad_format);
    TEST_ASSERT_EQUAL_UINT32(0U, received.count[inspect_message_of(IW_ID_LEFT_SETPOINT)]);
    TEST_ASSERT_EQUAL_UINT64(47U + 24U + 47U + 47U + 40U, received.bits);
}

TEST(test_inspect_full_bus_warns) {
    receive_healthy();
    received.bits = 1100000U;
    inspect_bus(&local, &received, &config, &findings);
    expect("load", INSPECT_WARN, "55.0 %", "lower ids");
}

TEST(test_inspect_bus_that_was_never_up_does_not_judge_wheels) {
    iwl_bus_link_t link = {.presence = IWL_LINK_UP};
    inspect_bus(&link, &received, &config, &findings);
    expect("bus_state", INSPECT_FAIL, "bus-off", "ip link set can0 down; ip link set can0 up");
    TEST_ASSERT_NULL(find("left_wheel"));
    inspect_begin(&findings);
    inspect_bus(&local, &received, &config, &findings);
    expect("interface", INSPECT_FAIL, "no simulator there", "iwheel-sim --can");
}

TEST(test_inspect_error_passive_bus_warns) {
    receive_healthy();
    received.worst = IW_BUS_PASSIVE;
    inspect_bus(&local, &received, &config, &findings);
    expect("bus_state", INSPECT_WARN, "error passive", "termination");
}

TEST(test_inspect_bus_off_fails_and_wheels_are_not_judged) {
    const iwl_bus_link_t link = {.presence = IWL_LINK_UP};
    received.was_up = true; // The bus was up before it went bus-off, or before the first error frame.
    received.worst = IW_BUS_OFF;
    received.last = IW_BUS_OFF;
    inspect_bus(&link, &received, &config, &findings);
    expect("bus_state", INSPECT_FAIL, "bus-off", "ip link set can0 down; ip link set can0 up");
    TEST_ASSERT_NULL(find("left_wheel"));
    inspect_begin(&findings);
    inspect_bus(&local, &received, &config, &findings);
    expect("bus_state", INSPECT_FAIL, "bus-off", "iwheel-sim busoff off");
    TEST_ASSERT_NULL(find("left_wheel"));
}

TEST(test_inspect_past_bus_off_warns_and_wheels_are_judged) {
    receive_healthy();
    received.worst = IW_BUS_OFF;
    inspect_bus(&local, &received, &config, &findings);
    expect("bus_state", INSPECT_WARN, "it was bus-off", "termination");
    expect("left_wheel", INSPECT_OK, "left wheel", "");
}

TEST(test_inspect_absent_hardware_gets_the_requested_verdict) {
    const inspect_estop_t estop = {
        .line = "ESTOP", .present = true, .level = -1, .trouble = "no chip", .no_gpio = true};
    findings.absent = INSPECT_SKIP;
    inspect_estop(&estop, &findings);
    expect("estop", INSPECT_SKIP, "unreadable", "no chip");
    inspect_unopened("can0", true, EAFNOSUPPORT, &findings);
    expect("interface", INSPECT_SKIP, "no CAN sockets", "modprobe can_raw");
    inspect_begin(&findings);
    inspect_estop(&estop, &findings);
    inspect_unopened("can0", true, EAFNOSUPPORT, &findings);
    TEST_ASSERT_EQUAL_UINT(2U, findings.total[INSPECT_FAIL]);
    TEST_ASSERT_EQUAL_STRING("skip", inspect_verdict_word(INSPECT_SKIP));
}

TEST(test_inspect_correct_link_has_no_finding) {
    const iwl_bus_link_t link = {.presence = IWL_LINK_UP,
                                 .echo_proven = true,
                                 .bitrate_hz = 1000000,
                                 .sample_point_permille = 625,
                                 .restart_ms = 100,
                                 .queue_length = 4};
    inspect_link(&link, &config, &findings);
    TEST_ASSERT_EQUAL_UINT(2U, findings.count);
    expect("bit_timing", INSPECT_OK, "1000000 bit/s, sample point 62.5 %", "");
}

TEST(test_inspect_each_fault_of_the_link_names_its_command) {
    const iwl_bus_link_t link = {.presence = IWL_LINK_UP,
                                 .is_mute = true,
                                 .bitrate_hz = 500000,
                                 .sample_point_permille = 875,
                                 .queue_length = 10};
    inspect_link(&link, &config, &findings);
    expect("mode", INSPECT_FAIL, "listen-only", "type can listen-only off");
    expect("bit_timing", INSPECT_FAIL, "500000 bit/s, sample point 87.5 %; wanted 1000000 bit/s, 62.5 %",
           "type can bitrate 1000000 sample-point 0.625 restart-ms 100; ip link set can0 txqueuelen 4");
    expect("queue", INSPECT_WARN, "10 frames", "ip link set can0 txqueuelen 4");
    expect("restart", INSPECT_WARN, "bus-off", "restart-ms 100");
    expect("echo", INSPECT_WARN, "unproven", "IFF_ECHO");
}

TEST(test_inspect_granted_buffer_is_reported) {
    const iwl_bus_link_t link = {.presence = IWL_LINK_UP, .room_bytes = 2U * IWL_LINK_ROOM_BYTES};
    inspect_room(&link, &findings);
    expect("room", INSPECT_OK, "4096 of 4096 KiB granted, 512 ms of a full bus", "");
}

TEST(test_inspect_buffer_not_granted_names_its_command) {
    const iwl_bus_link_t link = {.presence = IWL_LINK_UP, .room_bytes = 425984U};
    inspect_room(&link, &findings);
    expect("room", INSPECT_WARN, "208 of 4096 KiB granted, 26 ms of a full bus; if other",
           "sudo sysctl net.core.rmem_max=4194304");
}

TEST(test_inspect_unknown_buffer_is_not_judged) {
    const iwl_bus_link_t hub = {.presence = IWL_LINK_LOCAL, .room_bytes = 425984U};
    const iwl_bus_link_t unknown = {.presence = IWL_LINK_UP};
    inspect_room(&hub, &findings);
    inspect_room(&unknown, &findings);
    TEST_ASSERT_EQUAL_UINT(0U, findings.count);
}

TEST(test_inspect_wrong_timing_warns_only_where_configured) {
    const iwl_bus_link_t link = {.presence = IWL_LINK_UP, .echo_proven = true, .bitrate_hz = 500000, .restart_ms = 1};
    inspect_config_t lenient = config;
    lenient.refuses = false;
    inspect_link(&link, &lenient, &findings);
    expect("bit_timing", INSPECT_WARN, "500000", "bitrate 1000000");
}

TEST(test_inspect_absent_and_foreign_interfaces_differ) {
    iwl_bus_link_t link = {.presence = IWL_LINK_ABSENT};
    inspect_link(&link, &config, &findings);
    expect("interface", INSPECT_FAIL, "no such interface", "ip -brief link show type can");
    TEST_ASSERT_EQUAL_UINT(1U, findings.count);
    inspect_begin(&findings);
    link.presence = IWL_LINK_NOT_CAN;
    inspect_link(&link, &config, &findings);
    expect("interface", INSPECT_FAIL, "not a CAN interface", "ip -brief");
    inspect_begin(&findings);
    link.presence = IWL_LINK_DOWN;
    link.is_virtual = true;
    inspect_link(&link, &config, &findings);
    expect("interface", INSPECT_FAIL, "is down", "ip link set can0 up");
}

TEST(test_inspect_estop_levels_have_their_verdicts) {
    inspect_estop_t estop = {.line = "ESTOP", .present = true, .level = -1, .trouble = "gpioinfo lists them"};
    inspect_estop(&estop, &findings);
    expect("estop", INSPECT_FAIL, "unreadable, which counts as pressed", "gpioinfo");
    inspect_begin(&findings);
    estop.level = 1;
    inspect_estop(&estop, &findings);
    expect("estop", INSPECT_OK, "ESTOP: pressed", "");
    inspect_begin(&findings);
    estop = (inspect_estop_t){.line = "unix:/b", .present = true, .simulated = true};
    inspect_estop(&estop, &findings);
    expect("estop", INSPECT_WARN, "released, SIMULATED", "wire a button");
    inspect_begin(&findings);
    inspect_begin(&findings);
    estop = (inspect_estop_t){.line = "ESTOP", .present = true, .level = 1, .pressed_at = "line2"};
    inspect_estop(&estop, &findings);
    expect("estop", INSPECT_OK, "ESTOP: pressed at line2", "");
    inspect_begin(&findings);
    estop.level = IW_ESTOP_DISAGREES;
    inspect_estop(&estop, &findings);
    expect("estop", INSPECT_FAIL, "two contacts disagree, pressed at line2", "press and release the button");
    inspect_begin(&findings);
    estop = (inspect_estop_t){.line = "ESTOP", .present = true, .pressed_at = "neither"};
    inspect_estop(&estop, &findings);
    expect("estop", INSPECT_OK, "ESTOP: released", "");
    inspect_begin(&findings);
    inspect_unopened("gpiochip0:4", false, ENOTUNIQ, &findings);
    expect("estop", INSPECT_FAIL, "line and line2 are the same line", "line2 = none");
    inspect_begin(&findings);
    estop = (inspect_estop_t){.line = "none"};
    inspect_estop(&estop, &findings);
    expect("estop", INSPECT_WARN, "none", "[estop] line");
}

TEST(test_inspect_full_list_counts_further_failures) {
    for (unsigned i = 0; i < INSPECT_FINDINGS_MAX + 3U; i++) {
        inspect_add(&findings, "rates", INSPECT_FAIL, "%u", i);
        inspect_fix(&findings, "fix %u", i);
    }
    TEST_ASSERT_EQUAL_UINT(INSPECT_FINDINGS_MAX, findings.count);
    TEST_ASSERT_EQUAL_UINT(INSPECT_FINDINGS_MAX + 3U, findings.total[INSPECT_FAIL]);
    TEST_ASSERT_EQUAL_STRING("fix 39", findings.finding[INSPECT_FINDINGS_MAX - 1U].fix);
}
