// SPDX-License-Identifier: MIT
/// The judges: what was read of the link, heard on the bus and asked of the e-stop, put into findings. Nothing is ever sent.
///
/// A finding is one sentence: ok, worth a warning, wrong, or not to be looked at here; and the command that mends it. The owner
/// fills a list by calling the judges and its own code, and prints it as it likes. No heap.
///
/// Heard is everything on a bus while listening for a while: how many frames of each message, how much of the bus they took, and
/// what does not belong there.
#ifndef INSPECT_H
#define INSPECT_H

#include "iwheel/codec.h"
#include "iwheel_linux/linux_hal.h"

#include <stdbool.h>
#include <stddef.h>

// --- findings ----------------------------------------------------------------------------------------------------

/// More than all judges together ever say; what comes after that is counted only.
#define INSPECT_FINDINGS_MAX 40U
#define INSPECT_TEXT_SIZE    320U
#define INSPECT_CURE_SIZE    320U

/// INSPECT_SKIP: this machine has not what there would be to look at.
typedef enum { INSPECT_OK = 0, INSPECT_WARN, INSPECT_FAIL, INSPECT_SKIP } inspect_verdict_t;
#define INSPECT_VERDICTS 4U

typedef struct {
    const char *check; ///< What was looked at: a word of a closed list (docs/user/doctor.md).
    inspect_verdict_t verdict;
    char text[INSPECT_TEXT_SIZE]; ///< What is.
    char cure[INSPECT_CURE_SIZE]; ///< What mends it; empty if there is nothing to mend.
} inspect_finding_t;

typedef struct {
    inspect_finding_t finding[INSPECT_FINDINGS_MAX];
    unsigned count;
    unsigned lost;                    ///< That did not fit.
    unsigned total[INSPECT_VERDICTS]; ///< Of each verdict, those that did not fit too.
    inspect_verdict_t absent;         ///< What a machine without CAN or GPIO gets: INSPECT_FAIL unless set otherwise.
} inspect_findings_t;

void inspect_begin(inspect_findings_t *self);

/// Adds a finding without a cure. `check` must be a literal.
__attribute__((format(printf, 4, 5))) void inspect_say(inspect_findings_t *self, const char *check,
                                                       inspect_verdict_t verdict, const char *format, ...);

/// The cure of the finding added last.
__attribute__((format(printf, 2, 3))) void inspect_cure(inspect_findings_t *self, const char *format, ...);

/// "ok", "warn", "fail" or "skip".
const char *inspect_verdict_word(inspect_verdict_t verdict);

/// "text; cure" in one line.
void inspect_sentence(const inspect_finding_t *finding, char *out_text, size_t size);

// --- what was heard ----------------------------------------------------------------------------------------------

/// Other ids that are kept by number.
#define INSPECT_STRANGERS 8U

/// Frames in 1000 s, as documented; 0 of a setpoint.
uint32_t inspect_nominal_mHz(const iw_codec_row_t *row);

/// A wheel with power sends it always, not only in its first minute.
bool inspect_always(const iw_codec_row_t *row);

typedef struct {
    uint32_t count[IW_CODEC_ROWS];          ///< Good frames, in the order of `iw_codec_rows`; our own echoes are none.
    uint32_t bad_length;                    ///< Known id, shorter than the table.
    uint32_t bad_format;                    ///< Known id on a remote, extended or FD frame.
    uint32_t strange;                       ///< Frames of any other id.
    uint32_t strange_id[INSPECT_STRANGERS]; ///< Their id words, as in iw_can_frame_t.
    uint32_t strange_ids;                   ///< How many of these.
    uint64_t bits;                          ///< Of all frames, without stuff bits.
    iw_time_us_t span_us;                   ///< How long was listened.
    bool was_up;                            ///< The bus took part in life at least for a moment.
    iw_bus_state_t worst;                   ///< The worst state of the bus seen ...
    iw_bus_state_t last;                    ///< ... and the one at the end.
    int estop;                              ///< The last answer of the e-stop, as in iw_hal_t.
} inspect_heard_t;

void inspect_heard_begin(inspect_heard_t *self);

void inspect_heard_take(inspect_heard_t *self, const iw_can_frame_t *frame);

/// Listens for so long; blocks. The HAL must be open.
void inspect_listen(iwl_hal_t *hal, iw_time_us_t for_us, inspect_heard_t *out_heard);

/// Frames per 1000 s of the message with that index.
uint32_t inspect_rate_mHz(const inspect_heard_t *self, unsigned message);

/// Index of the message with this id; IW_CODEC_ROWS if there is none.
unsigned inspect_message_of(uint32_t id);

/// Share of the bus that all frames took.
uint32_t inspect_load_permille(const inspect_heard_t *self, uint32_t bitrate_hz);

// --- the judges --------------------------------------------------------------------------------------------------

/// What the bus is meant to be.
typedef struct {
    const char *name; ///< Interface or unix:PATH.
    uint32_t bitrate_hz;
    uint16_t sample_point_permille;
    bool refuses;         ///< A wrong timing is a failure, not only a warning.
    bool others_may_send; ///< A gateway runs on this bus: setpoints on it may be its own, and it judges the others.
} inspect_config_t;

/// Presence, mode, bit timing, queue, restart-ms, echo. Nothing for the local bus.
void inspect_link(const iwl_bus_link_t *link, const inspect_config_t *config, inspect_findings_t *findings);

/// Room for frames that wait to be taken. Nothing where it is not known.
void inspect_room(const iwl_bus_link_t *link, inspect_findings_t *findings);

/// Whether the bus lives, both wheels and the rate of each id, load, unknown ids, damaged frames, other masters.
void inspect_bus(const iwl_bus_link_t *link, const inspect_heard_t *heard, const inspect_config_t *config,
                 inspect_findings_t *findings);

/// What is known of the e-stop.
typedef struct {
    const char *line; ///< Its name in the configuration.
    const char
        *pressed_at; ///< Of two contacts: which one is pressed or unreadable, as `inspect_pressed_at`; else NULL.
    bool present;    ///< False: there is none at all.
    bool simulated;
    int level;           ///< As in iw_hal_t: 0 released, > 0 pressed, < 0 unreadable.
    const char *trouble; ///< Why it is unreadable, and what to do; may be empty.
    bool no_gpio;        ///< It would be a line of a GPIO chip, and this machine has none.
} inspect_estop_t;

/// The same from an open HAL, as last asked.
inspect_estop_t inspect_estop_of(const iwl_hal_t *hal, const char *line);

/// Of two contacts the one that does not say released: "neither", "line", "line2" or "both".
const char *inspect_pressed_at(const iwl_hal_t *hal);

/// The e-stop's level.
void inspect_estop(const inspect_estop_t *estop, inspect_findings_t *findings);

/// Why the e-stop cannot be read, and what to do about it; empty while it can.
const char *inspect_estop_trouble(const iwl_hal_t *hal);

/// A bus or an e-stop that cannot be opened at all: `error` of iwl_hal_open.
void inspect_unopened(const char *cause, bool is_bus, int error, inspect_findings_t *findings);

/// What could be opened.
typedef struct {
    bool hal; ///< At all: then it is to be closed.
    bool bus;
    bool estop;
} inspect_opened_t;

/// Opens bus and e-stop to look at them. What cannot be opened is told as a finding, and the other one is opened all the same.
inspect_opened_t inspect_open(iwl_hal_t *hal, const char *bus, const iwl_estop_config_t *line,
                              inspect_findings_t *findings);

#endif
