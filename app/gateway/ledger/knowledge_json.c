// SPDX-License-Identifier: MIT
#include "knowledge_json.h"

#include "process/owners.h"

#include "iwheel_northbound/words.h"

void gw_knowledge_write_item(const gw_daemon_t *daemon, iw_ledger_item_t item, iwn_out_t *json) {
    const iw_ledger_entry_t *entry = &gw_daemon_look(daemon).assumed[item];
    const gw_known_item_t *known = &daemon->knowledge.known.item[item];
    const bool noted = entry->state != IW_LEDGER_ASSUMED && known->entry.state == entry->state;
    char value[IWN_VALUE_SIZE];
    char reason[GW_EVIDENCE_SIZE];
    gw_assumption_value(&daemon->config, item, value);
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

static void write_ledger(const gw_daemon_t *daemon, iwn_out_t *json) {
    iwn_out_open(json, "ledger", '{');
    for (unsigned item = 0; item < IW_LEDGER_ITEMS; item++) {
        iwn_out_open(json, iwn_ledger_item_name((iw_ledger_item_t)item), '{');
        gw_knowledge_write_item(daemon, (iw_ledger_item_t)item, json);
        iwn_out_close(json, '}');
    }
    iwn_out_close(json, '}');
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

void gw_knowledge_write(const gw_daemon_t *daemon, iwn_out_t *json) {
    write_ledger(daemon, json);
    write_memory(&daemon->knowledge, json);
}
