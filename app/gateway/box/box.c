// SPDX-License-Identifier: MIT
#include "box.h"

#include "disk/box_files.h"
#include "sockets/log.h"

#include "iwheel_linux/clock.h"
#include "iwheel_northbound/words.h"

#include <errno.h>
#include <stddef.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/mman.h>

/// The loop has precedence over the writer.
#define NICE 10

static void write_recordings(int fd, const void *context) {
    const gw_box_t *self = (const gw_box_t *)context;
    gw_box_writer_run(fd, self->ring, &self->config);
}

static void read_recordings(int fd, const void *context) {
    const gw_box_t *self = (const gw_box_t *)context;
    gw_box_reader_run(fd, self->config.directory);
}

int gw_box_open(gw_box_t *self, const gw_box_config_t *config) {
    *self = (gw_box_t){.writer = {.fd = -1},
                       .reader = {.fd = -1},
                       .config = *config,
                       .ring_size = blackbox_ring_size(config->blackbox_s)};
    self->ring = (blackbox_ring_t *)mmap(NULL, self->ring_size, PROT_READ | PROT_WRITE,
                                         MAP_SHARED | MAP_ANONYMOUS | MAP_POPULATE, -1, 0);
    if (self->ring == MAP_FAILED) {
        self->ring = NULL;
        return errno;
    }
    blackbox_ring_init(self->ring, config->blackbox_s);
    if (config->blackbox_s > 0U) {
        (void)gw_child_start(&self->writer, &(gw_child_work_t){"iwheel-blackbox", NICE, write_recordings, self});
        (void)gw_child_start(&self->reader, &(gw_child_work_t){"iwheel-records", NICE, read_recordings, self});
    }
    return 0;
}

void gw_box_close(gw_box_t *self) {
    const gw_box_order_t bye = {.kind = GW_BOX_LAST};
    (void)gw_child_send(&self->writer, &bye, sizeof bye);
    gw_child_close(&self->writer);
    gw_child_close(&self->reader);
    if (self->ring != NULL) {
        (void)munmap(self->ring, self->ring_size);
        self->ring = NULL;
    }
}

bool gw_box_write(gw_box_t *self, const gw_box_order_t *order) {
    return gw_child_revive(&self->writer) && gw_child_send(&self->writer, order, sizeof *order);
}

static gw_child_news_t not_understood(gw_child_t *child) {
    gw_child_close(child);
    return GW_CHILD_ENDED;
}

/// A result of an earlier request changes nothing.
static void take_request(gw_box_request_t *self, const gw_box_result_t *result) {
    const char *slash = strrchr(result->path, '/');
    if (result->number != self->number) {
        return;
    }
    self->ended = result->ended;
    self->error = result->error;
    if (result->ended != GW_BOX_RUNS) {
        self->on = false;
    }
    if (slash != NULL) {
        (void)snprintf(self->name, sizeof self->name, "%.*s", (int)strcspn(slash + 1, "."), slash + 1);
    }
}

gw_child_news_t gw_box_take(gw_box_t *self) {
    gw_box_result_t result;
    size_t length;
    const gw_child_news_t news = gw_child_receive(&self->writer, &result, sizeof result, &length);
    if (news == GW_CHILD_MESSAGE && length != sizeof result) {
        return not_understood(&self->writer);
    }
    if (news == GW_CHILD_MESSAGE) {
        self->news = result.kind;
    }
    if (news == GW_CHILD_MESSAGE && result.kind != GW_BOX_STOP) {
        take_request(&self->request, &result);
    } else if (news == GW_CHILD_MESSAGE) {
        self->last = result;
        if (result.number != 0U) {
            self->stop = result;
        }
    } else if (news == GW_CHILD_ENDED && self->request.on) {
        self->request.on = false;
        self->request.ended = GW_BOX_BY_FAULT;
        self->request.error = ESRCH;
    }
    return news;
}

bool gw_box_ask(gw_box_t *self, const gw_box_question_t *question) {
    return gw_child_revive(&self->reader) && gw_child_send(&self->reader, question, sizeof *question);
}

gw_child_news_t gw_box_receive(gw_box_t *self) {
    const size_t head = offsetof(gw_box_answer_t, text);
    size_t length;
    const gw_child_news_t news = gw_child_receive(&self->reader, &self->answer, sizeof self->answer, &length);
    if (news != GW_CHILD_MESSAGE) {
        return news;
    }
    if (length < head || length - head != self->answer.length || self->answer.length >= sizeof self->answer.text) {
        return not_understood(&self->reader);
    }
    self->answer.text[self->answer.length] = '\0'; // The reader sends the text without it.
    return news;
}

/// Returns false if the recording cannot be ordered. Without a box nothing is ordered.
static bool order_recording(gw_box_t *box, const iwn_stop_note_t *note, const char *cause, iw_time_us_t now_us) {
    const char *side = iwn_sides_name(note->stop.sides);
    if (box->config.blackbox_s == 0U) {
        return true;
    }
    gw_box_order_t order = {
        .note = *note, .wall_minus_us = note->wall_us - (int64_t)now_us, .mark = blackbox_ring_written(box->ring)};
    (void)snprintf(order.cause, sizeof order.cause, "%s", cause);
    (void)snprintf(order.side, sizeof order.side, "%s", (side != NULL) ? side : "");
    (void)snprintf(order.from, sizeof order.from, "%s", iwn_state_name(note->stop.from));
    return gw_box_write(box, &order);
}

static const char *why_not(const gw_box_t *box) {
    return (box->writer.fd < 0) ? "gone (it is started again after 10 s)" : "too far behind (is the disk slow?)";
}

void gw_record_stop(gw_box_t *box, sock_log_t *log, const iwn_stop_note_t *note, iw_time_us_t now_us) {
    if (!order_recording(box, note, iwn_cause_name(note->stop.cause), now_us)) {
        sock_log(log, SOCK_LOG_WARNING,
                 "stop %u is not recorded: the process that writes recordings is %s; the frames around it are in "
                 "memory only: iwheelctl why",
                 (unsigned)note->stop.number, why_not(box));
    }
}

void gw_record_rolling(gw_box_t *box, sock_log_t *log, const iw_snapshot_t *seen) {
    iwn_stop_note_t note = {.stop = {.at_us = seen->at_us, .from = seen->state}, .wall_us = iwl_clock_wall_us()};
    for (unsigned side = 0; side < IW_SIDES; side++) {
        const bool turns = seen->wheel[side].heard && abs(seen->wheel[side].speed_mm_s) > IW_ROLLING_MM_S;
        if (turns) {
            note.stop.sides = (uint8_t)(note.stop.sides | (unsigned)IW_SIDES_LEFT << side);
        }
    }
    (void)snprintf(note.sentence, sizeof note.sentence,
                   "a wheel turns although nothing is sent to it, and soon after the last setpoint: the machine rolls "
                   "away; use its parking brake");
    if (!order_recording(box, &note, "rolling", seen->at_us)) {
        sock_log(log, SOCK_LOG_WARNING, "that is not recorded: the process that writes recordings is %s", why_not(box));
    }
}

static const char *const ends[GW_BOX_ENDS] = {
    [GW_BOX_BY_REQUEST] = "request", [GW_BOX_BY_TIME] = "time", [GW_BOX_BY_SIZE] = "size", [GW_BOX_BY_FAULT] = "fault"};

static bool order_request(gw_box_t *box, const gw_box_order_t *order) {
    return (order->kind == GW_BOX_BEGIN) ? gw_box_write(box, order) : gw_child_send(&box->writer, order, sizeof *order);
}

const char *gw_record_request(gw_box_t *box, bool on, const char *who, iw_time_us_t now_us) {
    gw_box_request_t *request = &box->request;
    if (box->config.blackbox_s == 0U) {
        return "nothing is recorded: [record] blackbox_s is 0; set it, then restart the gateway";
    }
    if (on == request->on) {
        return NULL;
    }
    if (on && request->number != 0U && now_us - request->begun_us < GW_RECORD_AGAIN_US) {
        return "the last recording on request began less than 2 s ago; wait, then send this request again";
    }
    gw_box_order_t order = {.kind = on ? GW_BOX_BEGIN : GW_BOX_END,
                            .cause = GW_BOX_REQUESTED,
                            .from = "listening",
                            .mark = blackbox_ring_written(box->ring)};
    order.note.stop.number = request->number + (on ? 1U : 0U);
    order.note.stop.at_us = now_us;
    order.note.wall_us = iwl_clock_wall_us();
    order.wall_minus_us = order.note.wall_us - (int64_t)now_us;
    (void)snprintf(order.note.sentence, sizeof order.note.sentence, "recorded on request of %s; it is no stop", who);
    if (!order_request(box, &order)) {
        return "the process that writes recordings is gone or too far behind; send this request again after 10 s";
    }
    if (on) {
        *request = (gw_box_request_t){.number = order.note.stop.number, .begun_us = now_us};
    }
    request->on = on;
    return NULL;
}

void gw_record_write_request(const gw_box_t *box, iwn_out_t *json) {
    const gw_box_request_t *request = &box->request;
    iwn_out_bool(json, "on", request->on);
    iwn_out_text(json, "name", (request->name[0] != '\0') ? request->name : NULL);
    iwn_out_text(json, "ended", ends[request->ended]);
    iwn_out_text(json, "fault", (request->ended == GW_BOX_BY_FAULT) ? sock_folder_fault(request->error) : NULL);
    iwn_out_int(json, "most_ms", (int64_t)(GW_BOX_REQUEST_US / IW_US_PER_MS));
    iwn_out_int(json, "most_bytes", (int64_t)GW_BOX_REQUEST_BYTES);
}

static void report_request(const gw_box_request_t *request, sock_log_t *log) {
    if (request->ended == GW_BOX_BY_FAULT) {
        sock_log(log, SOCK_LOG_WARNING, "the recording on request has ended: %s; %s", sock_folder_fault(request->error),
                 sock_folder_fix(request->error));
    } else if (request->ended == GW_BOX_RUNS) {
        sock_log(log, SOCK_LOG_INFO, "recording on request to %s", request->name);
    } else {
        sock_log(log, SOCK_LOG_INFO, "the recording on request %s has ended: %s", request->name, ends[request->ended]);
    }
}

static void report_result(const gw_box_t *box, sock_log_t *log) {
    const gw_box_result_t *result = &box->last;
    const char *directory = box->config.directory;
    if (result->number == 0U && result->error == 0) {
        sock_log(log, SOCK_LOG_INFO, "recorded in %s", result->path);
    } else if (result->number == 0U) {
        sock_log(log, SOCK_LOG_WARNING,
                 "no recording can be written to %s: %s; %s, or set [record] directory to another place. Until then a "
                 "stop is stored in memory only: iwheelctl why",
                 directory, sock_folder_fault(result->error), sock_folder_fix(result->error));
    } else if (result->error != 0) {
        sock_log(log, SOCK_LOG_WARNING,
                 "stop %u is not recorded in %s: %s; %s, or set [record] directory to another place",
                 (unsigned)result->number, directory, sock_folder_fault(result->error), sock_folder_fix(result->error));
    } else {
        sock_log(log, SOCK_LOG_INFO, "stop %u is recorded in %s (%u frames, %u.%u s before it)",
                 (unsigned)result->number, result->path, (unsigned)result->frames, (unsigned)(result->ms / 1000U),
                 (unsigned)(result->ms % 1000U / 100U));
    }
}

void gw_record_take(gw_box_t *box, sock_log_t *log) {
    switch (gw_box_take(box)) {
    case GW_CHILD_MESSAGE:
        if (box->news == GW_BOX_STOP) {
            report_result(box, log);
        } else {
            report_request(&box->request, log);
        }
        break;
    case GW_CHILD_ENDED:
        sock_log(
            log, SOCK_LOG_WARNING,
            "the process that writes recordings has ended (was it killed?); it is started again with the next stop");
        break;
    case GW_CHILD_SILENT:
        break;
    }
}

void gw_record_write(const gw_box_t *box, uint32_t number, iwn_out_t *json) {
    const gw_box_result_t *last = &box->stop;
    const bool known = number != 0U && last->number == number;
    iwn_out_text(json, "directory", box->config.directory);
    iwn_out_text(json, "recording", (known && last->error == 0) ? last->path : NULL);
    iwn_out_text(json, "recording_error", (known && last->error != 0) ? sock_folder_fault(last->error) : NULL);
}
