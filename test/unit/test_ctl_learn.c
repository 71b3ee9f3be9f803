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
    const message_t message = {
        .kind = IW_CODEC_SETPOINT,
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
    TEST_ASSERT_FALSE(learn.wheel[IW_RIGHT].has_ticks);
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

static void test_learn_judges_a_speed_that_has_been_told_for_a_second_and_no_sooner(void) {
    setpoint(IW_LEFT, 300, 500, CANDUMP_RECEIVED);
    for (unsigned ms = 4; ms < 1000U; ms += 4U) {
        now_us += 4 * MS;
        speed(IW_LEFT, -15);
    }
    TEST_ASSERT_EQUAL_UINT64(0, learn.wheel[IW_LEFT].steady);
    now_us += 4 * MS;
    speed(IW_LEFT, 15);
    TEST_ASSERT_EQUAL_UINT64(1, learn.wheel[IW_LEFT].steady);
    TEST_ASSERT_EQUAL_UINT64(1, learn.wheel[IW_LEFT].with_sign);
    setpoint(IW_LEFT, -300, 500, CANDUMP_RECEIVED);
    speed(IW_LEFT, 15);
    TEST_ASSERT_EQUAL_UINT64(0, learn.wheel[IW_LEFT].against_sign);
}

static void test_learn_takes_force_of_a_wheel_that_has_stood_for_half_a_second_only(void) {
    speed(IW_LEFT, 0);
    now_us += 499 * MS;
    force(IW_LEFT, 900);
    TEST_ASSERT_EQUAL_UINT64(0, learn.wheel[IW_LEFT].rest_force_count);
    now_us += 1 * MS;
    force(IW_LEFT, 100);
    TEST_ASSERT_EQUAL_UINT64(1, learn.wheel[IW_LEFT].rest_force_count);
    TEST_ASSERT_EQUAL_INT64(100, learn.wheel[IW_LEFT].rest_force_sum);
    speed(IW_LEFT, -30);
    now_us += 1000 * MS;
    force(IW_LEFT, 900);
    speed(IW_LEFT, 0);
    force(IW_LEFT, 900);
    TEST_ASSERT_EQUAL_UINT64(1, learn.wheel[IW_LEFT].rest_force_count);
}

static void test_learn_turns_and_ticks_leave_out_gaps_and_reboots(void) {
    ticks(IW_LEFT, 1000);
    speed(IW_LEFT, 60);
    now_us += 50 * MS;
    speed(IW_LEFT, 60);
    ticks(IW_LEFT, 1050);
    TEST_ASSERT_EQUAL_UINT64(50, learn.wheel[IW_LEFT].ticks);
    TEST_ASSERT_EQUAL_INT64(3000, learn.wheel[IW_LEFT].rpm_ms);
    now_us += 60000 * MS; // The recording stood still.
    speed(IW_LEFT, 60);
    ticks(IW_LEFT, 1060);
    TEST_ASSERT_EQUAL_INT64(3000, learn.wheel[IW_LEFT].rpm_ms);
    ticks(IW_LEFT, -500000); // It began anew.
    ticks(IW_LEFT, -500010);
    TEST_ASSERT_EQUAL_UINT64(70, learn.wheel[IW_LEFT].ticks);
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
    RUN_TEST(test_learn_takes_force_of_a_wheel_that_has_stood_for_half_a_second_only);
    RUN_TEST(test_learn_turns_and_ticks_leave_out_gaps_and_reboots);
    RUN_TEST(test_learn_pose_may_wrap);
    return UNITY_END();
}
