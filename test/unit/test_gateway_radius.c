// SPDX-License-Identifier: MIT
// Wheels of another radius than the 192 mm that their firmware assumes: setpoints pass unchanged, and measured speeds
// are compared with them in the unit of setpoints. The wheels of the simulator turn as the firmware commands; their
// real radius follows the configuration.
#include "unit.h"
#include "world_rig.h"

#include <string.h>

static const uint16_t radii[] = {60, 192, 250, 400};
#define RADII (sizeof radii / sizeof radii[0])

static world_rig_t rig;

static void begin(uint16_t radius_mm) {
    memset(&rig, FIXTURE_POISON, sizeof rig);
    fixture_config(&rig.config);
    rig.config.radius_mm = radius_mm;
    rig.config.rest_rpm = iw_config_rest(&rig.config).standard;
    rig.config.max_yaw_mrad_s = 10000; // These wheels are compared with their setpoints in a turn, too.
    world_rig_begin(&rig, 0);
    for (unsigned side = 0; side < IW_SIDES; side++) {
        rig.world.pair.wheel[side].motion.config.radius_mm = radius_mm;
    }
}

static void assert_armed(uint16_t radius_mm) {
    char what[32];
    (void)snprintf(what, sizeof what, "radius %u", radius_mm);
    TEST_ASSERT_EQUAL_INT_MESSAGE(IW_STATE_ARMED, iw_gateway_state(&rig.gateway), what);
}

TEST(test_gateway_radius_full_speed_is_no_fault) {
    for (size_t i = 0; i < RADII; i++) {
        begin(radii[i]);
        world_rig_drive(&rig, 1000, 1000, 5000);
        assert_armed(radii[i]);
        world_rig_drive(&rig, 500, -500, 5000);
        assert_armed(radii[i]);
        TEST_ASSERT_INT_WITHIN(45, 500 * radii[i] / 192, rig.gateway.wheel[IW_LEFT].speed_mm_s);
        TEST_ASSERT_INT_WITHIN(21, 500, rig.gateway.diverge.measured_mm_s[IW_LEFT]);
        TEST_ASSERT_INT_WITHIN(21, -500, rig.gateway.diverge.measured_mm_s[IW_RIGHT]);
    }
}

TEST(test_gateway_radius_setpoint_type_is_confirmed_by_any_wheel) {
    for (size_t i = 0; i < RADII; i++) {
        begin(radii[i]);
        world_rig_drive(&rig, 800, 800, 5000);
        TEST_ASSERT_EQUAL_INT(IW_CONFIRMED, rig.gateway.assumptions.entry[IW_ASSUMPTION_SETPOINT_TYPE].state);
    }
}

/// A limit of 60 mm in the unit of setpoints is reached after the same time for every radius.
TEST(test_gateway_radius_does_not_change_time_of_divergence) {
    iw_time_us_t took_us[RADII];
    for (size_t i = 0; i < RADII; i++) {
        begin(radii[i]);
        world_rig_drive(&rig, 1000, 1000, 3000);
        const iw_drive_t wanted = {.speed_mm_s = {1000, 1000}};
        const iw_time_us_t from_us = rig.now_us;
        iw_applied_t applied;
        rig.world.pair.wheel[IW_LEFT].motion.blocked = true;
        while (iw_gateway_state(&rig.gateway) == IW_STATE_ARMED && rig.now_us < from_us + 1000000U) {
            (void)iw_gateway_drive(&rig.gateway, rig.now_us, WORLD_CLIENT, &wanted, &applied);
            world_rig_run(&rig, 1);
        }
        took_us[i] = rig.now_us - from_us;
        TEST_ASSERT_EQUAL_INT(IW_CAUSE_PAIR_DIVERGES, rig.gateway.permit.stop.cause);
        TEST_ASSERT_EQUAL_UINT64(took_us[0], took_us[i]);
    }
}

/// One rpm is 42 mm/s at 400 mm, and 6 mm/s at 60 mm: standstill depends on rpm, and arm requires the same real speed.
TEST(test_gateway_radius_standstill_is_the_same_real_speed) {
    static const struct {
        uint16_t radius_mm;
        int16_t at_rest_rpm;
    } cases[] = {{60, 7}, {192, 2}, {400, 1}};
    for (size_t i = 0; i < sizeof cases / sizeof cases[0]; i++) {
        iw_codec_wheel_t telemetry = {.speed = {.speed_rpm = cases[i].at_rest_rpm}};
        begin(cases[i].radius_mm);
        iw_wheel_t *const wheel = &rig.gateway.wheel[IW_LEFT];
        iw_wheel_receive(wheel, rig.now_us, IW_CODEC_SPEED, &telemetry, true);
        TEST_ASSERT_GREATER_THAN_UINT32(0, iw_wheel_rest_us(wheel, rig.now_us + 1U));
        TEST_ASSERT_LESS_OR_EQUAL_INT32(45, wheel->speed_mm_s);
        telemetry.speed.speed_rpm++;
        iw_wheel_receive(wheel, rig.now_us, IW_CODEC_SPEED, &telemetry, true);
        TEST_ASSERT_EQUAL_UINT32(0, iw_wheel_rest_us(wheel, rig.now_us + 1U));
        TEST_ASSERT_GREATER_THAN_INT32(45, wheel->speed_mm_s);
    }
}
