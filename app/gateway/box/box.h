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
#include "disk/recording.h"
#include "process/child.h"

#include "iwheel_northbound/json_out.h"

struct sock_log;

typedef struct gw_box {
    blackbox_ring_t *ring;
    size_t ring_size;
    gw_box_config_t config;
    gw_child_t writer;
    gw_child_t reader;
    gw_box_result_t last;   ///< The last result; number 0: none, or not of a stop.
    gw_box_result_t stop;   ///< The last one of a stop; number 0: none.
    gw_box_answer_t answer; ///< The last one taken.
} gw_box_t;

/// Makes the ring, and the writer unless blackbox_s is 0. 0, or an errno: not enough memory. Call it while nothing is sent and few
/// descriptors are open.
int gw_box_open(gw_box_t *self, const gw_box_config_t *config);

/// Lets the writer finish and end by itself.
void gw_box_close(gw_box_t *self);

/// Orders a recording. False if it cannot be: the writer is gone and was started again only just now, or it is too far
/// behind.
bool gw_box_write(gw_box_t *self, const gw_box_order_t *order);

/// Asks the process that reads. False if it cannot be: blackbox_s is 0, it is gone and was started again only just now, or it has not
/// answered too much before.
bool gw_box_ask(gw_box_t *self, const gw_box_question_t *question);

/// The next answer of the process that reads, which is in `answer`. Never waits.
gw_child_news_t gw_box_receive(gw_box_t *self);

/// The next result of the writer, which is in `last`. Never waits.
gw_child_news_t gw_box_take(gw_box_t *self);

/// A stop on its way to disk, and what became of it.
///
/// Orders a recording of a stop that has just been seen, if stops are recorded.
void gw_record_stop(gw_box_t *box, struct sock_log *log, const iwn_stop_note_t *note, iw_time_us_t now_us);

/// The same of wheels that roll although nothing is sent to them: a recording without a stop, with the cause `rolling`.
void gw_record_rolling(gw_box_t *box, struct sock_log *log, const iw_snapshot_t *seen);

/// Takes what the writer tells, to the log.
void gw_record_take(gw_box_t *box, struct sock_log *log);

/// Where the stop with this number was written (0: there was none), into an object that is open.
void gw_record_write(const gw_box_t *box, uint32_t number, iwn_out_t *json);

#endif
