// SPDX-License-Identifier: MIT
/// The black box: the ring in memory shared with a process of its own, which writes it to disk when told, so that the loop
/// never waits for a disk.
///
///     gateway --order, through a socket that never blocks--> writer --result--> gateway
///        \----------- ring in shared memory ------------------^
///            --question, the same way----------------> reader --answer--> gateway
///
/// A second process reads recordings for clients: whoever reads a large one holds up neither the loop nor the next recording.
/// The writer holds nothing of the gateway's. It outlives it by the time it needs to finish: a gateway that dies while
/// setpoints are being sent is a stop worth a recording too. If the writer dies, another is started with the next order.
#ifndef GATEWAY_BOX_H
#define GATEWAY_BOX_H

#include "blackbox_ring.h"
#include "gateway_config.h"
#include "process/child.h"

#include "iwheel_northbound/request.h"
#include "iwheel_northbound/why.h"

/// Recordings on disk are never more, and together never larger, except that the newest is always kept.
#define GW_BOX_RECORDINGS_MAX 32U
#define GW_BOX_BYTES_MAX      ((uint64_t)128U * 1024U * 1024U)
/// The recording goes on for this long after the stop.
#define GW_BOX_AFTER_US   2000000U
#define GW_BOX_CAUSE_SIZE 32U
/// An answer of the process that reads: a piece in base64, or the list, and what is around it.
#define GW_BOX_ANSWER_SIZE 34000U
/// Directory, '/', "stop-000001-", cause, ".jsonl".
#define GW_BOX_PATH_SIZE (GATEWAY_PATH_SIZE + GW_BOX_CAUSE_SIZE + 48U)

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

typedef struct {
    blackbox_ring_t *ring;
    size_t ring_size;
    const gateway_config_t *config;
    gw_child_t writer;
    gw_child_t reader;
    gw_box_result_t last;   ///< The last result; number 0: none.
    gw_box_answer_t answer; ///< The last one taken.
} gw_box_t;

/// Makes the ring, and the writer unless blackbox_s is 0. 0, or an errno: not enough memory. Call it while nothing is sent and few
/// descriptors are open. `config` must outlive it.
int gw_box_open(gw_box_t *self, const gateway_config_t *config);

/// Lets the writer finish and end by itself.
void gw_box_close(gw_box_t *self);

/// Orders a recording. False if it cannot be: the writer is gone and was started again only just now, or it is too far
/// behind.
bool gw_box_write(gw_box_t *self, const gw_box_order_t *order);

/// Asks the process that reads. False if it cannot be: blackbox_s is 0, it is gone and was started again only just now, or it has not
/// answered too much before.
bool gw_box_ask(gw_box_t *self, const gw_box_question_t *question);

/// The next answer of the process that reads, which is in `answer`. Never waits.
gw_child_news_t gw_box_hear(gw_box_t *self);

/// The next result of the writer, which is in `last`. Never waits.
gw_child_news_t gw_box_take(gw_box_t *self);

#endif
