// SPDX-License-Identifier: MIT
#include "record.h"

#include "box.h"
#include "process/log.h"
#include "process/owners.h"

#include "iwheel_northbound/words.h"

#include <stdio.h>

void gw_record_stop(gw_box_t *box, gw_log_t *log, const iwn_stop_note_t *note, iw_time_us_t now_us) {
    const char *side = iwn_sides_name(note->stop.sides);
    if (box->wish.blackbox_s == 0U) {
        return;
    }
    gw_box_order_t order = {
        .note = *note, .wall_minus_us = note->wall_us - (int64_t)now_us, .mark = blackbox_ring_written(box->ring)};
    (void)snprintf(order.cause, sizeof order.cause, "%s", iwn_cause_name(note->stop.cause));
    (void)snprintf(order.side, sizeof order.side, "%s", (side != NULL) ? side : "");
    (void)snprintf(order.from, sizeof order.from, "%s", iwn_state_name(note->stop.from));
    if (!gw_box_write(box, &order)) {
        gw_log(log, GW_LOG_WARNING,
               "stop %u is not recorded: the process that writes recordings is %s; the frames around it are kept in "
               "memory: iwheelctl why",
               (unsigned)note->stop.number,
               (box->writer.fd < 0) ? "gone (it is started again after 10 s)" : "too far behind (is the disk slow?)");
    }
}

static void tell_result(const gw_box_t *box, gw_log_t *log) {
    const gw_box_result_t *result = &box->last;
    const char *directory = box->wish.directory;
    if (result->number == 0U && result->error == 0) {
        gw_log(log, GW_LOG_INFO, "recorded in %s", result->path);
    } else if (result->number == 0U) {
        gw_log(log, GW_LOG_WARNING,
               "no recording can be written to %s: %s; %s, or name another place as [record] directory. Until then a "
               "stop is kept in memory only: iwheelctl why",
               directory, gw_folder_fault(result->error), gw_folder_cure(result->error));
    } else if (result->error != 0) {
        gw_log(log, GW_LOG_WARNING,
               "stop %u is not recorded in %s: %s; %s, or name another place as [record] directory",
               (unsigned)result->number, directory, gw_folder_fault(result->error), gw_folder_cure(result->error));
    } else {
        gw_log(log, GW_LOG_INFO, "stop %u is recorded in %s (%u frames, %u.%u s before it)", (unsigned)result->number,
               result->path, (unsigned)result->frames, (unsigned)(result->ms / 1000U),
               (unsigned)(result->ms % 1000U / 100U));
    }
}

void gw_record_take(gw_box_t *box, gw_log_t *log) {
    switch (gw_box_take(box)) {
    case GW_CHILD_SAID:
        tell_result(box, log);
        break;
    case GW_CHILD_ENDED:
        gw_log(log, GW_LOG_WARNING,
               "the process that writes recordings has ended (was it killed?); it is started again with the next stop");
        break;
    case GW_CHILD_SILENT:
        break;
    }
}

void gw_record_write(const gw_box_t *box, uint32_t number, iwn_out_t *json) {
    const gw_box_result_t *last = &box->last;
    const bool known = number != 0U && last->number == number;
    iwn_out_text(json, "directory", box->wish.directory);
    iwn_out_text(json, "recording", (known && last->error == 0) ? last->path : NULL);
    iwn_out_text(json, "recording_error", (known && last->error != 0) ? gw_folder_fault(last->error) : NULL);
}
