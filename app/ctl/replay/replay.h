// SPDX-License-Identifier: MIT
/// A recording fed through the same core that runs in the gateway, and what the core decided.
///
/// Pure but for the stream it prints to: time, frames and requests come from the recording, so the same recording gives the
/// same bytes each time. What the core would send goes nowhere; where the recording has the echo of a setpoint it is
/// compared with what the core sent.
#ifndef REPLAY_H
#define REPLAY_H

#include "blackbox_entry.h"

#include "iwheel/gateway.h"

#include <stdio.h>

/// Answers of the port noted in one step.
#define REPLAY_ANSWERS 8U
/// Setpoints of one wheel on their way to their echo.
#define REPLAY_SENT 4U

typedef struct {
    uint64_t same;
    uint64_t different;
} replay_score_t;

/// Where it is told, and how.
typedef struct {
    FILE *file;
    bool json; ///< One object a line instead of text.
} replay_out_t;

typedef struct {
    iw_gateway_t gateway;
    replay_out_t out;
    const char *estop_name;
    const char *bus_name;
    iw_time_us_t zero_us; ///< Printed times count from here.
    iw_time_us_t now_us;  ///< Of the last step.
    iw_time_us_t next_us; ///< As it wished.
    // What the port answers.
    int estop;
    iw_bus_state_t bus;
    iw_can_frame_t frame[IW_GATEWAY_DRAIN_MAX]; ///< To be received in the next step.
    uint32_t frames;
    uint32_t received;
    blackbox_entry_t answer[REPLAY_ANSWERS]; ///< To sends and purges of the next step, in order.
    uint32_t answers;
    uint32_t answered;
    bool echoes; ///< While the recording has none: what is sent comes back as its echo.
    // What was told, so that only changes are.
    bool quiet;    ///< Nothing is told.
    bool compares; ///< Echoes are compared with what was sent.
    iw_state_t state;
    iw_refusal_t arm_refusal;
    bool arming;
    uint32_t stop_number;
    uint32_t present;
    bool heard[IW_SIDES];
    iw_force_validity_t force[IW_SIDES];
    iw_assumption_entry_t assumptions[IW_ASSUMPTION_ITEMS];
    blackbox_drive_t drive;
    uint8_t drive_refusal;
    iw_client_t drive_client; ///< IW_CLIENT_NONE: no command was told since the last other thing.
    // The comparison with what was recorded.
    iw_can_frame_t sent[IW_SIDES][REPLAY_SENT];
    uint32_t sent_count[IW_SIDES];
    uint64_t total_frames;
    uint64_t total_sent;
    replay_score_t setpoints;
    replay_score_t requests;
    replay_score_t states;
    replay_score_t stops;
} replay_t;

/// Begins with the bus active, the e-stop released, in LISTENING. `config` must be one that the core accepts.
void replay_init(replay_t *self, const iw_config_t *config, iw_time_us_t at_us, replay_out_t out);

/// The same, as the recorded gateway began.
void replay_start(replay_t *self, const iw_config_t *config, const blackbox_entry_t *entry);

/// A frame to be received in the next step. False: there is no room, step first.
bool replay_frame(replay_t *self, const iw_can_frame_t *frame);

/// One step of the core, and everything it decided.
void replay_step(replay_t *self, iw_time_us_t at_us);

/// Anything else that is in a recording: a change of the port's answers, a request; a decision is compared with ours.
/// BLACKBOX_FRAME, _STEP and _START are not for here.
void replay_event(replay_t *self, const blackbox_entry_t *entry);

/// What is known of the wheels after the last step.
iw_snapshot_t replay_look(const replay_t *self);

/// Tells in a closing line or two what was fed in, and how it compares with what was recorded.
void replay_finish(const replay_t *self);

/// Brings a replay to where the recorded gateway was when its recording begins: to the state, the lease and the speed that the
/// recording tells, on wheels made up for it. What it had learned before (force offsets, assumptions) stays unknown.
/// `state` is a BLACKBOX_STATE; `self->estop` and `self->bus` are the answers at its time. Nothing of this is told. False: the
/// core could not be brought there.
bool replay_warm(replay_t *self, const iw_config_t *config, const blackbox_entry_t *state);

// --- what it decides, in lines for people or as JSON (replay_tell.c) ---------------------------------------------

/// What the last step has changed.
void replay_tell_step(replay_t *self);

/// A request and what became of it. A drive command that says the same as the one before is not told again.
void replay_tell_request(replay_t *self, const blackbox_entry_t *entry, iw_refusal_t refusal);

/// An answer of the port that has changed; before it is taken over.
void replay_tell_answer(const replay_t *self, const blackbox_entry_t *entry);

/// A decision was recorded that is not ours.
void replay_tell_difference(const replay_t *self, const blackbox_entry_t *entry);

/// A remark that belongs to no time.
__attribute__((format(printf, 2, 3))) void replay_note(const replay_out_t *out, const char *format, ...);

#endif
