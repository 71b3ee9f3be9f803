// SPDX-License-Identifier: MIT
/// Stores and reports the assumptions about the wheels: a change is recorded, logged, sent to watchers, and stored over
/// restarts.
///
///     start: store process reads --> merged into the core; entries for other values are dropped and reported
///     run:   change of an assumption or a force offset --> record, log line, event --> store process writes
///
/// No function waits. Changes are not reported and arm is refused before the store process has answered, at most for
/// 1 s. A contradiction in a file that comes later denies the next arm; it does not end a drive.
#ifndef GATEWAY_ASSUMPTIONS_H
#define GATEWAY_ASSUMPTIONS_H

#include "assumptions_file.h"
#include "disk/file_store.h"
#include "sockets/owners.h"

#include "iwheel/gateway.h"
#include "iwheel_northbound/json_out.h"
#include "iwheel_northbound/request.h"

struct iwn_server;
struct sock_log;
struct gw_wheels;

/// Longest wait for the store process before changes are reported and arm is permitted.
#define GW_ASSUMPTIONS_PATIENCE_US 1000000U
/// Shortest interval between writes ...
#define GW_ASSUMPTIONS_WRITE_US 1000000U
/// ... and after a failed write.
#define GW_ASSUMPTIONS_RETRY_US 10000000U
/// Size of the cached text. A longer one is written again for each status; plain texts fit.
#define GW_ASSUMPTIONS_TEXT_SIZE 16384U

typedef enum {
    GW_ASSUMPTIONS_LOADING = 0,
    GW_ASSUMPTIONS_NEW,     ///< There was no file.
    GW_ASSUMPTIONS_STORED,  ///< The file was read, or written.
    GW_ASSUMPTIONS_IGNORED, ///< The file found at the start was not valid and is set aside; new ones are stored.
    GW_ASSUMPTIONS_FAILED,  ///< Nothing is stored, for the stored reason.
} gw_assumptions_state_t;

/// Last reported offset.
typedef struct {
    iw_time_us_t offset_us;
    int32_t offset_mN;
    iw_offset_provenance_t provenance;
    iw_offset_provenance_t from; ///< For a stored offset: its first source.
} gw_reported_offset_t;

/// Object `ledger` of a status as last written, with copies of its inputs. While the inputs are the same, the bytes are
/// reused.
typedef struct {
    iw_config_t config;
    uint32_t track_mm;
    iw_assumption_entry_t assumed[IW_ASSUMPTION_ITEMS];
    gw_stored_item_t known[IW_ASSUMPTION_ITEMS];
    size_t length; ///< Length of the text; 0 if nothing is cached.
    char text[GW_ASSUMPTIONS_TEXT_SIZE];
} gw_assumptions_written_t;

typedef struct gw_assumptions {
    struct gw_wheels *wheels;  ///< Wheels whose assumptions are stored.
    struct sock_log *log;      ///< Log for changes.
    struct iwn_server *server; ///< Server that informs clients.
    inspect_configured_t configured;
    const char *bus;
    gw_stored_t known;
    gw_assumptions_written_t written;
    gw_button_t button; ///< The owner sets its first two members.
    gw_reported_offset_t reported[IW_SIDES];
    iw_force_quality_t tare[IW_SIDES]; ///< Statistics of the window of the last tare.
    gw_file_store_t store;
    gw_assumptions_state_t state;
    iw_time_us_t start_us;
    iw_time_us_t write_us; ///< Earliest time of the next write.
    size_t stored_length;
    int error;                 ///< Errno of GW_ASSUMPTIONS_FAILED.
    bool answered;             ///< The store process has answered, or the wait has ended: changes are reported.
    bool observed;             ///< Changes up to `observed_changes` have been recorded.
    uint32_t observed_changes; ///< Value of `iw_snapshot_t::assumed_changes`.
    bool changed;              ///< There was a change since the last write.
    char reason[GW_ASSUMPTIONS_REASON_SIZE]; ///< Reason to ignore the file found at the start; empty if it is used.
    char path[SOCK_PATH_SIZE + 128U];
    char stored_text[GW_ASSUMPTIONS_FILE_SIZE]; ///< Last text that was passed to the store process.
} gw_assumptions_t;

/// Starts the store process for the wheels on `bus`, in `directory`. The members before are set and must exist as long
/// as `self`. Call it before other descriptors are opened.
void gw_assumptions_open(gw_assumptions_t *self, const char *directory);

/// Records and reports changes.
void gw_assumptions_observe(gw_assumptions_t *self, const iw_snapshot_t *seen);

/// Receives from the store process and passes changes to it. Call it once per cycle.
void gw_assumptions_poll(gw_assumptions_t *self);

/// Enters a decision of the operator and reports it. `word->found` as in inspect_assumption_compare. Returns false and
/// sets `out_refusal` if it is not accepted.
bool gw_assumptions_confirm(gw_assumptions_t *self, iw_assumption_item_t item, const inspect_word_t *word,
                            iwn_refusal_t *out_refusal);

/// Describes a contradicted item: "track is contradicted: ...; twist is refused".
void gw_assumptions_describe_contradiction(const gw_assumptions_t *self, iw_assumption_item_t item, char *out_text,
                                           size_t size);

/// Writes the objects `ledger` and `memory` of a snapshot: every item; file, state and reason. The bytes of the ledger
/// are reused until one of its inputs changes.
void gw_assumptions_write(gw_assumptions_t *self, const iw_snapshot_t *seen, iwn_out_t *json);

/// Writes one item with its state and source into an open object.
void gw_assumptions_write_item(const gw_assumptions_t *self, iw_assumption_item_t item, iwn_out_t *json);

/// Passes the rest to the store process, which ends when it is on the disk.
void gw_assumptions_close(gw_assumptions_t *self);

/// Texts, log lines and events for assumptions.c. This one reports a changed item.
void gw_assumptions_report_item(gw_assumptions_t *self, iw_assumption_item_t item);

/// Reports a changed offset.
void gw_assumptions_report_offset(gw_assumptions_t *self, iw_side_t side, const gw_reported_offset_t *now,
                                  const gw_reported_offset_t *before);

/// Reports a test of the button, or a change of its wiring.
void gw_assumptions_report_button(gw_assumptions_t *self, gw_button_news_t news);

/// Reports the file, or the reason why there is none.
void gw_assumptions_report_state(gw_assumptions_t *self);

/// Reports all items at the start.
void gw_assumptions_report_changes(gw_assumptions_t *self);

#endif
