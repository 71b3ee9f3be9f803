// SPDX-License-Identifier: MIT
#include "knowledge_json.h"

#include "names.h"
#include "process/owners.h"

void gw_knowledge_write_item(const gw_daemon_t *daemon, iw_ledger_item_t item, json_out_t *json) {
    const iw_ledger_entry_t *entry = &gw_daemon_look(daemon).assumed[item];
    const gw_known_item_t *known = &daemon->knowledge.known.item[item];
    const bool noted = entry->state != IW_LEDGER_ASSUMED && known->entry.state == entry->state;
    char value[GW_VALUE_SIZE];
    char reason[GW_EVIDENCE_SIZE];
    gw_assumption_value(&daemon->config, item, value);
    gw_assumption_evidence(item, entry, &known->word, reason);
    json_out_text(json, "state", gw_ledger_state_name(entry->state));
    json_out_text(json, "evidence", gw_evidence_name(entry->evidence));
    json_out_known(json, "figure", entry->evidence == IW_EVIDENCE_BUS, entry->figure);
    json_out_text(json, "value", value[0] != '\0' ? value : NULL);
    json_out_text(json, "found", noted && known->word.found[0] != '\0' ? known->word.found : NULL);
    json_out_text(json, "how", noted && known->word.how[0] != '\0' ? known->word.how : NULL);
    json_out_known(json, "since_wall_us", noted, known->since_wall_us);
    json_out_text(json, "reason", reason);
    json_out_text(json, "disabled", entry->state == IW_LEDGER_CONTRADICTED ? gw_assumption_cost(item) : NULL);
}

static void write_ledger(const gw_daemon_t *daemon, json_out_t *json) {
    json_out_open(json, "ledger", '{');
    for (unsigned item = 0; item < IW_LEDGER_ITEMS; ++item) {
        json_out_open(json, gw_ledger_item_name((iw_ledger_item_t)item), '{');
        gw_knowledge_write_item(daemon, (iw_ledger_item_t)item, json);
        json_out_close(json, '}');
    }
    json_out_close(json, '}');
}

static void write_memory(const gw_knowledge_t *self, json_out_t *json) {
    static const char *const names[] = {
        [GW_MEMORY_LOADING] = "loading", [GW_MEMORY_NEW] = "new",       [GW_MEMORY_KEPT] = "kept",
        [GW_MEMORY_IGNORED] = "ignored", [GW_MEMORY_FAILED] = "failed",
    };
    json_out_open(json, "memory", '{');
    json_out_text(json, "file", self->path);
    json_out_text(json, "state", names[self->state]);
    json_out_text(json, "reason",
                  self->state == GW_MEMORY_IGNORED  ? self->reason
                  : self->state == GW_MEMORY_FAILED ? gw_folder_fault(self->error)
                                                    : NULL);
    json_out_close(json, '}');
}

void gw_knowledge_write(const gw_daemon_t *daemon, json_out_t *json) {
    write_ledger(daemon, json);
    write_memory(&daemon->knowledge, json);
}
