// SPDX-License-Identifier: MIT
/// Guides the operator from unknown wheels to a configuration that the operator has seen to be right.
///
///     checks -> e-stop -> gear -> setpoint type -> current role -> signs -> force -> radius -> track -> file
///
/// Every movement goes through a gateway that is started for the session with a trial configuration (slow, little
/// current), so the core's limits, lease and e-stop apply here as they do later. Each step stores its result in
/// `config`, and the way it was found in a note. A value that is not found stays as it was, and is reported as assumed.
/// An error, and an operator who wants to quit, end the program at that place (`bringup_fail`, `bringup_quit`). A value
/// is confirmed only if everything that its sentence claims was observed, on both wheels if it is about both.
#ifndef BRINGUP_H
#define BRINGUP_H

#include "doctor/doctor.h"
#include "text/ctl_text.h"

#include <setjmp.h>

/// Wheels in the air turn slowly, but a direction can be seen; and briefly, but the operator has time to see it.
#define BRINGUP_SPEED_MM_S  100
#define BRINGUP_CURRENT_mA  500
#define BRINGUP_PROBE_MS    1200U
#define BRINGUP_NOTE_SIZE   160U
#define BRINGUP_STEPS       10U
#define BRINGUP_NOTES       16U
#define BRINGUP_ANSWER_SIZE 160U

/// The way in which a value was found.
typedef struct {
    const char *section;
    const char *key;
    const char *item; ///< Item of the assumption store if it is confirmed; NULL: still assumed.
    char text[BRINGUP_NOTE_SIZE];
} bringup_note_t;

/// The gateway of the session.
typedef struct {
    char folder[64]; ///< Empty: no folder was made.
    char program[512];
    int pid;   ///< 0: it does not run.
    int guard; ///< Process that removes the folder when no process holds `leash` any more; 0: none.
    int leash;
} trial_t;

typedef struct {
    ctl_t *ctl;
    gateway_config_t config; ///< Configuration that will be written.
    bringup_note_t note[BRINGUP_NOTES];
    unsigned notes;
    const char *recording; ///< Recording of another controller to learn from; NULL: none.
    const char *out_path;
    int current_mA;
    double mm_per_tick; ///< From a pushed distance; 0: not known.
    trial_t trial;
    int64_t known_us;  ///< Stops until this time are known: the operator answered later, or the stop is a result.
    int64_t estop_us;  ///< Time of the last e-stop of the trial gateways that ended; 0: none.
    jmp_buf disturbed; ///< Begin of the present step.
    bool repeats;      ///< The present step can be repeated: bringup_fail offers it.
    bool ending;       ///< The last question is being asked.
} bringup_t;

/// Reason why a count is not complete. A stall of this program or of the gateway is not a reason: wheels continue to
/// count.
typedef enum {
    HAND_COMPLETE = 0,
    HAND_OFFLINE,   ///< The gateway answered, but a wheel was offline for HAND_OFFLINE_US.
    HAND_RESTARTED, ///< A wheel restarted, or was offline for so long that it may have restarted.
    HAND_UNSEEN,    ///< No answer of the gateway for HAND_UNSEEN_US: a turn forth and back would not be seen.
} hand_gap_t;

#define HAND_OFFLINE_US 500000
#define HAND_UNSEEN_US  2000000
/// A longer time between two answers is a stall of this program or of the gateway; it shows nothing about the wheels.
#define HAND_STALL_US 200000

/// One answer of the gateway.
typedef struct {
    long long ticks[IW_SIDES];
    int rpm[IW_SIDES];
    long long reboots; ///< Sum of both wheels.
    bool heard;        ///< Both wheels are online.
} hand_sample_t;

/// Counts of the wheels while hands moved them, in the wheels' own sense of rotation.
typedef struct {
    long long ticks[IW_SIDES];
    long long way[IW_SIDES];     ///< Sum of forward and backward ticks.
    double rpm_turns[IW_SIDES];  ///< Reported rpm, integrated over time without stalls.
    long long rpm_way[IW_SIDES]; ///< Ticks of the same time.
    hand_gap_t gap;              ///< The first gap.
    hand_sample_t last;          ///< Last answer with both wheels online.
    int64_t received_us;         ///< Time of `last`.
    int64_t polled_us;
    int64_t offline_us; ///< Time offline since `received_us`, without stalls.
} hand_t;

/// A short movement of both wheels.
typedef struct {
    int speed_mm_s[IW_SIDES];
    int current_mA[IW_SIDES];
    bool has_current;
    unsigned for_ms;
    int enough_mm_s; ///< The burst ends when both wheels are this fast, or one wheel four times as fast; 0: never.
} burst_t;

typedef enum { BURST_DONE = 0, BURST_ABORTED, BURST_STOPPED, BURST_REFUSED, BURST_LOST } burst_end_t;

/// Result of a burst; speeds are in the machine's sense of direction.
typedef struct {
    burst_end_t end;
    int mean_mm_s[IW_SIDES]; ///< Mean of the second half; the peak if the burst ended by `enough_mm_s`.
    int peak_mm_s[IW_SIDES]; ///< Largest speed, with its sign.
    char why[256];           ///< Reason, unless BURST_DONE.
} outcome_t;

// --- talking (bringup_talk.c) ------------------------------------------------------------------------------------

/// Prints a paragraph, broken into lines.
__attribute__((format(printf, 1, 2))) void talk_print(const char *format, ...);

/// Prints the heading of a step.
void talk_step(unsigned number, const char *title);

/// Asks a question and reads a line. Discards input from before the question. An empty line means `otherwise`. Ends
/// bringup if the operator wants to quit (q, end of input, Ctrl-C).
void talk_ask(bringup_t *self, const char *question, const char *otherwise, char out_answer[BRINGUP_ANSWER_SIZE]);

/// Asks a question that is answered by yes or no, as talk_ask does.
bool talk_yes(bringup_t *self, const char *question, bool otherwise);

/// Asks for a number until it is within the bounds. Returns false after an empty line.
bool talk_number(bringup_t *self, const char *question, double low, double high, double *out_number);

/// Discards input from before the question.
void talk_forget(void);

/// From begin to end, a key is received immediately, without Enter. Neither call discards input: a key since the last
/// question counts as pressed until the next question.
void talk_keys_begin(void);
void talk_keys_end(void);
/// Returns true if a key was pressed or the input ended.
bool talk_key_pressed(void);

// --- the trial gateway (bringup_trial.c, bringup_burst.c) --------------------------------------------------------

/// Starts a trial gateway with `config` on the bus, slowed down; a running one ends. It does not use the files of the
/// real gateway. If that fails, prints the reason and ends bringup.
void trial_start(bringup_t *self, const gateway_config_t *config);
/// Starts a trial gateway with the real gateway's records and the configuration found. Returns false after it has
/// printed the reason of a failure.
bool trial_start_with_records(bringup_t *self);
void trial_stop(bringup_t *self);
/// Stops the trial gateway and removes its folder.
void trial_close(bringup_t *self);
/// Returns a new reference to the status of the trial gateway, or NULL.
json_t *trial_status(bringup_t *self);
/// Runs the burst, reports it to the operator before and after, and offers to repeat it after a failure. Returns false
/// if the burst was not done and the operator wants no repetition.
bool burst_show(bringup_t *self, const burst_t *burst, outcome_t *out_outcome);
/// Runs the burst as burst_show does, but ends bringup if it was not done.
void burst_insist(bringup_t *self, const burst_t *burst, outcome_t *out_outcome);

// --- conditions (bringup_ready.c) ---------------------------------------------------------------------------------

/// Waits until both wheels are online and at standstill and the gateway is listening. Returns false after it has
/// written the reason if that does not happen, or a key is pressed. An e-stop that is not released ends the wait
/// immediately, and so do a wheel that is offline for half a second and a stop that is later than the operator's last
/// answer: only an answer leads to a movement.
/// Resets an earlier latch.
bool ready_to_move(bringup_t *self, char *out_why, size_t size);
/// Waits until both wheels are online and at standstill and the e-stop is released, before hands move them. Resets
/// nothing. Ends bringup after it has printed the reason if that does not happen.
void ready_by_hand(bringup_t *self);
/// Waits until the trial gateway sends no zeros any more, and stores the time of its last e-stop: the next trial gateway
/// does not know it.
void ready_retain_estop(bringup_t *self);

// --- by hand (bringup_hand.c, bringup_sum.c) ----------------------------------------------------------------------

/// Waits until both wheels are at standstill, prompts, and adds up their counts until Enter. Ends bringup if they do
/// not come to standstill, or the operator wants to quit.
void hand_follow(bringup_t *self, const char *prompt, hand_t *out_hand);

/// Starts the sum with this answer.
void hand_begin(hand_t *out_hand, const hand_sample_t *first, int64_t now_us);
/// Adds the next answer.
void hand_add(hand_t *self, const hand_sample_t *now, int64_t now_us);
/// Returns false after it has printed why the count is not complete.
bool hand_is_complete(const hand_t *hand);
/// Returns the turns that the rpm show as a share of the rotor's turns; 0 if too little of them was measured.
double hand_rpm_share(const hand_t *hand, iw_side_t side);

/// Returns true if almost nothing of the wheel's way was backwards.
bool hand_went_one_way(const hand_t *hand, iw_side_t side);

// --- the steps ---------------------------------------------------------------------------------------------------

void bringup_checks(bringup_t *self);
void bringup_estop(bringup_t *self);

/// Sets the stored names of the e-stop's lines to `any`: the result of an earlier bringup is no longer valid.
void bringup_forget_wiring(bringup_t *self);

/// Stores the label of the chip and the name of each e-stop line in the configuration. A name that the configuration
/// cannot hold is left out.
void bringup_store_wiring(bringup_t *self);
void bringup_gear(bringup_t *self);
void bringup_type(bringup_t *self);
void bringup_role(bringup_t *self);
void bringup_signs(bringup_t *self);
void bringup_force(bringup_t *self);
void bringup_radius(bringup_t *self);
void bringup_track(bringup_t *self);
void bringup_write(bringup_t *self);

// --- shared by the steps -----------------------------------------------------------------------------------------

/// Ends the program because there is no input any more: stops the trial gateway, removes its folder and writes nothing.
_Noreturn void bringup_abandon(bringup_t *self);
/// Ends the program because the operator wants to quit. Offers to save the confirmed results before.
_Noreturn void bringup_quit(bringup_t *self);
/// The present step cannot continue; the reason has been printed. Offers to repeat the step; otherwise ends the program
/// as bringup_quit does.
_Noreturn void bringup_fail(bringup_t *self);

// --- results of a bringup that ended early (bringup_resume.c) -----------------------------------------------------

/// Writes the configuration with the notes to `path`. With `saved` the file can be continued with --from. Returns false
/// after it has printed the reason of a failure.
bool bringup_write_file(bringup_t *self, const char *path, bool saved);
/// Writes the last line of a saved file: the checksum of the text before it.
void bringup_print_mark(const char *text, size_t length, FILE *out);
/// Reads the confirmed results of a saved file; a file that was changed since, or another one, has none.
void bringup_read_saved(bringup_t *self, const char *path);
/// Asks whether the results of the saved file are for these wheels.
void bringup_resume(bringup_t *self);
/// Returns true if all results of this step are confirmed.
bool bringup_is_restored(const bringup_t *self, unsigned step);

/// Returns a burst of both wheels forwards, with current, to try the setpoint type.
burst_t bringup_ahead(const bringup_t *self, unsigned for_ms);
/// Starts a trial gateway that sends this type, with the current role in which a zero is certainly no torque.
void bringup_start_with(bringup_t *self, int type);
/// Returns true if a note confirms this item of the assumption store.
bool bringup_is_confirmed(const bringup_t *self, const char *item);

/// Notes how the value of a key was found; a later note replaces the earlier one. `item` is the item of the assumption
/// store if the note confirms it, otherwise NULL.
__attribute__((format(printf, 5, 6))) void bringup_note(bringup_t *self, const char *section, const char *key,
                                                        const char *item, const char *format, ...);

/// Sets `rest_rpm` to its default if it would classify a rolling wheel as at standstill after a change of radius or
/// gear.
void bringup_fit_rest(iw_config_t *core);

#endif
