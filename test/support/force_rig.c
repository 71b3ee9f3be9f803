// SPDX-License-Identifier: MIT
#include "force_rig.h"

#include "unity.h"

#include <string.h>

force_rig_t rig;

void setUp(void) {
    force_rig_init(&rig);
}

void force_rig_init(force_rig_t *self) {
    fixture_config(&self->config);
    self->now_us = FIXTURE_START_US;
    force_rig_begin(self, IW_LEFT, false);
}

void force_rig_begin(force_rig_t *self, iw_side_t side, bool boot_seen) {
    memset(&self->force, FIXTURE_POISON, sizeof self->force);
    iw_force_init(&self->force, self->config.force_unit[side]);
    iw_force_reopen(&self->force, boot_seen);
}

void force_rig_hear(force_rig_t *self, int16_t raw, bool still) {
    self->now_us += MS(50);
    iw_force_receive(&self->force, self->now_us, raw, still);
}

void force_rig_quiet(force_rig_t *self, uint32_t samples, int16_t raw) {
    for (uint32_t n = 0; n < samples; n++) {
        force_rig_hear(self, raw, true);
    }
}

void force_rig_alternate(force_rig_t *self, int16_t even, int16_t odd) {
    for (uint32_t n = 0; n < IW_FORCE_WINDOW_SAMPLES; n++) {
        force_rig_hear(self, ((n & 1U) == 0U) ? even : odd, true);
    }
}

void force_rig_offset(force_rig_t *self, int16_t offset_dN) {
    iw_force_receive_offset(&self->force, self->now_us, offset_dN);
}

iw_force_validity_t force_rig_validity(const force_rig_t *self) {
    return iw_force_validity(&self->force, self->now_us);
}

iw_tare_t force_rig_tare(force_rig_t *self) {
    return iw_force_tare(&self->force, self->now_us);
}
