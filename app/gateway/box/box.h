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

typedef struct gw_box {
    blackbox_ring_t *ring;
    size_t ring_size;
    gw_box_wish_t wish;
    gw_child_t writer;
    gw_child_t reader;
    gw_box_result_t last;   ///< The last result; number 0: none.
    gw_box_answer_t answer; ///< The last one taken.
} gw_box_t;

/// Makes the ring, and the writer unless blackbox_s is 0. 0, or an errno: not enough memory. Call it while nothing is sent and few
/// descriptors are open.
int gw_box_open(gw_box_t *self, const gw_box_wish_t *wish);

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
