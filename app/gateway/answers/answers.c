// SPDX-License-Identifier: MIT
// Requests: rights of clients, order of execution, and records.
#include "answers.h"

#include "assumptions/assumptions.h"
#include "wheels/wheels.h"

#include "iwheel_server/target.h"

#include <stdio.h>
#include <string.h>

void gw_answers_begin(gw_answers_t *self) {
    self->server.core = &self->wheels->core;
    self->server.version = IWHEEL_VERSION;
    self->server.rate_max_hz = IWN_RATE_MAX_HZ;
    self->server.topics = (1U << IWN_TOPICS) - 1U;
    iwn_server_begin(&self->server);
}

/// Writes the facts that do not change while the gateway runs.
static iwn_estop_t describe_estop(const gw_wheels_t *wheels) {
    const iwl_hal_t *hal = &wheels->hal;
    return (iwn_estop_t){
        .line = wheels->estop, .present = hal->estop_ops->present, .simulated = hal->estop_ops->simulated};
}

void gw_answers_refresh(gw_answers_t *self) {
    const iwl_hal_t *hal = &self->wheels->hal;
    iwn_estop_t *estop = &self->server.estop;
    self->server.now_us = self->wheels->now_us;
    if (estop->line == NULL) {
        *estop = describe_estop(self->wheels);
    }
    if (hal->two_contacts) {
        estop->line2 = self->wheels->estop2;
        estop->pressed_at = inspect_pressed_at(hal);
    }
    estop->answer = hal->estop_last;
}

iwn_client_t *iwn_target_next(iwn_server_t *server, const iwn_client_t *after) {
    gw_answers_t *self = gw_answers_of(server);
    const uint32_t from = (after == NULL) ? 0U : (uint32_t)((const gw_served_t *)after - self->served) + 1U;
    const uint32_t slot = sock_clients_from(self->clients, from);
    return (slot < SOCK_CLIENTS_MAX) ? &self->served[slot].client : NULL;
}

char *iwn_target_line(iwn_server_t *server, size_t *out_size) {
    sock_clients_t *clients = gw_answers_of(server)->clients;
    *out_size = sizeof clients->line;
    return clients->line;
}

void iwn_target_reply(iwn_server_t *server, iwn_client_t *client, char *line, size_t length) {
    sock_client_reply(gw_answers_connection(gw_answers_of(server), client), line, length);
}

void iwn_target_event(iwn_server_t *server, iwn_client_t *client, char *line, size_t length) {
    if (length > 0U) {
        sock_client_event(gw_answers_connection(gw_answers_of(server), client), line, length);
    }
}

/// A request that permits motion and waited behind an earlier one of its client must not undo a stop that arrived in
/// the meantime. No arm precedes the stored assumptions, because a contradiction is read at arm only. Each arm has a new
/// key.
bool iwn_target_permits(iwn_server_t *server, iwn_client_t *client) {
    gw_answers_t *self = gw_answers_of(server);
    const bool arms = server->request.cmd == IWN_CMD_ARM;
    if (arms && self->wheels->shutting_down) {
        return IWN_REFUSE(&server->refusal, IWN_DENIED, "the gateway is shutting down; wait until it is started again");
    }
    if (arms && !self->assumptions->answered) {
        return IWN_REFUSE(&server->refusal, IWN_DENIED,
                          "the gateway still reads the stored assumptions about the wheels, and one of them may forbid "
                          "motion; try again in a second");
    }
    if (sock_client_waited_through_stop(gw_answers_connection(self, client))) {
        return IWN_REFUSE(
            &server->refusal, IWN_STALE_COMMAND,
            "this request was sent before another client stopped the wheels; see why (iwheelctl why), then send "
            "it again");
    }
    return !arms || gw_grant_draw_key(self->key) ||
           IWN_REFUSE(&server->refusal, IWN_INTERNAL,
                      "the kernel has no random numbers for a key yet; wait a second, then arm again");
}

bool iwn_target_is_key(iwn_server_t *server, const iwn_client_t *client, const char *key) {
    return gw_grant_is_same_key(key, ((const gw_served_t *)client)->key) ||
           IWN_REFUSE(&server->refusal, IWN_NOT_HOLDER,
                      "the key is not that of the reply to the last arm; arm, and drive with the key of its reply");
}

bool iwn_target_is_fresh(iwn_server_t *server, iwn_client_t *client, iw_time_us_t *out_sent_us) {
    const gw_answers_t *self = gw_answers_of(server);
    const iw_time_us_t armed_us = gw_wheels_snapshot(self->wheels).armed_us;
    *out_sent_us = sock_client_sent_us(gw_answers_connection(self, client), server->now_us,
                                       armed_us); // The request may have waited.
    return true;
}

void iwn_target_asked_to_stop(iwn_server_t *server, const iwn_client_t *client) {
    gw_answers_t *self = gw_answers_of(server);
    const sock_client_t *connection = gw_answers_connection(self, client);
    const gw_stopper_t by = {.pid = connection->pid, .uid = connection->uid};
    sock_clients_note_stop(self->clients, connection);
    if (server->request.cmd == IWN_CMD_ESTOP) {
        self->estopped_by = by;
    } else {
        self->stopped_by = by;
    }
}

void iwn_target_judged(iwn_server_t *server, const iwn_client_t *client, iw_refusal_t refusal) {
    gw_wheels_t *wheels = gw_answers_of(server)->wheels;
    blackbox_entry_t entry = {.kind = BLACKBOX_STOP, .b = (uint8_t)refusal};
    switch (server->request.cmd) {
    case IWN_CMD_ARM:
        entry.kind = BLACKBOX_ARM;
        entry.a = server->request.takeover;
        break;
    case IWN_CMD_ESTOP:
        entry.kind = BLACKBOX_ESTOPPED;
        break;
    case IWN_CMD_RESET:
        entry.kind = BLACKBOX_RESET;
        break;
    case IWN_CMD_RELEASE:
        entry.kind = BLACKBOX_RELEASE;
        break;
    default:
        entry.a = (uint8_t)IW_CAUSE_CLIENT_STOP;
        break;
    }
    gw_wheels_note(wheels, client->id, &entry);
    wheels->requested = wheels->requested || refusal == IW_REFUSE_NONE;
}

void iwn_target_driven(iwn_server_t *server, const iwn_client_t *client, const iw_drive_t *wanted, iw_time_us_t sent_us,
                       iw_refusal_t refusal) {
    gw_wheels_t *wheels = gw_answers_of(server)->wheels;
    const blackbox_entry_t entry = {.at_us = server->now_us, .number = client->id, .b = (uint8_t)refusal};
    gw_tape_drive(&wheels->tape, &entry, wanted, sent_us);
    wheels->requested = wheels->requested || refusal == IW_REFUSE_NONE;
}

void iwn_target_granted(iwn_server_t *server, iwn_client_t *client) {
    gw_answers_t *self = gw_answers_of(server);
    gw_served_t *served = (gw_served_t *)client;
    memcpy(served->key, self->key, sizeof served->key);
    served->arm_id = server->request.id;
    gw_answers_connection(self, client)->held = true;
}

const iwn_id_t *iwn_target_settled(iwn_server_t *server, iwn_client_t *client) {
    sock_client_t *connection = gw_answers_connection(gw_answers_of(server), client);
    connection->held = false;
    sock_client_check_caught_up(connection, server->now_us);
    return &((const gw_served_t *)client)->arm_id;
}

void iwn_target_write_terms(iwn_server_t *server, const iwn_client_t *client, iwn_out_t *json) {
    (void)server;
    iwn_out_text(json, "key", ((const gw_served_t *)client)->key);
}

void iwn_target_tared(iwn_server_t *server, const iwn_client_t *client, iw_side_t side,
                      const iw_force_quality_t *window) {
    gw_answers_t *self = gw_answers_of(server);
    const blackbox_entry_t entry = {.kind = BLACKBOX_TARE, .a = (uint8_t)side, .b = (uint8_t)IW_TARE_OK};
    self->assumptions->tare[side] = *window;
    gw_wheels_note(self->wheels, client->id, &entry);
}

/// Confirms or contradicts an assumption by the operator. It moves nothing. What a contradiction disables is disabled
/// immediately, except motion: a contradiction that denies arm takes effect at the next arm. It does not end a drive,
/// because no cause of a stop names it.
static void do_confirm(gw_answers_t *self, iwn_client_t *client) {
    const iwn_request_t *request = &self->server.request;
    inspect_word_t word;
    memcpy(word.found, request->value, sizeof word.found);
    memcpy(word.how, request->how, sizeof word.how);
    if (!gw_assumptions_confirm(self->assumptions, request->item, &word, &self->server.refusal)) {
        iwn_server_refuse(&self->server, client, &request->id);
        return;
    }
    iwn_out_t json = iwn_server_begin_reply(&self->server, &request->id);
    iwn_out_text(&json, "item", iwn_assumption_item_name(request->item));
    gw_assumptions_write_item(self->assumptions, request->item, &json);
    iwn_server_send_reply(&self->server, client, &json);
}

void iwn_target_other(iwn_server_t *server, iwn_client_t *client) {
    gw_answers_t *self = gw_answers_of(server);
    switch (server->request.cmd) {
    case IWN_CMD_CONFIRM:
        do_confirm(self, client);
        break;
    case IWN_CMD_RECORDINGS:
    case IWN_CMD_RECORDING:
        gw_recordings_ask(self, client);
        break;
    case IWN_CMD_RECORD:
        gw_recordings_record(self, client);
        break;
    default: // A client that may drive must not change a file that an administrator writes.
        (void)IWN_REFUSE(&server->refusal, IWN_DENIED,
                         "this gateway's configuration is a file: change it, check it with "
                         "iwheel-gateway --check -c FILE, and start the gateway again");
        iwn_server_refuse(server, client, &server->request.id);
        break;
    }
}

/// Returns true if the line may be executed; otherwise refuses it. A client that may only stop, and a closing
/// connection, may only send stop requests.
static bool may_be_carried_out(gw_answers_t *self, const sock_client_t *connection, iwn_client_t *client,
                               bool is_right) {
    const bool stops = is_right && iwn_cmd_stops(self->server.request.cmd);
    if (sock_client_is_closing(connection) && !stops) {
        return false;
    }
    if (connection->right == SOCK_STOP && !stops) {
        sock_service_refuse_crowd(self->clients, connection, &self->server.refusal);
    } else if (is_right) {
        return true;
    }
    iwn_server_refuse(&self->server, client, &self->server.request.id);
    return false;
}

static void carry_out(void *context, sock_client_t *connection, const char *line, size_t length) {
    gw_answers_t *self = (gw_answers_t *)context;
    iwn_server_t *server = &self->server;
    iwn_client_t *client = &gw_answers_served(self, connection)->client;
    const bool is_right = iwn_request_read(line, length, &self->work, &server->request, &server->refusal);
    if (may_be_carried_out(self, connection, client, is_right)) {
        gw_wheels_time_request(self->wheels);
        server->now_us = self->wheels->now_us;
        iwn_server_request(server, client);
        gw_answers_check_watchers(self, iwn_server_snapshot(server));
    }
}

static bool stops(void *context, const char *line, size_t length) {
    gw_answers_t *self = (gw_answers_t *)context;
    iwn_server_t *server = &self->server;
    return iwn_request_read(line, length, &self->work, &server->request, &server->refusal) &&
           iwn_cmd_stops(server->request.cmd);
}

/// Reports the effects of the end while the client still has its name.
static void leave(void *context, sock_client_t *connection) {
    gw_answers_t *self = (gw_answers_t *)context;
    gw_served_t *served = gw_answers_served(self, connection);
    gw_wheels_time_request(self->wheels);
    gw_wheels_leave(self->wheels, connection->id);
    connection->held = false;
    served->client.arming = false;
    if (connection->phase != SOCK_OPEN) {
        served->client.topics = 0; // It receives no more events.
    }
    const iw_snapshot_t seen = gw_wheels_snapshot(self->wheels);
    gw_answers_observe(self, &seen);
}

/// A client that may only stop receives no `hello`: its first line is awaited.
static void welcome(void *context, sock_client_t *connection) {
    gw_answers_t *self = (gw_answers_t *)context;
    gw_served_t *served = gw_answers_served(self, connection);
    memset(served, 0, sizeof *served);
    iwn_server_welcome(&served->client, connection->id, connection->right == SOCK_WATCH);
    if (connection->right != SOCK_STOP) {
        self->server.now_us = self->wheels->now_us;
        iwn_server_hello(&self->server, &served->client);
    }
}

sock_handler_t gw_answers_handler(gw_answers_t *self) {
    return (sock_handler_t){
        .welcome = welcome, .carry_out = carry_out, .stops = stops, .leave = leave, .context = self};
}

void gw_answers_arming(gw_answers_t *self, const iw_snapshot_t *seen) {
    iwn_server_arming(&self->server, seen);
}

void gw_answers_periodic(gw_answers_t *self) {
    if (sock_clients_count(self->clients) > 0U) {
        self->server.now_us = self->wheels->now_us;
        iwn_server_periodic(&self->server);
    }
}

iw_time_us_t gw_answers_next_us(gw_answers_t *self) {
    return (sock_clients_count(self->clients) > 0U) ? iwn_server_next_us(&self->server) : IW_NEVER;
}

uint32_t gw_answers_watching_frames(gw_answers_t *self) {
    return (sock_clients_count(self->clients) > 0U) ? iwn_server_watching(&self->server, IWN_TOPIC_FRAME) : 0U;
}
