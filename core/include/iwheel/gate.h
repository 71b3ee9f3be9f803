// SPDX-License-Identifier: MIT
/// The one gate that every outgoing frame passes, right before it is handed to the port.
///
/// It knows nothing of why a frame is sent. It looks at the bytes, as the wheel would, and lets through only a
/// setpoint of one of the two ids, with the configured type and length, current and speed within the configured
/// maxima, and a speed no further from the last one that passed than the configured slopes allow for the time
/// between; a change of sign must pass through a zero that was sent. A zero of the right type and current passes
/// whatever its slew. A negative current is refused where the current is a limit; while setpoint type or current role
/// are unset nothing passes.
///
/// Written independently of the scheduler, so that an error in one is caught by the other.
#ifndef IW_GATE_H
#define IW_GATE_H

#include "iwheel/codec.h"
#include "iwheel/config.h"

/// Time between two frames counts up to this. Longer silence is no permission to jump: after it comes a zero.
#define IW_GATE_ELAPSED_MAX_US 300000U

typedef enum {
    IW_GATE_PASS = 0,
    IW_GATE_NOT_A_SETPOINT, ///< Wrong id, format or length.
    IW_GATE_TYPE,           ///< Not the configured setpoint type, or none is configured.
    IW_GATE_CURRENT,
    IW_GATE_SPEED,
    IW_GATE_SLEW,
} iw_gate_verdict_t;

typedef struct {
    const iw_config_t *config;
    iw_time_us_t last_us[IW_SIDES]; ///< When the last frame passed.
    int32_t last_mm_s[IW_SIDES];    ///< Its speed, as on the bus; 0 at first.
    uint32_t stopped;               ///< Frames that did not pass.
} iw_gate_t;

/// `config` must be checked and outlive it.
void iw_gate_init(iw_gate_t *self, const iw_config_t *config);

/// Judges one frame; what does not pass is counted and must not be sent.
iw_gate_verdict_t iw_gate_check(iw_gate_t *self, iw_time_us_t now_us, const iw_can_frame_t *frame);

#endif
