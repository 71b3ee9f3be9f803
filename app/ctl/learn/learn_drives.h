// SPDX-License-Identifier: MIT
/// How far each drive of a recording left its path: what the gateway's rule of the pair (iwheel/diverge.h) would
/// have seen. So an integrator knows the margin to `pair_mm` on the real wheels before the gateway drives them.
#ifndef LEARN_DRIVES_H
#define LEARN_DRIVES_H

#include "learn_lag.h"

#include "iwheel/diverge.h"

/// Drives told one by one.
#define LEARN_DRIVES_MAX 32U

/// From its first setpoint with a speed until both had none for a second, or none came for a second.
typedef struct {
    int64_t begin_us;  ///< In the recording's time.
    int64_t end_us;    ///< Its last setpoint with a speed.
    int64_t judged_us; ///< For how long both wheels were told and heard; 0: nothing is known of its deviation.
    uint32_t deviation_mm;
} learn_drive_t;

typedef struct {
    const iw_config_t *config;
    iw_diverge_t pair;
    int64_t received_us[IW_SIDES]; ///< Its last speed frame; -1: none.
    int64_t told_us[IW_SIDES];     ///< Its last setpoint; -1: none.
    int64_t last_us;               ///< Of any frame.
    int64_t moved_us;              ///< The last setpoint with a speed.
    bool driving;
    bool compared; ///< Up to the last frame.
    uint32_t count;
    learn_drive_t drive[LEARN_DRIVES_MAX + 1U]; ///< Of more drives the last place keeps the one that is going on.
    uint32_t largest_mm;                        ///< Of all.
    int64_t judged_us;                          ///< The same as in a drive, of all.
    learn_lag_t lag[IW_SIDES];
} learn_drives_t;

/// `config` must outlive it: limits, time constants, `invert` and the gear.
void learn_drives_init(learn_drives_t *self, const iw_config_t *config);

void learn_drives_frame(learn_drives_t *self, const candump_t *frame);

/// The drives that are told one by one.
uint32_t learn_drives_told(const learn_drives_t *self);

/// Adds its sentences.
void learn_drives_weigh(const learn_drives_t *self, learn_findings_t *out_findings);

#endif
