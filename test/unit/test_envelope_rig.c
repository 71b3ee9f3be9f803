// SPDX-License-Identifier: MIT
#include "test_envelope_rig.h"

#include "unity.h"

#include <string.h>

iw_config_t config;
iw_envelope_t envelope;
bool no_floor;

void restart(void) {
    config.min_current_mA = no_floor ? 300 : config.min_current_mA;
    TEST_ASSERT_EQUAL_INT(IW_CONFIG_OK, iw_config_check(&config));
    config.min_current_mA = no_floor ? 0 : config.min_current_mA;
    memset(&envelope, 0, sizeof envelope);
    envelope.config = &config;
}

void setUp(void) {
    iw_config_default(&config);
    config.setpoint_type = 7;
    config.setpoint_type_set = true;
    config.current_role = IW_ROLE_LIMIT;
    config.track_mm = 540;
    no_floor = true;
    restart();
}

iw_can_frame_t setpoint(iw_side_t side, int32_t speed_mm_s, int32_t current_mA) {
    iw_can_frame_t frame;
    const uint32_t speed = (uint32_t)speed_mm_s;
    const uint32_t current = (uint32_t)current_mA;
    memset(&frame, 0, sizeof frame);
    frame.id = (side == IW_LEFT) ? 266 : 298;
    frame.dlc = (uint8_t)config.setpoint_dlc;
    frame.data[0] = config.setpoint_type;
    frame.data[1] = (uint8_t)(speed >> 8 & 0xFFU);
    frame.data[2] = (uint8_t)(speed & 0xFFU);
    frame.data[3] = (uint8_t)(current >> 8 & 0xFFU);
    frame.data[4] = (uint8_t)(current & 0xFFU);
    return frame;
}

iw_envelope_verdict_t check(iw_time_us_t now_us, iw_side_t side, int32_t speed_mm_s, int32_t current_mA) {
    const iw_can_frame_t frame = setpoint(side, speed_mm_s, current_mA);
    return iw_envelope_check(&envelope, &frame, now_us);
}
