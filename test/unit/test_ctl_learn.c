// SPDX-License-Identifier: MIT
// What `learn` counts in a recording, frame by frame: of the right wheel, at the right time, in the right direction.
#include "learn/learn.h"

#include "message.h"

#include "unity.h"

#define MS 1000

static learn_t learn;
static int64_t now_us;

static void hear(const message_t *message) {
    iw_can_frame_t frame;
    TEST_ASSERT_EQUAL_INT(IW_OK, message_encode(message, &frame));
    const candump_t recorded = candump_from_core(&frame, now_us, "can0");
    learn_frame(&learn, &recorded);
}

static void setpoint(iw_side_t side, int16_t speed_mm_s, int16_t current_mA, candump_mark_t mark) {
    const message_t message = {.kind = IW_CODEC_SETPOINT,
                               .side = side,
                               .as = {.setpoint = {.type = 1, .speed_mm_s = speed_mm_s, .current_mA = current_mA}}};
    iw_can_frame_t frame;
    TEST_ASSERT_EQUAL_INT(IW_OK, message_encode(&message, &frame));
    candump_t recorded = candump_from_core(&frame, now_us, "can0");
    recorded.mark = mark;
    learn_frame(&learn, &recorded);
}

static void speed(iw_side_t side, int16_t rpm) {
    hear(&(message_t){.kind = IW_CODEC_SPEED, .side = side, .as = {.speed = {.speed_rpm = rpm}}});
}

static void ticks(iw_side_t side, int32_t odometry) {
    hear(&(message_t){.kind = IW_CODEC_STATUS, .side = side, .as = {.status = {.odometry_ticks = odometry}}});
}

static void force(iw_side_t side, int16_t raw) {
    hear(&(message_t){.kind = IW_CODEC_FORCE, .side = side, .as = {.force = {.force_raw = raw}}});
}

static void pose(int16_t x_mm) {
    hear(&(message_t){.kind = IW_CODEC_POSE, .side = IW_RIGHT, .as = {.pose = {.x_mm = x_mm}}});
}

void setUp(void) {
    now_us = 1700000000000000;
    learn_init(&learn);
}

void tearDown(void) {}

static void test_learn_counts_each_wheel_for_itself(void) {
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

static void test_learn_keeps_currents_apart_by_the_direction_they_come_with(void) {
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

static void test_learn_counts_as_sent_only_what_is_marked_so(void) {
    setpoint(IW_LEFT, 0, 0, CANDUMP_SENT);
    setpoint(IW_LEFT, 0, 0, CANDUMP_RECEIVED);
    setpoint(IW_LEFT, 0, 0, CANDUMP_UNMARKED);
    TEST_ASSERT_EQUAL_UINT64(3, learn.setpoint[IW_LEFT].count);
    TEST_ASSERT_EQUAL_UINT64(1, learn.setpoint[IW_LEFT].sent);
}

/// For so long, the left wheel is told that speed and shows that rpm, every 4 ms.
static void drive(unsigned ms, int16_t speed_mm_s, int16_t rpm) {
    for (unsigned passed = 0; passed < ms; passed += 4U) {
        setpoint(IW_LEFT, speed_mm_s, 500, CANDUMP_RECEIVED);
        now_us += 4 * MS;
        speed(IW_LEFT, rpm);
    }
}

static void test_learn_judges_a_speed_that_has_been_told_for_a_second_and_no_sooner(void) {
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

static void test_learn_keeps_answers_apart_by_the_direction_that_was_told(void) {
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

static void test_learn_judges_no_speed_that_is_no_longer_told(void) {
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
    drive(996, 300, -15); // The wheel had stopped: from the start.
    TEST_ASSERT_EQUAL_INT64(0, learn.wheel[IW_LEFT].forward.against_us);
}

/// For so long, the left wheel shows that rpm, every 10 ms.
static void turn(unsigned ms, int16_t rpm) {
    for (unsigned passed = 0; passed < ms; passed += 10U) {
        now_us += 10 * MS;
        speed(IW_LEFT, rpm);
    }
}

static void test_learn_takes_force_of_a_wheel_that_has_stood_for_half_a_second_only(void) {
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

static void test_learn_takes_no_force_of_a_wheel_that_was_not_heard(void) {
    speed(IW_LEFT, 0);
    turn(500, 0);
    now_us += 100 * MS;
    force(IW_LEFT, 900);
    TEST_ASSERT_EQUAL_UINT64(0, learn.wheel[IW_LEFT].rest_force_count);
    turn(500, 0); // Whether it stood in between, nobody knows.
    force(IW_LEFT, 900);
    TEST_ASSERT_EQUAL_UINT64(0, learn.wheel[IW_LEFT].rest_force_count);
    turn(10, 0);
    force(IW_LEFT, 100);
    TEST_ASSERT_EQUAL_UINT64(1, learn.wheel[IW_LEFT].rest_force_count);
    TEST_ASSERT_EQUAL_UINT64(3, learn.wheel[IW_LEFT].forces);
}

static void test_learn_turns_and_ticks_leave_out_gaps_and_reboots(void) {
    const learn_wheel_t *left = &learn.wheel[IW_LEFT];
    speed(IW_LEFT, 60);
    ticks(IW_LEFT, 1000);
    turn(50, 60);
    ticks(IW_LEFT, 1050);
    TEST_ASSERT_EQUAL_UINT64(50, left->ticks);
    TEST_ASSERT_EQUAL_INT64(3000 * MS, left->turned_rpm_us);
    now_us += 60000 * MS; // The recording stood still.
    speed(IW_LEFT, 60);
    ticks(IW_LEFT, 1060);
    TEST_ASSERT_EQUAL_UINT64(50, left->ticks);
    TEST_ASSERT_EQUAL_INT64(3000 * MS, left->turned_rpm_us);
    turn(50, 60);
    ticks(IW_LEFT, -500000); // It began anew.
    TEST_ASSERT_EQUAL_UINT64(50, left->ticks);
    TEST_ASSERT_EQUAL_INT64(3000 * MS, left->turned_rpm_us);
    turn(50, 60);
    ticks(IW_LEFT, -500010);
    TEST_ASSERT_EQUAL_UINT64(60, left->ticks);
    TEST_ASSERT_EQUAL_INT64(6000 * MS, left->turned_rpm_us);
}

static void test_learn_turns_and_ticks_leave_out_what_is_too_slow_or_turns_round(void) {
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

static void test_learn_pose_may_wrap(void) {
    pose(INT16_MAX - 1);
    pose(INT16_MIN + 1);
    TEST_ASSERT_EQUAL_UINT64(3, learn.pose.way_big);
    pose(INT16_MAX - 1);
    TEST_ASSERT_EQUAL_UINT64(6, learn.pose.way_big);
    TEST_ASSERT_GREATER_THAN_UINT64(100, learn.pose.way_little);
}

int main(void) {
    UNITY_BEGIN();
    RUN_TEST(test_learn_counts_each_wheel_for_itself);
    RUN_TEST(test_learn_keeps_currents_apart_by_the_direction_they_come_with);
    RUN_TEST(test_learn_counts_as_sent_only_what_is_marked_so);
    RUN_TEST(test_learn_judges_a_speed_that_has_been_told_for_a_second_and_no_sooner);
    RUN_TEST(test_learn_keeps_answers_apart_by_the_direction_that_was_told);
    RUN_TEST(test_learn_judges_no_speed_that_is_no_longer_told);
    RUN_TEST(test_learn_takes_force_of_a_wheel_that_has_stood_for_half_a_second_only);
    RUN_TEST(test_learn_takes_no_force_of_a_wheel_that_was_not_heard);
    RUN_TEST(test_learn_turns_and_ticks_leave_out_gaps_and_reboots);
    RUN_TEST(test_learn_turns_and_ticks_leave_out_what_is_too_slow_or_turns_round);
    RUN_TEST(test_learn_pose_may_wrap);
    return UNITY_END();
}
