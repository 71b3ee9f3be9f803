// SPDX-License-Identifier: MIT
// Sum of the ticks of wheels that a person turns by hand: a stall of this program is not a gap of the wheels.
#include "bringup/bringup.h"

#include "unit.h"

#include <math.h>

#define RPM     100 // 100 ticks per second: a tick is a sixtieth of a turn.
#define POLL_MS 20

static hand_t hand;
static hand_sample_t view;
static int64_t now_us;

void setUp(void) {
    view = (hand_sample_t){.heard = true};
    now_us = 5000000;
    hand_begin(&hand, &view, now_us);
}

/// The wheels turn for this time, the left one backwards; then an answer arrives.
static void turn_until_an_answer(int ms) {
    now_us += ms * INT64_C(1000);
    view.rpm[IW_LEFT] = -RPM;
    view.rpm[IW_RIGHT] = RPM;
    view.ticks[IW_LEFT] -= RPM * ms / 1000;
    view.ticks[IW_RIGHT] += RPM * ms / 1000;
    hand_add(&hand, &view, now_us);
}

static void turn(int ms) {
    for (int i = 0; i < ms; i += POLL_MS) {
        turn_until_an_answer(POLL_MS);
    }
}

TEST(test_hand_adds_the_ticks_of_both_wheels) {
    turn(3000);
    TEST_ASSERT_EQUAL_INT64(-300, hand.ticks[IW_LEFT]);
    TEST_ASSERT_EQUAL_INT64(300, hand.ticks[IW_RIGHT]);
    TEST_ASSERT_EQUAL_INT64(300, hand.way[IW_LEFT]);
    TEST_ASSERT_TRUE(hand_is_complete(&hand));
    TEST_ASSERT_INT_WITHIN(1, 100, lround(100.0 * hand_rpm_share(&hand, IW_LEFT)));
    TEST_ASSERT_INT_WITHIN(1, 100, lround(100.0 * hand_rpm_share(&hand, IW_RIGHT)));
}

/// Regression: the program did not run for longer than the wheels may be offline.
TEST(test_hand_stall_of_the_program_loses_no_ticks) {
    turn(1000);
    turn_until_an_answer(HAND_OFFLINE_US / 1000 + 100);
    view.heard = false; // Frames that waited meanwhile are not read yet.
    turn_until_an_answer(POLL_MS);
    view.heard = true;
    turn(1000);
    turn_until_an_answer(HAND_UNSEEN_US / 1000);
    TEST_ASSERT_TRUE(hand_is_complete(&hand));
    TEST_ASSERT_EQUAL_INT64(-100 - 60 - 2 - 100 - 200, hand.ticks[IW_LEFT]);
}

TEST(test_hand_stall_of_the_program_does_not_change_the_rpm) {
    turn(2000);
    now_us += 1000000; // The wheel turned, and is at standstill when the next answer arrives.
    view.ticks[IW_RIGHT] += RPM;
    view.rpm[IW_RIGHT] = 0;
    hand_add(&hand, &view, now_us);
    TEST_ASSERT_INT_WITHIN(1, 100, lround(100.0 * hand_rpm_share(&hand, IW_RIGHT)));
    view.ticks[IW_RIGHT] += 2 * RPM;
    now_us += HAND_STALL_US + 1;
    hand_add(&hand, &view, now_us);
    TEST_ASSERT_EQUAL_INT(0, lround(100.0 * hand_rpm_share(&hand, IW_RIGHT))); // 200 of 500 ticks are too few.
}

TEST(test_hand_without_ticks_shows_no_rpm) {
    TEST_ASSERT_EQUAL_INT(0, lround(100.0 * hand_rpm_share(&hand, IW_RIGHT)));
}

TEST(test_hand_offline_wheel_is_a_gap) {
    turn(100);
    view.heard = false;
    turn(HAND_OFFLINE_US / 1000);
    TEST_ASSERT_TRUE(hand_is_complete(&hand));
    view.heard = true;
    turn(100); // Separate short gaps do not add up.
    view.heard = false;
    turn(HAND_OFFLINE_US / 1000);
    TEST_ASSERT_TRUE(hand_is_complete(&hand));
    turn(POLL_MS);
    TEST_ASSERT_EQUAL_INT(HAND_OFFLINE, hand.gap);
    view.heard = true;
    turn(1000);
    TEST_ASSERT_FALSE(hand_is_complete(&hand));
}

TEST(test_hand_stall_with_offline_wheel_counts_as_short_gap) {
    view.heard = false;
    turn_until_an_answer(1000);
    turn_until_an_answer(1000);
    TEST_ASSERT_EQUAL_INT(HAND_COMPLETE, hand.gap);
    turn_until_an_answer(1000);
    TEST_ASSERT_EQUAL_INT(HAND_OFFLINE, hand.gap);
}

TEST(test_hand_restarted_wheel_is_a_gap) {
    turn(100);
    view.reboots = 1;
    turn(POLL_MS);
    turn_until_an_answer(HAND_UNSEEN_US / 1000 + 1); // The first reason stays.
    TEST_ASSERT_EQUAL_INT(HAND_RESTARTED, hand.gap);
    TEST_ASSERT_FALSE(hand_is_complete(&hand));
}

TEST(test_hand_without_answers_for_too_long_is_a_gap) {
    turn(100);
    turn_until_an_answer(HAND_UNSEEN_US / 1000 + 1);
    TEST_ASSERT_EQUAL_INT(HAND_UNSEEN, hand.gap);
    TEST_ASSERT_FALSE(hand_is_complete(&hand));
}

TEST(test_hand_begin_with_offline_wheel_is_a_gap) {
    view.heard = false;
    hand_begin(&hand, &view, now_us);
    TEST_ASSERT_EQUAL_INT(HAND_OFFLINE, hand.gap);
}
