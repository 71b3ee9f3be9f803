// SPDX-License-Identifier: MIT
// Yaw in the whole gateway: the reply to a client, the sent setpoints, and stops out of a turn, which are never
// delayed.
#include "test_gateway_core_rig.h"

#include "unit.h"

static iw_applied_t ask(int32_t left_mm_s, int32_t right_mm_s) {
    const iw_drive_t request = {{left_mm_s, right_mm_s}, {0, 0}, false};
    iw_applied_t applied;
    TEST_ASSERT_EQUAL_INT(IW_REFUSE_NONE, iw_gateway_drive(&rig.gateway, rig.now_us, HOLDER, &request, &applied));
    return applied;
}

static void assert_applied(int32_t left_mm_s, int32_t right_mm_s, bool limited, const iw_applied_t *applied) {
    TEST_ASSERT_EQUAL_INT16(left_mm_s, applied->pair.wheel[IW_LEFT].speed_mm_s);
    TEST_ASSERT_EQUAL_INT16(right_mm_s, applied->pair.wheel[IW_RIGHT].speed_mm_s);
    TEST_ASSERT_EQUAL_INT(limited, applied->limited);
}

TEST(test_gateway_turn_is_limited_first_by_yaw_then_by_speed) {
    gateway_rig_arm(&rig);
    iw_applied_t applied = ask(-270, 270);
    assert_applied(-270, 270, false, &applied);
    applied = ask(-1000, 1000);
    assert_applied(-270, 270, true, &applied);
    applied = ask(0, 1000);
    assert_applied(0, 540, true, &applied);
    applied = ask(3000, 4000); // Yaw limits it to 1620 and 2160, then speed
    assert_applied(750, 1000, true, &applied);
    applied = ask(2000, 2000);
    assert_applied(1000, 1000, true, &applied);
    applied = ask(32767, -32768);
    assert_applied(269, -270, true, &applied);
}

TEST(test_gateway_yaw_limit_depends_on_the_radius) {
    static const struct {
        uint16_t radius_mm;
        int16_t most_mm_s;
    } cases[] = {{60, 864}, {192, 270}, {400, 129}}; // 1 rad/s on 540 mm, half for each wheel, x 192 / radius
    for (size_t i = 0; i < sizeof cases / sizeof cases[0]; i++) {
        setUp();
        rig.config.radius_mm = cases[i].radius_mm;
        rig.config.rest_rpm = iw_config_rest(&rig.config).standard;
        gateway_rig_begin(&rig, false);
        gateway_rig_arm(&rig);
        const iw_applied_t applied = ask(-1000, 1000);
        assert_applied(-cases[i].most_mm_s, cases[i].most_mm_s, true, &applied);
    }
}

/// Drives the fastest pivot: both wheels in opposite directions, as fast as yaw permits.
static void pivot(bool mirrored, iw_time_us_t for_us) {
    setUp();
    rig.config.invert[IW_RIGHT] = mirrored;
    gateway_rig_begin(&rig, false);
    gateway_rig_arm(&rig);
    TEST_ASSERT_EQUAL_INT(IW_REFUSE_NONE, gateway_rig_cruise(&rig, -1000, 1000, for_us));
}

static void assert_stands_without_internal(void) {
    const iw_snapshot_t seen = gateway_rig_snapshot(&rig);
    TEST_ASSERT_TRUE(gateway_rig_commands_zero(&rig));
    TEST_ASSERT_TRUE(rig.gateway.permit.seen_us[IW_CAUSE_INTERNAL] == IW_NEVER);
    TEST_ASSERT_EQUAL_UINT32(0, seen.stopped);
}

/// At every phase: during the ramp into the pivot, within the period, and in the constant pivot.
TEST(test_gateway_stop_in_the_fastest_pivot_is_no_internal_fault) {
    for (uint32_t ms = 100; ms <= 900U; ms += 50U) {
        for (uint32_t phase_us = 0; phase_us < 20000U; phase_us += 1700U) {
            pivot((ms / 50U) % 2U == 0U, MS(ms));
            gateway_rig_run(&rig, phase_us);
            gateway_rig_stop(&rig);
            gateway_rig_run(&rig, MS(20) + 270000U * 1000U / 1500U); // One period, and the ramp by decel_mm_s2 alone
            assert_stands_without_internal();
            tearDown();
        }
    }
}

TEST(test_gateway_zero_command_in_a_pivot_needs_the_ramp_only) {
    pivot(true, MS(900));
    TEST_ASSERT_EQUAL_INT(-270, gateway_rig_snapshot(&rig).applied.wheel[IW_LEFT].speed_mm_s);
    TEST_ASSERT_EQUAL_INT(IW_REFUSE_NONE, gateway_rig_cruise(&rig, 0, 0, MS(250)));
    assert_stands_without_internal();
}

TEST(test_gateway_pivot_in_reverse_passes_the_envelope) {
    pivot(false, MS(900));
    for (unsigned i = 0; i < 8U; i++) {
        const int32_t speed = (i % 2U == 0U) ? 1000 : -1000;
        TEST_ASSERT_EQUAL_INT(IW_REFUSE_NONE, gateway_rig_cruise(&rig, speed, -speed, MS(350)));
        TEST_ASSERT_EQUAL_INT(IW_REFUSE_NONE, gateway_rig_cruise(&rig, 900, 400, MS(300)));
    }
    TEST_ASSERT_EQUAL_INT(IW_STATE_ARMED, state());
    TEST_ASSERT_EQUAL_UINT32(0, gateway_rig_snapshot(&rig).stopped);
}

/// The scheduler and the envelope disagree: the envelope stops what the scheduler misses, with zeros in the same step.
TEST(test_gateway_yaw_too_fast_is_stopped_by_the_envelope) {
    gateway_rig_arm(&rig);
    rig.gateway.setpoint.yaw.most_mm_s = 2000;
    rig.gateway.setpoint.yaw.growth_mm_s2 = 1080;
    (void)gateway_rig_cruise(&rig, -400, 400, MS(900));
    TEST_ASSERT_EQUAL_INT(IW_STATE_LATCHED, state());
    TEST_ASSERT_EQUAL_INT(IW_CAUSE_INTERNAL, stop()->cause);
    TEST_ASSERT_EQUAL_UINT32(IW_ENVELOPE_YAW, stop()->detail);
    TEST_ASSERT_TRUE(gateway_rig_commands_zero(&rig));
}

TEST(test_gateway_yaw_growth_too_fast_is_stopped_by_the_envelope) {
    gateway_rig_arm(&rig);
    rig.gateway.setpoint.yaw.growth_mm_s2 = 1600;
    (void)gateway_rig_cruise(&rig, -200, 200, MS(100));
    TEST_ASSERT_EQUAL_INT(IW_CAUSE_INTERNAL, stop()->cause);
    TEST_ASSERT_EQUAL_UINT32(IW_ENVELOPE_YAW, stop()->detail);
    TEST_ASSERT_TRUE(gateway_rig_commands_zero(&rig));
}
