// SPDX-License-Identifier: MIT
// Battery and temperature against their thresholds: which value is a fault, how long it must last, and no fault without
// a threshold.
#include "wheels/health.h"

#include "iwheel/codec.h"
#include "unit.h"

#include <string.h>

static iw_codec_wheel_t telemetry[IW_SIDES];
static iw_snapshot_t seen;
static gw_health_t health;

void setUp(void) {
    memset(&seen, 0, sizeof seen);
    memset(telemetry, 0, sizeof telemetry);
    health = (gw_health_t){.limits = {.battery_low_dV = 220, .temperature_high_degC = 60}};
    seen.at_us = 10000000U;
    for (unsigned side = 0; side < IW_SIDES; side++) {
        seen.wheel[side].telemetry = &telemetry[side];
        telemetry[side].status.battery_dV = 220;
        telemetry[side].status.temperature_degC = 60;
    }
}

static void step(iw_time_us_t after_us) {
    seen.at_us += after_us;
    for (unsigned side = 0; side < IW_SIDES; side++) {
        seen.wheel[side].status_us = seen.at_us;
    }
    gw_health_check(&health, &seen);
}

TEST(test_health_at_the_thresholds_is_no_fault) {
    step(0);
    step(2U * GW_HEALTH_US);
    TEST_ASSERT_EQUAL_UINT32(0, health.changes);
}

TEST(test_health_value_beyond_for_5_s_is_a_fault_of_its_wheel) {
    telemetry[IW_LEFT].status.battery_dV = 219;
    telemetry[IW_RIGHT].status.temperature_degC = 61;
    step(0);
    step(GW_HEALTH_US - 1U);
    TEST_ASSERT_EQUAL_UINT32(0, health.changes);
    step(1);
    TEST_ASSERT_EQUAL_UINT32(2, health.changes);
    TEST_ASSERT_TRUE(health.present[IW_LEFT][GW_BATTERY_LOW]);
    TEST_ASSERT_FALSE(health.present[IW_RIGHT][GW_BATTERY_LOW]);
    TEST_ASSERT_FALSE(health.present[IW_LEFT][GW_TEMPERATURE_HIGH]);
    TEST_ASSERT_TRUE(health.present[IW_RIGHT][GW_TEMPERATURE_HIGH]);
}

TEST(test_health_fault_ends_after_5_s_within_the_thresholds) {
    telemetry[IW_LEFT].status.battery_dV = 100;
    step(0);
    step(GW_HEALTH_US);
    telemetry[IW_LEFT].status.battery_dV = 220;
    step(1000);
    step(GW_HEALTH_US - 1U);
    TEST_ASSERT_TRUE(health.present[IW_LEFT][GW_BATTERY_LOW]);
    step(1);
    TEST_ASSERT_FALSE(health.present[IW_LEFT][GW_BATTERY_LOW]);
    TEST_ASSERT_EQUAL_UINT32(2, health.changes);
}

TEST(test_health_good_value_in_between_restarts_the_time) {
    telemetry[IW_LEFT].status.battery_dV = 100;
    step(0);
    step(GW_HEALTH_US - 1U);
    telemetry[IW_LEFT].status.battery_dV = 230;
    step(1);
    telemetry[IW_LEFT].status.battery_dV = 100;
    step(1);
    step(GW_HEALTH_US - 1U);
    TEST_ASSERT_EQUAL_UINT32(0, health.changes);
    step(1);
    TEST_ASSERT_EQUAL_UINT32(1, health.changes);
}

TEST(test_health_without_thresholds_reports_no_fault) {
    health.limits = (gw_health_limits_t){0, 0};
    telemetry[IW_LEFT].status.battery_dV = 0;
    telemetry[IW_LEFT].status.temperature_degC = 200;
    step(0);
    step(GW_HEALTH_US);
    TEST_ASSERT_EQUAL_UINT32(0, health.changes);
}

TEST(test_health_unknown_value_changes_nothing) {
    telemetry[IW_LEFT].status.battery_dV = 100;
    telemetry[IW_RIGHT].status.temperature_degC = IW_TEMPERATURE_MAX_degC + 1U;
    step(0);
    seen.wheel[IW_LEFT].status_us = seen.at_us;
    seen.at_us += GW_HEALTH_FRESH_US + 1U;
    gw_health_check(&health, &seen); // The value is too old: the time starts again.
    step(GW_HEALTH_US - GW_HEALTH_FRESH_US);
    step(GW_HEALTH_US - 1U);
    TEST_ASSERT_EQUAL_UINT32(0, health.changes);
    step(1);
    TEST_ASSERT_EQUAL_UINT32(1, health.changes);
    seen.wheel[IW_LEFT].status_us = IW_NEVER;
    seen.at_us += 2U * GW_HEALTH_US;
    gw_health_check(&health, &seen);
    TEST_ASSERT_TRUE(health.present[IW_LEFT][GW_BATTERY_LOW]);
}

TEST(test_health_sentences_name_wheel_value_and_threshold) {
    char text[128];
    telemetry[IW_LEFT].status.battery_dV = 219;
    telemetry[IW_RIGHT].status.temperature_degC = 61;
    step(0);
    gw_health_sentence(&health, &seen, IW_LEFT, GW_BATTERY_LOW, text);
    TEST_ASSERT_EQUAL_STRING("the left wheel's battery has 219 dV, below battery_low_dV 220; charge it", text);
    gw_health_sentence(&health, &seen, IW_RIGHT, GW_TEMPERATURE_HIGH, text);
    TEST_ASSERT_EQUAL_STRING("the right wheel has 61 degC, above temperature_high_degC 60; let it cool", text);
}
