// SPDX-License-Identifier: MIT
/// The invariants of the motion rules, judged from outside: from the frames handed to the bus and the answers clients got.
///
/// Knows nothing of how the gateway works. The first violation stays in `violation`.
#ifndef TEST_GATEWAY_JUDGE_H
#define TEST_GATEWAY_JUDGE_H

#include "fake_bus.h"
#include "iwheel/gateway.h"

typedef struct {
    const iw_config_t *config;
    const iw_gateway_t *gateway; ///< Asked for its state only.
    const fake_bus_t *bus;
    const char *violation;           ///< NULL: none so far.
    iw_time_us_t frame_us[IW_SIDES]; ///< Last frame accepted for each wheel.
    iw_time_us_t asked_us;           ///< Last nonzero drive that anybody asked for.
    iw_time_us_t drive_us;           ///< Last accepted drive.
    iw_time_us_t gap_us;             ///< Gaps between setpoints count from here at the earliest.
    int32_t speed_mm_s[IW_SIDES];    ///< Last accepted, as on the bus.
    uint32_t frames;
    uint32_t moving_frames; ///< Not zero.
    bool fresh;             ///< A nonzero drive was accepted, and nothing has taken its effect since.
    bool no_tail;           ///< Not even a ramp down may follow: until the next fresh drive.
    bool pair_broken;       ///< The next frames must be zero.
    bool tried[IW_SIDES];   ///< In this step: a frame was handed over ...
    bool taken[IW_SIDES];   ///< ... and accepted ...
    bool step_moves;        ///< ... and one of them was not zero.
} gateway_judge_t;

/// Also becomes the listener of the bus.
void gateway_judge_init(gateway_judge_t *self, const iw_gateway_t *gateway, fake_bus_t *bus);

/// Somebody asked to drive, whatever the answer will be.
void gateway_judge_asked(gateway_judge_t *self, bool nonzero);

/// A drive was accepted.
void gateway_judge_drive(gateway_judge_t *self, bool nonzero);

/// Arm, reset or takeover succeeded: whatever was commanded before does not count as fresh.
void gateway_judge_renew(gateway_judge_t *self);

/// Called right before a step. `pressed`: it will see the e-stop. `late_us`: how much later than promised it comes.
void gateway_judge_before(gateway_judge_t *self, bool pressed, iw_time_us_t late_us);

/// Called right after a step, with what it returned.
void gateway_judge_after(gateway_judge_t *self, iw_time_us_t wake_us);

#endif
