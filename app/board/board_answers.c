// SPDX-License-Identifier: MIT
// The board's part of the server: quotes of the serial line, names, and the requests of a microcontroller.
#include "host.h"

#include "iwheel_server/target.h"

#include <string.h>

#define NOT_HERE "a microcontroller has no "

iwn_client_t *iwn_target_next(iwn_server_t *server, const iwn_client_t *after) {
    brd_host_t *const self = brd_host_of(server);
    size_t next = (after == NULL) ? 0U : (size_t)((const brd_host_client_t *)after - self->client) + 1U;
    while (next < IWN_LINE_CHANNELS && self->client[next].served.id == IW_CLIENT_NONE) {
        next++;
    }
    return (next < IWN_LINE_CHANNELS) ? &self->client[next].served : NULL;
}

/// Stores the request. The snapshot is sent when the long line is free.
void iwn_target_status(iwn_server_t *server, iwn_client_t *client) {
    brd_host_client_t *const whose = (brd_host_client_t *)client;
    if (whose->owed_status) {
        (void)IWN_REFUSE(&server->refusal, IWN_BUSY, "an earlier status still waits for the serial line; wait for it");
        iwn_server_refuse(server, client, &server->request.id);
        return;
    }
    whose->owed_status = true; // Every client has a place for a status.
    brd_pending_put(&brd_host_of(server)->pending, client->id, IWN_CMD_STATUS, &server->request.id);
}

/// Marks the snapshot as due for each subscriber. It is sent when the long line is free.
void iwn_target_state(iwn_server_t *server, const iw_snapshot_t *seen, bool due_only) {
    (void)seen;
    for (iwn_client_t *client = iwn_target_next(server, NULL); client != NULL;
         client = iwn_target_next(server, client)) {
        brd_host_client_t *const whose = (brd_host_client_t *)client;
        if ((client->topics & (1U << IWN_TOPIC_STATE)) != 0U && (client->due || !due_only)) {
            whose->lost += (due_only && whose->owed_state) ? 1U : 0U;
            whose->owed_state = true;
        }
    }
}

bool iwn_target_permits(iwn_server_t *server, iwn_client_t *client) {
    brd_host_t *const self = brd_host_of(server);
    if (server->request.cmd != IWN_CMD_ARM) {
        return true;
    }
    if (self->restart_us != 0U) {
        return IWN_REFUSE(&server->refusal, IWN_DENIED,
                          "a configuration was committed: arm after the restart (if latched, reset first)");
    }
    if (!brd_host_is_configured(self)) {
        return false;
    }
    return brd_pending_has_room(&self->pending, client->id, IWN_CMD_ARM) ||
           IWN_REFUSE(&server->refusal, IWN_BUSY, "other answers still wait for the serial line; try again");
}

void iwn_target_refuse_right(iwn_server_t *server) {
    (void)IWN_REFUSE(&server->refusal, IWN_DENIED, "this channel is for watching, stop and estop");
}

bool iwn_target_is_key(iwn_server_t *server, const iwn_client_t *client, const char *key) {
    (void)client;
    (void)key;
    return IWN_REFUSE(&server->refusal, IWN_NOT_HOLDER, NOT_HERE, "key; leave key out");
}

/// Returns the defect of a quote, or NULL if there is none. A stamp from before the channel was opened belongs to
/// another client.
static const char *stale(const brd_host_t *self, const brd_host_client_t *client, const iwn_quote_t *quote) {
    char boot[IWN_LINE_BOOT + 1U];
    if (quote == NULL) {
        return "it has no boot, seq and t_us, which iwheel-serial adds";
    }
    if (strcmp(brd_host_boot_text(self->boot, boot), quote->boot) != 0) {
        return "it was meant for an earlier start of the board";
    }
    if (client->has_seq && quote->seq <= client->seq) {
        return "a command with this seq, or a later one, came before it";
    }
    if (quote->t_us > self->server.now_us || quote->t_us < client->opened_us ||
        self->server.now_us - quote->t_us > self->lease_us) {
        return "it is older than lease_ms, or from before its channel was opened: line or host was late";
    }
    return NULL;
}

/// The lease runs from the stamp. If the line is delayed, the wheels still stop lease_ms after a time at which the
/// command did not exist yet. If the gateway is not armed, the core refuses the command with any quote.
bool iwn_target_is_fresh(iwn_server_t *server, iwn_client_t *client, iw_time_us_t *out_sent_us) {
    const brd_host_t *const self = brd_host_of(server);
    brd_host_client_t *const whose = (brd_host_client_t *)client;
    const iwn_quote_t *const quote = self->quote;
    if (iw_gateway_state(server->core) != IW_STATE_ARMED) {
        return true;
    }
    const char *const why = stale(self, whose, quote);
    if (why != NULL) {
        return IWN_REFUSE(&server->refusal, IWN_STALE_COMMAND, "this command is void: ", why);
    }
    whose->has_seq = true;
    whose->seq = quote->seq;
    *out_sent_us = quote->t_us;
    return true;
}

void iwn_target_asked_to_stop(iwn_server_t *server, const iwn_client_t *client) {
    (void)server;
    (void)client;
}

void iwn_target_judged(iwn_server_t *server, const iwn_client_t *client, iw_refusal_t refusal) {
    (void)server;
    (void)client;
    (void)refusal;
}

void iwn_target_driven(iwn_server_t *server, const iwn_client_t *client, const iw_drive_t *wanted, iw_time_us_t sent_us,
                       iw_refusal_t refusal) {
    (void)server;
    (void)client;
    (void)wanted;
    (void)sent_us;
    (void)refusal;
}

void iwn_target_granted(iwn_server_t *server, iwn_client_t *client) {
    brd_pending_put(&brd_host_of(server)->pending, client->id, IWN_CMD_ARM, &server->request.id);
}

const iwn_id_t *iwn_target_settled(iwn_server_t *server, iwn_client_t *client) {
    return brd_pending_take(&brd_host_of(server)->pending, client->id, IWN_CMD_ARM);
}

void iwn_target_tared(iwn_server_t *server, const iwn_client_t *client, iw_side_t side,
                      const iw_force_quality_t *window) {
    (void)client;
    brd_host_of(server)->zero[side] = brd_assumptions_zero(server->seen.wheel[side].force, window);
}

void iwn_target_other(iwn_server_t *server, iwn_client_t *client) {
    switch (server->request.cmd) {
    case IWN_CMD_CONFIRM:
        brd_host_confirm(brd_host_of(server), client);
        break;
    case IWN_CMD_CONFIG:
        brd_host_config(brd_host_of(server), client);
        break;
    default:
        (void)IWN_REFUSE(&server->refusal, IWN_DENIED, NOT_HERE, "recordings");
        iwn_server_refuse(server, client, &server->request.id);
        break;
    }
}

void iwn_target_changed(iwn_server_t *server, const iw_snapshot_t *seen, iwn_change_t change, const char *word,
                        bool present) {
    (void)server;
    (void)seen;
    (void)change;
    (void)word;
    (void)present;
}

int64_t iwn_target_wall_us(void) {
    return IWN_WALL_UNKNOWN;
}

/// Writes the name into `self->scratch.texts[text]`, so that several names fit into a sentence.
static const char *name(brd_host_t *self, iw_client_t id, unsigned text) {
    const iwn_client_t *const client = iwn_server_find(&self->server, id);
    iwn_text_t out = iwn_text_begin(self->scratch.texts[text], sizeof self->scratch.texts[text]);
    const bool named = client != NULL && client->name[0] != '\0';
    IWN_TEXT_JOIN(&out, named ? "\"" : "", named ? client->name : "", named ? "\" (" : "", "client ");
    iwn_text_int(&out, id);
    iwn_text_add(&out, named ? ")" : (client == NULL) ? " (gone)" : "");
    return out.data;
}

const char *iwn_target_name(iwn_server_t *server, iw_client_t id) {
    return name(brd_host_of(server), id, 0);
}

iwn_surroundings_t iwn_target_around(iwn_server_t *server, const iw_snapshot_t *seen) {
    const brd_host_t *const self = brd_host_of(server);
    iwn_surroundings_t around = {
        .wall_us = IWN_WALL_UNKNOWN,
        .version = server->version,
        .bus = {.name = server->bus,
                .timing = "confirmed", // Asserted at compile time.
                .bitrate_hz = self->bitrate_hz,
                .sample_point_permille = self->sample_point_permille},
        .estop = server->estop,
    };
    for (unsigned side = 0; side < IW_SIDES; side++) {
        const brd_assumptions_zero_t *const zero = &self->zero[side];
        const bool measured = zero->from == IW_OFFSET_ESTIMATED || zero->from == IW_OFFSET_OPERATOR;
        around.zero[side] = (iwn_zero_note_t){.from = (iw_offset_provenance_t)zero->from,
                                              .samples = measured ? IW_FORCE_WINDOW_SAMPLES : 0U,
                                              .deviation_mN = zero->deviation_mN,
                                              .drift_mN = zero->drift_mN};
    }
    for (iwn_client_t *client = iwn_target_next(server, NULL); client != NULL;
         client = iwn_target_next(server, client)) {
        around.clients++;
        if (client->id == seen->holder) {
            around.holder = (iwn_holder_t){.client = client->id, .name = client->name};
        }
    }
    return around;
}

void iwn_target_describe(iwn_server_t *server, iw_refusal_t refusal, iwn_refuse_context_t *context) {
    brd_host_t *const self = brd_host_of(server);
    (void)refusal;
    context->holder = name(self, context->seen->holder, 0);
    context->stale_client = name(self, context->seen->stale_client, 1);
    context->stopped_by = (server->stopped_us > 0U) ? name(self, server->stopped_by, 2) : NULL;
    context->estopped_by = (server->estopped_us > 0U) ? name(self, server->estopped_by, 3) : NULL;
    context->bus_fix = "check cable, termination, transceiver and that the wheels have power";
    context->timing = "the bit timing of the bus is wrong; report this";
    context->contradiction = "an assumption that motion depends on is contradicted; see: iwheelctl ledger";
    context->configure = "by the request config (of section wheels) and commit";
    context->listen_only = "the image never sends; build it without listen only";
}

/// Only the track can be contradicted here: the server asks for no other item.
void iwn_target_contradiction(iwn_server_t *server, iw_assumption_item_t item, char *out_text, size_t size) {
    iwn_text_t text = iwn_text_begin(out_text, size);
    (void)server;
    (void)item;
    iwn_text_add(&text, "wheels.track_mm is contradicted, so a turn cannot be converted to wheel speeds; "
                        "correct it by the request config, or drive without yaw_mrad_s");
}

void iwn_target_write_terms(iwn_server_t *server, const iwn_client_t *client, iwn_out_t *json) {
    (void)server;
    (void)client;
    (void)json;
}

/// The board has no disk for recordings and no memory for frames.
void iwn_target_write_why(iwn_server_t *server, iwn_out_t *json) {
    (void)server;
    iwn_out_null(json, "directory");
    iwn_out_null(json, "recording");
    iwn_out_null(json, "recording_error");
    iwn_out_open(json, "frames_before", '[');
    iwn_out_close(json, ']');
    iwn_out_open(json, "frames_after", '[');
    iwn_out_close(json, ']');
}
