// SPDX-License-Identifier: MIT
// Assumption store for clients: confirmation of an item by the operator, and output of an entry.
#include "host.h"

#include <string.h>

/// A tyre cannot be measured more accurately than this.
#define TOLERANCE_PERCENT 2U

static bool is_near(uint32_t found, uint32_t wanted) {
    const uint32_t off = (found > wanted) ? found - wanted : wanted - found;
    return off * 100U <= wanted * TOLERANCE_PERCENT;
}

/// Returns true if the found value is the one in force. Only the key of the item differs between the two settings.
static bool is_same(iw_assumption_item_t item, const brd_settings_t *found, const brd_settings_t *wanted) {
    iw_config_t one;
    iw_config_t other;
    brd_settings_to(found, &one);
    brd_settings_to(wanted, &other);
    switch (item) {
    case IW_ASSUMPTION_WHEEL_RADIUS:
        return is_near(one.radius_mm, other.radius_mm);
    case IW_ASSUMPTION_TRACK:
        return is_near(one.track_mm, other.track_mm);
    case IW_ASSUMPTION_GEAR_RATIO:
        return (uint32_t)one.gear_turns * other.gear_per == (uint32_t)other.gear_turns * one.gear_per;
    default:
        return memcmp(found, wanted, sizeof *found) == 0;
    }
}

/// Compares the value of the request with the settings. Returns false, and sets `self->server.refusal`, if the item
/// cannot have that value.
static bool compare(brd_host_t *self, bool *out_same) {
    const iwn_request_t *const request = &self->server.request;
    const brd_key_t key = brd_assumptions_key(request->item);
    const bool has_value = request->value[0] != '\0';
    char value[BRD_SETTINGS_TEXT];
    brd_settings_t found = self->settings;
    iwn_text_t why = iwn_text_begin(self->server.refusal.message, sizeof self->server.refusal.message);
    *out_same = true;
    self->server.refusal.error = IWN_BAD_VALUE;
    if (key == BRD_KEY_NONE) {
        *out_same = !has_value || strcmp(request->value, "yes") == 0;
        return *out_same || strcmp(request->value, "no") == 0 ||
               IWN_REFUSE(&self->server.refusal, IWN_BAD_VALUE, "value must be yes or no; leave it out to confirm it");
    }
    if (!brd_settings_value(&self->settings, key, value)) {
        return IWN_REFUSE(&self->server.refusal,
                          (request->item == IW_ASSUMPTION_TRACK) ? IWN_TRACK_NOT_SET : IWN_TYPE_NOT_SET,
                          "it is not configured, so there is nothing to confirm; set it by the request config first");
    }
    if (has_value && !brd_settings_set_key(&found, key, request->value, &why)) {
        return false;
    }
    *out_same = is_same(request->item, &found, &self->settings);
    return true;
}

void brd_host_write_item(brd_host_t *self, iw_assumption_item_t item, iwn_out_t *json) {
    const iw_assumption_entry_t *const entry = &iwn_server_snapshot(&self->server)->assumed[item];
    const brd_key_t key = brd_assumptions_key(item);
    char plain[BRD_SETTINGS_TEXT] = "yes";
    char whose[BRD_SETTINGS_TEXT];
    char value[2U * BRD_SETTINGS_TEXT + 16U];
    iwn_text_t text = iwn_text_begin(value, sizeof value);
    const bool is_set = key == BRD_KEY_NONE || brd_settings_value(&self->settings, key, plain);
    iwn_text_add(&text, plain);
    if (key == BRD_KEY_GEAR_RATIO && brd_settings_value(&self->settings, BRD_KEY_RPM_OF, whose)) {
        IWN_TEXT_JOIN(&text, ", rpm of the ", whose); // As the daemon writes it.
    }
    iwn_out_text(json, "item", iwn_assumption_item_name(item));
    iwn_out_text(json, "state", iwn_assumption_state_name(entry->state));
    iwn_out_text(json, "evidence", iwn_source_name(entry->source));
    iwn_out_known(json, "figure", entry->source == IW_SOURCE_BUS, entry->figure);
    iwn_out_text(json, "value", is_set ? value : NULL);
    iwn_out_null(json, "found");
    iwn_out_null(json, "how");
    iwn_out_null(json, "since_wall_us");
    iwn_out_null(json, "reason");
    iwn_out_null(json, "disabled");
}

void brd_host_confirm(brd_host_t *self, iwn_client_t *client) {
    bool same;
    if (!compare(self, &same)) {
        iwn_server_refuse(&self->server, client, &self->server.request.id);
        return;
    }
    const iw_assumption_entry_t entry = {same ? IW_CONFIRMED : IW_CONTRADICTED, IW_SOURCE_OPERATOR, 0};
    iw_gateway_set_assumption(self->server.core, self->server.request.item, &entry);
    iwn_out_t json = iwn_server_begin_reply(&self->server, &self->server.request.id);
    brd_host_write_item(self, self->server.request.item, &json);
    iwn_server_send_reply(&self->server, client, &json);
}
