// SPDX-License-Identifier: MIT
/// A force sensor whose frames come every 50 ms, and the core's processing of them.
#ifndef TEST_FORCE_RIG_H
#define TEST_FORCE_RIG_H

#include "fixture.h"
#include "iwheel/force_offset.h"

typedef struct {
    iw_config_t config;
    iw_force_t force;
    iw_time_us_t now_us;
} force_rig_t;

extern force_rig_t rig;

/// Begins with a wheel whose first telemetry comes while it is already running; the left one, in cN.
void force_rig_init(force_rig_t *self);

/// Begins again for one side, with the rig's configuration. `boot_seen`: the start of the wheel was observed.
void force_rig_begin(force_rig_t *self, iw_side_t side, bool boot_seen);

/// One frame, 50 ms after the previous one.
void force_rig_hear(force_rig_t *self, int16_t raw, bool still);

/// This many frames of a quiet sensor at standstill.
void force_rig_quiet(force_rig_t *self, uint32_t samples, int16_t raw);

/// Two seconds that alternate between both values, at standstill.
void force_rig_alternate(force_rig_t *self, int16_t even, int16_t odd);

/// The wheel sends its own offset.
void force_rig_offset(force_rig_t *self, int16_t offset_dN);

/// Reads the result now.
iw_force_validity_t force_rig_validity(const force_rig_t *self);
iw_tare_t force_rig_tare(force_rig_t *self);

#endif
