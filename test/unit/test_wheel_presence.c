// SPDX-License-Identifier: MIT
// Whether a wheel is online, at standstill, or back after a reboot.
#include "fixture.h"
#include "iwheel/private/wheel.h"
#include "message.h"
#include "unit.h"
#include <string.h>

#define SILENT_US MS(50)

static iw_config_t config;
static iw_wheel_t wheel;
static iw_time_us_t now_us;

static void begin(void) {
    now_us = FIXTURE_START_US;
    memset(&wheel, FIXTURE_POISON, sizeof wheel);
    iw_wheel_init(&wheel, &config, IW_LEFT, now_us);
}

void setUp(void) {
    fixture_config(&config);
    begin();
}

static void receive_as(int16_t rpm, bool fresh) {
    const message_t message = {IW_CODEC_SPEED, IW_LEFT, {.speed = {.speed_rpm = rpm}}};
    iw_wheel_receive(&wheel, now_us, message.kind, &message.as, fresh);
}

static void receive(int16_t rpm) {
    receive_as(rpm, true);
}

static void receive_status(int32_t ticks) {
    const message_t message = {IW_CODEC_STATUS, IW_LEFT, {.status = {ticks, 240, 30, 20}}};
    iw_wheel_receive(&wheel, now_us, message.kind, &message.as, true);
}

static void receive_other(iw_codec_kind_t kind) {
    message_t message;
    memset(&message, 0, sizeof message);
    message.kind = kind;
    iw_wheel_receive(&wheel, now_us, message.kind, &message.as, true);
}

/// Receives speed frames every 4 ms for `for_us`.
static void receive_for(iw_time_us_t for_us, int16_t rpm) {
    const iw_time_us_t until_us = now_us + for_us;
    while (now_us + MS(4) <= until_us) {
        now_us += MS(4);
        receive(rpm);
    }
    now_us = until_us;
}

static bool rests(iw_time_us_t at_us, uint32_t for_us) {
    return iw_wheel_rest_us(&wheel, at_us + 1U) > for_us;
}

TEST(test_wheel_never_received_is_lost_and_not_at_standstill) {
    TEST_ASSERT_FALSE(iw_wheel_online(&wheel, now_us));
    TEST_ASSERT_TRUE(iw_wheel_lost(&wheel, now_us));
    TEST_ASSERT_FALSE(rests(now_us, 0));
    TEST_ASSERT_TRUE(wheel.speed_us == IW_NEVER);
    TEST_ASSERT_TRUE(wheel.rest_since_us == IW_NEVER);
    TEST_ASSERT_EQUAL_INT(IW_REBOOT_NONE, iw_wheel_next_reboot(&wheel));
    iw_wheel_excuse(&wheel, now_us + MS(100));
    TEST_ASSERT_TRUE(iw_wheel_lost(&wheel, now_us + MS(100)));
}

TEST(test_wheel_never_received_is_not_online_at_clock_start) {
    iw_wheel_init(&wheel, &config, IW_LEFT, 0);
    TEST_ASSERT_FALSE(iw_wheel_online(&wheel, 0));
    TEST_ASSERT_FALSE(iw_wheel_online(&wheel, 1000));
    TEST_ASSERT_TRUE(iw_wheel_lost(&wheel, 1000));
}

TEST(test_wheel_is_online_for_exactly_its_silence_limit) {
    static const uint16_t limits_ms[] = {20, 50, 200};
    for (size_t i = 0; i < 3; i++) {
        config.wheel_silent_ms = limits_ms[i];
        begin();
        receive(5);
        TEST_ASSERT_TRUE(iw_wheel_online(&wheel, now_us));
        TEST_ASSERT_TRUE(iw_wheel_online(&wheel, now_us + MS(limits_ms[i]) - 1U));
        TEST_ASSERT_FALSE(iw_wheel_lost(&wheel, now_us + MS(limits_ms[i]) - 1U));
        TEST_ASSERT_FALSE(iw_wheel_online(&wheel, now_us + MS(limits_ms[i])));
        TEST_ASSERT_TRUE(iw_wheel_lost(&wheel, now_us + MS(limits_ms[i])));
        TEST_ASSERT_TRUE(iw_wheel_lost(&wheel, now_us + MS(limits_ms[i]) + 4294967296ULL));
    }
}

TEST(test_wheel_stays_online_by_speed_frames_only) {
    static const iw_codec_kind_t others[] = {IW_CODEC_STATUS, IW_CODEC_FORCE, IW_CODEC_OFFSET, IW_CODEC_POSE};
    receive(0);
    for (uint32_t n = 0; n < 40; n++) {
        now_us += MS(2);
        receive_other(others[n % 4U]);
    }
    TEST_ASSERT_TRUE(iw_wheel_lost(&wheel, now_us));
    TEST_ASSERT_FALSE(iw_wheel_online(&wheel, now_us));
}

TEST(test_wheel_is_not_online_by_frames_of_unknown_age) {
    receive_as(7, false);
    TEST_ASSERT_FALSE(iw_wheel_online(&wheel, now_us));
    TEST_ASSERT_TRUE(iw_wheel_lost(&wheel, now_us));
    TEST_ASSERT_EQUAL_INT(140, wheel.speed_mm_s);
    TEST_ASSERT_TRUE(wheel.speed_us == now_us);
    receive(0);
    now_us += SILENT_US - 1U;
    receive_as(0, false);
    TEST_ASSERT_TRUE(iw_wheel_lost(&wheel, now_us + 1U));
    receive(0);
    TEST_ASSERT_TRUE(iw_wheel_online(&wheel, now_us + 1U));
}

TEST(test_wheel_silence_during_our_stall_is_excused_once) {
    receive(0);
    now_us += MS(300);
    iw_wheel_excuse(&wheel, now_us);
    TEST_ASSERT_FALSE(iw_wheel_lost(&wheel, now_us));
    TEST_ASSERT_FALSE(iw_wheel_online(&wheel, now_us));
    TEST_ASSERT_FALSE(iw_wheel_lost(&wheel, now_us + SILENT_US - 1U));
    TEST_ASSERT_TRUE(iw_wheel_lost(&wheel, now_us + SILENT_US));
    iw_wheel_excuse(&wheel, now_us + MS(40));
    receive_as(0, false);
    iw_wheel_excuse(&wheel, now_us + MS(41));
    TEST_ASSERT_TRUE(iw_wheel_lost(&wheel, now_us + SILENT_US));
}

TEST(test_wheel_is_excused_again_after_a_fresh_frame) {
    receive(0);
    now_us += MS(300);
    iw_wheel_excuse(&wheel, now_us);
    receive(0);
    now_us += MS(300);
    iw_wheel_excuse(&wheel, now_us);
    TEST_ASSERT_FALSE(iw_wheel_lost(&wheel, now_us));
}

TEST(test_wheel_at_standstill_counts_an_unbroken_run) {
    receive(0);
    const iw_time_us_t start_us = now_us;
    receive_for(MS(200), 0);
    TEST_ASSERT_TRUE(rests(now_us, 0));
    TEST_ASSERT_TRUE(rests(start_us + MS(200), 200000));
    TEST_ASSERT_FALSE(rests(start_us + MS(200) - 1U, 200000));
    TEST_ASSERT_FALSE(rests(start_us + MS(200), 500000));
    now_us += MS(4);
    receive(3);
    TEST_ASSERT_FALSE(rests(now_us, 0));
    now_us += MS(4);
    receive(0);
    TEST_ASSERT_FALSE(rests(now_us, 1));
    TEST_ASSERT_TRUE(rests(now_us + 1U, 1));
}

TEST(test_wheel_at_standstill_has_its_limit_in_both_directions) {
    static const struct {
        int16_t rpm;
        bool rest;
    } cases[] = {{0, true},   {2, true},      {-2, true},      {3, false},
                 {-3, false}, {32767, false}, {-32768, false}, {-32767, false}};
    for (size_t i = 0; i < sizeof cases / sizeof cases[0]; i++) {
        begin();
        receive(cases[i].rpm);
        TEST_ASSERT_EQUAL_INT(cases[i].rest, rests(now_us, 0));
    }
    config.rest_rpm = 0;
    begin();
    receive(1);
    TEST_ASSERT_FALSE(rests(now_us, 0));
}

TEST(test_wheel_standstill_is_broken_by_a_gap) {
    receive(0);
    receive_for(MS(400), 0);
    now_us += SILENT_US - 4000U;
    receive(0);
    TEST_ASSERT_TRUE(rests(now_us, 400000));
    now_us += SILENT_US;
    TEST_ASSERT_FALSE(rests(now_us, 0));
    receive(0);
    TEST_ASSERT_TRUE(rests(now_us, 0));
    TEST_ASSERT_FALSE(rests(now_us, 1));
}

TEST(test_wheel_standstill_cannot_begin_at_a_frame_of_unknown_age) {
    receive_as(0, false);
    receive(5);
    receive_as(0, false);
    TEST_ASSERT_FALSE(rests(now_us, 0));
    receive(0);
    TEST_ASSERT_TRUE(rests(now_us, 0));
    receive_as(30, false);
    TEST_ASSERT_FALSE(rests(now_us, 0));
}

TEST(test_wheel_offline_for_a_second_has_rebooted) {
    receive(0);
    now_us += MS(1000) - 1U;
    receive(0);
    TEST_ASSERT_EQUAL_INT(IW_REBOOT_NONE, iw_wheel_next_reboot(&wheel));
    now_us += MS(1000);
    receive(0);
    TEST_ASSERT_EQUAL_INT(IW_REBOOT_SILENCE, iw_wheel_next_reboot(&wheel));
    TEST_ASSERT_EQUAL_INT(IW_REBOOT_NONE, iw_wheel_next_reboot(&wheel));
    TEST_ASSERT_EQUAL_UINT32(1, wheel.reboots);
    TEST_ASSERT_TRUE(wheel.boot_seen);
}

TEST(test_wheel_that_sends_any_frame_has_not_rebooted) {
    receive(0);
    for (uint32_t n = 0; n < 30; n++) {
        now_us += MS(40);
        receive_status(0);
    }
    receive(0);
    TEST_ASSERT_EQUAL_INT(IW_REBOOT_NONE, iw_wheel_next_reboot(&wheel));
}

TEST(test_wheel_silence_of_our_own_stall_is_no_reboot) {
    receive(0);
    now_us += MS(5000);
    iw_wheel_excuse(&wheel, now_us);
    receive_as(0, false);
    now_us += MS(4);
    receive(0);
    TEST_ASSERT_EQUAL_INT(IW_REBOOT_NONE, iw_wheel_next_reboot(&wheel));
}

TEST(test_wheel_first_frame_is_no_reboot_but_may_set_boot_seen) {
    now_us += MS(1000) - 1U;
    receive(0);
    TEST_ASSERT_FALSE(wheel.boot_seen);
    TEST_ASSERT_EQUAL_INT(IW_REBOOT_NONE, iw_wheel_next_reboot(&wheel));
    begin();
    now_us += MS(1000);
    receive(0);
    TEST_ASSERT_TRUE(wheel.boot_seen);
    TEST_ASSERT_EQUAL_INT(IW_REBOOT_NONE, iw_wheel_next_reboot(&wheel));
    TEST_ASSERT_EQUAL_UINT32(0, wheel.reboots);
}

/// Receives offset frames every `period_us` with speed frames between them. None may report a reboot.
static void receive_offsets(uint32_t number, iw_time_us_t period_us) {
    for (uint32_t n = 0; n < number; n++) {
        receive_for(period_us, 0);
        receive_other(IW_CODEC_OFFSET);
        TEST_ASSERT_EQUAL_INT(IW_REBOOT_NONE, iw_wheel_next_reboot(&wheel));
    }
}

TEST(test_wheel_endless_offset_frames_are_no_reboot) {
    receive(0);
    receive_for(IW_WHEEL_OFFSET_LEARN_US, 0);
    receive_offsets(200, IW_WHEEL_OFFSET_PERIOD_US);
    TEST_ASSERT_EQUAL_UINT32(0, wheel.reboots);
}

TEST(test_wheel_four_lost_offset_frames_are_no_reboot) {
    receive(0);
    receive_offsets(30, 5U * IW_WHEEL_OFFSET_PERIOD_US - 1U);
    TEST_ASSERT_EQUAL_UINT32(0, wheel.reboots);
}

TEST(test_wheel_found_during_its_offset_frames_has_not_rebooted) {
    static const uint32_t ages_s[] = {3, 30, 59};
    for (size_t i = 0; i < 3; i++) {
        begin();
        now_us += MS(10);
        receive(0);
        receive_offsets(60U - ages_s[i], IW_WHEEL_OFFSET_PERIOD_US);
        receive_for(MS(120000), 0);
        TEST_ASSERT_EQUAL_UINT32(0, wheel.reboots);
    }
}

TEST(test_wheel_offset_frames_that_return_are_a_reboot) {
    static const uint32_t received_s[] = {
        1, 10, 58, 61, 300}; // Also long before a gateway that started late can know the limit of 60 s.
    for (size_t i = 0; i < 5; i++) {
        for (iw_time_us_t early_us = 0; early_us < 2; early_us++) {
            begin();
            receive(0);
            receive_offsets(received_s[i], IW_WHEEL_OFFSET_PERIOD_US);
            receive_for(IW_WHEEL_OFFSET_BACK_US - early_us, 0);
            receive_other(IW_CODEC_OFFSET);
            TEST_ASSERT_EQUAL_INT(early_us ? IW_REBOOT_NONE : IW_REBOOT_OFFSET_FRAMES, iw_wheel_next_reboot(&wheel));
            receive_offsets(60, IW_WHEEL_OFFSET_PERIOD_US);
            TEST_ASSERT_EQUAL_UINT32(early_us ? 0 : 1, wheel.reboots);
        }
    }
}

TEST(test_wheel_found_old_has_rebooted_at_an_offset_frame) {
    receive(0);
    receive_for(IW_WHEEL_OFFSET_BACK_US - 1U, 0);
    receive_other(IW_CODEC_OFFSET); // At this time the wheel may just have started.
    TEST_ASSERT_EQUAL_INT(IW_REBOOT_NONE, iw_wheel_next_reboot(&wheel));
    begin();
    receive(0);
    receive_for(IW_WHEEL_OFFSET_BACK_US, 0);
    receive_other(IW_CODEC_OFFSET);
    TEST_ASSERT_EQUAL_INT(IW_REBOOT_OFFSET_FRAMES, iw_wheel_next_reboot(&wheel));
    TEST_ASSERT_TRUE(wheel.boot_seen);
}

/// Silence or odometry reveals a reboot within the first minute of the wheel, which its offset frames do not reveal.
TEST(test_wheel_reboot_within_a_minute_shows_by_silence_or_ticks) {
    receive(0);
    receive_offsets(20, IW_WHEEL_OFFSET_PERIOD_US);
    now_us += IW_WHEEL_REBOOT_SILENCE_US;
    receive(0);
    TEST_ASSERT_EQUAL_INT(IW_REBOOT_SILENCE, iw_wheel_next_reboot(&wheel));
    receive_for(IW_WHEEL_OFFSET_LEARN_US + IW_WHEEL_OFFSET_PERIOD_US, 0);
    receive_offsets(20, IW_WHEEL_OFFSET_PERIOD_US);
    receive_status(100000);
    receive_for(MS(400), 0);
    receive_status(0);
    TEST_ASSERT_EQUAL_INT(IW_REBOOT_ODOMETRY, iw_wheel_next_reboot(&wheel));
    receive_for(IW_WHEEL_OFFSET_LEARN_US + IW_WHEEL_OFFSET_PERIOD_US, 0);
    receive_offsets(20, IW_WHEEL_OFFSET_PERIOD_US);
    TEST_ASSERT_EQUAL_UINT32(2, wheel.reboots);
}

/// Only the offset frames reveal a restart during a stall of the gateway: silence is excused then.
TEST(test_wheel_offset_frames_after_our_own_stall_are_a_reboot) {
    receive(0);
    receive_offsets(3, IW_WHEEL_OFFSET_PERIOD_US);
    now_us += IW_WHEEL_OFFSET_BACK_US;
    iw_wheel_excuse(&wheel, now_us);
    receive_other(IW_CODEC_OFFSET);
    TEST_ASSERT_EQUAL_INT(IW_REBOOT_OFFSET_FRAMES, iw_wheel_next_reboot(&wheel));
}

TEST(test_wheel_late_frames_of_other_kinds_are_no_reboot) {
    static const iw_codec_kind_t others[] = {IW_CODEC_SPEED, IW_CODEC_STATUS, IW_CODEC_FORCE, IW_CODEC_POSE};
    receive_for(MS(70000), 0);
    for (size_t i = 0; i < sizeof others / sizeof others[0]; i++) {
        receive_other(others[i]);
        TEST_ASSERT_EQUAL_INT(IW_REBOOT_NONE, iw_wheel_next_reboot(&wheel));
    }
}

TEST(test_wheel_power_cut_with_restarted_odometry_is_one_reboot) {
    receive(0);
    receive_status(1000000);
    now_us += MS(10000);
    receive_status(0);
    receive(0);
    now_us += MS(40);
    receive_status(1);
    TEST_ASSERT_EQUAL_INT(IW_REBOOT_SILENCE, iw_wheel_next_reboot(&wheel));
    TEST_ASSERT_EQUAL_UINT32(1, wheel.reboots);
    TEST_ASSERT_TRUE(wheel.ticks == 1);
}

TEST(test_wheel_standstill_time_saturates_at_its_limit) {
    const iw_time_us_t hours_us = (iw_time_us_t)UINT32_MAX + 5U;
    receive_for(MS(20), 0);
    wheel.rest_since_us = now_us - hours_us;
    TEST_ASSERT_EQUAL_UINT32(UINT32_MAX, iw_wheel_rest_us(&wheel, now_us));
    wheel.rest_since_us = now_us - (hours_us - 6U);
    TEST_ASSERT_EQUAL_UINT32(UINT32_MAX - 1U, iw_wheel_rest_us(&wheel, now_us));
}
