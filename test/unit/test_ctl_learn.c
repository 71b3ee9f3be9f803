// SPDX-License-Identifier: MIT
// `learn`: which frames of a recording count for which wheel, time and direction.
#include "learn/learn_drives.h"

#include "message.h"

#include "unit.h"

#include <stdlib.h>

#define MS 1000

static learn_t learn;
static learn_drives_t drives;
static iw_config_t config;
static int64_t now_us;

static void feed_marked(const message_t *message, candump_mark_t mark) {
    iw_can_frame_t frame;
    TEST_ASSERT_EQUAL_INT(IW_OK, message_encode(message, &frame));
    candump_t recorded = candump_from_core(&frame, now_us, "can0");
    recorded.mark = mark;
    learn_frame(&learn, &recorded);
    learn_drives_frame(&drives, &recorded);
}

static void feed(const message_t *message) {
    feed_marked(message, CANDUMP_RECEIVED);
}

static void setpoint(iw_side_t side, int16_t speed_mm_s, int16_t current_mA, candump_mark_t mark) {
    const message_t message = {.kind = IW_CODEC_SETPOINT,
                               .side = side,
                               .as = {.setpoint = {.type = 1, .speed_mm_s = speed_mm_s, .current_mA = current_mA}}};
    feed_marked(&message, mark);
}

static void speed(iw_side_t side, int16_t rpm) {
    feed(&(message_t){.kind = IW_CODEC_SPEED, .side = side, .as = {.speed = {.speed_rpm = rpm}}});
}

static void ticks(iw_side_t side, int32_t odometry) {
    feed(&(message_t){.kind = IW_CODEC_STATUS, .side = side, .as = {.status = {.odometry_ticks = odometry}}});
}

static void force(iw_side_t side, int16_t raw) {
    feed(&(message_t){.kind = IW_CODEC_FORCE, .side = side, .as = {.force = {.force_raw = raw}}});
}

static void pose(int16_t x_mm) {
    feed(&(message_t){.kind = IW_CODEC_POSE, .side = IW_RIGHT, .as = {.pose = {.x_mm = x_mm}}});
}

void setUp(void) {
    now_us = 1700000000000000;
    learn_init(&learn);
    iw_config_default(&config);
    learn_drives_init(&drives, &config);
}

TEST(test_learn_counts_each_wheel_separately) {
    setpoint(IW_RIGHT, 300, 500, CANDUMP_RECEIVED);
    speed(IW_RIGHT, 15);
    ticks(IW_LEFT, 7);
    force(IW_LEFT, -100);
    TEST_ASSERT_EQUAL_UINT64(0, learn.setpoint[IW_LEFT].count);
    TEST_ASSERT_EQUAL_UINT64(1, learn.setpoint[IW_RIGHT].count);
    TEST_ASSERT_EQUAL_INT32(15, learn.wheel[IW_RIGHT].rpm);
    TEST_ASSERT_EQUAL_INT32(0, learn.wheel[IW_LEFT].rpm);
    TEST_ASSERT_EQUAL_INT32(7, learn.wheel[IW_LEFT].last_ticks);
    TEST_ASSERT_EQUAL_UINT64(1, learn.wheel[IW_LEFT].statuses);
    TEST_ASSERT_EQUAL_UINT64(0, learn.wheel[IW_RIGHT].statuses);
    TEST_ASSERT_EQUAL_INT32(-100, learn.wheel[IW_LEFT].force.low);
    TEST_ASSERT_GREATER_THAN_INT32(learn.wheel[IW_RIGHT].force.high, learn.wheel[IW_RIGHT].force.low);
}

TEST(test_learn_separates_currents_by_direction) {
    setpoint(IW_LEFT, 300, 500, CANDUMP_RECEIVED);
    setpoint(IW_LEFT, -300, -700, CANDUMP_RECEIVED);
    setpoint(IW_LEFT, 0, 20, CANDUMP_RECEIVED);
    const learn_setpoint_t *left = &learn.setpoint[IW_LEFT];
    TEST_ASSERT_EQUAL_INT32(500, left->current_forward_mA.low);
    TEST_ASSERT_EQUAL_INT32(500, left->current_forward_mA.high);
    TEST_ASSERT_EQUAL_INT32(-700, left->current_backward_mA.low);
    TEST_ASSERT_EQUAL_INT32(-700, left->current_backward_mA.high);
    TEST_ASSERT_EQUAL_INT32(20, left->current_at_rest_mA.low);
    TEST_ASSERT_EQUAL_INT32(20, left->current_at_rest_mA.high);
}

TEST(test_learn_counts_only_marked_frames_as_sent) {
    setpoint(IW_LEFT, 0, 0, CANDUMP_SENT);
    setpoint(IW_LEFT, 0, 0, CANDUMP_RECEIVED);
    setpoint(IW_LEFT, 0, 0, CANDUMP_UNMARKED);
    TEST_ASSERT_EQUAL_UINT64(3, learn.setpoint[IW_LEFT].count);
    TEST_ASSERT_EQUAL_UINT64(1, learn.setpoint[IW_LEFT].sent);
}

/// Commands this speed to the left wheel for this time, every 4 ms; the wheel reports this rpm.
static void drive(unsigned ms, int16_t speed_mm_s, int16_t rpm) {
    for (unsigned passed = 0; passed < ms; passed += 4U) {
        setpoint(IW_LEFT, speed_mm_s, 500, CANDUMP_RECEIVED);
        now_us += 4 * MS;
        speed(IW_LEFT, rpm);
    }
}

TEST(test_learn_judges_speed_after_one_second_of_setpoints) {
    const learn_wheel_t *left = &learn.wheel[IW_LEFT];
    drive(996, 300, -15);
    TEST_ASSERT_EQUAL_INT64(0, left->forward.against_us);
    TEST_ASSERT_EQUAL_INT64(0, left->steady_us);
    drive(8, 300, 15);
    TEST_ASSERT_EQUAL_INT64(8 * MS, left->forward.with_us);
    TEST_ASSERT_EQUAL_INT64(8 * MS, left->steady_fit_us);
    drive(996, -300, 15);
    TEST_ASSERT_EQUAL_INT64(0, left->backward.against_us);
    TEST_ASSERT_EQUAL_INT64(8 * MS, left->steady_us);
}

TEST(test_learn_separates_answers_by_commanded_direction) {
    const learn_wheel_t *left = &learn.wheel[IW_LEFT];
    drive(996, 300, 15);
    drive(4, 300, -15);
    drive(8, 300, 2);
    drive(996, -300, 15);
    drive(12, -300, 15);
    TEST_ASSERT_EQUAL_INT64(0, left->forward.with_us);
    TEST_ASSERT_EQUAL_INT64(4 * MS, left->forward.against_us);
    TEST_ASSERT_EQUAL_INT64(8 * MS, left->forward.still_us);
    TEST_ASSERT_EQUAL_INT64(0, left->backward.with_us);
    TEST_ASSERT_EQUAL_INT64(12 * MS, left->backward.against_us);
    TEST_ASSERT_EQUAL_INT64(0, left->backward.still_us);
}

TEST(test_learn_judges_no_speed_after_the_setpoints_end) {
    drive(1000, 300, 15);
    TEST_ASSERT_EQUAL_INT64(4 * MS, learn.wheel[IW_LEFT].forward.with_us);
    for (int64_t passed_us = 0; passed_us <= (int64_t)IW_WHEEL_WATCHDOG_US; passed_us += 4 * MS) {
        now_us += 4 * MS;
        speed(IW_LEFT, 15);
    }
    const int64_t judged_us = learn.wheel[IW_LEFT].forward.with_us;
    now_us += 4 * MS;
    speed(IW_LEFT, 15);
    TEST_ASSERT_EQUAL_INT64(judged_us, learn.wheel[IW_LEFT].forward.with_us);
    drive(996, 300, -15); // The wheel had stopped: the second begins again.
    TEST_ASSERT_EQUAL_INT64(0, learn.wheel[IW_LEFT].forward.against_us);
}

/// The left wheel reports this rpm for this time, every 10 ms.
static void turn(unsigned ms, int16_t rpm) {
    for (unsigned passed = 0; passed < ms; passed += 10U) {
        now_us += 10 * MS;
        speed(IW_LEFT, rpm);
    }
}

TEST(test_learn_uses_force_after_500_ms_at_standstill_only) {
    const learn_wheel_t *left = &learn.wheel[IW_LEFT];
    speed(IW_LEFT, 0);
    turn(490, 0);
    now_us += 9 * MS;
    force(IW_LEFT, 900);
    TEST_ASSERT_EQUAL_UINT64(0, left->rest_force_count);
    now_us += 1 * MS;
    force(IW_LEFT, 100);
    TEST_ASSERT_EQUAL_UINT64(1, left->rest_force_count);
    TEST_ASSERT_EQUAL_INT64(100, left->rest_force_sum);
    turn(1000, -30);
    force(IW_LEFT, 900);
    speed(IW_LEFT, 0);
    force(IW_LEFT, 900);
    TEST_ASSERT_EQUAL_UINT64(1, left->rest_force_count);
}

TEST(test_learn_uses_no_force_after_a_gap_of_telemetry) {
    speed(IW_LEFT, 0);
    turn(500, 0);
    now_us += 100 * MS;
    force(IW_LEFT, 900);
    TEST_ASSERT_EQUAL_UINT64(0, learn.wheel[IW_LEFT].rest_force_count);
    turn(500, 0); // The wheel may have turned during the gap.
    force(IW_LEFT, 900);
    TEST_ASSERT_EQUAL_UINT64(0, learn.wheel[IW_LEFT].rest_force_count);
    turn(10, 0);
    force(IW_LEFT, 100);
    TEST_ASSERT_EQUAL_UINT64(1, learn.wheel[IW_LEFT].rest_force_count);
    TEST_ASSERT_EQUAL_UINT64(3, learn.wheel[IW_LEFT].forces);
}

TEST(test_learn_turns_and_ticks_exclude_gaps_and_reboots) {
    const learn_wheel_t *left = &learn.wheel[IW_LEFT];
    speed(IW_LEFT, 60);
    ticks(IW_LEFT, 1000);
    turn(50, 60);
    ticks(IW_LEFT, 1050);
    TEST_ASSERT_EQUAL_UINT64(50, left->ticks);
    TEST_ASSERT_EQUAL_INT64(3000 * MS, left->turned_rpm_us);
    now_us += 60000 * MS; // Pause of the recording
    speed(IW_LEFT, 60);
    ticks(IW_LEFT, 1060);
    TEST_ASSERT_EQUAL_UINT64(50, left->ticks);
    TEST_ASSERT_EQUAL_INT64(3000 * MS, left->turned_rpm_us);
    turn(50, 60);
    ticks(IW_LEFT, -500000); // The wheel restarted.
    TEST_ASSERT_EQUAL_UINT64(50, left->ticks);
    TEST_ASSERT_EQUAL_INT64(3000 * MS, left->turned_rpm_us);
    turn(50, 60);
    ticks(IW_LEFT, -500010);
    TEST_ASSERT_EQUAL_UINT64(60, left->ticks);
    TEST_ASSERT_EQUAL_INT64(6000 * MS, left->turned_rpm_us);
}

TEST(test_learn_turns_and_ticks_exclude_slow_or_reversing_wheel) {
    const learn_wheel_t *left = &learn.wheel[IW_LEFT];
    speed(IW_LEFT, 60);
    ticks(IW_LEFT, 1000);
    turn(10, 9);
    turn(40, 60);
    ticks(IW_LEFT, 1050);
    TEST_ASSERT_EQUAL_UINT64(0, left->ticks);
    turn(50, -60);
    ticks(IW_LEFT, 1040);
    TEST_ASSERT_EQUAL_UINT64(0, left->ticks);
    TEST_ASSERT_EQUAL_INT64(0, left->turned_rpm_us);
    turn(50, -60);
    ticks(IW_LEFT, 990);
    TEST_ASSERT_EQUAL_UINT64(50, left->ticks);
    TEST_ASSERT_EQUAL_INT64(3000 * MS, left->turned_rpm_us);
}

TEST(test_learn_pose_may_wrap) {
    pose(INT16_MAX - 1);
    pose(INT16_MIN + 1);
    TEST_ASSERT_EQUAL_UINT64(3, learn.pose.way_big);
    pose(INT16_MAX - 1);
    TEST_ASSERT_EQUAL_UINT64(6, learn.pose.way_big);
    TEST_ASSERT_GREATER_THAN_UINT64(100, learn.pose.way_little);
}

// Deviation of a drive from its path ----------------------------------------------------------------------------------

/// Commands these speeds to both wheels and reports these rpm, every 4 ms.
static void drive_both(unsigned ms, const int16_t commanded_mm_s[IW_SIDES], const int16_t rpm[IW_SIDES]) {
    for (unsigned passed = 0; passed < ms; passed += 4U) {
        setpoint(IW_LEFT, commanded_mm_s[IW_LEFT], 500, CANDUMP_RECEIVED);
        setpoint(IW_RIGHT, commanded_mm_s[IW_RIGHT], 500, CANDUMP_RECEIVED);
        now_us += 4 * MS;
        speed(IW_LEFT, rpm[IW_LEFT]);
        speed(IW_RIGHT, rpm[IW_RIGHT]);
    }
}

static const int16_t still[IW_SIDES] = {0, 0};
static const int16_t straight[IW_SIDES] = {1005, 1005}; // 50 rpm
static const int16_t level[IW_SIDES] = {50, 50};

TEST(test_learn_drive_on_its_path_has_no_deviation) {
    drive_both(100, still, still);
    const int64_t begin_us = now_us;
    drive_both(2000, straight, level);
    drive_both(1500, still, still);
    TEST_ASSERT_EQUAL_UINT32(1, drives.count);
    TEST_ASSERT_EQUAL_INT64(begin_us, drives.drive[0].begin_us);
    TEST_ASSERT_EQUAL_INT64(begin_us + 1996 * MS, drives.drive[0].end_us);
    TEST_ASSERT_INT64_WITHIN(8 * MS, 3000 * MS, drives.drive[0].judged_us);
    TEST_ASSERT_LESS_THAN_UINT32(2, drives.drive[0].deviation_mm);
}

/// A fifth of the speed is missing; 4 % of it and 7/8 of an rpm are tolerated: 142 mm/s too slow for 0.3 s, of which a
/// part leaks.
TEST(test_learn_deviation_equals_the_one_of_the_gateway) {
    drive_both(1000, straight, level);
    drive_both(300, straight, (const int16_t[IW_SIDES]){40, 50});
    TEST_ASSERT_UINT32_WITHIN(3, 38, drives.drive[0].deviation_mm);
    drive_both(3000, straight, level);
    TEST_ASSERT_UINT32_WITHIN(3, 38, drives.drive[0].deviation_mm); // The largest value stays.
    TEST_ASSERT_EQUAL_UINT32(drives.drive[0].deviation_mm, drives.largest_mm);
}

TEST(test_learn_each_drive_has_its_own_deviation) {
    drive_both(1000, straight, level);
    drive_both(300, straight, (const int16_t[IW_SIDES]){40, 50});
    drive_both(300, straight, level);
    drive_both(1100, still, still);
    drive_both(1000, straight, level);
    TEST_ASSERT_EQUAL_UINT32(2, drives.count);
    TEST_ASSERT_UINT32_WITHIN(3, 38, drives.drive[0].deviation_mm);
    TEST_ASSERT_LESS_THAN_UINT32(2, drives.drive[1].deviation_mm);
}

TEST(test_learn_drive_ends_with_silence_not_with_500_ms_at_zero) {
    drive_both(500, straight, level);
    drive_both(500, still, still);
    drive_both(500, straight, level);
    TEST_ASSERT_EQUAL_UINT32(1, drives.count);
    now_us += 1100 * MS; // The wheels have stopped on their own.
    drive_both(500, straight, level);
    TEST_ASSERT_EQUAL_UINT32(2, drives.count);
}

TEST(test_learn_compares_nothing_while_a_wheel_is_offline) {
    drive_both(1000, straight, level);
    for (unsigned i = 0; i < 100U; i++) { // The left wheel is at standstill and offline.
        setpoint(IW_LEFT, 1005, 500, CANDUMP_RECEIVED);
        setpoint(IW_RIGHT, 1005, 500, CANDUMP_RECEIVED);
        now_us += 4 * MS;
        speed(IW_RIGHT, 50);
    }
    drive_both(4, straight, (const int16_t[IW_SIDES]){0, 50});
    TEST_ASSERT_LESS_THAN_UINT32(2, drives.drive[0].deviation_mm);
    TEST_ASSERT_INT64_WITHIN(60 * MS, 1000 * MS, drives.drive[0].judged_us);
}

/// Both wheels are 10 % slow: straight ahead the errors cancel, unless one wheel counts in the other direction.
TEST(test_learn_mirrored_wheel_is_compared_by_its_mount_sign) {
    const int16_t speeds[IW_SIDES] = {1005, -1005};
    const int16_t slow[IW_SIDES] = {45, -45};
    config.invert[IW_RIGHT] = true;
    learn_drives_init(&drives, &config);
    drive_both(2000, speeds, slow);
    TEST_ASSERT_LESS_THAN_UINT32(2, drives.largest_mm);
    config.invert[IW_RIGHT] = false;
    learn_drives_init(&drives, &config);
    drive_both(2000, speeds, slow);
    TEST_ASSERT_GREATER_THAN_UINT32(40, drives.largest_mm);
}

TEST(test_learn_drives_beyond_the_list_count_for_the_largest) {
    for (unsigned i = 0; i < LEARN_DRIVES_MAX + 2U; i++) {
        drive_both(40, straight, level);
        now_us += 1100 * MS;
    }
    drive_both(1000, straight, level);
    drive_both(300, straight, (const int16_t[IW_SIDES]){40, 50});
    TEST_ASSERT_EQUAL_UINT32(LEARN_DRIVES_MAX + 3U, drives.count);
    TEST_ASSERT_EQUAL_UINT32(LEARN_DRIVES_MAX, learn_drives_printed(&drives));
    TEST_ASSERT_UINT32_WITHIN(3, 38, drives.largest_mm);
    TEST_ASSERT_LESS_THAN_UINT32(2, drives.drive[LEARN_DRIVES_MAX - 1U].deviation_mm);
}

// Lag of a wheel ------------------------------------------------------------------------------------------------------

/// Wheel that follows with this lag, loses this fraction of its speed, and reports whole rpm.
typedef struct {
    double lag_ms;
    double droop;
    double speed_mm_s;
    int32_t ramp_mm_s; ///< Its setpoint
} model_t;

/// Follows towards this setpoint for this time, with 1000 mm/s2 and a setpoint every 20 ms.
static void follow(model_t *wheel, unsigned ms, int16_t target_mm_s) {
    for (unsigned passed = 0; passed < ms; passed += 4U) {
        if (passed % 20U == 0U) {
            const int32_t way = target_mm_s - wheel->ramp_mm_s;
            wheel->ramp_mm_s += (way > 20) ? 20 : (way < -20) ? -20 : way;
            setpoint(IW_LEFT, (int16_t)wheel->ramp_mm_s, 500, CANDUMP_RECEIVED);
        }
        now_us += 4 * MS;
        wheel->speed_mm_s +=
            ((double)wheel->ramp_mm_s * (1.0 - wheel->droop) - wheel->speed_mm_s) * 4.0 / wheel->lag_ms;
        speed(IW_LEFT, (int16_t)(wheel->speed_mm_s / 20.106 + (double)(passed % 40U) / 40.0));
    }
}

static void assert_lag(double lag_ms, double droop) {
    model_t wheel = {.lag_ms = lag_ms, .droop = droop};
    learn_drives_init(&drives, &config);
    follow(&wheel, 1500, 0);
    follow(&wheel, 2500, 600);
    follow(&wheel, 2500, 100);
    follow(&wheel, 2500, -500);
    TEST_ASSERT_EQUAL_UINT32(3, drives.lag[IW_LEFT].count);
    TEST_ASSERT_INT_WITHIN(7, (int)lag_ms, (int)drives.lag[IW_LEFT].least_ms);
    TEST_ASSERT_INT_WITHIN(7, (int)lag_ms, (int)drives.lag[IW_LEFT].most_ms);
}

TEST(test_learn_lag_of_a_wheel_is_independent_of_its_droop) {
    assert_lag(30.0, 0.0);
    assert_lag(60.0, 0.04);
    assert_lag(120.0, 0.1);
}

static const learn_finding_t *lag_found(unsigned side, const char *item) {
    static learn_findings_t findings;
    findings.count = 0;
    learn_drives_weigh(&drives, &findings);
    return learn_find(&findings, item, side);
}

TEST(test_learn_lag_above_the_assumption_is_marked) {
    assert_lag(60.0, 0.0);
    TEST_ASSERT_EQUAL_CHAR('+', lag_found(IW_LEFT, "wheel_lag")->mark);
    assert_lag(120.0, 0.0);
    TEST_ASSERT_EQUAL_CHAR('-', lag_found(IW_LEFT, "wheel_lag")->mark);
    TEST_ASSERT_EQUAL_CHAR('?', lag_found(IW_RIGHT, "wheel_lag")->mark);
    TEST_ASSERT_NULL(lag_found(LEARN_BOTH, "wheel_lag_ms")); // One wheel alone has no common value.
    drives.lag[IW_RIGHT] = drives.lag[IW_LEFT];
    TEST_ASSERT_EQUAL_INT32(120, (atoi(lag_found(LEARN_BOTH, "wheel_lag_ms")->value) + 5) / 10 * 10);
}

TEST(test_learn_lag_of_differing_changes_has_no_value) {
    assert_lag(60.0, 0.0);
    drives.lag[IW_RIGHT] = drives.lag[IW_LEFT];
    drives.lag[IW_RIGHT].most_ms = 100.0;
    TEST_ASSERT_EQUAL_CHAR('-', lag_found(IW_RIGHT, "wheel_lag")->mark);
    TEST_ASSERT_NULL(lag_found(LEARN_BOTH, "wheel_lag_ms"));
}

/// Not counted: small changes, a wheel that does not follow, a gap in its speed frames, less than a second of steady
/// speed before the change.
TEST(test_learn_lag_requires_steady_speed_before_and_after) {
    model_t wheel = {.lag_ms = 60.0};
    follow(&wheel, 900, 0);
    follow(&wheel, 2500, 600); // The speed was steady for 0.4 s of 0.9 s.
    TEST_ASSERT_EQUAL_UINT32(0, drives.lag[IW_LEFT].count);
    follow(&wheel, 2500, 400);
    TEST_ASSERT_EQUAL_UINT32(0, drives.lag[IW_LEFT].count);
    follow(&wheel, 300, 0);
    now_us += 150 * MS;
    follow(&wheel, 2500, 0);
    TEST_ASSERT_EQUAL_UINT32(0, drives.lag[IW_LEFT].count);
    wheel.droop = 0.6;
    follow(&wheel, 2500, 600);
    TEST_ASSERT_EQUAL_UINT32(0, drives.lag[IW_LEFT].count);
    wheel.droop = 0.0;
    follow(&wheel, 2500, 0);
    follow(&wheel, 2500, 600);
    TEST_ASSERT_EQUAL_UINT32(1, drives.lag[IW_LEFT].count);
}
