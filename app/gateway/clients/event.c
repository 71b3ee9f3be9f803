// SPDX-License-Identifier: MIT
#include "event.h"

iwn_out_t gw_event_begin(gw_daemon_t *daemon, const char *name) {
    iwn_out_t json;
    iwn_out_init(&json, daemon->line, sizeof daemon->line);
    iwn_out_open(&json, NULL, '{');
    iwn_out_text(&json, "event", name);
    return json;
}

void gw_event_send(gw_daemon_t *daemon, iwn_out_t *json, iwn_topic_t topic) {
    iwn_out_close(json, '}');
    const size_t length = iwn_out_finish(json);
    for (uint32_t i = 0; i < GW_CLIENTS_MAX && length > 0U; i++) {
        gw_client_t *client = &daemon->client[i];
        if (client->id != IW_CLIENT_NONE && (client->topics & (1U << topic)) != 0U) {
            gw_client_event(client, json->data, length);
        }
    }
}
