// SPDX-License-Identifier: MIT
#include "assumptions.h"

#include "wheels/wheels.h"

#include "iwheel_northbound/words.h"

#include <string.h>

/// All inputs of the written text. The writer receives nothing else, so that `is_as_written` compares all of them.
typedef struct {
    const inspect_configured_t *configured;
    const iw_assumption_entry_t *assumed; ///< Indexed by item.
    const gw_stored_item_t *known;        ///< Indexed by item.
} source_t;

static void write_item(const source_t *source, iw_assumption_item_t item, iwn_out_t *json) {
    const iw_assumption_entry_t *entry = &source->assumed[item];
    const gw_stored_item_t *known = &source->known[item];
    const bool noted = entry->state != IW_ASSUMED && known->entry.state == entry->state;
    char value[IWN_VALUE_SIZE];
    char reason[INSPECT_SOURCE_SIZE];
    inspect_assumption_value(source->configured, item, value);
    inspect_assumption_source(item, entry, &known->word, reason);
    iwn_out_text(json, "state", iwn_assumption_state_name(entry->state));
    iwn_out_text(json, "evidence", iwn_source_name(entry->source));
    iwn_out_known(json, "figure", entry->source == IW_SOURCE_BUS, entry->figure);
    iwn_out_text(json, "value", (value[0] != '\0') ? value : NULL);
    iwn_out_text(json, "found", (noted && known->word.found[0] != '\0') ? known->word.found : NULL);
    iwn_out_text(json, "how", (noted && known->word.how[0] != '\0') ? known->word.how : NULL);
    iwn_out_known(json, "since_wall_us", noted, known->since_wall_us);
    iwn_out_text(json, "reason", reason);
    iwn_out_text(json, "disabled", (entry->state == IW_CONTRADICTED) ? inspect_assumption_cost(item) : NULL);
}

void gw_assumptions_write_item(const gw_assumptions_t *self, iw_assumption_item_t item, iwn_out_t *json) {
    const source_t source = {&self->configured, gw_wheels_snapshot(self->wheels).assumed, self->known.item};
    write_item(&source, item, json);
}

/// Compares bytes including padding: an irrelevant difference costs one more write, and no relevant difference is
/// missed.
static bool is_alike(const void *one, const void *other, size_t size) {
    return memcmp(one, other, size) == 0;
}

static bool is_as_written(const gw_assumptions_written_t *written, const source_t *source) {
    return written->length > 0U && written->track_mm == source->configured->track_mm &&
           is_alike(&written->config, source->configured->core, sizeof written->config) &&
           is_alike(written->assumed, source->assumed, sizeof written->assumed) &&
           is_alike(written->known, source->known, sizeof written->known);
}

/// Stores the bytes of the object at the end of the line, if they fit.
static void store(gw_assumptions_written_t *written, const source_t *source, const iwn_out_t *json, size_t begin) {
    const size_t length = json->overflow ? 0U : json->length - begin;
    written->length = 0;
    if (length > 0U && length <= sizeof written->text) {
        memcpy(&written->config, source->configured->core, sizeof written->config);
        written->track_mm = source->configured->track_mm;
        memcpy(written->assumed, source->assumed, sizeof written->assumed);
        memcpy(written->known, source->known, sizeof written->known);
        memcpy(written->text, &json->data[begin], length);
        written->length = length;
    }
}

static void write_assumptions(gw_assumptions_written_t *written, const source_t *source, iwn_out_t *json) {
    if (is_as_written(written, source)) {
        iwn_out_span(json, iwn_span("ledger"), (iwn_span_t){written->text, written->length});
        return;
    }
    iwn_out_open(json, "ledger", '{');
    const size_t begin = json->length - 1U;
    for (unsigned item = 0; item < IW_ASSUMPTION_ITEMS; item++) {
        iwn_out_open(json, iwn_assumption_item_name((iw_assumption_item_t)item), '{');
        write_item(source, (iw_assumption_item_t)item, json);
        iwn_out_close(json, '}');
    }
    iwn_out_close(json, '}');
    store(written, source, json, begin);
}

static void write_store(const gw_assumptions_t *self, iwn_out_t *json) {
    static const char *const names[] = {
        [GW_ASSUMPTIONS_LOADING] = "loading", [GW_ASSUMPTIONS_NEW] = "new",       [GW_ASSUMPTIONS_STORED] = "kept",
        [GW_ASSUMPTIONS_IGNORED] = "ignored", [GW_ASSUMPTIONS_FAILED] = "failed",
    };
    iwn_out_open(json, "memory", '{');
    iwn_out_text(json, "file", self->path);
    iwn_out_text(json, "state", names[self->state]);
    iwn_out_text(json, "reason",
                 (self->state == GW_ASSUMPTIONS_IGNORED)  ? self->reason
                 : (self->state == GW_ASSUMPTIONS_FAILED) ? sock_folder_fault(self->error)
                                                          : NULL);
    iwn_out_close(json, '}');
}

void gw_assumptions_write(gw_assumptions_t *self, const iw_snapshot_t *seen, iwn_out_t *json) {
    const source_t source = {&self->configured, seen->assumed, self->known.item};
    write_assumptions(&self->written, &source, json);
    write_store(self, json);
}
