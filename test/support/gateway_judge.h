// SPDX-License-Identifier: MIT
/// The invariants of the motion rules, judged from outside: from the frames passed to the bus and the replies to clients.
///
/// The judge does not know how the gateway works. The first violation stays in `violation`.
#ifndef TEST_GATEWAY_JUDGE_H
#define TEST_GATEWAY_JUDGE_H

#include "fake_bus.h"
#include "iwheel/gateway.h"

typedef struct {
    const iw_config_t *config;
    const iw_gateway_t *gateway; ///< Read only for its state.
    const fake_bus_t *bus;
    const char *violation;           ///< NULL: none so far.
    iw_time_us_t frame_us[IW_SIDES]; ///< Time of the last frame accepted for each wheel.
    iw_time_us_t asked_us;           ///< Time of the last request for a nonzero drive.
    iw_time_us_t drive_us;           ///< Time of the last accepted drive.
    iw_time_us_t gap_us;             ///< Gaps between setpoints count from this time on.
    int32_t speed_mm_s[IW_SIDES];    ///< Speed last accepted, as on the bus.
    uint32_t frames;
    uint32_t moving_frames;  ///< Frames with a nonzero speed.
    bool fresh;              ///< A nonzero drive was accepted, and nothing has ended its effect since.
    bool no_tail;            ///< No ramp down may follow either, until the next fresh drive.
    bool pair_broken;        ///< The next frames must be zero.
    bool tried[IW_SIDES];    ///< In this step the gateway passed a frame to the bus ...
    bool accepted[IW_SIDES]; ///< ... the bus accepted it ...
    bool step_moves;         ///< ... and one accepted frame was not zero.
} gateway_judge_t;

/// Begins, and becomes the listener of the bus.
void gateway_judge_init(gateway_judge_t *self, const iw_gateway_t *gateway, fake_bus_t *bus);

/// A client requested to drive, whatever the reply will be.
void gateway_judge_asked(gateway_judge_t *self, bool nonzero);

/// A drive was accepted.
void gateway_judge_drive(gateway_judge_t *self, bool nonzero);

/// Arm, reset or takeover succeeded: earlier commands do not count as fresh.
void gateway_judge_renew(gateway_judge_t *self);

/// Called immediately before a step. `pressed`: the step will read a pressed e-stop. `late_us`: how much later than planned the step comes.
void gateway_judge_before(gateway_judge_t *self, bool pressed, iw_time_us_t late_us);

/// Called immediately after a step, with its result.
void gateway_judge_after(gateway_judge_t *self, iw_time_us_t wake_us);

#endif
