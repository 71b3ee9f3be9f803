// SPDX-License-Identifier: MIT
/// Guides from unknown wheels to a configuration that somebody has seen to be right.
///
///     checks -> e-stop -> gear -> setpoint type -> current role -> signs -> force -> radius -> track -> file
///
/// Everything that moves goes through a gateway of its own, started for the session with a trial configuration (slow,
/// little current), so that the core's limits, lease and e-stop hold here as they do later. Each step puts what it found
/// into `config`, and how it was found into a note. Whatever is not found out stays as it was and is said to be assumed.
/// What cannot go on, and an operator who wants to end, ends the program at that place (`bringup_fail`, `bringup_quit`).
/// A value is confirmed only if all that its sentence claims was seen, on both wheels where it speaks of both.
#ifndef BRINGUP_H
#define BRINGUP_H

#include "doctor/doctor.h"
#include "text/ctl_text.h"

/// Wheels in the air: as slow as a sign can be seen from, and no longer than a look takes.
#define BRINGUP_SPEED_MM_S  100
#define BRINGUP_CURRENT_mA  500
#define BRINGUP_PROBE_MS    1200U
#define BRINGUP_NOTE_SIZE   160U
#define BRINGUP_STEPS       10U
#define BRINGUP_NOTES       16U
#define BRINGUP_ANSWER_SIZE 160U

/// How a value was found.
typedef struct {
    const char *section;
    const char *key;
    const char *item; ///< Of the ledger, if it is confirmed; null: assumed still.
    char text[BRINGUP_NOTE_SIZE];
} bringup_note_t;

/// A gateway of our own.
typedef struct {
    char folder[64]; ///< Empty: none was made.
    char program[512];
    int pid;   ///< 0: none runs.
    int guard; ///< The process that removes the folder when nobody holds `leash` any more; 0: none.
    int leash;
} trial_t;

typedef struct {
    ctl_t *ctl;
    gateway_config_t config; ///< What will be written.
    bringup_note_t note[BRINGUP_NOTES];
    unsigned notes;
    const char *recording; ///< Of another controller, to learn from; null: none.
    const char *out_path;
    int current_mA;
    double mm_per_tick; ///< By a distance that was pushed; 0: none was.
    trial_t trial;
} bringup_t;

/// Why a count is not complete. A stall of this program or of the gateway is none: the wheels go on counting.
typedef enum {
    HAND_COMPLETE = 0,
    HAND_OFFLINE,   ///< The gateway answered, and received nothing of a wheel for HAND_OFFLINE_US.
    HAND_RESTARTED, ///< The gateway saw a wheel restart, or away for so long that it may have.
    HAND_UNSEEN,    ///< No answer of the gateway for HAND_UNSEEN_US: a turn there and back would not have been seen.
} hand_gap_t;

#define HAND_OFFLINE_US 500000
#define HAND_UNSEEN_US  2000000
/// A longer time between two answers is a stall of ours, and says nothing of the wheels.
#define HAND_STALL_US 200000

/// One answer of the gateway.
typedef struct {
    long long ticks[IW_SIDES];
    int rpm[IW_SIDES];
    long long reboots; ///< Of both wheels.
    bool heard;        ///< Both wheels.
} hand_look_t;

/// What the wheels counted while hands moved them, in their own sense.
typedef struct {
    long long ticks[IW_SIDES];
    long long way[IW_SIDES];     ///< Back and forth, all added.
    double rpm_turns[IW_SIDES];  ///< The rpm they told, summed up over time,
    long long rpm_way[IW_SIDES]; ///< and the ticks of just that time: without stalls.
    hand_gap_t gap;              ///< The first one.
    hand_look_t last;            ///< The last answer with both wheels,
    int64_t heard_us;            ///< and when it came.
    int64_t looked_us;
    int64_t offline_us; ///< Since then, without stalls.
} hand_t;

/// The two wheels turn so for a moment.
typedef struct {
    int speed_mm_s[IW_SIDES];
    int current_mA[IW_SIDES];
    bool has_current;
    unsigned for_ms;
    int enough_mm_s; ///< Ends as soon as both wheels turn that fast, or one four times as fast; 0: never.
} burst_t;

typedef enum { BURST_DONE = 0, BURST_ABORTED, BURST_STOPPED, BURST_REFUSED, BURST_LOST } burst_end_t;

/// What the wheels did, in the machine's sense.
typedef struct {
    burst_end_t end;
    int mean_mm_s[IW_SIDES]; ///< Of the second half; the peak, if that was enough.
    int peak_mm_s[IW_SIDES]; ///< The largest, with its sign.
    char why[256];           ///< Unless BURST_DONE.
} outcome_t;

// --- talking (bringup_talk.c) ------------------------------------------------------------------------------------

/// A paragraph, broken into lines.
__attribute__((format(printf, 1, 2))) void talk_say(const char *format, ...);

/// A heading.
void talk_step(unsigned number, const char *title);

/// Asks and reads a line; what was typed before the question is thrown away. An empty line stands for `otherwise`. Ends
/// bringup if the operator wants to quit (q, end of input, Ctrl-C).
void talk_ask(bringup_t *self, const char *question, const char *otherwise, char out_answer[BRINGUP_ANSWER_SIZE]);

/// The same for yes or no.
bool talk_yes(bringup_t *self, const char *question, bool otherwise);

/// A number within the bounds, asked for until it is one; false after an empty line.
bool talk_number(bringup_t *self, const char *question, double low, double high, double *out_number);

/// Forgets what was typed before the question.
void talk_forget(void);

/// Keys are seen at once, without Enter, from begin to end.
void talk_keys_begin(void);
void talk_keys_end(void);
/// True if one was pressed (or the input ended).
bool talk_key_pressed(void);

// --- the trial gateway (bringup_trial.c, bringup_burst.c) --------------------------------------------------------

/// Starts one with `config` on the bus, made slow; the former one ends. It keeps and finds nothing of the real gateway's.
/// Ends bringup after telling why not.
void trial_start(bringup_t *self, const gateway_config_t *config);
/// The same with the real gateway's records and the configuration found. False after telling why not.
bool trial_start_with_records(bringup_t *self);
void trial_stop(bringup_t *self);
/// Ends it and removes its folder.
void trial_close(bringup_t *self);
/// A new reference to its status, or null.
json_t *trial_status(bringup_t *self);
/// Waits until both wheels are heard and stand, and no e-stop is pressed. False after telling.
bool trial_wait_ready(bringup_t *self);
/// The same, told to the operator before and after, and offered again when it went wrong. False: it was not done, and the
/// operator wants no more of it.
bool burst_show(bringup_t *self, const burst_t *burst, outcome_t *out_outcome);
/// The same; ends bringup if it was not done.
void burst_insist(bringup_t *self, const burst_t *burst, outcome_t *out_outcome);

// --- by hand (bringup_hand.c, bringup_sum.c) ------------------------------------------------------------------------------------

/// Waits until both wheels stand, prompts, and adds up what they count until Enter. Ends bringup if they do not stand, or the
/// operator wants to quit.
void hand_follow(bringup_t *self, const char *prompt, hand_t *out_hand);

/// The sum begins with this answer.
void hand_begin(hand_t *out_hand, const hand_look_t *first, int64_t now_us);
/// The next answer.
void hand_add(hand_t *self, const hand_look_t *now, int64_t now_us);
/// False after reporting why not all was counted.
bool hand_is_complete(const hand_t *hand);
/// How much of the rotor's turns the rpm made; 0: too little of it was seen.
double hand_rpm_share(const hand_t *hand, iw_side_t side);

/// Hardly any of its way was back again.
bool hand_went_one_way(const hand_t *hand, iw_side_t side);

// --- the steps ---------------------------------------------------------------------------------------------------

void bringup_checks(bringup_t *self);
void bringup_estop(bringup_t *self);

/// What an earlier bringup saw of the e-stop's line no longer counts.
void bringup_forget_wiring(bringup_t *self);

/// Puts the label of its chip and its own name into the configuration. A name that this cannot hold is left out.
void bringup_store_wiring(bringup_t *self);
void bringup_gear(bringup_t *self);
void bringup_type(bringup_t *self);
void bringup_role(bringup_t *self);
void bringup_signs(bringup_t *self);
void bringup_force(bringup_t *self);
void bringup_radius(bringup_t *self);
void bringup_track(bringup_t *self);
void bringup_write(bringup_t *self);

// --- what they share ---------------------------------------------------------------------------------------------

/// The operator wants to end, or nobody answers any more: the session's gateway ends, its folder goes, nothing is written.
_Noreturn void bringup_quit(bringup_t *self);
/// The same because it cannot go on; the reason was told.
_Noreturn void bringup_fail(bringup_t *self);

/// Both wheels forwards, with current, as a try of the type.
burst_t bringup_ahead(const bringup_t *self, unsigned for_ms);
/// A trial gateway that sends this type, with the role under which a zero surely is no torque.
void bringup_start_with(bringup_t *self, int type);
/// A note confirms that item of the ledger.
bool bringup_is_confirmed(const bringup_t *self, const char *item);

/// Notes how a key's value was found; a later note replaces the former. `item`: the ledger's, if that confirms it.
__attribute__((format(printf, 5, 6))) void bringup_note(bringup_t *self, const char *section, const char *key,
                                                        const char *item, const char *format, ...);

/// After another radius or gear: a `rest_rpm` that would now call a rolling wheel at rest becomes the default.
void bringup_fit_rest(iw_config_t *core);

#endif
