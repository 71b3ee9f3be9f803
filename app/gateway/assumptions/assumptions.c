// SPDX-License-Identifier: MIT
#include "assumptions.h"

#include "sockets/log.h"
#include "wheels/wheels.h"

#include "iwheel_linux/clock.h"
#include "iwheel_northbound/words.h"

#include <errno.h>
#include <stdio.h>
#include <string.h>

void gw_assumptions_open(gw_assumptions_t *self, const char *directory) {
    char name[SOCK_ADDRESS_SIZE + 8U];
    gw_assumptions_file_name(self->bus, name, sizeof name);
    (void)snprintf(self->path, sizeof self->path, "%s/%s", directory, name);
    self->start_us = iwl_clock_now_us();
    self->error = gw_file_store_open(&self->store, directory, name);
    if (self->error != 0) {
        self->state = GW_ASSUMPTIONS_FAILED;
    }
}

/// Records an entry that has changed. Another figure for the same observation is not a change.
static void observe_item(gw_assumptions_t *self, iw_assumption_item_t item, const iw_assumption_entry_t *entry) {
    gw_stored_item_t *known = &self->known.item[item];
    const bool news = entry->state != known->entry.state || entry->source != known->entry.source;
    if (entry->state == IW_ASSUMED || (!news && entry->figure == known->entry.figure)) {
        return;
    }
    known->entry = *entry;
    self->changed = true;
    if (!news) {
        return;
    }
    known->since_wall_us = iwl_clock_wall_us();
    inspect_assumption_value(&self->configured, item, known->value);
    if (known->entry.source != IW_SOURCE_OPERATOR) {
        known->word = (inspect_word_t){"", ""};
    }
    gw_assumptions_report_item(self, item);
}

/// Records source and quality of an offset of this run. An offset that the wheel's force cannot reach is not stored.
static void note_offset(gw_assumptions_t *self, iw_side_t side, const iw_force_t *force) {
    iw_force_quality_t quality = {0};
    if (force->provenance == IW_OFFSET_OPERATOR) {
        quality = self->tare[side];
    } else if (force->provenance == IW_OFFSET_ESTIMATED) {
        quality = force->quality;
    }
    const gw_stored_offset_t known = {.from = force->provenance,
                                      .unit = self->configured.core->force_unit[side],
                                      .offset_mN = force->offset_mN,
                                      .drift_mN = quality.drift_mN,
                                      .deviation_mN = quality.deviation_mN,
                                      .samples = quality.samples,
                                      .wall_us = iwl_clock_wall_us()};
    if (gw_bounds_offset(&known)) {
        self->known.offset[side] = known;
        self->changed = true;
    }
}

static void observe_offset(gw_assumptions_t *self, iw_side_t side, const iw_force_t *force) {
    gw_reported_offset_t *reported = &self->reported[side];
    const bool tared = force->provenance == IW_OFFSET_OPERATOR && force->offset_us != reported->offset_us;
    if (force->provenance == reported->provenance && force->offset_mN == reported->offset_mN && !tared) {
        return;
    }
    gw_reported_offset_t now = {
        .offset_us = force->offset_us, .offset_mN = force->offset_mN, .provenance = force->provenance};
    if (now.provenance > IW_OFFSET_STORED && now.offset_us != IW_NEVER) {
        note_offset(self, side, force);
    }
    now.from = self->known.offset[side].from;
    gw_assumptions_report_offset(self, side, &now, reported);
    *reported = now;
}

/// Logs each time that the button becomes untested, and at the start.
static void observe_button(gw_assumptions_t *self) {
    gw_wheels_t *wheels = self->wheels;
    const iwl_estop_ops_t *kind = wheels->hal.estop_ops;
    wheels->estop_tried_us = self->known.tried.wall_us;
    if (!kind->present || kind->simulated) {
        return;
    }
    const gw_button_news_t news = gw_button_poll(&self->button, &wheels->hal, wheels->now_us, &self->known.tried);
    if (news != GW_BUTTON_NO_NEWS) {
        self->changed = true;
        gw_assumptions_report_button(self, news);
    }
    wheels->estop_tried_us = self->known.tried.wall_us;
    const bool untried = self->known.tried.wall_us == 0;
    if (untried && !wheels->estop_untried) {
        sock_log(self->log, SOCK_LOG_WARNING, GW_ESTOP_UNTRIED, wheels->estop);
    }
    wheels->estop_untried = untried;
}

void gw_assumptions_observe(gw_assumptions_t *self, const iw_snapshot_t *seen) {
    if (!self->answered) {
        return;
    }
    const bool observed = self->observed && seen->assumed_changes == self->observed_changes;
    self->observed = true;
    self->observed_changes = seen->assumed_changes;
    for (unsigned item = 0; item < IW_ASSUMPTION_ITEMS && !observed; item++) {
        observe_item(self, (iw_assumption_item_t)item, &seen->assumed[item]);
    }
    observe_offset(self, IW_LEFT, seen->wheel[IW_LEFT].force);
    observe_offset(self, IW_RIGHT, seen->wheel[IW_RIGHT].force);
    observe_button(self);
}

/// Adds an entry of an earlier run, unless this run has a newer one.
static void merge_item(gw_assumptions_t *self, iw_assumption_item_t item, const gw_stored_item_t *stored) {
    const iw_assumption_entry_t *present = &gw_wheels_snapshot(self->wheels).assumed[item];
    char value[IWN_VALUE_SIZE];
    inspect_assumption_value(&self->configured, item, value);
    const bool newer = present->state != IW_ASSUMED && present->source == IW_SOURCE_OPERATOR;
    if (stored->entry.state == IW_ASSUMED || present->state == IW_CONTRADICTED || newer) {
        return;
    }
    if (strcmp(value, stored->value) != 0) {
        sock_log(self->log, SOCK_LOG_INFO, "%s: the stored result was for %s, and %s is configured now: dropped",
                 iwn_assumption_item_name(item), stored->value, (value[0] != '\0') ? value : "nothing");
        self->changed = true;
        return;
    }
    if (stored->entry.state == IW_CONTRADICTED || present->state == IW_ASSUMED ||
        stored->entry.source == IW_SOURCE_OPERATOR) {
        gw_wheels_set_assumption(self->wheels, item, &stored->entry);
    }
    self->known.item[item] = *stored;
    self->known.item[item].entry = *present;
}

static void merge_offset(gw_assumptions_t *self, iw_side_t side, const gw_stored_offset_t *stored) {
    const bool newer = gw_wheels_snapshot(self->wheels).wheel[side].force->provenance == IW_OFFSET_OPERATOR;
    if (stored->from == IW_OFFSET_NONE || newer) {
        return;
    }
    if (stored->unit != self->configured.core->force_unit[side]) {
        sock_log(self->log, SOCK_LOG_WARNING,
                 "the %s wheel's stored force offset was measured in another force_unit: dropped; unload both wheels, "
                 "then: iwheelctl tare",
                 (side == IW_LEFT) ? "left" : "right");
        self->changed = true;
        return;
    }
    self->known.offset[side] = *stored;
    iw_gateway_restore_offset(&self->wheels->core, side,
                              (stored->from == IW_OFFSET_OPERATOR) ? IW_OFFSET_OPERATOR : IW_OFFSET_STORED,
                              stored->offset_mN);
}

static void merge(gw_assumptions_t *self, const gw_stored_t *stored) {
    for (unsigned item = 0; item < IW_ASSUMPTION_ITEMS; item++) {
        merge_item(self, (iw_assumption_item_t)item, &stored->item[item]);
    }
    merge_offset(self, IW_LEFT, &stored->offset[IW_LEFT]);
    merge_offset(self, IW_RIGHT, &stored->offset[IW_RIGHT]);
    if (self->known.tried.wall_us == 0) { // A test since the start is newer.
        self->known.tried = stored->tried;
        self->button.polled = false;
    }
}

/// Handles the first news: the file, or the reason why there is none.
static void take_file(gw_assumptions_t *self, gw_file_store_news_t news, const char *text, size_t length) {
    static gw_stored_t stored; // Too large for a stack.
    if (news == GW_FILE_STORE_ABSENT) {
        self->state = GW_ASSUMPTIONS_NEW;
    } else if (news == GW_FILE_STORE_READ && gw_assumptions_file_read(text, length, self->bus, &stored, self->reason)) {
        self->state = GW_ASSUMPTIONS_STORED;
        self->stored_length = (length <= sizeof self->stored_text) ? length : 0U;
        memcpy(self->stored_text, text, self->stored_length);
        merge(self, &stored);
    } else {
        self->state = GW_ASSUMPTIONS_IGNORED;
        if (news == GW_FILE_STORE_BAD) {
            (void)snprintf(self->reason, sizeof self->reason, "it cannot be read: %s", sock_folder_fault(self->error));
        }
        gw_file_store_set_aside(&self->store);
    }
    gw_assumptions_report_state(self);
}

static void receive_result(gw_assumptions_t *self, gw_file_store_news_t news, int error) {
    const bool failed = news != GW_FILE_STORE_WRITTEN;
    const bool reported = failed && self->state == GW_ASSUMPTIONS_FAILED && self->error == error;
    const bool recovered = !failed && self->state == GW_ASSUMPTIONS_FAILED;
    const bool set_aside = self->reason[0] != '\0'; // The first write must not clear this reason.
    self->state = failed ? GW_ASSUMPTIONS_FAILED : set_aside ? GW_ASSUMPTIONS_IGNORED : GW_ASSUMPTIONS_STORED;
    self->error = error;
    if (failed) {
        self->changed = true;
        self->stored_length = 0;
        self->write_us = self->wheels->now_us + GW_ASSUMPTIONS_RETRY_US;
    }
    if ((failed && !reported) || recovered) {
        gw_assumptions_report_state(self);
    }
}

static void receive_store(gw_assumptions_t *self) {
    const char *text = NULL;
    size_t length = 0;
    int error = 0;
    const gw_file_store_news_t news = gw_file_store_receive(&self->store, &text, &length, &error);
    const bool loaded = news == GW_FILE_STORE_READ || news == GW_FILE_STORE_ABSENT || news == GW_FILE_STORE_BAD;
    if (loaded) {
        self->error = error;
        take_file(self, news, text, length);
    } else if (news != GW_FILE_STORE_NO_NEWS) {
        receive_result(self, news, (news == GW_FILE_STORE_GONE) ? ECHILD : error);
    }
    const bool waited = self->wheels->now_us - self->start_us > GW_ASSUMPTIONS_PATIENCE_US;
    if (loaded || (!self->answered && (self->state != GW_ASSUMPTIONS_LOADING || waited))) { // A late file is reported.
        self->answered = true;
        gw_assumptions_report_changes(self);
    }
}

static void hand_over(gw_assumptions_t *self) {
    static char text[GW_ASSUMPTIONS_FILE_SIZE]; // Too large for a stack.
    const size_t length = gw_assumptions_file_write(&self->known, self->bus, text, sizeof text);
    const bool same = length == self->stored_length && memcmp(text, self->stored_text, length) == 0;
    if (same || gw_file_store_write(&self->store, text, length)) {
        memcpy(self->stored_text, text, length);
        self->stored_length = length;
        self->changed = false;
    }
}

void gw_assumptions_poll(gw_assumptions_t *self) {
    if (!self->answered || self->store.waits) {
        receive_store(self);
    }
    if (self->answered && self->changed && !self->store.waits && self->wheels->now_us >= self->write_us) {
        self->write_us = self->wheels->now_us + GW_ASSUMPTIONS_WRITE_US;
        hand_over(self);
    }
}

/// Sets the reason why nothing was confirmed.
static void refuse(iw_assumption_item_t item, inspect_found_t verdict, iwn_refusal_t *out_refusal) {
    const char *name = iwn_assumption_item_name(item);
    if (verdict == INSPECT_FOUND_UNSET) {
        (void)IWN_REFUSE(out_refusal, (item == IW_ASSUMPTION_TRACK) ? IWN_TRACK_NOT_SET : IWN_TYPE_NOT_SET, name,
                         " is not configured, so there is nothing to confirm; set it under [wheels] first");
    } else {
        (void)IWN_REFUSE(out_refusal, IWN_BAD_VALUE, "value of ", name, " must be ", inspect_assumption_values(item),
                         "; leave it out to confirm what is configured");
    }
}

bool gw_assumptions_confirm(gw_assumptions_t *self, iw_assumption_item_t item, const inspect_word_t *word,
                            iwn_refusal_t *out_refusal) {
    gw_stored_item_t *known = &self->known.item[item];
    const inspect_found_t verdict = inspect_assumption_compare(&self->configured, item, word->found);
    const bool is_repeated = verdict == INSPECT_FOUND_SAME && known->entry.state == IW_CONFIRMED &&
                             known->entry.source == IW_SOURCE_OPERATOR && known->word.how[0] != '\0';
    if (verdict != INSPECT_FOUND_SAME && verdict != INSPECT_FOUND_DIFFERENT) {
        refuse(item, verdict, out_refusal);
        return false;
    }
    const iw_assumption_entry_t entry = {(verdict == INSPECT_FOUND_SAME) ? IW_CONFIRMED : IW_CONTRADICTED,
                                         IW_SOURCE_OPERATOR, 0};
    gw_wheels_set_assumption(self->wheels, item, &entry);
    if (!is_repeated || word->how[0] != '\0') { // A repeated confirmation retains the description of the first one.
        known->word = *word;
        known->since_wall_us = iwl_clock_wall_us();
    }
    self->changed = true;
    const iw_snapshot_t seen = gw_wheels_snapshot(self->wheels);
    gw_assumptions_observe(self, &seen);
    return true;
}

void gw_assumptions_describe_contradiction(const gw_assumptions_t *self, iw_assumption_item_t item, char *out_text,
                                           size_t size) {
    char source[INSPECT_SOURCE_SIZE];
    inspect_assumption_source(item, &gw_wheels_snapshot(self->wheels).assumed[item], &self->known.item[item].word,
                              source);
    (void)snprintf(out_text, size, "%s is contradicted: %s; %s", iwn_assumption_item_name(item), source,
                   inspect_assumption_cost(item));
}

void gw_assumptions_close(gw_assumptions_t *self) {
    // A file that has not been read yet has values that this run does not know: it stays as it is.
    if (self->answered && self->changed && self->state != GW_ASSUMPTIONS_LOADING) {
        self->store.waits = false; // The result of an outstanding write no longer matters.
        hand_over(self);
    }
    gw_file_store_close(&self->store);
}
