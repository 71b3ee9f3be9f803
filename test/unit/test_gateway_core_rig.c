// SPDX-License-Identifier: MIT
#include "test_gateway_core_rig.h"

#include "unity.h"

gateway_rig_t rig;

void setUp(void) {
    gateway_rig_init(&rig);
}

void tearDown(void) {
    TEST_ASSERT_NULL_MESSAGE(rig.judge.violation, rig.judge.violation);
}

iw_state_t state(void) {
    return iw_gateway_state(&rig.gateway);
}

const iw_stop_t *stop(void) {
    return &rig.gateway.permit.stop;
}

void drive_on(void) {
    gateway_rig_arm(&rig);
    TEST_ASSERT_EQUAL_INT(IW_STATE_ARMED, state());
    (void)gateway_rig_cruise(&rig, 400, 400, MS(1000));
    TEST_ASSERT_EQUAL_INT(IW_STATE_ARMED, state());
    TEST_ASSERT_EQUAL_INT(400, rig.bus.commanded_mm_s[IW_LEFT]);
    TEST_ASSERT_EQUAL_INT(400, rig.bus.commanded_mm_s[IW_RIGHT]);
}

void arm_and_cruise(int32_t left_mm_s, int32_t right_mm_s, iw_time_us_t for_us) {
    gateway_rig_arm(&rig);
    (void)gateway_rig_cruise(&rig, left_mm_s, right_mm_s, for_us);
}

void stall_by(iw_time_us_t late_us) {
    gateway_rig_stall(&rig, rig.wake_us - rig.now_us + late_us);
}

void turn(size_t side, int16_t rpm) {
    rig.wheel[side].rpm_fixed = true;
    rig.wheel[side].rpm = rpm;
}

void set_mute(bool mute) {
    rig.wheel[IW_LEFT].mute = mute;
    rig.wheel[IW_RIGHT].mute = mute;
}

void put(const message_t *message) {
    iw_can_frame_t frame;
    TEST_ASSERT_EQUAL_INT(IW_OK, message_encode(message, &frame));
    fake_bus_put(&rig.bus, &frame);
}
