// SPDX-License-Identifier: MIT
#include "driver.h"

#include <string.h>

/// Largest yaw rate of the pad: a full turn on the spot in six seconds.
#define YAW_MAX_MRAD_S 1000

void web_driver_begin(web_driver_t *self, uint64_t now_us) {
    self->is_driven = true;
    self->sequence = 0;
    self->silent_us = now_us + WEB_FIRST_US;
}

void web_driver_end(web_driver_t *self) {
    self->is_driven = false;
}

bool web_command_moves(const web_command_t *command) {
    int64_t v = 0;
    int64_t yaw = 0;
    return web_number(command->v_mm_s, INT32_MIN, INT32_MAX, &v) &&
           web_number(command->yaw_mrad_s, INT32_MIN, INT32_MAX, &yaw) && (v != 0 || yaw != 0);
}

const char *web_age_wrong(const char *t_us, uint64_t gateway_us, int64_t *out_t_us) {
    int64_t since_us = 0;
    if (!web_number(t_us, 0, INT64_MAX, &since_us)) {
        return "it has no time: add boot of /api/challenge, and t_us of the newest state";
    }
    if ((uint64_t)since_us > gateway_us + WEB_AHEAD_US) {
        return "its t_us is in the future; use t_us of the newest state";
    }
    if ((uint64_t)since_us < gateway_us && gateway_us - (uint64_t)since_us > WEB_AGE_US) {
        return "it is older than a second; send it again";
    }
    *out_t_us = since_us;
    return NULL;
}

static const char *judge(const web_driver_t *self, const web_command_t *command, const web_limits_t *limits,
                         uint64_t gateway_us) {
    int64_t sequence = 0;
    int64_t stamp_us = 0;
    if (!self->is_driven || !command->is_holders) {
        return "this page does not hold the lease; arm from it";
    }
    if (!web_number(command->t_us, 0, INT64_MAX, &stamp_us) ||
        !web_number(command->sequence, 1, INT64_MAX, &sequence)) {
        return "a command needs t_us and sequence";
    }
    if (sequence <= self->sequence) {
        return "a newer command has already arrived";
    }
    if ((uint64_t)stamp_us > gateway_us + WEB_AHEAD_US) {
        return "its t_us is in the future; use t_us of the newest state";
    }
    if ((uint64_t)stamp_us < gateway_us && gateway_us - (uint64_t)stamp_us > limits->ttl_us) {
        return "too old: the connection is too slow for driving";
    }
    return NULL;
}

const char *web_driver_take(web_driver_t *self, const web_command_t *command, const web_limits_t *limits,
                            uint64_t now_us, web_twist_t *out_twist) {
    const int64_t max = limits->max_speed_mm_s;
    int64_t v = 0;
    int64_t yaw = 0;
    const char *why = judge(self, command, limits, now_us + (uint64_t)limits->ahead_us);
    if (why == NULL && (!web_number(command->v_mm_s, -max, max, &v) ||
                        !web_number(command->yaw_mrad_s, -YAW_MAX_MRAD_S, YAW_MAX_MRAD_S, &yaw))) {
        why = "v_mm_s or yaw_mrad_s is outside what this page may drive";
    }
    if (why != NULL) {
        self->dropped++;
        return why;
    }
    (void)web_number(command->sequence, 1, INT64_MAX, &self->sequence);
    self->silent_us = now_us + WEB_SILENT_US;
    *out_twist = (web_twist_t){(int32_t)v, (int32_t)yaw};
    return NULL;
}

bool web_driver_silent(const web_driver_t *self, uint64_t now_us) {
    return self->is_driven && now_us >= self->silent_us;
}
