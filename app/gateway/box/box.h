// SPDX-License-Identifier: MIT
/// The black box: a ring in memory that is shared with a separate process, which writes it to disk on an order, so that
/// the loop never waits for a disk.
///
///     gateway --order, through a socket that never blocks--> writer --result--> gateway
///        \----------- ring in shared memory ------------------^
///            --question, the same way----------------> reader --answer--> gateway
///
/// A second process reads recordings for clients, so that reading a large one delays neither the loop nor the next
/// recording. The writer shares no resource of the gateway except the ring. It continues after the gateway has ended
/// until it has finished, because a gateway that dies while it sends setpoints is a stop to record too. If the writer
/// dies, the next order starts another one.
#ifndef GATEWAY_BOX_H
#define GATEWAY_BOX_H

#include "blackbox_ring.h"
#include "disk/recording.h"
#include "process/child.h"

#include "iwheel_northbound/json_out.h"

struct sock_log;

/// The recording on request, as its last order and the writer's results describe it.
typedef struct {
    uint32_t number; ///< Number of the last request to begin; 0: there was none.
    bool on;         ///< It is being written, or the writer has the order to begin it.
    iw_time_us_t begun_us;
    gw_box_end_t ended;          ///< Reason for its end; GW_BOX_RUNS if the writer has not reported it.
    int error;                   ///< An errno or a reason of owners.h, with GW_BOX_BY_FAULT.
    char name[GW_BOX_STEM_SIZE]; ///< Name of its files without ending; empty before they exist.
} gw_box_request_t;

typedef struct gw_box {
    blackbox_ring_t *ring;
    size_t ring_size;
    gw_box_config_t config;
    gw_child_t writer;
    gw_child_t reader;
    gw_box_result_t last;     ///< Last result of a stop or of the directory; number 0: it was not a stop.
    gw_box_order_kind_t news; ///< Kind of order to which the last received result belongs.
    gw_box_request_t request;
    gw_box_result_t stop;   ///< Last result of a stop; number 0 if there is none.
    gw_box_answer_t answer; ///< Last answer.
} gw_box_t;

/// Creates the ring, and the writer unless blackbox_s is 0. Returns 0 or an errno (not enough memory). Call it while
/// nothing is sent and few descriptors are open.
int gw_box_open(gw_box_t *self, const gw_box_config_t *config);

/// Lets the writer finish and end.
void gw_box_close(gw_box_t *self);

/// Orders a recording. Returns false if it cannot: the writer has ended and was restarted recently, or has too many
/// orders.
bool gw_box_write(gw_box_t *self, const gw_box_order_t *order);

/// Sends a question to the reading process. Returns false if it cannot: blackbox_s is 0, the process has ended and was
/// restarted recently, or has too many questions.
bool gw_box_ask(gw_box_t *self, const gw_box_question_t *question);

/// Receives the next answer of the reading process into `answer`. Never waits.
gw_child_news_t gw_box_receive(gw_box_t *self);

/// Receives the next result of the writer into `last`. Never waits.
gw_child_news_t gw_box_take(gw_box_t *self);

/// Orders of recordings, and their results.
///
/// Orders a recording of the last stop, if stops are recorded.
void gw_record_stop(gw_box_t *box, struct sock_log *log, const iwn_stop_note_t *note, iw_time_us_t now_us);

/// Orders a recording of rolling wheels: without a stop, with the cause `rolling`.
void gw_record_rolling(gw_box_t *box, struct sock_log *log, const iw_snapshot_t *seen);

/// Two recordings on request begin at least this time apart, so that no client fills the log or wears the disk.
#define GW_RECORD_AGAIN_US 2000000U

/// Begins or ends the recording on request. `who` describes the client. A request for the present state changes
/// nothing. Returns NULL, or the reason why it cannot begin, with the fix.
const char *gw_record_request(gw_box_t *box, bool on, const char *who, iw_time_us_t now_us);

/// Writes the state of the recording on request into an open object.
void gw_record_write_request(const gw_box_t *box, iwn_out_t *json);

/// Receives results of the writer and logs them.
void gw_record_take(gw_box_t *box, struct sock_log *log);

/// Writes the file of the stop with this number (0: there was none) into an open object.
void gw_record_write(const gw_box_t *box, uint32_t number, iwn_out_t *json);

#endif
