// SPDX-License-Identifier: MIT
#include "fixture.h"

void fixture_config(iw_config_t *out_config) {
    iw_config_default(out_config);
    out_config->setpoint_type = 1;
    out_config->setpoint_type_set = true;
    out_config->current_role = IW_ROLE_LIMIT;
    out_config->track_mm = 540;
}

void fixture_random_init(fixture_random_t *self, uint32_t seed) {
    self->state = (seed * 2654435761U) ^ 0x9E3779B9U;
    if (self->state == 0) {
        self->state = 1;
    }
}

uint32_t fixture_random(fixture_random_t *self) {
    self->state ^= self->state << 13;
    self->state ^= self->state >> 17;
    self->state ^= self->state << 5;
    return self->state;
}

int32_t fixture_random_in(fixture_random_t *self, int32_t low, int32_t high) {
    const uint32_t span = (uint32_t)(high - low) + 1U;
    return low + (int32_t)(fixture_random(self) % span);
}
