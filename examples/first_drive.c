// SPDX-License-Identifier: MIT
#include "first_drive.h"

#include "iwheel/snapshot.h"

#define CLIENT        1U
#define ARM_AFTER_us  500000U
#define STOP_AFTER_us 1500000U

/// Progress of the program. After a stop it does not arm again: a person must start it.
///
///     WAITING --listening, both wheels online--> READY --armed--> DRIVING --any stop--> DONE
///                                                  '--not armed until STOP_AFTER_us----> DONE
static enum { WAITING, READY, DRIVING, DONE } progress;
static iw_time_us_t since_us; ///< Begin of READY; in WAITING that of the program.

bool first_drive_init(iw_gateway_t *gateway, const iw_hal_t *hal, iw_time_us_t now_us, bool restarted) {
    iw_config_t config;
    progress = WAITING;
    since_us = now_us;
    iw_config_default(&config);
    config.setpoint_type = 1U; // Ask the wheels' vendor for the right type: the document lists no values.
    config.setpoint_type_set = true;
    config.current_role = IW_ROLE_LIMIT; // Ask the vendor for this one too.
    config.track_mm = 540U;              // Measure your machine, from the middle of one tyre to that of the other.
    config.max_speed_mm_s = 500U;
    return iw_gateway_init(gateway, &config, hal, now_us, restarted) == IW_CONFIG_OK;
}

/// After a reset in motion the gateway first sends zeros, for `zero_hold_ms`.
static iw_refusal_t await_wheels(const iw_gateway_t *gateway, iw_time_us_t now_us) {
    iw_snapshot_t seen;
    iw_gateway_snapshot(gateway, now_us, &seen);
    if (seen.state != IW_STATE_LISTENING) {
        return IW_REFUSE_NONE;
    }
    if (!seen.wheel[IW_LEFT].heard || !seen.wheel[IW_RIGHT].heard) {
        return (now_us - since_us >= ARM_AFTER_us) ? IW_REFUSE_WHEEL_LOST : IW_REFUSE_NONE;
    }
    progress = READY;
    since_us = now_us;
    return IW_REFUSE_NONE;
}

static iw_refusal_t arm(iw_gateway_t *gateway, iw_time_us_t now_us) {
    const iw_state_t state = iw_gateway_state(gateway);
    if (state == IW_STATE_ARMED) {
        progress = DRIVING;
    } else if (now_us - since_us >= STOP_AFTER_us) {
        progress = DONE;
    } else if (now_us - since_us >= ARM_AFTER_us && state == IW_STATE_LISTENING && !iw_gateway_arming(gateway)) {
        return iw_gateway_arm(gateway, now_us, CLIENT, false); // If it is refused, the next step tries again.
    }
    return IW_REFUSE_NONE;
}

static iw_refusal_t drive(iw_gateway_t *gateway, iw_time_us_t now_us) {
    const iw_drive_t forward = {.speed_mm_s = {200, 200}};
    iw_applied_t applied;
    if (iw_gateway_state(gateway) != IW_STATE_ARMED) {
        progress = DONE;
    } else if (now_us - since_us >= STOP_AFTER_us) {
        iw_gateway_stop(gateway, now_us, CLIENT, IW_CAUSE_CLIENT_STOP);
    } else {
        return iw_gateway_drive(gateway, now_us, CLIENT, &forward, &applied); // Extends the lease.
    }
    return IW_REFUSE_NONE;
}

iw_refusal_t first_drive_command(iw_gateway_t *gateway, iw_time_us_t now_us) {
    iw_refusal_t refusal = IW_REFUSE_NONE;
    if (progress == WAITING) {
        refusal = await_wheels(gateway, now_us);
    }
    if (progress == READY) {
        refusal = arm(gateway, now_us);
    }
    if (progress == DRIVING) {
        refusal = drive(gateway, now_us);
    }
    return refusal;
}
