// SPDX-License-Identifier: MIT
#include "first_drive.h"

#define CLIENT     1U
#define ARM_AT_us  500000U
#define STOP_AT_us 1500000U

bool first_drive_init(iw_gateway_t *gateway, const iw_hal_t *hal, iw_time_us_t now_us, bool restarted) {
    iw_config_t config;
    iw_config_default(&config);
    config.setpoint_type = 1U; // Ask the wheels' vendor for the right type: the document lists no values.
    config.setpoint_type_set = true;
    config.current_role = IW_ROLE_LIMIT; // Ask the vendor for this one too.
    config.track_mm = 540U;              // Measure your machine, from the middle of one tyre to that of the other.
    config.max_speed_mm_s = 500U;
    return iw_gateway_init(gateway, &config, hal, now_us, restarted) == IW_CONFIG_OK;
}

iw_refusal_t first_drive_command(iw_gateway_t *gateway, iw_time_us_t now_us) {
    static bool was_armed; // After a stop the program does not arm again: a person must start it.
    const iw_drive_t forward = {.speed_mm_s = {200, 200}};
    iw_applied_t applied;
    const bool is_armed = iw_gateway_state(gateway) == IW_STATE_ARMED;
    if (now_us < ARM_AT_us || (was_armed && !is_armed)) {
        return IW_REFUSE_NONE;
    }
    was_armed = is_armed;
    if (now_us >= STOP_AT_us) {
        if (is_armed) {
            iw_gateway_stop(gateway, now_us, CLIENT, IW_CAUSE_CLIENT_STOP);
        }
    } else if (iw_gateway_state(gateway) == IW_STATE_LISTENING && !iw_gateway_arming(gateway)) {
        return iw_gateway_arm(gateway, now_us, CLIENT, false); // If it is refused, the next step tries again.
    } else if (is_armed) {
        return iw_gateway_drive(gateway, now_us, CLIENT, &forward, &applied); // Extends the lease.
    }
    return IW_REFUSE_NONE;
}
