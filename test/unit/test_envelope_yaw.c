// SPDX-License-Identifier: MIT
// Envelope of a pair: the yaw rate of the machine and its growth; a stop always passes.
#include "fixture.h"
#include "iwheel/private/transmit.h"
#include "unit.h"

#include <stdlib.h>
#include <string.h>

static iw_config_t config;
static iw_envelope_t envelope;
static iw_time_us_t now_us;

static int32_t turn(void) {
    const int32_t left = config.invert[IW_LEFT] ? -envelope.last_mm_s[IW_LEFT] : envelope.last_mm_s[IW_LEFT];
    const int32_t right = config.invert[IW_RIGHT] ? -envelope.last_mm_s[IW_RIGHT] : envelope.last_mm_s[IW_RIGHT];
    return abs(right - left);
}

static void begin(void) {
    memset(&envelope, 0, sizeof envelope);
    envelope.config = &config;
    now_us = FIXTURE_START_US;
}

void setUp(void) {
    fixture_config(&config);
    begin();
}

/// Checks a pair written byte by byte. Speeds are as on the bus.
static iw_envelope_verdict_t check(iw_time_us_t after_us, int32_t left_mm_s, int32_t right_mm_s) {
    const int32_t speeds[IW_SIDES] = {left_mm_s, right_mm_s};
    iw_can_frame_t frames[IW_SIDES];
    memset(frames, 0, sizeof frames);
    for (int side = 0; side < IW_SIDES; side++) {
        frames[side].id = (side == IW_LEFT) ? 266 : 298;
        frames[side].dlc = 5;
        frames[side].data[0] = 1;
        frames[side].data[1] = (uint8_t)((uint32_t)speeds[side] >> 8 & 0xFFU);
        frames[side].data[2] = (uint8_t)((uint32_t)speeds[side] & 0xFFU);
    }
    now_us += after_us;
    const iw_envelope_verdict_t verdict = iw_envelope_check_pair(&envelope, frames, now_us);
    if (verdict == IW_ENVELOPE_PASS) { // The rules of a single wheel are not tested here.
        envelope.last_mm_s[IW_LEFT] = left_mm_s;
        envelope.last_mm_s[IW_RIGHT] = right_mm_s;
        envelope.last_us[IW_LEFT] = envelope.last_us[IW_RIGHT] = now_us;
    }
    return verdict;
}

/// Reaches a difference of speeds in steps that pass.
static void settle(int32_t left_mm_s, int32_t right_mm_s) {
    while (check(300000, left_mm_s, right_mm_s) != IW_ENVELOPE_PASS) {
        const int32_t grown = turn() + 2;
        TEST_ASSERT_EQUAL_INT(IW_ENVELOPE_PASS, check(300000, 0, (right_mm_s < left_mm_s) ? -grown : grown));
    }
    envelope.stopped = 0;
}

TEST(test_envelope_turn_passes_up_to_the_configured_yaw) {
    static const struct {
        uint16_t max_mrad_s, track_mm, radius_mm;
        int32_t most_mm_s;
    } cases[] = {{1000, 540, 192, 540}, {1000, 540, 60, 1728}, {1000, 540, 400, 259},   {999, 333, 191, 334},
                 {50, 200, 500, 3},     {1001, 540, 192, 540}, {10000, 1500, 400, 7200}};
    for (size_t i = 0; i < sizeof cases / sizeof cases[0]; i++) {
        config.max_yaw_mrad_s = cases[i].max_mrad_s;
        config.track_mm = cases[i].track_mm;
        config.radius_mm = cases[i].radius_mm;
        const int32_t most = cases[i].most_mm_s;
        begin();
        settle(0, most);
        TEST_ASSERT_EQUAL_INT(IW_ENVELOPE_PASS, check(20000, -most, 0));
        TEST_ASSERT_EQUAL_INT(IW_ENVELOPE_PASS, check(20000, 700, 700 + most));
        TEST_ASSERT_EQUAL_INT(IW_ENVELOPE_PASS, check(20000, -most / 2, most - most / 2));
        TEST_ASSERT_EQUAL_INT(IW_ENVELOPE_YAW, check(20000, 0, most + 1));
        TEST_ASSERT_EQUAL_INT(IW_ENVELOPE_YAW, check(20000, 0, -most - 1));
        TEST_ASSERT_EQUAL_INT(IW_ENVELOPE_YAW, check(20000, -most, 1));
        TEST_ASSERT_EQUAL_UINT32(3, envelope.stopped);
    }
}

TEST(test_envelope_without_a_track_only_zeros_pass) {
    config.track_mm = 0;
    begin();
    TEST_ASSERT_EQUAL_INT(IW_ENVELOPE_PASS, check(300000, 0, 0));
    TEST_ASSERT_EQUAL_INT(IW_ENVELOPE_YAW, check(300000, 0, 1));
    TEST_ASSERT_EQUAL_INT(IW_ENVELOPE_YAW, check(300000, 1, -1));
    TEST_ASSERT_EQUAL_INT(IW_ENVELOPE_PASS, check(300000, 0, 0));
}

TEST(test_envelope_turn_grows_at_most_as_configured) {
    static const struct {
        uint16_t accel_mrad_s2, track_mm, radius_mm;
        uint32_t after_us;
        int32_t most_mm_s; ///< With 2 mm/s for the rounding of both speeds
    } cases[] = {{2000, 540, 192, 20000, 23},   {2000, 540, 192, 0, 2},        {2000, 540, 192, 925, 2},
                 {2000, 540, 192, 926, 3},      {2000, 540, 192, 300000, 326}, {2000, 540, 192, 9000000, 326},
                 {2000, 540, 60, 20000, 71},    {2000, 540, 400, 20000, 12},   {100, 200, 400, 20000, 2},
                 {1001, 333, 192, 300001, 101}, // One microsecond more would permit 102.
                 {1999, 477, 100, 27311, 51}};  // 52 would exceed the limit by less than a billionth.
    config.max_yaw_mrad_s = 10000;
    for (size_t i = 0; i < sizeof cases / sizeof cases[0]; i++) {
        const int32_t most = cases[i].most_mm_s;
        config.yaw_accel_mrad_s2 = cases[i].accel_mrad_s2;
        config.track_mm = cases[i].track_mm;
        config.radius_mm = cases[i].radius_mm;
        for (int32_t way = -1; way <= 1; way += 2) {
            for (int32_t from = 0; from <= 100; from += 50) {
                begin();
                settle(0, way * from);
                TEST_ASSERT_EQUAL_INT(IW_ENVELOPE_YAW, check(cases[i].after_us, 0, way * (from + most + 1)));
                now_us -= cases[i].after_us;
                TEST_ASSERT_EQUAL_INT(IW_ENVELOPE_YAW, check(cases[i].after_us, 500, 500 - way * (from + most + 1)));
                now_us -= cases[i].after_us;
                TEST_ASSERT_EQUAL_INT(IW_ENVELOPE_PASS, check(cases[i].after_us, 0, way * (from + most)));
                TEST_ASSERT_EQUAL_INT32(from + most, turn());
            }
        }
    }
}

TEST(test_envelope_stopped_turn_is_not_stored) {
    settle(0, 100);
    TEST_ASSERT_EQUAL_INT(IW_ENVELOPE_YAW, check(20000, 0, 500));
    TEST_ASSERT_EQUAL_INT32(100, turn());
    TEST_ASSERT_EQUAL_INT(IW_ENVELOPE_PASS, check(20000, 0, 145)); // From the last pair that passed, 40 ms ago
    TEST_ASSERT_EQUAL_UINT32(1, envelope.stopped);
}

/// A zero may be sent to one wheel alone: it does not extend the time in which the turn may grow.
TEST(test_envelope_turn_grows_from_the_later_frame_of_both_wheels) {
    for (int side = 0; side < IW_SIDES; side++) {
        begin();
        TEST_ASSERT_EQUAL_INT(IW_ENVELOPE_PASS, check(0, 0, 0));
        envelope.last_us[side] += 20000;
        TEST_ASSERT_EQUAL_INT(IW_ENVELOPE_YAW, check(40000, 0, 24));
        TEST_ASSERT_EQUAL_INT(IW_ENVELOPE_PASS, check(0, 0, 23));
    }
}

TEST(test_envelope_turn_that_decreases_passes_without_delay) {
    static const int32_t lefts[] = {0, -270, 270, 300, 1000};
    for (size_t i = 0; i < sizeof lefts / sizeof lefts[0]; i++) {
        for (int32_t way = -1; way <= 1; way += 2) {
            begin();
            settle(lefts[i], lefts[i] + way * 540);
            TEST_ASSERT_EQUAL_INT(IW_ENVELOPE_PASS, check(0, lefts[i], lefts[i] + way * 540));
            TEST_ASSERT_EQUAL_INT(IW_ENVELOPE_PASS, check(0, 0, way * 300));
            TEST_ASSERT_EQUAL_INT(IW_ENVELOPE_PASS, check(0, 0, way * -300));
            TEST_ASSERT_EQUAL_INT(IW_ENVELOPE_PASS, check(0, 0, 0));
        }
    }
}

TEST(test_envelope_turn_is_checked_in_the_frame_of_the_machine) {
    for (int left = 0; left < 2; left++) {
        for (int right = 0; right < 2; right++) {
            const int32_t l = (left != 0) ? -1 : 1;
            const int32_t r = (right != 0) ? -1 : 1;
            config.invert[IW_LEFT] = left != 0;
            config.invert[IW_RIGHT] = right != 0;
            begin();
            settle(l * 900, r * 900); // Straight ahead
            TEST_ASSERT_EQUAL_INT32(0, turn());
            TEST_ASSERT_EQUAL_INT(IW_ENVELOPE_YAW, check(20000, l * -12, r * 12));
            TEST_ASSERT_EQUAL_INT(IW_ENVELOPE_PASS, check(0, l * -11, r * 12));
        }
    }
}
