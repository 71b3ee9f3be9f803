// SPDX-License-Identifier: MIT
/// What the gateway learns about its wheels: noted as it comes, told to the log and to watchers, kept over restarts.
///
///     start: keeper reads --> merged into the core: what was found for other configured values is forgotten, and told
///     run:   every change of the ledger and of the force offsets --> note, log line, event --> keeper writes
///
/// Nothing here waits. As long as the keeper has not answered (1 s at the most), changes are not told yet.
#ifndef GATEWAY_KNOWLEDGE_H
#define GATEWAY_KNOWLEDGE_H

#include "disk/keeper.h"
#include "memory.h"
#include "sockets/owners.h"

#include "iwheel/gateway.h"
#include "iwheel_northbound/json_out.h"
#include "iwheel_northbound/request.h"

struct iwn_server;
struct gw_log;
struct gw_wheels;

/// Nothing is told before the keeper has answered, but not for longer than this.
#define GW_KNOWLEDGE_PATIENCE_US 1000000U
/// Two writes are at least this far apart ...
#define GW_KNOWLEDGE_WRITE_US 1000000U
/// ... and after one that failed, this far.
#define GW_KNOWLEDGE_RETRY_US 10000000U
/// A longer ledger is written anew for each status: none that is told in plain words.
#define GW_LEDGER_TEXT_SIZE 16384U

typedef enum {
    GW_MEMORY_LOADING = 0,
    GW_MEMORY_NEW,  ///< There was no file.
    GW_MEMORY_KEPT, ///< The file was read, or written.
    GW_MEMORY_IGNORED, ///< The file found at the start was not to be trusted and is set aside; what is learnt since is kept.
    GW_MEMORY_FAILED, ///< Nothing is kept: the reason tells why.
} gw_memory_state_t;

/// An offset in force, as last told.
typedef struct {
    iw_time_us_t offset_us;
    int32_t offset_mN;
    iw_offset_provenance_t provenance;
    iw_offset_provenance_t from; ///< Of a stored one: where it came from first.
} gw_told_offset_t;

/// The object `ledger` of a status, as written last, with copies of all that it was written from: while those are as they
/// were, so are its bytes.
typedef struct {
    iw_config_t config;
    uint32_t track_mm;
    iw_ledger_entry_t assumed[IW_LEDGER_ITEMS];
    gw_known_item_t known[IW_LEDGER_ITEMS];
    size_t length; ///< 0: nothing is kept.
    char text[GW_LEDGER_TEXT_SIZE];
} gw_ledger_written_t;

typedef struct gw_knowledge {
    struct gw_wheels *wheels;  ///< Of which it is known.
    struct gw_log *log;        ///< Told what is learnt.
    struct iwn_server *server; ///< By which clients are told.
    gw_configured_t configured;
    const char *bus;
    gw_known_t known;
    gw_ledger_written_t written;
    gw_button_t button; ///< Its first two members are set already.
    gw_told_offset_t told[IW_SIDES];
    iw_force_quality_t tare[IW_SIDES]; ///< Of the window of the last tare.
    gw_keeper_t keeper;
    gw_memory_state_t state;
    iw_time_us_t start_us;
    iw_time_us_t write_us; ///< Nothing is written before.
    size_t kept_length;
    int error;                          ///< Of GW_MEMORY_FAILED.
    bool answered;                      ///< The keeper has, or our patience has ended: changes are told.
    bool observed;                      ///< Changes of the ledger have been noted, up to this one:
    uint32_t observed_changes;          ///< As `iw_snapshot_t::assumed_changes`.
    bool changed;                       ///< Since the last write.
    char reason[GW_MEMORY_REASON_SIZE]; ///< Why the file found at the start is ignored; empty: it is not.
    char path[GW_PATH_SIZE + 128U];
    char kept[GW_MEMORY_SIZE]; ///< The text handed over last.
} gw_knowledge_t;

/// Starts the keeper of what is known of the wheels at `bus`, in `directory`; the members before are set already and must
/// outlive it. Call it before anything is opened.
void gw_knowledge_open(gw_knowledge_t *self, const char *directory);

/// Notes and tells what has changed.
void gw_knowledge_observe(gw_knowledge_t *self, const iw_snapshot_t *seen);

/// Hears the keeper and hands over what has changed. Once per cycle.
void gw_knowledge_tend(gw_knowledge_t *self);

/// The operator's word, noted and told; `word->found` as in gw_assumption_compare. False: it was not taken, and `out_refusal` tells
/// why.
bool gw_knowledge_confirm(gw_knowledge_t *self, iw_ledger_item_t item, const gw_word_t *word,
                          iwn_refusal_t *out_refusal);

/// "track is contradicted: ...; twist is refused", of an item that is.
void gw_knowledge_describe_contradiction(const gw_knowledge_t *self, iw_ledger_item_t item, char *out_text,
                                         size_t size);

/// The objects `ledger` and `memory` of a snapshot: every item; file, state and reason. The ledger's bytes are kept and
/// written again until something of it changes.
void gw_knowledge_write(gw_knowledge_t *self, const iw_snapshot_t *seen, iwn_out_t *json);

/// One item of the ledger, its state and what it rests on, into an object that is open.
void gw_knowledge_write_item(const gw_knowledge_t *self, iw_ledger_item_t item, iwn_out_t *json);

/// Hands over the rest. The keeper ends when it is on the disk.
void gw_knowledge_close(gw_knowledge_t *self);

/// In words, lines of the log and events; for knowledge.c: an item has changed.
void gw_knowledge_tell_item(gw_knowledge_t *self, iw_ledger_item_t item);

/// The offset in force has changed.
void gw_knowledge_tell_offset(gw_knowledge_t *self, iw_side_t side, const gw_told_offset_t *now,
                              const gw_told_offset_t *before);

/// The button was tried, or what was tried is another wiring.
void gw_knowledge_tell_button(gw_knowledge_t *self, gw_button_news_t news);

/// Where it is kept, or why not.
void gw_knowledge_tell_memory(gw_knowledge_t *self);

/// The whole ledger, at start.
void gw_knowledge_tell_ledger(gw_knowledge_t *self);

#endif
