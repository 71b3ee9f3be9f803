// SPDX-License-Identifier: MIT
/// The envelope and the scheduler are independent: the envelope must pass every pair that the scheduler makes of
/// commands and times.

#include "iwheel/codec.h"
#include "iwheel/private/setpoint.h"
#include "iwheel/private/transmit.h"
#include "unit.h"

static uint32_t seed;

static uint32_t draw(uint32_t below) {
    seed = seed * 1664525U + 1013904223U;
    return (seed >> 8) % below;
}

static iw_config_t any_config(void) {
    static const uint16_t slopes[] = {100, 137, 800, 1500, 1501, 7919, 20000};
    iw_config_t config;
    iw_config_default(&config);
    config.setpoint_type_set = true;
    config.current_role = (draw(2) == 0U) ? IW_ROLE_LIMIT : IW_ROLE_SETPOINT;
    config.accel_mm_s2 = slopes[draw(7)];
    config.decel_mm_s2 = slopes[draw(7)];
    config.max_speed_mm_s = (uint16_t)(10U + draw(4991));
    config.max_yaw_mrad_s = (uint16_t)(50U + draw(9951) / (1U + draw(9)));
    config.yaw_accel_mrad_s2 = (uint16_t)(100U + draw(9901) / (1U + draw(9)));
    config.track_mm = (uint16_t)(200U + draw(1301));
    config.radius_mm = (uint16_t)(60U + draw(341));
    return config;
}

static iw_command_t any_command(const iw_config_t *config) {
    const int32_t speed = config->max_speed_mm_s;
    const iw_command_t command = {(int16_t)((int32_t)draw((uint32_t)(2 * speed + 1)) - speed), 700};
    return command;
}

/// Returns a pair as the gateway commands it: within the limit of yaw.
static iw_pair_t any_pair(const iw_config_t *config, const iw_yaw_t *yaw) {
    iw_pair_t pair = {{any_command(config), any_command(config)}};
    int32_t speeds[IW_SIDES] = {pair.wheel[IW_LEFT].speed_mm_s, pair.wheel[IW_RIGHT].speed_mm_s};
    (void)iw_yaw_limit(yaw, speeds);
    pair.wheel[IW_LEFT].speed_mm_s = (int16_t)speeds[IW_LEFT];
    pair.wheel[IW_RIGHT].speed_mm_s = (int16_t)speeds[IW_RIGHT];
    return pair;
}

static void send_through_gate(iw_envelope_t *envelope, const iw_config_t *config, iw_time_us_t now_us,
                              const iw_pair_t *pair) {
    iw_can_frame_t frames[IW_SIDES];
    for (int side = IW_LEFT; side <= IW_RIGHT; side++) {
        const iw_command_t *const command = &pair->wheel[side];
        const iw_codec_setpoint_t setpoint = {command->speed_mm_s, command->current_mA, config->setpoint_type};
        iw_can_frame_t *const frame = &frames[side];
        TEST_ASSERT_FALSE(iw_codec_encode_setpoint((iw_side_t)side, &setpoint, (uint8_t)config->setpoint_dlc, frame));
    }
    TEST_ASSERT_EQUAL(IW_ENVELOPE_PASS, iw_envelope_check_pair(envelope, frames, now_us));
    for (int side = IW_LEFT; side <= IW_RIGHT; side++) {
        TEST_ASSERT_EQUAL(IW_ENVELOPE_PASS, iw_envelope_check(envelope, &frames[side], now_us));
    }
}

static void run_once(void) {
    const iw_config_t config = any_config();
    iw_setpoint_t setpoint;
    iw_envelope_t envelope = {.config = &config};
    iw_time_us_t now_us = 1000000U + draw(1000000U);
    iw_setpoint_init(&setpoint, &config);
    iw_setpoint_demand(&setpoint, now_us, IW_DEMAND_ZERO);
    for (uint32_t i = 0; i < 400U; i++) {
        if (draw(20) == 0U) {
            const iw_pair_t command = any_pair(&config, &setpoint.yaw);
            iw_setpoint_demand(&setpoint, now_us, IW_DEMAND_FOLLOW);
            iw_setpoint_command(&setpoint, now_us, &command);
        }
        if (draw(100) == 0U) {
            iw_setpoint_demand(&setpoint, now_us, IW_DEMAND_BRAKE);
        }
        now_us = iw_setpoint_next_us(&setpoint) + draw(30000U);
        const iw_pair_t pair = iw_setpoint_next(&setpoint, now_us);
        send_through_gate(&envelope, &config, now_us, &pair);
    }
}

TEST(test_envelope_every_pair_of_the_scheduler_passes) {
    for (seed = 1; seed < 3000U; seed++) {
        const uint32_t run = seed;
        run_once();
        seed = run;
    }
}
