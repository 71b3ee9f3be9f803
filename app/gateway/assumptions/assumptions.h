// SPDX-License-Identifier: MIT
/// What the gateway learns about its wheels: noted as it comes, told to the log and to watchers, kept over restarts.
///
///     start: keeper reads --> merged into the core: what was found for other configured values is forgotten, and told
///     run:   every change of the ledger and of the force offsets --> note, log line, event --> keeper writes
///
/// Nothing here waits. As long as the keeper has not answered (1 s at the most), changes are not told yet.
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

/// Nothing is told before the keeper has answered, but not for longer than this.
#define GW_ASSUMPTIONS_PATIENCE_US 1000000U
/// Two writes are at least this far apart ...
#define GW_ASSUMPTIONS_WRITE_US 1000000U
/// ... and after one that failed, this far.
#define GW_ASSUMPTIONS_RETRY_US 10000000U
/// A longer ledger is written anew for each status: none that is told in plain words.
#define GW_ASSUMPTIONS_TEXT_SIZE 16384U

typedef enum {
    GW_ASSUMPTIONS_LOADING = 0,
    GW_ASSUMPTIONS_NEW,    ///< There was no file.
    GW_ASSUMPTIONS_STORED, ///< The file was read, or written.
    GW_ASSUMPTIONS_IGNORED, ///< The file found at the start was not to be trusted and is set aside; what is learnt since is kept.
    GW_ASSUMPTIONS_FAILED, ///< Nothing is kept: the reason tells why.
} gw_assumptions_state_t;

/// An offset in force, as last told.
typedef struct {
    iw_time_us_t offset_us;
    int32_t offset_mN;
    iw_offset_provenance_t provenance;
    iw_offset_provenance_t from; ///< Of a stored one: where it came from first.
} gw_reported_offset_t;

/// The object `ledger` of a status, as written last, with copies of all that it was written from: while those are as they
/// were, so are its bytes.
typedef struct {
    iw_config_t config;
    uint32_t track_mm;
    iw_assumption_entry_t assumed[IW_ASSUMPTION_ITEMS];
    gw_stored_item_t known[IW_ASSUMPTION_ITEMS];
    size_t length; ///< 0: nothing is kept.
    char text[GW_ASSUMPTIONS_TEXT_SIZE];
} gw_assumptions_written_t;

typedef struct gw_assumptions {
    struct gw_wheels *wheels;  ///< Of which it is known.
    struct sock_log *log;      ///< Told what is learnt.
    struct iwn_server *server; ///< By which clients are told.
    inspect_configured_t configured;
    const char *bus;
    gw_stored_t known;
    gw_assumptions_written_t written;
    gw_button_t button; ///< Its first two members are set already.
    gw_reported_offset_t told[IW_SIDES];
    iw_force_quality_t tare[IW_SIDES]; ///< Of the window of the last tare.
    gw_file_store_t store;
    gw_assumptions_state_t state;
    iw_time_us_t start_us;
    iw_time_us_t write_us; ///< Nothing is written before.
    size_t stored_length;
    int error;                               ///< Of GW_ASSUMPTIONS_FAILED.
    bool answered;                           ///< The keeper has, or our patience has ended: changes are told.
    bool observed;                           ///< Changes of the ledger have been noted, up to this one:
    uint32_t observed_changes;               ///< As `iw_snapshot_t::assumed_changes`.
    bool changed;                            ///< Since the last write.
    char reason[GW_ASSUMPTIONS_REASON_SIZE]; ///< Why the file found at the start is ignored; empty: it is not.
    char path[SOCK_PATH_SIZE + 128U];
    char stored_text[GW_ASSUMPTIONS_FILE_SIZE]; ///< The text handed over last.
} gw_assumptions_t;

/// Starts the keeper of what is known of the wheels at `bus`, in `directory`; the members before are set already and must
/// outlive it. Call it before anything is opened.
void gw_assumptions_open(gw_assumptions_t *self, const char *directory);

/// Notes and tells what has changed.
void gw_assumptions_observe(gw_assumptions_t *self, const iw_snapshot_t *seen);

/// Hears the keeper and hands over what has changed. Once per cycle.
void gw_assumptions_poll(gw_assumptions_t *self);

/// The operator's word, noted and told; `word->found` as in inspect_assumption_compare. False: it was not taken, and `out_refusal` tells
/// why.
bool gw_assumptions_confirm(gw_assumptions_t *self, iw_assumption_item_t item, const inspect_word_t *word,
                            iwn_refusal_t *out_refusal);

/// "track is contradicted: ...; twist is refused", of an item that is.
void gw_assumptions_describe_contradiction(const gw_assumptions_t *self, iw_assumption_item_t item, char *out_text,
                                           size_t size);

/// The objects `ledger` and `memory` of a snapshot: every item; file, state and reason. The ledger's bytes are kept and
/// written again until something of it changes.
void gw_assumptions_write(gw_assumptions_t *self, const iw_snapshot_t *seen, iwn_out_t *json);

/// One item of the ledger, its state and what it rests on, into an object that is open.
void gw_assumptions_write_item(const gw_assumptions_t *self, iw_assumption_item_t item, iwn_out_t *json);

/// Hands over the rest. The keeper ends when it is on the disk.
void gw_assumptions_close(gw_assumptions_t *self);

/// In words, lines of the log and events; for assumptions.c: an item has changed.
void gw_assumptions_report_item(gw_assumptions_t *self, iw_assumption_item_t item);

/// The offset in force has changed.
void gw_assumptions_report_offset(gw_assumptions_t *self, iw_side_t side, const gw_reported_offset_t *now,
                                  const gw_reported_offset_t *before);

/// The button was tried, or what was tried is another wiring.
void gw_assumptions_report_button(gw_assumptions_t *self, gw_button_news_t news);

/// Where it is kept, or why not.
void gw_assumptions_report_state(gw_assumptions_t *self);

/// The whole ledger, at start.
void gw_assumptions_report_changes(gw_assumptions_t *self);

#endif
