// SPDX-License-Identifier: MIT
// Request config: it stages keys, and commit writes them to the flash.
#include "host.h"

static bool stage(brd_host_t *self, iwn_text_t *why) {
    const iwn_request_t *const request = &self->server.request;
    if (request->value[0] == '\0') {
        iwn_text_add(why, "key needs a value; without both all keys are read");
        return false;
    }
    if (!brd_settings_set(&self->staged, request->key, request->value, why)) {
        return false;
    }
    self->has_staged = true;
    return true;
}

/// Returns true if the request was executed, or there was nothing to do. Otherwise writes the cause to `*out_error`.
static bool configure(brd_host_t *self, iwn_text_t *why, iwn_error_t *out_error) {
    const iwn_request_t *const request = &self->server.request;
    *out_error = IWN_BAD_VALUE;
    if (request->key[0] != '\0' || request->value[0] != '\0') {
        return stage(self, why);
    }
    if (!request->has_commit) {
        return true;
    }
    if (!request->commit) {
        self->has_staged = false;
        self->staged = self->settings;
        return true;
    }
    if (!brd_settings_check(&self->staged, why)) {
        return false;
    }
    *out_error = IWN_DENIED;
    if (!brd_host_is_silent(self)) {
        iwn_text_add(why, "the flash is written only while listening: stop or reset, and wait");
        return false;
    }
    *out_error = IWN_INTERNAL;
    if (!brd_host_store(&self->staged)) {
        iwn_text_add(why, "the flash did not accept it; the old configuration stays; switch the board off and on");
        return false;
    }
    self->has_staged = false;
    self->restart_us = self->server.now_us + BRD_HOST_RESTART_US;
    return true;
}

void brd_host_config(brd_host_t *self, iwn_client_t *client) {
    iwn_text_t why = iwn_text_begin(self->server.refusal.message, sizeof self->server.refusal.message);
    if (!configure(self, &why, &self->server.refusal.error)) {
        iwn_server_refuse(&self->server, client, &self->server.request.id);
        return;
    }
    iwn_out_t json = iwn_server_begin_reply(&self->server, &self->server.request.id);
    brd_settings_write(&self->staged, &json);
    iwn_out_bool(&json, "staged", self->has_staged);
    iwn_out_bool(&json, "restarts", self->restart_us != 0U);
    iwn_server_send_reply(&self->server, client, &json);
}
