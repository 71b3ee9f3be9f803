// SPDX-License-Identifier: MIT
#include "driver.h"

#include <string.h>

/// Of the pad: a full turn on the spot in six seconds.
#define YAW_MAX_MRAD_S 1000

void web_driver_begin(web_driver_t *self, const char *key, uint64_t now_us) {
    memcpy(self->key, key, sizeof self->key);
    self->sequence = 0;
    self->silent_us = now_us + WEB_FIRST_US;
}

void web_driver_end(web_driver_t *self) {
    self->key[0] = '\0';
}

static const char *judge(const web_driver_t *self, const web_command_t *command, const web_limits_t *limits,
                         uint64_t now_us) {
    int64_t sequence = 0;
    int64_t told_us = 0;
    if (self->key[0] == '\0' || command->key == NULL || !web_token_is(self->key, command->key)) {
        return "another page drives, or nobody: arm from this one";
    }
    if (!web_number(command->t_us, 0, INT64_MAX, &told_us) || !web_number(command->sequence, 1, INT64_MAX, &sequence)) {
        return "a command needs t_us and sequence";
    }
    if (sequence <= self->sequence) {
        return "a newer command was here already";
    }
    if ((uint64_t)told_us > now_us || now_us - (uint64_t)told_us > limits->ttl_us) {
        return "too old: the connection is too slow for driving";
    }
    return NULL;
}

const char *web_driver_take(web_driver_t *self, const web_command_t *command, const web_limits_t *limits,
                            uint64_t now_us, web_twist_t *out_twist) {
    const int64_t max = limits->max_speed_mm_s;
    int64_t v = 0;
    int64_t yaw = 0;
    const char *why = judge(self, command, limits, now_us);
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
    return self->key[0] != '\0' && now_us >= self->silent_us;
}
