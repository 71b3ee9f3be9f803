// SPDX-License-Identifier: MIT
#include "iwheel/private/current.h"

#include "iwheel/codec.h"

bool iw_current_limit(const iw_config_t *config, int32_t limit_mA[IW_SIDES], bool zero) {
    const int32_t left = limit_mA[IW_LEFT];
    const int32_t right = limit_mA[IW_RIGHT];
    const int32_t larger = (left > right) ? left : right;
    const int32_t lowest = zero ? (int32_t)config->max_current_mA : iw_current_floor(config);
    for (size_t side = 0; side < IW_SIDES; side++) {
        const int32_t wanted = config->asymmetric_current ? limit_mA[side] : larger;
        limit_mA[side] = (wanted > lowest) ? wanted : lowest;
    }
    return limit_mA[IW_LEFT] != left || limit_mA[IW_RIGHT] != right;
}

void iw_current_follow(int16_t limit_mA[IW_SIDES], const iw_pair_t *target, uint32_t elapsed_us) {
    const uint32_t us = (elapsed_us < IW_WHEEL_WATCHDOG_US) ? elapsed_us : IW_WHEEL_WATCHDOG_US;
    const int32_t fall_mA = (int32_t)(us / IW_CURRENT_FALL_US);
    for (size_t side = 0; side < IW_SIDES; side++) {
        const int32_t target_mA = target->wheel[side].current_mA;
        const int32_t fallen_mA = limit_mA[side] - fall_mA;
        limit_mA[side] = (int16_t)((fallen_mA > target_mA) ? fallen_mA : target_mA);
    }
}
