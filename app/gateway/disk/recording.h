// SPDX-License-Identifier: MIT
/// What the gateway and the processes that write and read its recordings tell each other.
#ifndef GATEWAY_RECORDING_H
#define GATEWAY_RECORDING_H

#include "sockets/owners.h"

#include "iwheel_northbound/request.h"
#include "iwheel_northbound/why.h"

/// Recordings on disk are together never larger, except that the newest is always kept.
#define GW_BOX_BYTES_MAX ((uint64_t)128U * 1024U * 1024U)
/// The most recordings that a configuration can ask for: all their names fit into one reply.
#define GW_BOX_KEEP_MAX 256U
/// The recording goes on for this long after the stop.
#define GW_BOX_AFTER_US   2000000U
#define GW_BOX_CAUSE_SIZE 32U
/// An answer of the process that reads: a piece in base64, or the list, and what is around it.
#define GW_BOX_ANSWER_SIZE 52000U
/// Directory, '/', "stop-000001-", cause, ".jsonl".
#define GW_BOX_PATH_SIZE (SOCK_PATH_SIZE + GW_BOX_CAUSE_SIZE + 48U)

/// What is recorded, and where. The texts must outlive the box.
typedef struct {
    uint16_t blackbox_s; ///< Length of the ring in memory; 0: nothing is recorded.
    uint16_t keep_stops; ///< Recordings on disk, 1..GW_BOX_KEEP_MAX; those of stops in motion are removed last.
    const char *directory;
    const char *bus;    ///< As configured; also the next two.
    const char *estop;  ///< The line.
    const char *config; ///< The whole configuration in force, as its file would be.
} gw_box_config_t;

/// What the gateway tells the writer.
typedef struct {
    bool last; ///< Nothing is to be written: the gateway ends as it should.
    iwn_stop_note_t note;
    char cause[GW_BOX_CAUSE_SIZE];
    char side[8];          ///< "left", "right", "both", or empty.
    char from[16];         ///< Name of the state.
    int64_t wall_minus_us; ///< Wall clock minus monotonic clock.
    uint64_t mark;         ///< Entries written when it stopped.
} gw_box_order_t;

/// What the writer tells the gateway. An order without a stop (number 0): the directory cannot be used.
typedef struct {
    uint32_t number; ///< Of the stop.
    int error;       ///< An errno or a reason of owners.h, 0: written.
    uint32_t frames;
    uint32_t ms; ///< From the first entry to the stop.
    char path[GW_BOX_PATH_SIZE];
} gw_box_result_t;

/// What a client wants to read.
typedef struct {
    iw_client_t client;
    bool list;      ///< The recordings there are; else a piece of a file.
    int64_t offset; ///< Where the piece begins.
    char name[IWN_FILE_MAX + 1U];
} gw_box_question_t;

/// What is told to it.
typedef struct {
    iw_client_t client;
    iwn_error_t error; ///< IWN_OK: `text` has the fields of the reply, as JSON; else why not, in words.
    uint32_t length;   ///< Of the text.
    char text[GW_BOX_ANSWER_SIZE];
} gw_box_answer_t;

#endif
