// SPDX-License-Identifier: MIT
/// The envelope of one wheel, and frames for it.
#ifndef TEST_ENVELOPE_RIG_H
#define TEST_ENVELOPE_RIG_H

#include "iwheel/private/transmit.h"

#define START_US 5000000123ULL
#define AGES_US  3600000000ULL

extern iw_config_t config;
extern iw_envelope_t envelope;
extern bool no_floor; ///< Most tests check speeds with a current of 0: true at first.

/// Creates a new envelope after a change of the configuration.
void restart(void);

/// Returns a frame written byte by byte, so that a fault of the encoder does not hide one of the envelope.
iw_can_frame_t setpoint(iw_side_t side, int32_t speed_mm_s, int32_t current_mA);

iw_envelope_verdict_t check(iw_time_us_t now_us, iw_side_t side, int32_t speed_mm_s, int32_t current_mA);

#endif
