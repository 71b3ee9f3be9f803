// SPDX-License-Identifier: MIT
// Envelope: which frames may be sent, byte by byte; all others are stopped.
#include "test_envelope_rig.h"

#include "unit.h"

/// Brings the wheel to a low speed: sends zero, and the speed a long time after it.
static void settle(iw_time_us_t now_us, iw_side_t side, int32_t speed_mm_s) {
    TEST_ASSERT_EQUAL_INT(IW_ENVELOPE_PASS, check(now_us - AGES_US, side, 0, config.max_current_mA));
    TEST_ASSERT_EQUAL_INT(IW_ENVELOPE_PASS, check(now_us, side, speed_mm_s, config.max_current_mA));
}

TEST(test_envelope_init_has_no_previous_setpoint) {
    TEST_ASSERT_EQUAL_UINT32(0, envelope.stopped);
    TEST_ASSERT_EQUAL_INT32(0, envelope.last_mm_s[IW_LEFT]);
    TEST_ASSERT_EQUAL_INT32(0, envelope.last_mm_s[IW_RIGHT]);
    TEST_ASSERT_EQUAL_INT(IW_ENVELOPE_PASS, check(START_US, IW_LEFT, 0, 0));
    TEST_ASSERT_EQUAL_INT(IW_ENVELOPE_PASS, check(START_US, IW_RIGHT, 0, 2000));
}

static uint32_t format_of(unsigned bits) {
    return (((bits & 1U) != 0) ? IW_CAN_EXTENDED : 0U) | (((bits & 2U) != 0) ? IW_CAN_REMOTE : 0U) |
           (((bits & 4U) != 0) ? IW_CAN_ERROR : 0U) | (((bits & 8U) != 0) ? IW_CAN_FD : 0U);
}

/// Checks every length, format and kind with this number. Returns how many frames passed.
static uint32_t sweep_number(uint32_t number) {
    uint32_t passed = 0;
    for (unsigned rest = 0; rest < 16U * 16U * 2U; rest++) {
        iw_can_frame_t frame = setpoint(IW_LEFT, 0, 0);
        frame.id = number | format_of(rest % 16U);
        frame.dlc = (uint8_t)(rest / 16U % 16U);
        frame.kind = (uint8_t)(rest / 256U);
        const bool wanted = (frame.id == 266 || frame.id == 298) && frame.dlc == config.setpoint_dlc;
        const iw_envelope_verdict_t verdict = iw_envelope_check(&envelope, &frame, START_US);
        if (verdict != (wanted ? IW_ENVELOPE_PASS : IW_ENVELOPE_NOT_A_SETPOINT)) {
            TEST_ASSERT_EQUAL_HEX32_MESSAGE(0, frame.id, "wrong verdict for this id");
        }
        passed += (verdict == IW_ENVELOPE_PASS) ? 1U : 0U;
    }
    return passed;
}

TEST(test_envelope_every_id_and_format_passes_two_setpoints_only) {
    for (uint16_t dlc = 5; dlc <= 8; dlc++) {
        uint32_t passed = 0;
        config.setpoint_dlc = dlc;
        restart();
        for (uint32_t number = 0; number <= IW_CAN_ID_MASK; number++) {
            passed += sweep_number(number);
        }
        TEST_ASSERT_EQUAL_UINT32(4, passed);
        TEST_ASSERT_EQUAL_UINT32(2048U * 512U - 4U, envelope.stopped);
    }
}

TEST(test_envelope_29_bit_id_with_setpoint_bits_is_stopped) {
    for (unsigned bit = 11; bit < 32; bit++) {
        iw_can_frame_t frame = setpoint(IW_RIGHT, 0, 0);
        frame.id |= (uint32_t)1 << bit;
        TEST_ASSERT_EQUAL_INT(IW_ENVELOPE_NOT_A_SETPOINT, iw_envelope_check(&envelope, &frame, START_US));
    }
}

TEST(test_envelope_other_length_is_stopped) {
    for (unsigned dlc = 0; dlc < 256; dlc++) {
        iw_can_frame_t frame = setpoint(IW_RIGHT, 0, 0);
        frame.dlc = (uint8_t)dlc;
        const iw_envelope_verdict_t wanted = (dlc == 5) ? IW_ENVELOPE_PASS : IW_ENVELOPE_NOT_A_SETPOINT;
        TEST_ASSERT_EQUAL_INT(wanted, iw_envelope_check(&envelope, &frame, START_US));
    }
}

TEST(test_envelope_every_type_passes_the_configured_one_only) {
    for (unsigned configured = 0; configured < 256; configured++) {
        config.setpoint_type = (uint8_t)configured;
        restart();
        for (unsigned type = 0; type < 256; type++) {
            iw_can_frame_t frame = setpoint(IW_LEFT, 0, 0);
            frame.data[0] = (uint8_t)type;
            const iw_envelope_verdict_t wanted = (type == configured) ? IW_ENVELOPE_PASS : IW_ENVELOPE_TYPE;
            TEST_ASSERT_EQUAL_INT(wanted, iw_envelope_check(&envelope, &frame, START_US));
        }
    }
}

TEST(test_envelope_unset_type_stops_every_frame) {
    config.setpoint_type_set = false;
    restart();
    for (unsigned type = 0; type < 256; type++) {
        iw_can_frame_t frame = setpoint(IW_LEFT, 0, 0);
        frame.data[0] = (uint8_t)type;
        TEST_ASSERT_EQUAL_INT(IW_ENVELOPE_TYPE, iw_envelope_check(&envelope, &frame, START_US));
    }
    TEST_ASSERT_EQUAL_UINT32(256, envelope.stopped);
}

TEST(test_envelope_unset_role_stops_every_frame) {
    config.current_role = IW_ROLE_UNSET;
    restart();
    TEST_ASSERT_EQUAL_INT(IW_ENVELOPE_TYPE, check(START_US, IW_LEFT, 0, 0));
    TEST_ASSERT_EQUAL_INT(IW_ENVELOPE_TYPE, check(START_US, IW_RIGHT, 0, 100));
    TEST_ASSERT_EQUAL_UINT32(2, envelope.stopped);
}

/// A current limit has no sign and a floor: the envelope stops a negative limit and one below the floor.
static void sweep_currents(int32_t speed_mm_s) {
    const int32_t highest = config.max_current_mA;
    const int32_t lowest = (config.current_role == IW_ROLE_LIMIT) ? config.min_current_mA : -highest;
    for (int32_t current = -32768; current <= 32767; current++) {
        const bool within = current >= lowest && current <= highest;
        const iw_envelope_verdict_t verdict = check(START_US, IW_LEFT, speed_mm_s, current);
        if (verdict != (within ? IW_ENVELOPE_PASS : IW_ENVELOPE_CURRENT)) {
            TEST_ASSERT_EQUAL_INT32_MESSAGE(0, current, "wrong verdict for this current");
        }
    }
}

TEST(test_envelope_every_current_passes_within_the_limits_only) {
    static const uint16_t maxima[] = {300, 301, 700, 1234, 1999, 2000};
    static const uint16_t minima[] = {300, 300, 500, 1233, 1999, 300};
    static const iw_current_role_t roles[] = {IW_ROLE_LIMIT, IW_ROLE_SETPOINT};
    no_floor = false;
    for (size_t i = 0; i < 12; i++) {
        config.max_current_mA = maxima[i / 2];
        config.min_current_mA = minima[i / 2];
        config.current_role = roles[i % 2];
        restart();
        sweep_currents(0);
        settle(START_US, IW_LEFT, 200);
        sweep_currents(200);
    }
}

TEST(test_envelope_every_speed_passes_within_the_maximum_only) {
    static const uint16_t maxima[] = {10, 11, 1000, 4999, 5000};
    for (size_t i = 0; i < sizeof maxima / sizeof maxima[0]; i++) {
        config.max_speed_mm_s = maxima[i];
        config.accel_mm_s2 = 20000;
        config.decel_mm_s2 = 20000;
        restart();
        for (int32_t speed = -32768; speed <= 32767; speed++) {
            const bool within = speed >= -(int32_t)maxima[i] && speed <= (int32_t)maxima[i];
            const iw_time_us_t now_us = AGES_US + (iw_time_us_t)(speed + 32768) * 2U * AGES_US;
            TEST_ASSERT_EQUAL_INT(IW_ENVELOPE_PASS, check(now_us, IW_RIGHT, 0, 0));
            const iw_envelope_verdict_t verdict = check(now_us + AGES_US, IW_RIGHT, speed, 0);
            if (verdict != (within ? IW_ENVELOPE_PASS : IW_ENVELOPE_SPEED)) {
                TEST_ASSERT_EQUAL_INT32_MESSAGE(0, speed, "wrong verdict for this speed");
            }
        }
    }
}

TEST(test_envelope_several_faults_names_the_first_one) {
    iw_can_frame_t frame = setpoint(IW_LEFT, 30000, 30000);
    frame.data[0] = 2;
    frame.id = 267;
    TEST_ASSERT_EQUAL_INT(IW_ENVELOPE_NOT_A_SETPOINT, iw_envelope_check(&envelope, &frame, START_US));
    frame.id = 266;
    TEST_ASSERT_EQUAL_INT(IW_ENVELOPE_TYPE, iw_envelope_check(&envelope, &frame, START_US));
    TEST_ASSERT_EQUAL_INT(IW_ENVELOPE_CURRENT, check(START_US, IW_LEFT, 30000, 30000));
    TEST_ASSERT_EQUAL_INT(IW_ENVELOPE_SPEED, check(START_US, IW_LEFT, 30000, 0));
    TEST_ASSERT_EQUAL_UINT32(4, envelope.stopped);
}
