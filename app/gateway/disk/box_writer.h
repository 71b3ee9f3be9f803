// SPDX-License-Identifier: MIT
/// A recording while it is written. The writer process writes at most two at the same time: that of a stop, and the
/// recording on request.
#ifndef GATEWAY_BOX_WRITER_H
#define GATEWAY_BOX_WRITER_H

#include "box_files.h"

typedef struct gw_writer {
    int fd;
    const blackbox_ring_t *ring;
    const gw_box_config_t *config;
    blackbox_entry_t *copy; ///< Buffer for all entries of the ring. Both recordings use it, one after the other.
    const char *bus;        ///< Name in the file of frames.
    const gw_box_order_t *order;
    struct gw_writer *request; ///< The recording on request; NULL in itself.
    FILE *frames_file;         ///< NULL: no recording is being written.
    FILE *events_file;
    uint32_t number; ///< Number in the names of the files.
    uint64_t next;   ///< Number of the next entry to write.
    uint64_t frames;
    uint64_t bytes;      ///< Written bytes of both files.
    uint64_t most_bytes; ///< No entry is written after this size.
    int error;           ///< Errno of the first failed write of this attempt.
    bool in_motion;      ///< A wheel turned at the stop, or was commanded to.
    gw_box_result_t result;
    char line[GW_BOX_LINE_SIZE]; ///< Buffer of a line.
} gw_writer_t;

/// Creates the three files of recording `number`, with the configuration and the first two lines. Returns 0 or the
/// errno of the first failure; then no file is open. EEXIST: another process uses the number.
int gw_writer_open(gw_writer_t *self, int directory, uint32_t number);

/// Writes the first two lines of the events. `from_start`: the ring has every entry since the gateway's start.
void gw_writer_head(gw_writer_t *self, bool from_start);

/// Writes the entries up to number `to`, except those before `since_us`.
void gw_writer_entries(gw_writer_t *self, uint64_t to, iw_time_us_t since_us);

/// Passes written lines to the kernel.
void gw_writer_flush(gw_writer_t *self);

/// Writes the last line, which confirms the others, if there was no error. Then flushes both files to the disk and
/// closes them.
void gw_writer_close(gw_writer_t *self);

/// Begins the recording on request. Sends the result to the gateway.
void gw_request_begin(gw_writer_t *self, const gw_box_order_t *order);

/// Writes the new entries of the recording on request, and ends it at its limits.
void gw_request_step(gw_writer_t *self);

/// Ends the recording on request, if it runs.
void gw_request_end(gw_writer_t *self, gw_box_end_t reason);

static inline bool gw_request_runs(const gw_writer_t *self) {
    return self->frames_file != NULL;
}

#endif
