// SPDX-License-Identifier: MIT
#include "angles.h"

#include "iwheel/gateway.h"

/// A radian in tenths of a degree, by 1000.
#define MILLI_TENTHS_PER_RADIAN 572958U
#define GONE_PERCENT            25U
#define LATE_MS                 100U
/// Resolution of telemetry: seven eighths of the 20 mm/s of one rpm.
#define TELEMETRY_MM_S 18U

/// Converts a speed or a distance by setpoints to the configured radius.
static uint64_t real(const gateway_config_t *config, uint64_t by_setpoints) {
    return by_setpoints * config->core.radius_mm / IW_SETPOINT_RADIUS_MM;
}

/// Returns the angle for a difference of the distances of both wheels, in real millimetres.
static unsigned tenths(const gateway_config_t *config, uint64_t apart_mm) {
    return (unsigned)(apart_mm * MILLI_TENTHS_PER_RADIAN / 1000U / config->core.track_mm);
}

/// Returns the distance of a wheel that receives zero: first with the assumed deceleration, then by its lag.
static uint64_t brake_mm(const gateway_config_t *config, uint64_t speed_mm_s) {
    const uint64_t lag_ms = config->core.wheel_lag_ms;
    const uint64_t soft_mm_s = (uint64_t)GW_ANGLES_BRAKE_MM_S2 * lag_ms / 1000U;
    if (speed_mm_s <= soft_mm_s) {
        return speed_mm_s * lag_ms / 1000U;
    }
    return (speed_mm_s * speed_mm_s - soft_mm_s * soft_mm_s) / (2U * (uint64_t)GW_ANGLES_BRAKE_MM_S2) +
           soft_mm_s * lag_ms / 1000U;
}

gw_angles_t gw_angles(const gateway_config_t *config) {
    const iw_config_t *const core = &config->core;
    const uint64_t speed = real(config, core->max_speed_mm_s);
    const uint64_t pair_mm = real(config, core->pair_mm);
    const uint64_t ordinary = speed * IW_DIVERGE_DROOP_PERCENT / 100U + real(config, TELEMETRY_MM_S);
    const uint64_t steady = pair_mm * 1000U / core->pair_leak_ms + ordinary;
    const uint64_t quarter = speed * GONE_PERCENT / 100U;
    const uint64_t apart = speed - quarter;
    const uint64_t ramp = speed * core->max_speed_mm_s / (2U * (uint64_t)core->decel_mm_s2);
    const uint64_t coast = speed * speed / (2U * (uint64_t)GW_ANGLES_COAST_MM_S2);
    const bool noticed = apart > steady;
    return (gw_angles_t){
        .unnoticed = tenths(config, steady),
        .blocked = tenths(config, pair_mm / 2U + speed / 100U + brake_mm(config, speed)),
        .slow = noticed ? tenths(config, pair_mm * apart / (apart - ordinary) + speed / 100U + brake_mm(config, speed) -
                                             brake_mm(config, quarter))
                        : tenths(config, apart),
        .coasting = tenths(config, (coast > ramp) ? coast - ramp : 0U),
        .runs_on = tenths(config, speed),
        .late = tenths(config, speed * LATE_MS / 1000U),
    };
}
