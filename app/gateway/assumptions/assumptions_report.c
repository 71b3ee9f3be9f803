// SPDX-License-Identifier: MIT
#include "assumptions.h"

#include "sockets/log.h"
#include "wheels/wheels.h"

#include "iwheel_northbound/words.h"
#include "iwheel_server/server.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

/// A larger change of an offset in one step causes a warning: there was a load, before or now.
#define MOVED_mN ((int32_t)IW_FORCE_QUIET_mN)

static const char *side_name(iw_side_t side) {
    return (side == IW_LEFT) ? "left" : "right";
}

void gw_assumptions_report_item(gw_assumptions_t *self, iw_assumption_item_t item) {
    const iw_assumption_entry_t *entry = &gw_wheels_snapshot(self->wheels).assumed[item];
    const bool bad = entry->state == IW_CONTRADICTED;
    char value[IWN_VALUE_SIZE];
    char source[INSPECT_SOURCE_SIZE];
    inspect_assumption_value(&self->configured, item, value);
    inspect_assumption_source(item, entry, &self->known.item[item].word, source);
    sock_log(self->log, bad ? SOCK_LOG_WARNING : SOCK_LOG_INFO, "assumption %s = %s is %s by the %s: %s%s%s",
             iwn_assumption_item_name(item), value, iwn_assumption_state_name(entry->state),
             iwn_source_name(entry->source), source, bad ? "; disabled: " : "",
             bad ? inspect_assumption_cost(item) : "");
    iwn_out_t json = iwn_server_begin_event(self->server, "ledger");
    iwn_out_int(&json, "t_us", (int64_t)self->wheels->now_us);
    iwn_out_text(&json, "item", iwn_assumption_item_name(item));
    gw_assumptions_write_item(self, item, &json);
    iwn_server_send_event(self->server, IWN_TOPIC_STATE, &json);
}

/// Writes "12.300 N, stored (wheel)", or "none".
static void describe(const gw_reported_offset_t *offset, char *out_text, size_t size) {
    const char *word = iwn_offset_word(offset->provenance, offset->offset_us);
    const bool stored = strcmp(word, iwn_provenance_name(IW_OFFSET_STORED)) == 0;
    if (offset->provenance == IW_OFFSET_NONE) {
        (void)snprintf(out_text, size, "none");
        return;
    }
    (void)snprintf(out_text, size, "%s%d.%03d N, %s%s%s%s", (offset->offset_mN < 0) ? "-" : "",
                   abs(offset->offset_mN / 1000), abs(offset->offset_mN % 1000), word, stored ? " (" : "",
                   stored ? iwn_provenance_name(offset->from) : "", stored ? ")" : "");
}

void gw_assumptions_report_offset(gw_assumptions_t *self, iw_side_t side, const gw_reported_offset_t *now,
                                  const gw_reported_offset_t *before) {
    const bool known = now->provenance != IW_OFFSET_NONE;
    const bool knew = before->provenance != IW_OFFSET_NONE;
    const bool moved = knew && abs(now->offset_mN - before->offset_mN) > MOVED_mN;
    char is[64];
    char was[64];
    describe(now, is, sizeof is);
    describe(before, was, sizeof was);
    sock_log(self->log, moved ? SOCK_LOG_WARNING : SOCK_LOG_INFO, "%s force offset: %s; before: %s", side_name(side),
             is, was);
    iwn_out_t json = iwn_server_begin_event(self->server, "offset");
    iwn_out_int(&json, "t_us", (int64_t)self->wheels->now_us);
    iwn_out_text(&json, "side", side_name(side));
    iwn_out_known(&json, "offset_mN", known, now->offset_mN);
    iwn_out_text(&json, "provenance", iwn_offset_word(now->provenance, now->offset_us));
    iwn_out_known(&json, "before_mN", knew, before->offset_mN);
    iwn_out_text(&json, "before_provenance", iwn_offset_word(before->provenance, before->offset_us));
    iwn_server_send_event(self->server, IWN_TOPIC_FORCE, &json);
}

void gw_assumptions_report_state(gw_assumptions_t *self) {
    sock_log_t *log = self->log;
    switch (self->state) {
    case GW_ASSUMPTIONS_STORED:
        sock_log(log, SOCK_LOG_INFO, "the assumptions about the wheels are stored in %s", self->path);
        break;
    case GW_ASSUMPTIONS_NEW:
        sock_log(log, SOCK_LOG_INFO, "nothing was measured on these wheels yet; results will be stored in %s",
                 self->path);
        break;
    case GW_ASSUMPTIONS_IGNORED:
        sock_log(log, SOCK_LOG_WARNING, "%s is ignored: %s; it is set aside as %s.damaged", self->path, self->reason,
                 self->path);
        break;
    case GW_ASSUMPTIONS_FAILED:
    case GW_ASSUMPTIONS_LOADING:
    default:
        sock_log(log, SOCK_LOG_WARNING, "the assumptions about the wheels are not stored in %s: %s; %s%s", self->path,
                 sock_folder_fault(self->error),
                 (self->store.child.fd < 0) ? "start the gateway again" : sock_folder_fix(self->error),
                 (self->store.child.fd < 0) ? "" : ", or set [record] directory; the gateway tries again");
        break;
    }
}

/// Lists the names of the items in one state.
static void list_items(const iw_assumption_entry_t *assumed, iw_assumption_state_t state, char *out_text, size_t size) {
    out_text[0] = '\0';
    for (unsigned item = 0; item < IW_ASSUMPTION_ITEMS; item++) {
        if (assumed[item].state == state) {
            const size_t length = strlen(out_text);
            (void)snprintf(&out_text[length], size - length, "%s%s", (length > 0U) ? ", " : "",
                           iwn_assumption_item_name((iw_assumption_item_t)item));
        }
    }
}

void gw_assumptions_report_changes(gw_assumptions_t *self) {
    const iw_assumption_entry_t *assumed = gw_wheels_snapshot(self->wheels).assumed;
    char items[512];
    list_items(assumed, IW_CONFIRMED, items, sizeof items);
    if (items[0] != '\0') {
        sock_log(self->log, SOCK_LOG_INFO, "confirmed before: %s", items);
    }
    list_items(assumed, IW_ASSUMED, items, sizeof items);
    if (items[0] != '\0') {
        sock_log(self->log, SOCK_LOG_INFO, "assumed, never verified: %s", items);
    }
    for (unsigned item = 0; item < IW_ASSUMPTION_ITEMS; item++) {
        if (assumed[item].state == IW_CONTRADICTED) {
            gw_assumptions_report_item(self, (iw_assumption_item_t)item);
        }
    }
}

void gw_assumptions_report_button(gw_assumptions_t *self, gw_button_news_t news) {
    const char *line = self->wheels->estop;
    if (news == GW_BUTTON_TRIED) {
        sock_log(self->log, SOCK_LOG_INFO, "e-stop %s: its button was pressed and released, it works", line);
    } else if (news == GW_BUTTON_BROKEN) {
        sock_log(self->log, SOCK_LOG_WARNING,
                 "e-stop %s: its contacts disagree, so the earlier test of the button is void", line);
    } else {
        sock_log(self->log, SOCK_LOG_WARNING, "e-stop %s: its button was tested on another wiring; that test is void",
                 line);
    }
}
