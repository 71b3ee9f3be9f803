// SPDX-License-Identifier: MIT
// Output of the ROS bridge for a snapshot: odometry with its uncertainty, diagnostics, state.
#include "diagnosis.h"
#include "odometry.h"

#include "unit.h"

#include <math.h>
#include <stdio.h>
#include <string.h>

#define SECOND INT64_C(1000000)
#define TRACK  540

static ros_odometry_t odometry;
static ros_facts_t facts;
static ros_status_t status;

void setUp(void) {
    memset(&odometry, 0, sizeof odometry);
    memset(&facts, 0, sizeof facts);
    facts.link = ROS_LINK_UP;
    facts.drive = true;
    facts.machine.now.machine = IWC_LISTENING;
    facts.machine.lease_ms = 200;
    facts.machine.now.left.heard = true;
    facts.machine.now.right.heard = true;
    facts.machine.estop_tried = true;
    (void)snprintf(facts.machine.estop, sizeof facts.machine.estop, "released");
    (void)snprintf(facts.machine.bus, sizeof facts.machine.bus, "active");
    (void)snprintf(facts.machine.timing, sizeof facts.machine.timing, "confirmed");
}

static void go(int64_t t_us, int64_t left_mm, int64_t right_mm) {
    const ros_ways_t ways = {t_us, left_mm, right_mm};
    ros_odometry_step(&odometry, &ways, &(ros_measures_t){.tick_m = 0.0201, .track_m = TRACK / 1000.0});
}

/// The macro of Unity may be built without doubles.
static void expect_near(double within, double expected, double actual) {
    char words[80];
    (void)snprintf(words, sizeof words, "%g expected, not %g", expected, actual);
    TEST_ASSERT_TRUE_MESSAGE(fabs(actual - expected) <= within, words);
}

// ---- odometry -----------------------------------------------------------------------------------------------------

TEST(test_odometry_first_distances_are_the_origin) {
    go(0, 123456, -98765);
    TEST_ASSERT_TRUE(odometry.begun);
    expect_near(1e-12, 0.0, odometry.x_m);
    expect_near(1e-12, 0.0, odometry.yaw_rad);
    TEST_ASSERT_EQUAL_UINT(0, odometry.restarts);
}

TEST(test_odometry_straight_path_is_x) {
    for (int i = 0; i <= 100; i++) {
        go(i * SECOND / 50, 10 * i, 10 * i);
    }
    expect_near(1e-9, 1.0, odometry.x_m);
    expect_near(1e-9, 0.0, odometry.y_m);
    expect_near(1e-9, 1.0, odometry.path_m);
}

TEST(test_odometry_turn_to_the_left_is_positive_without_drift) {
    for (int i = 0; i <= 1000; i++) {
        go(i * SECOND / 50, -17 * i / 10, 17 * i / 10);
    }
    expect_near(1e-9, 3400.0 / TRACK, odometry.yaw_rad);
    expect_near(0.01, 0.0, odometry.x_m);
}

TEST(test_odometry_quarter_circle_has_the_exact_pose) {
    const double radius_mm = 1000.0;
    for (int i = 0; i <= 1000; i++) {
        const double angle = M_PI / 2.0 * i / 1000.0;
        go(i * SECOND / 50, lround(angle * (radius_mm - TRACK / 2.0)), lround(angle * (radius_mm + TRACK / 2.0)));
    }
    expect_near(0.004, 1.0, odometry.x_m);
    expect_near(0.004, 1.0, odometry.y_m);
    expect_near(0.003, M_PI / 2.0, odometry.yaw_rad);
}

TEST(test_odometry_lost_messages_lose_no_distance) {
    go(0, 0, 0);
    go(2 * SECOND, 1900, 1900);
    expect_near(1e-9, 1.9, odometry.x_m);
    TEST_ASSERT_EQUAL_UINT(0, odometry.restarts);
}

TEST(test_odometry_jump_of_a_distance_restarts_at_the_origin) {
    go(0, 0, 0);
    go(SECOND, 900, 900);
    go(SECOND + 20000, 0, 900);
    TEST_ASSERT_EQUAL_UINT(1, odometry.restarts);
    expect_near(1e-12, 0.0, odometry.x_m);
    go(SECOND + 40000, 10, 910);
    expect_near(1e-9, 0.01, odometry.x_m);
    TEST_ASSERT_EQUAL_UINT(1, odometry.restarts);
}

TEST(test_doubt_grows_with_the_path_and_less_if_confirmed) {
    const ros_measures_t assumed = {false, false, 0.02, 0.54};
    const ros_measures_t confirmed = {true, true, 0.02, 0.54};
    go(0, 0, 0);
    const ros_doubt_t at_start = ros_odometry_doubt(&odometry, &assumed, 0, 0);
    for (int i = 1; i <= 100; i++) {
        go(i * SECOND / 20, 40 * i, 42 * i);
    }
    const ros_doubt_t later = ros_odometry_doubt(&odometry, &assumed, 0.8, 0.1);
    const ros_doubt_t better = ros_odometry_doubt(&odometry, &confirmed, 0.8, 0.1);
    expect_near(1e-9, 0.29 * 0.02, at_start.x_m);
    TEST_ASSERT_TRUE(later.x_m > 4.1 * 0.0447 && later.yaw_rad > at_start.yaw_rad);
    TEST_ASSERT_TRUE(better.x_m < later.x_m && better.yaw_rad < later.yaw_rad && better.v_m_s < later.v_m_s);
    TEST_ASSERT_TRUE(better.x_m > 4.1 * 0.0223); // The share of slip stays.
}

/// Whole ticks, with the two wheels half a tick apart, for 4.7 m at 0.5 m/s.
TEST(test_doubt_on_a_straight_path_ignores_tick_jitter) {
    const ros_measures_t assumed = {false, false, 0.0201, TRACK / 1000.0};
    for (int i = 0; i <= 470; i++) {
        const double way_mm = 10.0 * i;
        go(i * SECOND / 50, lround(floor(way_mm / 20.1) * 20.1), lround(floor(way_mm / 20.1 + 0.5) * 20.1));
    }
    const ros_doubt_t doubt = ros_odometry_doubt(&odometry, &assumed, 0.5, 0.0);
    TEST_ASSERT_TRUE(doubt.yaw_rad < 0.03);
    TEST_ASSERT_TRUE(doubt.x_m > 4.7 * 0.0447 && doubt.x_m < 4.7 * 0.05);
}

/// The growth on each metre of a straight path of 50 m is at most 5 % of it. A turn on the spot makes the heading
/// uncertain, not the position.
TEST(test_doubt_grows_by_5_percent_of_a_straight_path) {
    const ros_measures_t assumed = {false, false, 0.0201, TRACK / 1000.0};
    double place_m = 0.0;
    double yaw_rad = 0.0;
    go(0, 0, 0);
    for (int m = 1; m <= 50; m++) {
        for (int i = 1; i <= 50; i++) {
            const int64_t way_mm = 1000 * (m - 1) + 20 * i;
            go((int64_t)m * SECOND + i * SECOND / 50, way_mm, way_mm);
        }
        const ros_doubt_t doubt = ros_odometry_doubt(&odometry, &assumed, 1.0, 0.0);
        TEST_ASSERT_TRUE(doubt.x_m > place_m && doubt.x_m <= 0.05 * m && doubt.y_m <= 0.05 * m);
        TEST_ASSERT_TRUE(doubt.yaw_rad > yaw_rad && doubt.yaw_rad < 0.05);
        place_m = doubt.x_m;
        yaw_rad = doubt.yaw_rad;
    }
}

TEST(test_doubt_of_the_heading_grows_by_turning_up_to_pi) {
    const ros_measures_t assumed = {false, false, 0.0201, TRACK / 1000.0};
    double before_rad = 0.0;
    for (int i = 0; i <= 4000; i++) {
        go(i * SECOND / 50, -20 * i, 20 * i);
        const ros_doubt_t doubt = ros_odometry_doubt(&odometry, &assumed, 0.0, 1.0);
        TEST_ASSERT_TRUE(doubt.yaw_rad >= before_rad && doubt.yaw_rad <= M_PI);
        before_rad = doubt.yaw_rad;
    }
    expect_near(1e-9, M_PI, before_rad);
}

// ---- a snapshot ---------------------------------------------------------------------------------------------------

static const char SNAPSHOT[] =
    "{\"event\":\"state\",\"t_us\":5,\"wall_us\":1760000000000007,\"state\":\"armed\",\"cause\":null,"
    "\"lease\":{\"holder\":4,\"name\":\"joy\\\"stick\",\"remaining_ms\":9,\"lease_ms\":300},"
    "\"bus\":{\"state\":\"passive\",\"timing\":\"near\"},\"estop\":{\"state\":\"none\"},"
    "\"left\":{\"heard\":true,\"distance_mm\":-7},\"right\":{\"heard\":false,\"distance_mm\":null},"
    "\"ledger\":{\"wheel_radius\":{\"state\":\"confirmed\",\"value\":\"200\"},"
    "\"track\":{\"state\":\"contradicted\",\"value\":\"600\",\"reason\":\"turned too far\",\"disabled\":\"no twist\"},"
    "\"gear_ratio\":{\"state\":\"assumed\",\"value\":\"5/2, rpm of the rotor\"},"
    "\"current_role\":{\"state\":\"assumed\",\"value\":\"setpoint\"}}}";

static iwc_message_t snapshot(void) {
    return (iwc_message_t){.text = SNAPSHOT, .length = sizeof SNAPSHOT - 1U, .is_event = true};
}

TEST(test_snapshot_is_read_and_unknown_stays_unknown) {
    iwc_t *gateway = iwc_new();
    const iwc_message_t message = snapshot();
    TEST_ASSERT_TRUE(ros_facts_read(gateway, &message, &facts.machine));
    TEST_ASSERT_EQUAL_INT64(1760000000000007, facts.machine.wall_us);
    TEST_ASSERT_EQUAL_INT64(300, facts.machine.lease_ms);
    TEST_ASSERT_EQUAL_STRING("none", facts.machine.estop);
    TEST_ASSERT_EQUAL_STRING("joy\"stick", facts.machine.holder);
    TEST_ASSERT_TRUE(facts.machine.now.left.distance_mm.known);
    TEST_ASSERT_FALSE(facts.machine.now.right.distance_mm.known);
    const iwc_message_t other = {.text = "{\"event\":\"bus\"}", .length = 15, .is_event = true};
    TEST_ASSERT_FALSE(ros_facts_read(gateway, &other, &facts.machine));
    iwc_free(gateway);
}

TEST(test_snapshot_assumptions_set_measures_and_contradiction) {
    const iwc_message_t message = snapshot();
    ros_facts_read_assumptions(&message, &facts.machine);
    TEST_ASSERT_EQUAL_INT64(200, facts.machine.radius_mm);
    TEST_ASSERT_EQUAL_INT64(600, facts.machine.track_mm);
    TEST_ASSERT_TRUE(facts.machine.measures.radius_confirmed);
    TEST_ASSERT_FALSE(facts.machine.measures.track_confirmed);
    expect_near(1e-9, 2.0 * M_PI * 0.2 / 60.0 / 2.5, facts.machine.measures.tick_m);
    TEST_ASSERT_EQUAL_STRING("track: turned too far; no twist", facts.machine.contradicted);
    TEST_ASSERT_EQUAL_UINT(2, facts.machine.assumed);
    TEST_ASSERT_TRUE(facts.machine.setpoint_current);
}

TEST(test_snapshot_assumptions_unchanged_are_read_once) {
    static const char other[] = "{\"event\":\"state\",\"ledger\":{\"track\":{\"value\":\"610\"}}}";
    static const char longer[] = "{\"event\":\"state\",\"ledger\":{\"track\":{\"value\":\"%s\"},\"%*s\":0}}";
    static char text[ROS_ASSUMPTIONS_SIZE + 128U];
    const iwc_message_t first = snapshot();
    const iwc_message_t second = {.text = other, .length = sizeof other - 1U, .is_event = true};
    const iwc_message_t empty = {.text = "{}", .length = 2};
    ros_facts_read_assumptions(&first, &facts.machine);
    facts.machine.track_mm = 1;
    ros_facts_read_assumptions(&first, &facts.machine);
    TEST_ASSERT_EQUAL_INT64(1, facts.machine.track_mm);
    ros_facts_read_assumptions(&second, &facts.machine);
    TEST_ASSERT_EQUAL_INT64(610, facts.machine.track_mm);
    ros_facts_read_assumptions(&first, &facts.machine);
    TEST_ASSERT_EQUAL_INT64(600, facts.machine.track_mm);
    facts.machine.track_mm = 1;
    ros_facts_read_config(&empty, &facts.machine); // The configuration may have other values now.
    ros_facts_read_assumptions(&first, &facts.machine);
    TEST_ASSERT_EQUAL_INT64(600, facts.machine.track_mm);
    for (unsigned i = 0; i < 2U; i++) { // Too long to be stored.
        const int length =
            snprintf(text, sizeof text, longer, (i == 0U) ? "620" : "630", (int)ROS_ASSUMPTIONS_SIZE, "");
        const iwc_message_t seen = {.text = text, .length = (size_t)length, .is_event = true};
        ros_facts_read_assumptions(&seen, &facts.machine);
        TEST_ASSERT_EQUAL_INT64((i == 0U) ? 620 : 630, facts.machine.track_mm);
    }
}

/// An invented track would turn the machine on every map.
TEST(test_snapshot_track_not_configured_is_none) {
    static const char unset[] =
        "{\"event\":\"state\",\"ledger\":{\"wheel_radius\":{\"value\":\"192\"},\"track\":{\"value\":null}}}";
    const iwc_message_t seen = {.text = unset, .length = sizeof unset - 1U, .is_event = true};
    ros_facts_read_assumptions(&seen, &facts.machine);
    TEST_ASSERT_EQUAL_INT64(192, facts.machine.radius_mm);
    TEST_ASSERT_EQUAL_INT64(0, facts.machine.track_mm);
}

TEST(test_configuration_replaces_values_missing_on_a_board) {
    static const char board[] =
        "{\"event\":\"state\",\"ledger\":{\"wheel_radius\":{\"state\":\"assumed\",\"value\":null},"
        "\"track\":{\"state\":\"confirmed\",\"value\":null},\"gear_ratio\":{\"value\":null}}}";
    static const char config[] =
        "{\"ok\":true,\"keys\":[{\"key\":\"wheels.current_role\",\"value\":\"setpoint\"},{\"key\":\"wheels.radius_mm\","
        "\"value\":\"150\"},{\"key\":\"wheels.gear_ratio\",\"value\":\"5/"
        "2\"},{\"key\":\"wheels.track_mm\",\"value\":\"610\"}],"
        "\"staged\":false}";
    const iwc_message_t seen = {.text = board, .length = sizeof board - 1U, .is_event = true};
    const iwc_message_t reply = {.text = config, .length = sizeof config - 1U};
    const iwc_message_t whole = snapshot();
    TEST_ASSERT_TRUE(ros_facts_lack_values(&seen));
    TEST_ASSERT_FALSE(ros_facts_lack_values(&whole));
    ros_facts_read_config(&reply, &facts.machine);
    ros_facts_read_assumptions(&seen, &facts.machine);
    TEST_ASSERT_EQUAL_INT64(150, facts.machine.radius_mm);
    TEST_ASSERT_EQUAL_INT64(610, facts.machine.track_mm);
    TEST_ASSERT_TRUE(facts.machine.setpoint_current && facts.machine.measures.track_confirmed);
    expect_near(1e-9, 2.0 * M_PI * 0.15 / 60.0 / 2.5, facts.machine.measures.tick_m);
    const iwc_message_t cut = {.text = config, .length = 60};
    ros_facts_read_config(&cut, &facts.machine); // The reply is no valid JSON: the known values stay.
    ros_facts_read_assumptions(&whole, &facts.machine);
    TEST_ASSERT_EQUAL_INT64(200, facts.machine.radius_mm);
}

// ---- diagnostics --------------------------------------------------------------------------------------------------

static void expect(ros_report_t which, ros_level_t level, const char *part) {
    ros_diagnose(&facts, which, &status);
    TEST_ASSERT_EQUAL_MESSAGE(level, status.level, status.message);
    if (strstr(status.message, part) == NULL) {
        TEST_FAIL_MESSAGE(status.message);
    }
}

TEST(test_diagnosis_button_never_pressed_is_a_warning) {
    facts.machine.estop_tried = false;
    expect(ROS_REPORT_ESTOP, ROS_WARN, "never tried on this wiring");
    facts.machine.estop_simulated = true;
    expect(ROS_REPORT_ESTOP, ROS_OK, "released");
}

TEST(test_diagnosis_without_a_fault_is_ok) {
    for (unsigned i = 0; i < ROS_REPORTS; i++) {
        ros_diagnose(&facts, (ros_report_t)i, &status);
        TEST_ASSERT_EQUAL_MESSAGE(ROS_OK, status.level, status.message);
        TEST_ASSERT_TRUE(strlen(status.message) > 5U && strlen(status.name) > 2U);
    }
    expect(ROS_REPORT_COMMANDS, ROS_OK, "15 Hz");
}

TEST(test_diagnosis_gateway_offline_is_an_error_others_stale) {
    facts.link = ROS_LINK_GONE;
    (void)snprintf(facts.trouble, sizeof facts.trouble, "no program listens");
    expect(ROS_REPORT_GATEWAY, ROS_ERROR, "no program listens");
    expect(ROS_REPORT_LEFT, ROS_STALE, "gone");
    facts.link = ROS_LINK_SILENT;
    expect(ROS_REPORT_GATEWAY, ROS_ERROR, "does not answer");
    expect(ROS_REPORT_ESTOP, ROS_STALE, "does not answer");
}

TEST(test_diagnosis_each_stop_has_its_sentence_and_fix) {
    facts.machine.now.machine = IWC_LATCHED;
    (void)snprintf(facts.machine.stop, sizeof facts.machine.stop, "the left wheel was lost");
    expect(ROS_REPORT_GATEWAY, ROS_ERROR, "the left wheel was lost; remove the cause, reset");
    facts.machine.rolling = true;
    expect(ROS_REPORT_GATEWAY, ROS_ERROR,
           "hold the machine, or use its parking brake; stopped and latched: the left wheel was lost");
    facts.machine.rolling = false;
    facts.machine.now.machine = IWC_STOPPING;
    expect(ROS_REPORT_GATEWAY, ROS_WARN, "stopping: the left wheel was lost");
    facts.machine.holding = true;
    expect(ROS_REPORT_GATEWAY, ROS_WARN,
           "holding: zeros until iwheelctl release or arm; use the parking brake; the stop: "
           "the left wheel was lost");
    facts.machine.holding = false;
    facts.machine.now.machine = IWC_LISTENING;
    facts.machine.rolling = true;
    expect(ROS_REPORT_GATEWAY, ROS_WARN,
           "a wheel turns although the gateway sends nothing to it: hold the machine, or use its parking brake");
    facts.machine.rolling = false;
    (void)snprintf(facts.machine.estop, sizeof facts.machine.estop, "pressed");
    expect(ROS_REPORT_ESTOP, ROS_ERROR, "release the button");
    (void)snprintf(facts.machine.pressed_at, sizeof facts.machine.pressed_at, "both");
    expect(ROS_REPORT_ESTOP, ROS_ERROR, "the e-stop is pressed: release the button");
    (void)snprintf(facts.machine.pressed_at, sizeof facts.machine.pressed_at, "line2");
    expect(ROS_REPORT_ESTOP, ROS_ERROR, "pressed at its contact line2: release the button");
    (void)snprintf(facts.machine.estop, sizeof facts.machine.estop, "disagrees");
    expect(ROS_REPORT_ESTOP, ROS_ERROR, "two contacts disagree, pressed at line2");
    (void)snprintf(facts.machine.estop, sizeof facts.machine.estop, "unreadable");
    expect(ROS_REPORT_ESTOP, ROS_ERROR, "check its wire");
    (void)snprintf(facts.machine.bus, sizeof facts.machine.bus, "down");
    expect(ROS_REPORT_BUS, ROS_ERROR, "arm again");
    (void)snprintf(facts.machine.bus, sizeof facts.machine.bus, "bus_off");
    expect(ROS_REPORT_BUS, ROS_ERROR, "arm again");
    (void)snprintf(facts.machine.timing, sizeof facts.machine.timing, "contradicted");
    expect(ROS_REPORT_TIMING, ROS_ERROR, "62.5 %");
    facts.machine.now.right.heard = false;
    expect(ROS_REPORT_RIGHT, ROS_ERROR, "power and cable");
    (void)snprintf(facts.machine.contradicted, sizeof facts.machine.contradicted, "track: no");
    expect(ROS_REPORTS_ASSUMPTIONS, ROS_ERROR, "track: no");
}

TEST(test_diagnosis_commands_report_why_they_do_not_drive) {
    facts.commands.late = 3;
    expect(ROS_REPORT_COMMANDS, ROS_WARN, "3 commands came too late");
    (void)snprintf(facts.commands.refusal, sizeof facts.commands.refusal, "arm first");
    facts.commands.coming = true;
    expect(ROS_REPORT_COMMANDS, ROS_WARN, "refused: arm first");
    facts.commands.unusable = true;
    facts.commands.bad = 7;
    expect(ROS_REPORT_COMMANDS, ROS_WARN,
           "no usable numbers (NaN, infinity, or 32 m/s or rad/s and more): dropped, 7 so far");
    facts.commands.coming = false;
    expect(ROS_REPORT_COMMANDS, ROS_WARN, "3 commands came too late, 7 had no usable numbers");
    facts.commands.coming = true;
    facts.commands.unusable = false;
    facts.commands.publishers = 2;
    expect(ROS_REPORT_COMMANDS, ROS_WARN, "twist_mux");
    facts.machine.setpoint_current = true;
    expect(ROS_REPORT_COMMANDS, ROS_WARN, "carries no current");
    facts.drive = false;
    expect(ROS_REPORT_COMMANDS, ROS_OK, "watching only");
}

TEST(test_diagnosis_unmatched_publisher_is_named_with_the_fix) {
    ros_unmatched_t *unmatched = &facts.commands.unmatched;
    *unmatched =
        (ros_unmatched_t){.count = 1, .topic = "/w1/cmd_vel", .policy = "", .wanted = "geometry_msgs/msg/Twist"};
    ros_facts_type_name("ackermann_msgs::msg::dds_::AckermannDrive_", unmatched->type, sizeof unmatched->type);
    expect(ROS_REPORT_COMMANDS, ROS_WARN,
           "1 publishers of /w1/cmd_vel are not received: one sends ackermann_msgs/msg/AckermannDrive; publish "
           "geometry_msgs/msg/Twist, or set [drive] command = both");
    unmatched->policy = "partition";
    expect(ROS_REPORT_COMMANDS, ROS_WARN,
           "the QoS policy partition of a publisher of ackermann_msgs/msg/AckermannDrive");
    *unmatched = (ros_unmatched_t){.topic = "/cmd_vel", .elsewhere = "/diff_drive/cmd_vel"};
    expect(ROS_REPORT_COMMANDS, ROS_OK, "no publisher of /cmd_vel, but /diff_drive/cmd_vel has one: remap it");
    facts.commands.publishers = 1;
    expect(ROS_REPORT_COMMANDS, ROS_OK, "15 Hz");
}

TEST(test_type_name_from_outside_is_cut_and_escaped) {
    char name[16];
    ros_facts_type_name("a::msg::dds_::B\x07\"_", name, sizeof name);
    TEST_ASSERT_EQUAL_STRING("a/msg/B??", name);
    ros_facts_type_name("abcdefghijklmnopqrstuvwxyz", name, sizeof name);
    TEST_ASSERT_EQUAL_STRING("abcdefghijklmno", name);
    ros_facts_type_name("", name, sizeof name);
    TEST_ASSERT_EQUAL_STRING("", name);
    ros_facts_type_name("/w1/cmd_vel", name, sizeof name);
    TEST_ASSERT_EQUAL_STRING("/w1/cmd_vel", name);
}

static void expect_estop(ros_link_t link, const char *state, ros_estop_t expected) {
    facts.link = link;
    (void)snprintf(facts.machine.estop, sizeof facts.machine.estop, "%s", state);
    TEST_ASSERT_EQUAL_INT_MESSAGE(expected, ros_facts_estop(&facts), state);
}

TEST(test_estop_unreadable_is_pressed_and_none_is_no_line) {
    expect_estop(ROS_LINK_UP, "released", ROS_ESTOP_RELEASED);
    expect_estop(ROS_LINK_UP, "pressed", ROS_ESTOP_PRESSED);
    expect_estop(ROS_LINK_UP, "unreadable", ROS_ESTOP_PRESSED);
    expect_estop(ROS_LINK_UP, "disagrees", ROS_ESTOP_PRESSED);
    expect_estop(ROS_LINK_UP, "none", ROS_ESTOP_NO_LINE);
    expect_estop(ROS_LINK_UP, "", ROS_ESTOP_NO_LINE);
    expect_estop(ROS_LINK_SILENT, "released", ROS_ESTOP_PRESSED);
    expect_estop(ROS_LINK_GONE, "released", ROS_ESTOP_PRESSED);
    expect_estop(ROS_LINK_GONE, "none", ROS_ESTOP_NO_LINE);
}

TEST(test_diagnosis_unknown_values_are_empty) {
    ros_diagnose(&facts, ROS_REPORT_LEFT, &status);
    TEST_ASSERT_EQUAL_STRING("speed_mm_s", status.values[0].key);
    TEST_ASSERT_EQUAL_STRING("", status.values[0].text);
}

// ---- iwheel/state -------------------------------------------------------------------------------------------------

TEST(test_state_texts_from_outside_are_escaped) {
    char json[2048];
    facts.machine.now.holder.known = true;
    (void)snprintf(facts.machine.holder, sizeof facts.machine.holder, "a\"b\\\\u0007");
    (void)snprintf(facts.machine.stop, sizeof facts.machine.stop, "\"x\" stopped");
    ros_state_json(&facts, json, sizeof json);
    TEST_ASSERT_NOT_NULL(strstr(json, "\"holder\":\"a\\\"b\\\\\\u0007\""));
    TEST_ASSERT_NOT_NULL(strstr(json, "\"last_stop\":\"\\\"x\\\" stopped\"}"));
    TEST_ASSERT_NOT_NULL(strstr(json, "\"cause\":null"));
}

TEST(test_state_gateway_offline_has_no_old_values) {
    char json[2048];
    facts.link = ROS_LINK_GONE;
    ros_state_json(&facts, json, sizeof json);
    TEST_ASSERT_EQUAL_STRING("{\"gateway\":\"gone\"}", json);
}
