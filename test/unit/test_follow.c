// SPDX-License-Identifier: MIT
// Following error of a wheel: each verdict with its threshold, its time, and what restarts the time.
#include "fixture.h"
#include "iwheel/private/follow.h"
#include "unit.h"
#include <string.h>

static iw_config_t config;
static iw_follow_t watch;

static void begin(void) {
    memset(&watch, FIXTURE_POISON, sizeof watch);
    iw_follow_init(&watch, &config);
}

void setUp(void) {
    fixture_config(&config);
    begin();
}

typedef struct {
    int32_t applied_mm_s;
    int32_t measured_mm_s;
} speeds_t;

static iw_follow_verdict_t step(iw_time_us_t after_us, speeds_t speeds) {
    return iw_follow_step(&watch, FIXTURE_START_US + after_us, speeds.applied_mm_s, speeds.measured_mm_s);
}

/// Checks that the verdict occurs at exactly `for_us`, not a microsecond before.
static void assert_verdict_after(iw_follow_verdict_t expected, iw_time_us_t for_us, speeds_t speeds) {
    begin();
    TEST_ASSERT_EQUAL_INT(IW_FOLLOW_OK, step(0, speeds));
    TEST_ASSERT_EQUAL_INT(IW_FOLLOW_OK, step(for_us / 2U, speeds));
    TEST_ASSERT_EQUAL_INT(IW_FOLLOW_OK, step(for_us - 1U, speeds));
    TEST_ASSERT_EQUAL_INT(expected, step(for_us, speeds));
    TEST_ASSERT_EQUAL_INT(expected, step(for_us + 1U, speeds));
}

static void assert_never(speeds_t speeds) {
    begin();
    for (uint32_t n = 0; n < 100; n++) {
        TEST_ASSERT_EQUAL_INT(IW_FOLLOW_OK, step(n * MS(200), speeds));
    }
}

TEST(test_follow_opposite_sign_is_reported_after_300_ms) {
    assert_verdict_after(IW_FOLLOW_SIGN, MS(300), (speeds_t){101, -101});
    assert_verdict_after(IW_FOLLOW_SIGN, MS(300), (speeds_t){-101, 101});
    assert_verdict_after(IW_FOLLOW_SIGN, MS(300), (speeds_t){1000, -150});
    assert_verdict_after(IW_FOLLOW_SIGN, MS(300), (speeds_t){-5000, 32767});
}

TEST(test_follow_sign_needs_both_above_100) {
    static const speeds_t below[] = {{100, -101}, {101, -100}, {-100, 101}, {-101, 100}, {100, -100}, {0, -150}};
    for (size_t i = 0; i < sizeof below / sizeof below[0]; i++) {
        begin();
        TEST_ASSERT_EQUAL_INT(IW_FOLLOW_OK, step(0, below[i]));
        TEST_ASSERT_EQUAL_INT(IW_FOLLOW_OK, step(MS(400), below[i]));
    }
}

TEST(test_follow_overspeed_is_reported_after_follow_ms) {
    assert_verdict_after(IW_FOLLOW_OVERSPEED, MS(500), (speeds_t){0, 301});
    assert_verdict_after(IW_FOLLOW_OVERSPEED, MS(500), (speeds_t){0, -301});
    assert_verdict_after(IW_FOLLOW_OVERSPEED, MS(500), (speeds_t){500, 801});
    assert_verdict_after(IW_FOLLOW_OVERSPEED, MS(500), (speeds_t){-500, -801});
    assert_verdict_after(IW_FOLLOW_OVERSPEED, MS(500), (speeds_t){50, -351});
}

TEST(test_follow_overspeed_uses_the_configuration) {
    config.follow_mm_s = 50;
    config.follow_ms = 100;
    assert_verdict_after(IW_FOLLOW_OVERSPEED, MS(100), (speeds_t){200, 251});
    assert_never((speeds_t){200, 249});
}

TEST(test_follow_slower_than_the_margin_is_no_overspeed) {
    assert_never((speeds_t){0, 300});
    assert_never((speeds_t){0, 299});
    assert_never((speeds_t){0, -299});
    assert_never((speeds_t){500, 799});
    assert_never((speeds_t){-500, -799});
}

TEST(test_follow_blocked_is_reported_after_blocked_ms) {
    assert_verdict_after(IW_FOLLOW_BLOCKED, MS(1000), (speeds_t){100, 19});
    assert_verdict_after(IW_FOLLOW_BLOCKED, MS(1000), (speeds_t){-100, -19});
    assert_verdict_after(IW_FOLLOW_BLOCKED, MS(1000), (speeds_t){1000, 199});
    assert_verdict_after(IW_FOLLOW_BLOCKED, MS(1000), (speeds_t){1000, 0});
    assert_verdict_after(IW_FOLLOW_BLOCKED, MS(1000), (speeds_t){5000, 999});
}

TEST(test_follow_slow_opposite_speed_is_blocked) {
    assert_verdict_after(IW_FOLLOW_BLOCKED, MS(1000), (speeds_t){400, -90});
    assert_verdict_after(IW_FOLLOW_BLOCKED, MS(1000), (speeds_t){-400, 90});
}

TEST(test_follow_blocked_uses_the_configuration) {
    config.blocked_ms = 200;
    assert_verdict_after(IW_FOLLOW_BLOCKED, MS(200), (speeds_t){500, 0});
}

TEST(test_follow_twenty_percent_or_a_small_command_is_not_blocked) {
    static const speeds_t fine[] = {{100, 20}, {-100, -20}, {1000, 200}, {-1000, -200}, {99, 0}, {-99, 0}, {0, 0}};
    for (size_t i = 0; i < sizeof fine / sizeof fine[0]; i++) {
        assert_never(fine[i]);
    }
}

TEST(test_follow_interruption_restarts_the_time) {
    static const struct {
        speeds_t bad;
        iw_follow_verdict_t verdict;
        uint32_t for_ms;
    } cases[] = {{{200, -200}, IW_FOLLOW_SIGN, 300},
                 {{200, 600}, IW_FOLLOW_OVERSPEED, 500},
                 {{200, 0}, IW_FOLLOW_BLOCKED, 1000}};
    const speeds_t good = {200, 200};
    for (size_t i = 0; i < 3; i++) {
        begin();
        const iw_time_us_t for_us = MS(cases[i].for_ms);
        (void)step(0, cases[i].bad);
        TEST_ASSERT_EQUAL_INT(IW_FOLLOW_OK, step(for_us - 2U, cases[i].bad));
        TEST_ASSERT_EQUAL_INT(IW_FOLLOW_OK, step(for_us - 1U, good));
        TEST_ASSERT_EQUAL_INT(IW_FOLLOW_OK, step(for_us, cases[i].bad));
        TEST_ASSERT_EQUAL_INT(IW_FOLLOW_OK, step(2U * for_us - 1U, cases[i].bad));
        TEST_ASSERT_EQUAL_INT(cases[i].verdict, step(2U * for_us, cases[i].bad));
        TEST_ASSERT_EQUAL_INT(IW_FOLLOW_OK, step(2U * for_us + 1U, good));
    }
}

TEST(test_follow_restart_restarts_every_time) {
    static const speeds_t bad[] = {{200, -200}, {200, 600}, {200, 0}};
    static const uint32_t for_ms[] = {300, 500, 1000};
    for (size_t i = 0; i < 3; i++) {
        begin();
        (void)step(0, bad[i]);
        iw_follow_restart(&watch);
        TEST_ASSERT_EQUAL_INT(IW_FOLLOW_OK, step(MS(for_ms[i]), bad[i]));
        TEST_ASSERT_EQUAL_INT(IW_FOLLOW_OK, step(MS(2 * for_ms[i]) - 1U, bad[i]));
        TEST_ASSERT_TRUE(IW_FOLLOW_OK != step(MS(2 * for_ms[i]), bad[i]));
    }
}

TEST(test_follow_most_severe_verdict_precedes) {
    config.follow_ms = 300;
    config.blocked_ms = 300;
    (void)step(0, (speeds_t){200, -600});
    TEST_ASSERT_EQUAL_INT(IW_FOLLOW_SIGN, step(MS(300), (speeds_t){200, -600}));
    begin();
    config.follow_ms = 300;
    config.blocked_ms = 300;
    config.follow_mm_s = 50;
    (void)step(0, (speeds_t){100, -160});
    TEST_ASSERT_EQUAL_INT(IW_FOLLOW_OVERSPEED, step(MS(300), (speeds_t){100, -160}));
}

TEST(test_follow_times_run_independently) {
    (void)step(0, (speeds_t){200, -90});
    (void)step(MS(800), (speeds_t){200, -600});
    TEST_ASSERT_EQUAL_INT(IW_FOLLOW_OK, step(MS(1000) - 1U, (speeds_t){200, -600}));
    TEST_ASSERT_EQUAL_INT(IW_FOLLOW_BLOCKED, step(MS(1000), (speeds_t){200, -600}));
    TEST_ASSERT_EQUAL_INT(IW_FOLLOW_SIGN, step(MS(1100), (speeds_t){200, -600}));
}

TEST(test_follow_extreme_values_do_not_overflow) {
    assert_verdict_after(IW_FOLLOW_OVERSPEED, MS(500), (speeds_t){0, INT32_MAX});
    assert_verdict_after(IW_FOLLOW_OVERSPEED, MS(500), (speeds_t){0, -INT32_MAX});
    assert_verdict_after(IW_FOLLOW_SIGN, MS(300), (speeds_t){5000, -INT32_MAX});
    assert_verdict_after(IW_FOLLOW_SIGN, MS(300), (speeds_t){-5000, INT32_MAX});
}

TEST(test_follow_sign_is_confirmed_after_300_ms_of_agreement) {
    static const speeds_t agreeing[] = {{101, 101}, {-101, -101}, {1000, 150}};
    for (size_t i = 0; i < 3; i++) {
        begin();
        TEST_ASSERT_FALSE(iw_follow_sign_confirmed(&watch, FIXTURE_START_US));
        (void)step(0, agreeing[i]);
        TEST_ASSERT_FALSE(iw_follow_sign_confirmed(&watch, FIXTURE_START_US));
        (void)step(MS(299), agreeing[i]);
        TEST_ASSERT_FALSE(iw_follow_sign_confirmed(&watch, FIXTURE_START_US + MS(300) - 1U));
        TEST_ASSERT_TRUE(iw_follow_sign_confirmed(&watch, FIXTURE_START_US + MS(300)));
    }
}

TEST(test_follow_sign_is_not_confirmed_by_weak_agreement) {
    static const speeds_t weak[] = {{100, 101}, {101, 100}, {-100, -101}, {-101, -100}, {0, 0}, {200, -200}};
    for (size_t i = 0; i < sizeof weak / sizeof weak[0]; i++) {
        begin();
        (void)step(0, weak[i]);
        (void)step(MS(300), weak[i]);
        TEST_ASSERT_FALSE(iw_follow_sign_confirmed(&watch, FIXTURE_START_US + MS(300)));
    }
    begin();
    (void)step(0, (speeds_t){200, 200});
    (void)step(MS(200), (speeds_t){200, 50});
    (void)step(MS(201), (speeds_t){200, 200});
    TEST_ASSERT_FALSE(iw_follow_sign_confirmed(&watch, FIXTURE_START_US + MS(501) - 1U));
    TEST_ASSERT_TRUE(iw_follow_sign_confirmed(&watch, FIXTURE_START_US + MS(501)));
    iw_follow_restart(&watch);
    TEST_ASSERT_FALSE(iw_follow_sign_confirmed(&watch, FIXTURE_START_US + MS(501)));
}

TEST(test_follow_without_elapsed_time_has_no_verdict) {
    for (uint32_t n = 0; n < 1000; n++) {
        TEST_ASSERT_EQUAL_INT(IW_FOLLOW_OK, step(0, (speeds_t){1000, -1000}));
    }
}
