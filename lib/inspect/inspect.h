// SPDX-License-Identifier: MIT
/// Checks of the link, the bus and the e-stop, with their findings. No function sends a frame.
///
/// A finding is one sentence with a verdict (ok, warning, failure, or not checked here) and the command that fixes it.
/// The owner fills a list by calling the judges and its own code, and prints it in its own form. No heap.
///
/// `inspect_listen` records the traffic for some time: the number of frames of each message, the bus load, and frames
/// that do not belong to the iWheel.
#ifndef INSPECT_H
#define INSPECT_H

#include "iwheel/codec.h"
#include "iwheel_linux/linux_hal.h"

#include <stdbool.h>
#include <stddef.h>

// --- findings ----------------------------------------------------------------------------------------------------

/// Limit of findings, above that of all judges together. Further findings are only counted.
#define INSPECT_FINDINGS_MAX 40U
#define INSPECT_TEXT_SIZE    320U ///< Size of the text of a finding, with its terminator.
#define INSPECT_FIX_SIZE     320U ///< Size of the fix of a finding, with its terminator.

/// Result of a check. INSPECT_SKIP: this machine has no such device to check.
typedef enum { INSPECT_OK = 0, INSPECT_WARN, INSPECT_FAIL, INSPECT_SKIP } inspect_verdict_t;
#define INSPECT_VERDICTS 4U

/// One finding.
typedef struct {
    const char *check;            ///< Subject: a word of a closed list (docs/user/doctor.md).
    inspect_verdict_t verdict;    ///< Result of the check.
    char text[INSPECT_TEXT_SIZE]; ///< State.
    char fix[INSPECT_FIX_SIZE];   ///< Fix; empty if there is nothing to fix.
} inspect_finding_t;

/// A list of findings, owned by the caller. One list belongs to one thread.
typedef struct {
    inspect_finding_t finding[INSPECT_FINDINGS_MAX]; ///< The first `count` entries are valid.
    unsigned count;                                  ///< Number of stored findings.
    unsigned lost;                                   ///< Number of findings that did not fit.
    unsigned total[INSPECT_VERDICTS]; ///< Number of findings by verdict, including those that did not fit.
    inspect_verdict_t absent;         ///< Verdict for a machine without CAN or GPIO: INSPECT_FAIL unless set otherwise.
} inspect_findings_t;

/// Empties the list and sets `absent` to INSPECT_FAIL.
void inspect_begin(inspect_findings_t *self);

/// Adds a finding without a fix; counts it in `lost` if the list is full. `check` must be a literal: the list has only
/// its address. A text that is too long is cut.
__attribute__((format(printf, 4, 5))) void inspect_add(inspect_findings_t *self, const char *check,
                                                       inspect_verdict_t verdict, const char *format, ...);

/// Sets the fix of the last finding, cut if it is too long. Nothing if the list has lost a finding.
__attribute__((format(printf, 2, 3))) void inspect_fix(inspect_findings_t *self, const char *format, ...);

/// Returns "ok", "warn", "fail" or "skip".
const char *inspect_verdict_word(inspect_verdict_t verdict);

/// Writes "text; fix" in one line.
void inspect_sentence(const inspect_finding_t *finding, char *out_text, size_t size);

// --- traffic -----------------------------------------------------------------------------------------------------

/// Number of other ids that are stored.
#define INSPECT_STRANGERS 8U

/// Returns the documented number of frames in 1000 s; 0 for a setpoint.
uint32_t inspect_nominal_mHz(const iw_codec_row_t *row);

/// Returns true if a wheel with power always sends this message, not only in its first minute.
bool inspect_always(const iw_codec_row_t *row);

/// Frames that were received in a time.
typedef struct {
    uint32_t count[IW_CODEC_ROWS]; ///< Good frames in the order of `iw_codec_rows`, without the echoes of this program.
    uint32_t bad_length;           ///< Frames with a known id, shorter than in the table.
    uint32_t bad_format;           ///< Remote, extended or FD frames with a known id.
    uint32_t strange;              ///< Frames with any other id.
    uint32_t strange_id[INSPECT_STRANGERS]; ///< Id words of these, as in iw_can_frame_t.
    uint32_t strange_ids;                   ///< Number of stored ids.
    uint64_t bits;                          ///< Bits of all frames, without stuff bits.
    iw_time_us_t span_us;                   ///< Duration of receiving.
    bool was_up;                            ///< The bus was up at least for a moment.
    iw_bus_state_t worst;                   ///< Worst state of the bus ...
    iw_bus_state_t last;                    ///< ... and the last one.
    int estop;                              ///< Last result of the e-stop, as in iw_hal_t.
} inspect_traffic_t;

/// Begins without a frame, with the bus active and the e-stop unreadable.
void inspect_traffic_begin(inspect_traffic_t *self);

/// Counts one received frame.
void inspect_traffic_count(inspect_traffic_t *self, const iw_can_frame_t *frame);

/// Receives for this time. It blocks. The HAL must be open.
void inspect_listen(iwl_hal_t *hal, iw_time_us_t for_us, inspect_traffic_t *out_traffic);

/// Returns the rate of a message, as frames per 1000 s.
uint32_t inspect_rate_mHz(const inspect_traffic_t *self, unsigned message);

/// Returns the index of the message with this id; IW_CODEC_ROWS if there is none.
unsigned inspect_message_of(uint32_t id);

/// Returns the share of the bus that all frames used.
uint32_t inspect_load_permille(const inspect_traffic_t *self, uint32_t bitrate_hz);

// --- the judges --------------------------------------------------------------------------------------------------

/// Expected properties of the bus.
typedef struct {
    const char *name;               ///< Interface or unix:PATH.
    uint32_t bitrate_hz;            ///< Bit rate in bit/s.
    uint16_t sample_point_permille; ///< Sample point.
    bool refuses;                   ///< A wrong bit timing is a failure, not a warning.
    bool others_may_send;           ///< A gateway runs on this bus: setpoints may be its own, and it judges others.
} inspect_config_t;

/// Judges presence, mode, bit timing, queue, restart-ms and echo. Nothing for the local bus.
void inspect_link(const iwl_bus_link_t *link, const inspect_config_t *config, inspect_findings_t *findings);

/// Judges the receive buffer. Nothing if its size is unknown.
void inspect_room(const iwl_bus_link_t *link, inspect_findings_t *findings);

/// Judges activity, both wheels and the rate of each id, load, unknown ids, damaged frames, and other masters.
void inspect_bus(const iwl_bus_link_t *link, const inspect_traffic_t *traffic, const inspect_config_t *config,
                 inspect_findings_t *findings);

/// State of the e-stop.
typedef struct {
    const char *line;       ///< Configured name.
    const char *pressed_at; ///< Pressed or unreadable contact of two, by `inspect_pressed_at`; NULL with one contact.
    bool present;           ///< False if there is no e-stop.
    bool simulated;         ///< It is a simulated button.
    int level;              ///< As in iw_hal_t: 0 released, > 0 pressed, < 0 unreadable.
    const char *trouble;    ///< Reason why it is unreadable, and the fix; may be empty.
    bool no_gpio;           ///< It would be a GPIO line, and this machine has no GPIO.
} inspect_estop_t;

/// Returns the state from an open HAL, by its last reading.
inspect_estop_t inspect_estop_of(const iwl_hal_t *hal, const char *line);

/// Returns which of two contacts is not released: "neither", "line", "line2" or "both".
const char *inspect_pressed_at(const iwl_hal_t *hal);

/// Judges the level of the e-stop.
void inspect_estop(const inspect_estop_t *estop, inspect_findings_t *findings);

/// Returns why the e-stop cannot be read, and the fix; empty while it can.
const char *inspect_estop_trouble(const iwl_hal_t *hal);

/// Judges a bus or an e-stop that cannot be opened. `error`: result of iwl_hal_open.
void inspect_unopened(const char *cause, bool is_bus, int error, inspect_findings_t *findings);

/// Parts that could be opened.
typedef struct {
    bool hal;   ///< The HAL is open and must be closed.
    bool bus;   ///< The bus is open.
    bool estop; ///< The e-stop is open.
} inspect_opened_t;

/// Opens bus and e-stop for the checks. A part that cannot be opened becomes a finding, and the other one is opened
/// anyway.
inspect_opened_t inspect_open(iwl_hal_t *hal, const char *bus, const iwl_estop_config_t *line,
                              inspect_findings_t *findings);

#endif
