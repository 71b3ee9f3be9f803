// SPDX-License-Identifier: MIT
// The sender alone: complete pairs, both frames or none, its counters and its initial state.
#include "fake_bus.h"
#include "iwheel/private/transmit.h"
#include "unit.h"
#include <string.h>

static const iw_pair_t zero_pair = {{{0, 2000}, {0, 2000}}};

static iw_config_t config;
static fake_bus_t bus;
static iw_hal_t hal;
static iw_sender_t sender;
static iw_time_us_t now_us;

void setUp(void) {
    fixture_config(&config);
    now_us = FIXTURE_START_US;
    fake_bus_init(&bus, now_us);
    hal = fake_bus_hal(&bus);
    memset(&sender, FIXTURE_POISON, sizeof sender);
    iw_sender_init(&sender, &config, &hal);
}

static iw_send_result_t send(int16_t left_mm_s, int16_t right_mm_s) {
    iw_pair_t pair = zero_pair;
    pair.wheel[IW_LEFT].speed_mm_s = left_mm_s;
    pair.wheel[IW_RIGHT].speed_mm_s = right_mm_s;
    return iw_sender_send(&sender, &pair, now_us, left_mm_s == 0 && right_mm_s == 0);
}

static void echo(iw_side_t side) {
    iw_confirmation_echo(&sender.confirmation, side, &bus.last[side]);
}

/// Sends a complete pair of zeros and its echoes.
static void send_whole(iw_time_us_t after_us) {
    now_us += after_us;
    TEST_ASSERT_EQUAL_INT(IW_SEND_DONE, send(0, 0));
    echo(IW_LEFT);
    echo(IW_RIGHT);
}

TEST(test_sender_starts_with_zero_counters_and_no_pending_frame) {
    TEST_ASSERT_TRUE(iw_sender_ready(&sender, false));
    TEST_ASSERT_TRUE(iw_confirmation_waiting_us(&sender.confirmation) == IW_NEVER);
    TEST_ASSERT_EQUAL_UINT32(0, sender.confirmation.stray);
    TEST_ASSERT_EQUAL_UINT32(0, sender.envelope.stopped);
    TEST_ASSERT_EQUAL_UINT32(0, sender.sent.gap_us);
    TEST_ASSERT_EQUAL_UINT32(0, sender.sent.gap_max_us);
    TEST_ASSERT_EQUAL_UINT32(0, sender.sent.pairs);
    TEST_ASSERT_EQUAL_UINT32(0, sender.sent.later);
    TEST_ASSERT_EQUAL_UINT32(0, sender.sent.clamped);
    TEST_ASSERT_EQUAL_INT(IW_ENVELOPE_PASS, sender.verdict);
}

TEST(test_sender_first_pair_has_no_gap) {
    send_whole(0);
    TEST_ASSERT_EQUAL_UINT32(0, sender.sent.gap_us);
    TEST_ASSERT_EQUAL_UINT32(0, sender.sent.gap_max_us);
    TEST_ASSERT_EQUAL_UINT32(1, sender.sent.pairs);
}

TEST(test_sender_retains_the_largest_gap_until_it_rests) {
    send_whole(0);
    send_whole(MS(20));
    send_whole(MS(10));
    TEST_ASSERT_EQUAL_UINT32(10000, sender.sent.gap_us);
    TEST_ASSERT_EQUAL_UINT32(20000, sender.sent.gap_max_us);
    iw_sender_rest(&sender);
    send_whole(MS(5000));
    TEST_ASSERT_EQUAL_UINT32(0, sender.sent.gap_us);
    TEST_ASSERT_EQUAL_UINT32(0, sender.sent.gap_max_us);
}

TEST(test_sender_zero_to_one_wheel_only_is_no_complete_pair) {
    static const iw_side_t blocked[] = {IW_LEFT, IW_RIGHT};
    for (size_t i = 0; i < 2; i++) {
        setUp();
        const iw_side_t free = (blocked[i] == IW_LEFT) ? IW_RIGHT : IW_LEFT;
        TEST_ASSERT_EQUAL_INT(IW_SEND_DONE, send(0, 0));
        TEST_ASSERT_EQUAL_INT(IW_SEND_DONE, send(0, 0)); // After the pairs without echo: no third one may follow.
        echo(free);
        TEST_ASSERT_TRUE(iw_sender_ready(&sender, true));
        TEST_ASSERT_FALSE(iw_sender_ready(&sender, false));
        TEST_ASSERT_EQUAL_INT(IW_SEND_DONE, send(0, 0));
        TEST_ASSERT_EQUAL_UINT32(5, bus.sent);
        TEST_ASSERT_EQUAL_UINT32(2, sender.sent.pairs);
    }
}

TEST(test_sender_zero_is_sent_right_when_the_port_refuses_left) {
    bus.send_result[IW_LEFT] = 0;
    TEST_ASSERT_EQUAL_INT(IW_SEND_LATER, send(0, 0));
    TEST_ASSERT_EQUAL_UINT32(1, bus.sent);
    TEST_ASSERT_EQUAL_UINT32(1, sender.sent.later);
    TEST_ASSERT_EQUAL_UINT32(0, sender.sent.pairs);
}

TEST(test_sender_motion_is_sent_to_both_wheels_or_none) {
    bus.send_result[IW_LEFT] = 0;
    TEST_ASSERT_EQUAL_INT(IW_SEND_LATER, send(1, 1));
    TEST_ASSERT_EQUAL_UINT32(0, bus.sent);
    TEST_ASSERT_EQUAL_UINT32(1, sender.sent.later);
}

TEST(test_sender_pair_is_sent_in_one_call) {
    send_whole(0);
    TEST_ASSERT_EQUAL_UINT32(1, bus.calls);
    TEST_ASSERT_EQUAL_UINT32(2, bus.call_frames);
    TEST_ASSERT_EQUAL_INT(IW_SEND_DONE, send(1, 1));
    TEST_ASSERT_EQUAL_UINT32(2, bus.calls);
    TEST_ASSERT_EQUAL_UINT32(2, bus.call_frames);
}

/// The port accepts the left frame and refuses the right one. The left frame is counted as pending, and the sender
/// retries nothing.
TEST(test_sender_one_accepted_of_two_is_a_refused_pair) {
    static const int16_t speeds_mm_s[] = {0, 1};
    for (size_t i = 0; i < 2; i++) {
        setUp();
        bus.send_result[IW_RIGHT] = (i == 0U) ? 0 : -1;
        TEST_ASSERT_EQUAL_INT(IW_SEND_LATER, send(speeds_mm_s[i], speeds_mm_s[i]));
        TEST_ASSERT_EQUAL_UINT32(1, bus.calls);
        TEST_ASSERT_EQUAL_UINT32(1, bus.sent);
        TEST_ASSERT_EQUAL_UINT32(1, sender.sent.later);
        TEST_ASSERT_EQUAL_UINT32(0, sender.sent.pairs);
        TEST_ASSERT_EQUAL_UINT8(1, sender.confirmation.pending[IW_LEFT]);
        TEST_ASSERT_EQUAL_UINT8(0, sender.confirmation.pending[IW_RIGHT]);
        TEST_ASSERT_TRUE(sender.confirmation.waiting_us[IW_RIGHT] == now_us);
        TEST_ASSERT_FALSE(iw_sender_ready(&sender, false));
        TEST_ASSERT_TRUE(iw_sender_ready(&sender, true));
    }
}

TEST(test_sender_pair_refused_by_the_port_is_not_pending) {
    bus.send_result[IW_LEFT] = -1;
    bus.send_result[IW_RIGHT] = -1;
    TEST_ASSERT_EQUAL_INT(IW_SEND_LATER, send(0, 0));
    TEST_ASSERT_EQUAL_UINT32(2, bus.calls); // The right zero alone is tried, too.
    TEST_ASSERT_EQUAL_UINT32(2, sender.sent.later);
    TEST_ASSERT_EQUAL_UINT8(0, sender.confirmation.pending[IW_LEFT]);
    TEST_ASSERT_EQUAL_UINT8(0, sender.confirmation.pending[IW_RIGHT]);
}

TEST(test_sender_port_that_reports_7_frames_has_accepted_two) {
    bus.boast = 7;
    TEST_ASSERT_EQUAL_INT(IW_SEND_DONE, send(1, 1));
    TEST_ASSERT_EQUAL_UINT8(1, sender.confirmation.pending[IW_LEFT]);
    TEST_ASSERT_EQUAL_UINT8(1, sender.confirmation.pending[IW_RIGHT]);
}

/// Not ready, but called: after two frames that wait for their echo, no third frame is sent.
TEST(test_sender_pair_blocked_for_both_wheels_is_not_sent) {
    TEST_ASSERT_EQUAL_INT(IW_SEND_DONE, send(0, 0));
    TEST_ASSERT_EQUAL_INT(IW_SEND_DONE, send(0, 0));
    TEST_ASSERT_FALSE(iw_sender_ready(&sender, true));
    TEST_ASSERT_EQUAL_INT(IW_SEND_DONE, send(0, 0));
    TEST_ASSERT_EQUAL_UINT32(2, bus.calls);
}

TEST(test_sender_stores_the_verdict_of_the_last_stopped_pair) {
    const int16_t fast_mm_s = (int16_t)(config.max_speed_mm_s + 1);
    TEST_ASSERT_EQUAL_INT(IW_SEND_STOPPED, send(0, fast_mm_s)); // The pair is judged first.
    TEST_ASSERT_EQUAL_INT(IW_ENVELOPE_YAW, sender.verdict);
    TEST_ASSERT_EQUAL_INT(IW_SEND_STOPPED, send(fast_mm_s, fast_mm_s));
    TEST_ASSERT_EQUAL_UINT32(0, bus.sent);
    send_whole(0);
    TEST_ASSERT_EQUAL_INT(IW_ENVELOPE_SPEED, sender.verdict);
    TEST_ASSERT_EQUAL_INT(IW_SEND_STOPPED, send(100, 100));
    TEST_ASSERT_EQUAL_INT(IW_ENVELOPE_SLEW, sender.verdict);
}

TEST(test_sender_purge_clears_pending_only_if_the_port_confirms) {
    static const int results[] = {-1, 0, 1};
    for (size_t i = 0; i < 3; i++) {
        setUp();
        (void)send(0, 0);
        bus.purge_result = results[i];
        TEST_ASSERT_EQUAL_INT(results[i], iw_sender_purge(&sender));
        TEST_ASSERT_EQUAL_INT(results[i] > 0, iw_sender_ready(&sender, false));
    }
}
