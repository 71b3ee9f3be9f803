// SPDX-License-Identifier: MIT
#include "knowledge.h"

#include "wheels/wheels.h"

#include "iwheel_northbound/words.h"

#include <string.h>

/// All that the ledger is written from. What writes it sees nothing else, so that nothing can be missing in `is_as_written`.
typedef struct {
    const gw_configured_t *configured;
    const iw_ledger_entry_t *assumed; ///< By item.
    const gw_known_item_t *known;     ///< By item.
} source_t;

static void write_item(const source_t *source, iw_ledger_item_t item, iwn_out_t *json) {
    const iw_ledger_entry_t *entry = &source->assumed[item];
    const gw_known_item_t *known = &source->known[item];
    const bool noted = entry->state != IW_LEDGER_ASSUMED && known->entry.state == entry->state;
    char value[IWN_VALUE_SIZE];
    char reason[GW_EVIDENCE_SIZE];
    gw_assumption_value(source->configured, item, value);
    gw_assumption_evidence(item, entry, &known->word, reason);
    iwn_out_text(json, "state", iwn_ledger_state_name(entry->state));
    iwn_out_text(json, "evidence", iwn_evidence_name(entry->evidence));
    iwn_out_known(json, "figure", entry->evidence == IW_EVIDENCE_BUS, entry->figure);
    iwn_out_text(json, "value", (value[0] != '\0') ? value : NULL);
    iwn_out_text(json, "found", (noted && known->word.found[0] != '\0') ? known->word.found : NULL);
    iwn_out_text(json, "how", (noted && known->word.how[0] != '\0') ? known->word.how : NULL);
    iwn_out_known(json, "since_wall_us", noted, known->since_wall_us);
    iwn_out_text(json, "reason", reason);
    iwn_out_text(json, "disabled", (entry->state == IW_LEDGER_CONTRADICTED) ? gw_assumption_cost(item) : NULL);
}

void gw_knowledge_write_item(const gw_knowledge_t *self, iw_ledger_item_t item, iwn_out_t *json) {
    const source_t source = {&self->configured, gw_wheels_look(self->wheels).assumed, self->known.item};
    write_item(&source, item, json);
}

/// Bytes, padding and all: a difference that means nothing costs one writing anew, and none that means something is missed.
static bool is_alike(const void *one, const void *other, size_t size) {
    return memcmp(one, other, size) == 0;
}

static bool is_as_written(const gw_ledger_written_t *written, const source_t *source) {
    return written->length > 0U && written->track_mm == source->configured->track_mm &&
           is_alike(&written->config, source->configured->core, sizeof written->config) &&
           is_alike(written->assumed, source->assumed, sizeof written->assumed) &&
           is_alike(written->known, source->known, sizeof written->known);
}

/// Keeps the bytes of the object that ends the line so far, if there is room for them.
static void keep(gw_ledger_written_t *written, const source_t *source, const iwn_out_t *json, size_t begin) {
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

static void write_ledger(gw_ledger_written_t *written, const source_t *source, iwn_out_t *json) {
    if (is_as_written(written, source)) {
        iwn_out_span(json, iwn_span("ledger"), (iwn_span_t){written->text, written->length});
        return;
    }
    iwn_out_open(json, "ledger", '{');
    const size_t begin = json->length - 1U;
    for (unsigned item = 0; item < IW_LEDGER_ITEMS; item++) {
        iwn_out_open(json, iwn_ledger_item_name((iw_ledger_item_t)item), '{');
        write_item(source, (iw_ledger_item_t)item, json);
        iwn_out_close(json, '}');
    }
    iwn_out_close(json, '}');
    keep(written, source, json, begin);
}

static void write_memory(const gw_knowledge_t *self, iwn_out_t *json) {
    static const char *const names[] = {
        [GW_MEMORY_LOADING] = "loading", [GW_MEMORY_NEW] = "new",       [GW_MEMORY_KEPT] = "kept",
        [GW_MEMORY_IGNORED] = "ignored", [GW_MEMORY_FAILED] = "failed",
    };
    iwn_out_open(json, "memory", '{');
    iwn_out_text(json, "file", self->path);
    iwn_out_text(json, "state", names[self->state]);
    iwn_out_text(json, "reason",
                 (self->state == GW_MEMORY_IGNORED)  ? self->reason
                 : (self->state == GW_MEMORY_FAILED) ? gw_folder_fault(self->error)
                                                     : NULL);
    iwn_out_close(json, '}');
}

void gw_knowledge_write(gw_knowledge_t *self, const iw_snapshot_t *seen, iwn_out_t *json) {
    const source_t source = {&self->configured, seen->assumed, self->known.item};
    write_ledger(&self->written, &source, json);
    write_memory(self, json);
}
