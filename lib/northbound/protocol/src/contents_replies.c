// SPDX-License-Identifier: MIT
// Short replies and events, and the beginning of all of them.
#include "iwheel_northbound/contents.h"

static void write_id(const iwn_id_t *id, iwn_out_t *json) {
    if (id->kind == IWN_ID_NUMBER) {
        iwn_out_int(json, "id", id->number);
    } else {
        iwn_out_text(json, "id", (id->kind == IWN_ID_TEXT) ? id->text : NULL);
    }
}

static iwn_out_t begin(char *data, size_t size) {
    iwn_out_t json;
    iwn_out_init(&json, data, size);
    iwn_out_open(&json, NULL, '{');
    return json;
}

iwn_out_t iwn_write_reply(char *data, size_t size, const iwn_id_t *id, bool ok) {
    iwn_out_t json = begin(data, size);
    write_id(id, &json);
    iwn_out_bool(&json, "ok", ok);
    return json;
}

iwn_out_t iwn_write_event(char *data, size_t size, const char *name) {
    iwn_out_t json = begin(data, size);
    iwn_out_text(&json, "event", name);
    return json;
}

size_t iwn_write_refusal(char *data, size_t size, const iwn_id_t *id, const iwn_refusal_t *refusal) {
    iwn_out_t json = iwn_write_reply(data, size, id, false);
    iwn_out_text(&json, "error", iwn_error_name(refusal->error));
    iwn_out_text(&json, "message", refusal->message);
    iwn_out_close(&json, '}');
    return iwn_out_finish(&json);
}

void iwn_write_hello(const iwn_hello_t *hello, iwn_out_t *json) {
    iwn_out_text(json, "name", "iwheel-gateway");
    iwn_out_text(json, "version", hello->version);
    iwn_out_int(json, "api", IWN_API_VERSION);
    iwn_out_text(json, "bus", hello->bus);
    iwn_out_text(json, "state", iwn_state_name(hello->state));
    iwn_out_int(json, "client", hello->client);
    iwn_out_text(json, "rights", hello->watches_only ? "watch" : "drive");
}

const char *iwn_write_change(iw_client_t holder, iw_client_t former) {
    return (holder == IW_CLIENT_NONE) ? "lost" : (former == IW_CLIENT_NONE) ? "gained" : "moved";
}

void iwn_write_lease(const iwn_holder_t *holder, iw_client_t former, iwn_out_t *json) {
    const bool held = holder->client != IW_CLIENT_NONE;
    const bool named = held && holder->name != NULL && holder->name[0] != '\0';
    iwn_out_text(json, "change", iwn_write_change(holder->client, former));
    iwn_out_known(json, "holder", held, holder->client);
    iwn_out_text(json, "name", named ? holder->name : NULL);
    iwn_out_known(json, "former", former != IW_CLIENT_NONE, former);
}

void iwn_write_applied(const iw_applied_t *applied, iwn_out_t *json) {
    iwn_out_int(json, "left_mm_s", applied->pair.wheel[IW_LEFT].speed_mm_s);
    iwn_out_int(json, "right_mm_s", applied->pair.wheel[IW_RIGHT].speed_mm_s);
    iwn_out_int(json, "left_mA", applied->pair.wheel[IW_LEFT].current_mA);
    iwn_out_int(json, "right_mA", applied->pair.wheel[IW_RIGHT].current_mA);
    iwn_out_bool(json, "limited", applied->limited);
}

void iwn_write_terms(const iw_snapshot_t *seen, const iwn_surroundings_t *around, iwn_out_t *json) {
    const iw_stop_budget_t budget = iw_config_stop_budget(seen->config);
    iwn_out_text(json, "state", iwn_state_name(seen->state));
    IWN_OUT_NUMBERS(json, "lease_ms\0first_lease_ms\0stop_budget_ms\0stop_budget_mm\0", seen->config->lease_ms,
                    IW_FIRST_LEASE_US / IW_US_PER_MS, budget.client_lost_ms, budget.client_lost_mm);
    iwn_write_warnings(around, json);
}

void iwn_write_watched(uint8_t topics, uint32_t rate_hz, bool limited, iwn_out_t *json) {
    iwn_out_open(json, "topics", '[');
    for (unsigned topic = 0; topic < IWN_TOPICS; topic++) {
        if ((topics & (1U << topic)) != 0U) {
            iwn_out_text(json, NULL, iwn_topic_name((iwn_topic_t)topic));
        }
    }
    iwn_out_close(json, ']');
    iwn_out_int(json, "rate_hz", rate_hz);
    iwn_out_bool(json, "limited", limited);
}

void iwn_write_tare(const iw_force_t *force, const iw_force_quality_t *window, const iw_force_t *before,
                    iwn_out_t *json) {
    iwn_out_int(json, "offset_mN", force->offset_mN);
    iwn_out_int(json, "samples", window->samples);
    iwn_out_int(json, "deviation_mN", window->deviation_mN);
    iwn_out_int(json, "drift_mN", window->drift_mN);
    iwn_out_known32(json, "before_mN", before->provenance != IW_OFFSET_NONE, before->offset_mN);
    iwn_out_text(json, "before_provenance", iwn_offset_word(before->provenance, before->offset_us));
}
