// SPDX-License-Identifier: MIT
// The recording on request: continuous, in the same three files as that of a stop, until a client ends it or it
// reaches a limit. It displaces only older ones of its kind. One that ends because of the disk lacks the last line.
#include "box_writer.h"

#include "iwheel_linux/clock.h"

#include <errno.h>
#include <sys/socket.h>
#include <unistd.h>

/// Number of attempts if another process uses a number first.
#define TRIES 8U

static void send_result(gw_writer_t *self, gw_box_order_kind_t kind, gw_box_end_t reason) {
    self->result.kind = kind;
    self->result.ended = reason;
    self->result.number = self->order->note.stop.number;
    self->result.error = self->error;
    self->result.frames = (uint32_t)self->frames;
    (void)send(self->fd, &self->result, sizeof self->result, MSG_NOSIGNAL);
}

static int open_next(gw_writer_t *self) {
    const int directory = gw_box_files_open(self->config->directory);
    if (directory < 0) {
        return errno;
    }
    gw_box_files_limit_requested(directory, GW_BOX_REQUESTS_KEPT);
    uint32_t number = gw_box_files_next(directory);
    int error = gw_writer_open(self, directory, number);
    for (unsigned i = 0; i < TRIES && error == EEXIST; i++) {
        number++;
        error = gw_writer_open(self, directory, number);
    }
    if (error != 0 && error != EEXIST) {
        gw_box_files_remove(directory, number);
    }
    (void)fsync(directory);
    (void)close(directory);
    return error;
}

void gw_request_begin(gw_writer_t *self, const gw_box_order_t *order) {
    static gw_box_order_t begun; // Until the end of the recording.
    if (gw_request_runs(self)) {
        gw_request_end(self, GW_BOX_BY_REQUEST);
    }
    begun = *order;
    self->order = &begun;
    self->in_motion = false; // It never displaces the recording of a stop in motion.
    self->most_bytes = GW_BOX_REQUEST_BYTES;
    self->error = open_next(self);
    if (gw_request_runs(self)) {
        self->next = order->mark;
        gw_writer_head(self, false);
    }
    send_result(self, GW_BOX_BEGIN, (self->error != 0) ? GW_BOX_BY_FAULT : GW_BOX_RUNS);
}

void gw_request_end(gw_writer_t *self, gw_box_end_t reason) {
    if (!gw_request_runs(self)) {
        return;
    }
    gw_writer_entries(self, UINT64_MAX, 0);
    gw_writer_close(self);
    send_result(self, GW_BOX_END, (self->error != 0) ? GW_BOX_BY_FAULT : reason);
}

void gw_request_step(gw_writer_t *self) {
    if (!gw_request_runs(self)) {
        return;
    }
    gw_writer_entries(self, UINT64_MAX, 0);
    gw_writer_flush(self);
    if (self->error != 0) {
        gw_request_end(self, GW_BOX_BY_FAULT);
    } else if (self->bytes >= self->most_bytes) {
        gw_request_end(self, GW_BOX_BY_SIZE);
    } else if (iwl_clock_now_us() >= self->order->note.stop.at_us + GW_BOX_REQUEST_US) {
        gw_request_end(self, GW_BOX_BY_TIME);
    }
}
