// SPDX-License-Identifier: MIT
// Lines to the host: where each is put, and which are dropped.
#include "host.h"

#include "serial.h"

#include "iwheel_server/target.h"

#include <string.h>

#define CHANNEL_LINK 0U

const char *brd_host_boot_text(uint64_t boot, char out_text[IWN_LINE_BOOT + 1U]) {
    for (unsigned i = 0; i < IWN_LINE_BOOT; i++) {
        out_text[i] = "0123456789abcdef"[boot >> (60U - 4U * i) & 15U];
    }
    out_text[IWN_LINE_BOOT] = '\0';
    return out_text;
}

static uint8_t channel_of(const brd_host_t *self, const brd_host_client_t *client) {
    return (uint8_t)(client - self->client + 1);
}

/// Puts channel and stamp directly before the JSON at `json`, and the CRC after it. Returns the start of the line.
/// `*out_length` is its length; 0: it does not fit.
static const char *frame(brd_host_t *self, uint8_t channel, char *json, size_t length, size_t *out_length) {
    const iwn_line_t line = {.t_us = self->server.now_us, .channel = channel, .stamped = true};
    char prefix[IWN_LINE_PREFIX];
    const size_t before = iwn_line_begin(&line, prefix, sizeof prefix);
    char *const begin = json - before;
    memcpy(begin, prefix, before);
    *out_length = iwn_line_end(begin, before + length, before + length + IWN_LINE_SUFFIX);
    return begin;
}

/// Puts a line of `self->scratch.small` into the ring, if that leaves `reserve` bytes free. Returns false if not.
static bool put(brd_host_t *self, uint8_t channel, size_t length, size_t reserve) {
    size_t whole;
    if (length + reserve > brd_serial_room()) {
        return false; // Skips the CRC, which would delay the next read of the e-stop.
    }
    const char *const line = frame(self, channel, &self->scratch.small[IWN_LINE_PREFIX], length, &whole);
    if (whole == 0U || whole + reserve > brd_serial_room()) {
        return false;
    }
    self->stamped_us = self->server.now_us;
    return brd_serial_write(line, whole);
}

/// Closes the object. Returns its length without the newline; 0 if it does not fit.
static size_t finish(iwn_out_t *json) {
    iwn_out_close(json, '}');
    const size_t length = iwn_out_finish(json);
    return (length > 0U) ? length - 1U : 0U;
}

char *iwn_target_line(iwn_server_t *server, size_t *out_size) {
    *out_size = BRD_HOST_SMALL_BYTES - IWN_LINE_PREFIX - IWN_LINE_SUFFIX;
    return &brd_host_of(server)->scratch.small[IWN_LINE_PREFIX];
}

void iwn_target_reply(iwn_server_t *server, iwn_client_t *client, char *line, size_t length) {
    brd_host_client_t *const whose = (brd_host_client_t *)client;
    (void)line;
    if (length == 0U || !put(brd_host_of(server), channel_of(brd_host_of(server), whose), length - 1U, 0U)) {
        whose->lost++;
    }
}

/// Drops the event while the client has not received the number of events that were dropped before it.
void iwn_target_event(iwn_server_t *server, iwn_client_t *client, char *line, size_t length) {
    brd_host_t *const self = brd_host_of(server);
    brd_host_client_t *const whose = (brd_host_client_t *)client;
    (void)line;
    if (length == 0U || whose->lost > 0U || !put(self, channel_of(self, whose), length - 1U, BRD_HOST_REPLY_ROOM)) {
        whose->lost++;
    }
}

/// Reports the number of dropped lines before any other event.
void brd_host_report_lost(brd_host_t *self, brd_host_client_t *client) {
    iwn_out_t json = iwn_server_begin_event(&self->server, "lost");
    iwn_out_int(&json, "count", client->lost);
    const size_t length = finish(&json);
    if (put(self, channel_of(self, client), length, BRD_HOST_REPLY_ROOM)) {
        client->lost = 0;
    }
}

static void write_records(const brd_host_t *self, iwn_out_t *json) {
    static const char *const states[] = {
        [BRD_RECORDS_NEW] = "new", [BRD_RECORDS_STORED] = "kept", [BRD_RECORDS_FAILED] = "failed"};
    iwn_out_open(json, "memory", '{');
    iwn_out_text(json, "file", "flash");
    iwn_out_text(json, "state", states[self->records]);
    iwn_out_text(json, "reason",
                 (self->records == BRD_RECORDS_FAILED) ? "it is full, or fails; switch the board off and on" : NULL);
    iwn_out_close(json, '}');
}

static void write_assumptions(const iw_snapshot_t *seen, iwn_out_t *json) {
    iwn_out_open(json, "ledger", '{');
    for (unsigned item = 0; item < IW_ASSUMPTION_ITEMS; item++) {
        iwn_out_open(json, iwn_assumption_item_name((iw_assumption_item_t)item), '{');
        // Only these fields, because the e-stop is not read while a snapshot is written.
        iwn_out_text(json, "state", iwn_assumption_state_name(seen->assumed[item].state));
        iwn_out_text(json, "evidence", iwn_source_name(seen->assumed[item].source));
        iwn_out_close(json, '}');
    }
    iwn_out_close(json, '}');
}

void iwn_target_write_assumptions(iwn_server_t *server, const iw_snapshot_t *seen, iwn_out_t *json) {
    write_assumptions(seen, json);
    write_records(brd_host_of(server), json);
    iwn_out_null(json, "gaps");
}

void brd_host_send_status(brd_host_t *self, brd_host_client_t *client, const iw_snapshot_t *seen, const iwn_id_t *id) {
    char *const data = &self->big[IWN_LINE_PREFIX];
    const size_t size = sizeof self->big - IWN_LINE_PREFIX - IWN_LINE_SUFFIX;
    iwn_out_t json = (id != NULL) ? iwn_write_reply(data, size, id, true) : iwn_write_event(data, size, "state");
    iwn_server_write_status(&self->server, seen, &json);
    size_t whole = 0;
    const size_t length = finish(&json);
    const char *const line = (length > 0U) ? frame(self, channel_of(self, client), data, length, &whole) : NULL;
    if (whole > 0U && brd_serial_lend(line, whole)) {
        self->stamped_us = self->server.now_us;
    } else {
        client->lost++;
    }
}

void brd_host_report_link(brd_host_t *self) {
    char boot[IWN_LINE_BOOT + 1U];
    iwn_out_t json = iwn_server_begin_event(&self->server, "link");
    iwn_out_text(&json, "boot", brd_host_boot_text(self->boot, boot));
    iwn_out_text(&json, "version", self->server.version);
    IWN_OUT_NUMBERS(&json, "line_bytes\0channels\0silent_ms\0", BRD_HOST_LINE_BYTES, IWN_LINE_CHANNELS,
                    IWN_LINE_SILENT_MS);
    if (self->last_fault.cause != 0U) {
        IWN_OUT_NUMBERS(&json, "fault_cause\0fault_pc\0", self->last_fault.cause, self->last_fault.pc);
    }
    if (put(self, CHANNEL_LINK, finish(&json), 0U)) {
        self->linked_us = self->server.now_us;
    }
}

void brd_host_report_fault(brd_host_t *self) {
    if (self->errors == self->errors_reported || self->server.now_us - self->error_us < BRD_HOST_ERROR_US) {
        return;
    }
    self->error_us = self->server.now_us;
    iwn_out_t json = iwn_server_begin_event(&self->server, "line_error");
    iwn_out_text(&json, "reason", iwn_line_verdict_name(self->fault));
    iwn_out_int(&json, "count", self->errors - self->errors_reported);
    if (put(self, CHANNEL_LINK, finish(&json), BRD_HOST_REPLY_ROOM)) {
        self->errors_reported = self->errors;
    }
}
