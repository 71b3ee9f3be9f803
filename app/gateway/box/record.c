// SPDX-License-Identifier: MIT
#include "record.h"

#include "process/owners.h"

#include "iwheel_linux/clock.h"
#include "iwheel_northbound/json_out.h"
#include "iwheel_northbound/words.h"

#include <stdio.h>
#include <string.h>

static void order_recording(gw_daemon_t *daemon) {
    const iwn_stop_note_t *note = &daemon->last_stop;
    const char *side = iwn_sides_name(note->stop.sides);
    gw_box_order_t order = {.note = *note,
                            .wall_minus_us = note->wall_us - (int64_t)daemon->now_us,
                            .mark = blackbox_ring_written(daemon->box.ring)};
    (void)snprintf(order.cause, sizeof order.cause, "%s", iwn_cause_name(note->stop.cause));
    (void)snprintf(order.side, sizeof order.side, "%s", (side != NULL) ? side : "");
    (void)snprintf(order.from, sizeof order.from, "%s", iwn_state_name(note->stop.from));
    if (!gw_box_write(&daemon->box, &order)) {
        gw_log(&daemon->log, GW_LOG_WARNING,
               "stop %u is not recorded: the process that writes recordings is %s; the frames around it are kept in "
               "memory: iwheelctl why",
               (unsigned)note->stop.number,
               (daemon->box.writer.fd < 0) ? "gone (it is started again after 10 s)"
                                           : "too far behind (is the disk slow?)");
    }
}

void gw_record_stop(gw_daemon_t *daemon) {
    const iw_stop_t *stop = &daemon->last_stop.stop;
    gw_tape_put(&daemon->tape, &(blackbox_entry_t){.at_us = daemon->now_us,
                                                   .kind = BLACKBOX_STOPPED,
                                                   .number = stop->number,
                                                   .a = (uint8_t)stop->cause,
                                                   .b = stop->sides,
                                                   .as = {.value = stop->detail}});
    gw_tape_mark(&daemon->tape);
    if (stop->latched && daemon->config.record.blackbox_s > 0U) {
        order_recording(daemon);
    }
}

void gw_record_state(gw_daemon_t *daemon, iw_state_t before) {
    const iw_snapshot_t seen = gw_daemon_look(daemon);
    const iw_pair_t applied = seen.applied;
    blackbox_entry_t entry = {.at_us = daemon->now_us,
                              .kind = BLACKBOX_STATE,
                              .number = seen.holder,
                              .a = (uint8_t)seen.state,
                              .b = (uint8_t)before};
    for (unsigned side = 0; side < IW_SIDES; side++) {
        entry.as.drive.speed_mm_s[side] = applied.wheel[side].speed_mm_s;
        entry.as.drive.current_mA[side] = applied.wheel[side].current_mA;
    }
    gw_tape_put(&daemon->tape, &entry);
}

void gw_record_assumption(gw_daemon_t *daemon, iw_ledger_item_t item) {
    const iw_ledger_entry_t *entry = &gw_daemon_look(daemon).assumed[item];
    gw_tape_put(&daemon->tape, &(blackbox_entry_t){.at_us = daemon->now_us,
                                                   .kind = BLACKBOX_LEDGER,
                                                   .number = (uint32_t)entry->evidence,
                                                   .a = (uint8_t)item,
                                                   .b = (uint8_t)entry->state,
                                                   .as = {.value = entry->figure}});
}

void gw_record_again(gw_daemon_t *daemon) {
    if (gw_tape_again(&daemon->tape, daemon->now_us)) {
        gw_record_state(daemon, iw_gateway_state(&daemon->gateway));
        const iw_ledger_item_t doubt = gw_daemon_look(daemon).doubt;
        if (doubt != IW_LEDGER_ITEMS) {
            gw_record_assumption(daemon, doubt);
        }
    }
}

static void tell_result(gw_daemon_t *daemon, const gw_box_result_t *result) {
    const char *directory = daemon->config.record.directory;
    if (result->number == 0U && result->error == 0) {
        gw_log(&daemon->log, GW_LOG_INFO, "recorded in %s", result->path);
    } else if (result->number == 0U) {
        gw_log(&daemon->log, GW_LOG_WARNING,
               "no recording can be written to %s: %s; %s, or name another place as [record] directory. Until then a "
               "stop is "
               "kept in memory only: iwheelctl why",
               directory, gw_folder_fault(result->error), gw_folder_cure(result->error));
    } else if (result->error != 0) {
        gw_log(&daemon->log, GW_LOG_WARNING,
               "stop %u is not recorded in %s: %s; %s, or name another place as [record] directory",
               (unsigned)result->number, directory, gw_folder_fault(result->error), gw_folder_cure(result->error));
    } else {
        gw_log(&daemon->log, GW_LOG_INFO, "stop %u is recorded in %s (%u frames, %u.%u s before it)",
               (unsigned)result->number, result->path, (unsigned)result->frames, (unsigned)(result->ms / 1000U),
               (unsigned)(result->ms % 1000U / 100U));
    }
}

void gw_record_take(gw_daemon_t *daemon) {
    switch (gw_box_take(&daemon->box)) {
    case GW_CHILD_SAID:
        tell_result(daemon, &daemon->box.last);
        break;
    case GW_CHILD_ENDED:
        gw_log(&daemon->log, GW_LOG_WARNING,
               "the process that writes recordings has ended (was it killed?); it is started again with the next stop");
        break;
    case GW_CHILD_SILENT:
        break;
    }
}

static void write_frames(iwn_out_t *json, const char *name, const blackbox_entry_t *frames, uint32_t count) {
    iwn_out_open(json, name, '[');
    for (uint32_t i = 0; i < count; i++) {
        iw_can_frame_t frame = {.id = frames[i].number, .dlc = frames[i].a, .kind = frames[i].b};
        memcpy(frame.data, frames[i].as.data, sizeof frame.data);
        iwn_out_open(json, NULL, '{');
        iwn_out_frame(&frame, frames[i].at_us, json);
        iwn_out_close(json, '}');
    }
    iwn_out_close(json, ']');
}

void gw_record_write(const gw_daemon_t *daemon, iwn_out_t *json) {
    const gw_box_result_t *last = &daemon->box.last;
    const uint32_t number = daemon->last_stop.stop.number;
    const bool known = number != 0U && last->number == number;
    iwn_out_text(json, "directory", daemon->config.record.directory);
    iwn_out_text(json, "recording", (known && last->error == 0) ? last->path : NULL);
    iwn_out_text(json, "recording_error", (known && last->error != 0) ? gw_folder_fault(last->error) : NULL);
    write_frames(json, "frames_before", daemon->tape.before, daemon->tape.before_count);
    write_frames(json, "frames_after", daemon->tape.after, (number != 0U) ? daemon->tape.after_count : 0U);
}
