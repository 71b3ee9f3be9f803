// SPDX-License-Identifier: MIT
/// A stop on its way to disk, and what became of it.
#ifndef GATEWAY_RECORD_H
#define GATEWAY_RECORD_H

#include "iwheel_northbound/json_out.h"
#include "iwheel_northbound/why.h"

struct gw_box;
struct gw_log;

/// Orders a recording of a stop that has just been seen, if stops are recorded.
void gw_record_stop(struct gw_box *box, struct gw_log *log, const iwn_stop_note_t *note, iw_time_us_t now_us);

/// Takes what the writer tells, to the log.
void gw_record_take(struct gw_box *box, struct gw_log *log);

/// Where the stop with this number was written (0: there was none), into an object that is open.
void gw_record_write(const struct gw_box *box, uint32_t number, iwn_out_t *json);

#endif
