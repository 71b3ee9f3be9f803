// SPDX-License-Identifier: MIT
/// Distance by which each drive of a recording left its path, as the gateway's rule of the pair (iwheel/diverge.h)
/// would have measured it. It shows the margin to `pair_mm` on the real wheels before the gateway drives them.
#ifndef LEARN_DRIVES_H
#define LEARN_DRIVES_H

#include "learn_lag.h"

#include "iwheel/diverge.h"

/// Maximum number of drives that are reported one by one.
#define LEARN_DRIVES_MAX 32U

/// A drive begins with its first setpoint with a speed. It ends when both wheels had no speed for a second, or no
/// setpoint arrived for a second.
typedef struct {
    int64_t begin_us;  ///< Time in the recording.
    int64_t end_us;    ///< Time of its last setpoint with a speed.
    int64_t judged_us; ///< Time in which both wheels had setpoints and speed frames; 0: its deviation is not known.
    uint32_t deviation_mm;
} learn_drive_t;

typedef struct {
    const iw_config_t *config;
    iw_diverge_t pair;
    int64_t received_us[IW_SIDES]; ///< Time of its last speed frame; -1: none.
    int64_t setpoint_us[IW_SIDES]; ///< Time of its last setpoint; -1: none.
    int64_t last_us;               ///< Time of the last frame.
    int64_t moved_us;              ///< Time of the last setpoint with a speed.
    bool driving;
    bool compared; ///< The comparison has reached the last frame.
    uint32_t count;
    learn_drive_t drive[LEARN_DRIVES_MAX + 1U]; ///< The last place stores the current drive if there are more.
    uint32_t largest_mm;                        ///< Largest deviation of all drives.
    int64_t judged_us;                          ///< Sum of `judged_us` of all drives.
    learn_lag_t lag[IW_SIDES];
} learn_drives_t;

/// Initialises `self`. `config` must exist as long as `self`: limits, time constants, `invert` and the gear.
void learn_drives_init(learn_drives_t *self, const iw_config_t *config);

void learn_drives_frame(learn_drives_t *self, const candump_t *frame);

/// Returns the number of drives that are reported one by one.
uint32_t learn_drives_printed(const learn_drives_t *self);

/// Adds the findings about the drives.
void learn_drives_weigh(const learn_drives_t *self, learn_findings_t *out_findings);

#endif
