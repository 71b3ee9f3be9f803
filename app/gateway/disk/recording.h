// SPDX-License-Identifier: MIT
/// Messages between the gateway and the processes that write and read its recordings.
#ifndef GATEWAY_RECORDING_H
#define GATEWAY_RECORDING_H

#include "sockets/owners.h"

#include "iwheel_northbound/request.h"
#include "iwheel_northbound/why.h"

/// Largest total size of recordings on disk. The newest one is always retained.
#define GW_BOX_BYTES_MAX ((uint64_t)128U * 1024U * 1024U)
/// Largest configurable number of recordings: all their names fit one reply.
#define GW_BOX_KEEP_MAX 256U
/// A recording continues for this time after the stop.
#define GW_BOX_AFTER_US   2000000U
#define GW_BOX_CAUSE_SIZE 32U
/// Recordings are numbered, few, and have three files each. Size of such a name without its ending.
#define GW_BOX_STEM_SIZE 64U
/// Cause of a recording on request, in its name. It ends after this time, or at this size of its files.
#define GW_BOX_REQUESTED     "requested"
#define GW_BOX_REQUEST_US    ((iw_time_us_t)600000000U)
#define GW_BOX_REQUEST_BYTES ((uint64_t)16U * 1024U * 1024U)
/// Number of finished recordings on request that stay when another one begins.
#define GW_BOX_REQUESTS_KEPT 2U
/// Size of an answer of the reading process: a piece in base64, or the list.
#define GW_BOX_ANSWER_SIZE 52000U
/// Directory, '/', "stop-000001-", cause, ".jsonl".
#define GW_BOX_PATH_SIZE (SOCK_PATH_SIZE + GW_BOX_CAUSE_SIZE + 48U)

/// Contents and place of recordings. The texts must exist as long as the box.
typedef struct {
    uint16_t blackbox_s; ///< Length of the ring in memory; 0: no recordings.
    uint16_t keep_stops; ///< Recordings on disk, 1..GW_BOX_KEEP_MAX; those of stops in motion are removed last.
    const char *directory;
    const char *bus;    ///< Configured name of the bus.
    const char *estop;  ///< Configured name of the e-stop line.
    const char *config; ///< Whole configuration, as in a file.
} gw_box_config_t;

typedef enum {
    GW_BOX_STOP = 0, ///< Record a stop.
    GW_BOX_BEGIN,    ///< Begin the recording on request ...
    GW_BOX_END,      ///< ... and end it.
    GW_BOX_LAST,     ///< Nothing to write: the gateway ends regularly.
} gw_box_order_kind_t;

/// Reason for the end of the recording on request.
typedef enum {
    GW_BOX_RUNS = 0,
    GW_BOX_BY_REQUEST, ///< A client requested it, or the gateway has ended.
    GW_BOX_BY_TIME,    ///< GW_BOX_REQUEST_US
    GW_BOX_BY_SIZE,    ///< GW_BOX_REQUEST_BYTES
    GW_BOX_BY_FAULT,   ///< The disk failed or is full, or the writer has ended.
    GW_BOX_ENDS,
} gw_box_end_t;

/// Message of the gateway to the writer.
typedef struct {
    gw_box_order_kind_t kind;
    iwn_stop_note_t note; ///< GW_BOX_BEGIN, GW_BOX_END: the number is that of the request.
    char cause[GW_BOX_CAUSE_SIZE];
    char side[8];          ///< "left", "right", "both", or empty.
    char from[16];         ///< Name of the state.
    int64_t wall_minus_us; ///< Wall clock minus monotonic clock.
    uint64_t mark;         ///< Entries written at the time of the stop.
} gw_box_order_t;

/// Message of the writer to the gateway. Without a stop (number 0): the directory cannot be used.
typedef struct {
    gw_box_order_kind_t kind; ///< GW_BOX_STOP, or that of the order about the recording on request.
    gw_box_end_t ended;       ///< GW_BOX_END: the reason.
    uint32_t number;          ///< Number of the stop, or of the request.
    int error;                ///< An errno or a reason of owners.h; 0 if it is written.
    uint32_t frames;
    uint32_t ms; ///< Time from the first entry to the stop.
    char path[GW_BOX_PATH_SIZE];
} gw_box_result_t;

/// Question of a client.
typedef struct {
    iw_client_t client;
    bool list;      ///< The list of recordings; otherwise a piece of a file.
    int64_t offset; ///< Offset of the piece.
    char name[IWN_FILE_MAX + 1U];
} gw_box_question_t;

/// Answer to a question.
typedef struct {
    iw_client_t client;
    bool list;         ///< The question was for the list.
    iwn_error_t error; ///< IWN_OK: `text` has the fields of the reply as JSON; otherwise the reason.
    uint32_t length;   ///< Length of the text.
    char text[GW_BOX_ANSWER_SIZE];
} gw_box_answer_t;

#endif
