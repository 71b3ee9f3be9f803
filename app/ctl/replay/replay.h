// SPDX-License-Identifier: MIT
/// Feeds a recording through the core of the gateway and prints the decisions of the core.
///
/// Pure, except for the output stream: time, frames and requests come from the recording, so the same recording results
/// in the same bytes each time. The frames that the core sends are dropped. If the recording has the echo of a setpoint,
/// it is compared with the frame that the core sent.
#ifndef REPLAY_H
#define REPLAY_H

#include "blackbox_entry.h"

#include "iwheel/gateway.h"

#include <stdio.h>

/// Maximum number of answers of the port in one step.
#define REPLAY_ANSWERS 8U
/// Maximum number of setpoints of one wheel without an echo.
#define REPLAY_SENT 4U

typedef struct {
    uint64_t same;
    uint64_t different;
} replay_score_t;

/// Output stream and form.
typedef struct {
    FILE *file;
    bool json;            ///< One object per line instead of text.
    uint32_t samples_us;  ///< Samples instead of decisions, at least this long apart; 0: decisions.
    bool frames_only;     ///< Samples of a recording without requests and states: these are unknown.
    int64_t wall_less_us; ///< Times of samples are those of the core plus this.
} replay_out_t;

/// The setpoints of the recording, for samples.
typedef struct {
    iw_time_us_t due_us;          ///< Time of the next sample.
    iw_time_us_t at_us[IW_SIDES]; ///< Time of the last setpoint of a wheel.
    int16_t speed_mm_s[IW_SIDES]; ///< Its speed, in the machine's frame.
    bool known[IW_SIDES];         ///< There was one.
} replay_samples_t;

typedef struct {
    iw_gateway_t gateway;
    replay_out_t out;
    const char *estop_name;
    const char *bus_name;
    iw_time_us_t zero_us; ///< Printed times count from this time.
    iw_time_us_t now_us;  ///< Time of the last step.
    iw_time_us_t next_us; ///< Time of the next step that the core requested.
    // Answers of the port.
    int estop;
    iw_bus_state_t bus;
    iw_can_frame_t frame[IW_GATEWAY_DRAIN_MAX]; ///< Received in the next step.
    uint32_t frames;
    uint32_t received;
    blackbox_entry_t answer[REPLAY_ANSWERS]; ///< Answers to sends and purges of the next step, in order.
    uint32_t answers;
    uint32_t answered;
    bool echoes; ///< For a time without recorded echoes: each sent frame returns as its echo.
    replay_samples_t samples;
    // Values that were printed, so that only changes are printed.
    bool quiet;    ///< Nothing is printed.
    bool compares; ///< Echoes are compared with sent frames.
    iw_state_t state;
    iw_refusal_t arm_refusal;
    bool arming;
    uint32_t stop_number;
    uint32_t present;
    bool online[IW_SIDES];
    iw_force_validity_t force[IW_SIDES];
    iw_assumption_entry_t assumptions[IW_ASSUMPTION_ITEMS];
    blackbox_drive_t drive;
    uint8_t drive_refusal;
    iw_client_t drive_client; ///< IW_CLIENT_NONE: no command was printed since the last other event.
    // Comparison with the recording.
    iw_can_frame_t sent[IW_SIDES][REPLAY_SENT];
    uint32_t sent_count[IW_SIDES];
    uint64_t total_frames;
    uint64_t total_sent;
    replay_score_t setpoints;
    replay_score_t requests;
    replay_score_t states;
    replay_score_t stops;
} replay_t;

/// Starts with bus active, e-stop released, state LISTENING. The core must accept `config`.
void replay_init(replay_t *self, const iw_config_t *config, iw_time_us_t at_us, replay_out_t out);

/// Starts as the recorded gateway started.
void replay_start(replay_t *self, const iw_config_t *config, const blackbox_entry_t *entry);

/// Adds a frame for the next step. Returns false if the buffer is full; then step first.
bool replay_frame(replay_t *self, const iw_can_frame_t *frame);

/// Runs one step of the core and prints its decisions.
void replay_step(replay_t *self, iw_time_us_t at_us);

/// Applies another entry of a recording: a change of the port's answers, or a request; a recorded decision is compared
/// with the present one. BLACKBOX_FRAME, _STEP and _START must not be passed.
void replay_event(replay_t *self, const blackbox_entry_t *entry);

/// Returns the snapshot after the last step.
iw_snapshot_t replay_snapshot(const replay_t *self);

/// Prints a summary: the number of inputs, and the comparison with the recording.
void replay_finish(const replay_t *self);

/// Brings a replay to the point where the recording begins: to its state, lease and speed, on simulated wheels. Values
/// that the gateway had learned before (force offsets, assumptions) stay unknown. `state` is a BLACKBOX_STATE;
/// `self->estop` and `self->bus` are the answers at its time. Prints nothing. Returns false if the core could not be
/// brought to this state.
bool replay_warm(replay_t *self, const iw_config_t *config, const blackbox_entry_t *state);

// --- decisions, as text or as JSON (replay_report.c) -----------------------------------------------------------------

/// Prints the changes of the last step.
void replay_report_step(replay_t *self);

/// Prints a request and its result. A drive command that is equal to the one before is not printed again.
void replay_report_request(replay_t *self, const blackbox_entry_t *entry, iw_refusal_t refusal);

/// Prints a changed answer of the port. Called before the answer is stored.
void replay_report_answer(const replay_t *self, const blackbox_entry_t *entry);

/// Prints a recorded decision that differs from the present one.
void replay_report_difference(const replay_t *self, const blackbox_entry_t *entry);

// --- samples: a table of both wheels in SI units (replay_samples.c) --------------------------------------------------

/// Prints the names of the columns. The unit is the last part of a name.
void replay_samples_begin(const replay_out_t *out);

/// Stores the speed of a setpoint of the recording.
void replay_samples_frame(replay_t *self, const iw_can_frame_t *frame);

/// Prints a row if it is due.
void replay_samples_step(replay_t *self);

/// Prints a row with an event, between the samples.
void replay_samples_event(const replay_t *self, iw_time_us_t at_us, const char *event, const char *text);

/// Prints a remark without a time.
__attribute__((format(printf, 2, 3))) void replay_note(const replay_out_t *out, const char *format, ...);

#endif
