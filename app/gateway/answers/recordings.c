// SPDX-License-Identifier: MIT
#include "answers.h"

#include "box/box.h"

#include <stdio.h>
#include <string.h>

static void refuse(gw_answers_t *self, iwn_client_t *client, const iwn_id_t *id, iwn_error_t error, const char *words) {
    (void)IWN_REFUSE(&self->server.refusal, error, words);
    iwn_server_refuse(&self->server, client, id);
}

void gw_recordings_ask(gw_answers_t *self, iwn_client_t *client) {
    sock_client_t *connection = gw_answers_connection(self, client);
    const iwn_request_t *request = &self->server.request;
    const char *why = NULL;
    gw_box_question_t question = {
        .client = client->id, .list = request->cmd == IWN_CMD_RECORDINGS, .offset = request->offset};
    memcpy(question.name, request->file, sizeof question.name);
    if (connection->owed) {
        why =
            "the recording of the last request is still being read; wait for that reply, then send this request again";
    } else if (self->box->config.blackbox_s == 0U) {
        why = "nothing is recorded: [record] blackbox_s is 0; set it, then restart the gateway";
    } else if (!gw_box_ask(self->box, &question)) {
        why = "the process that reads recordings is gone or too far behind; ask again after 10 s";
    }
    if (why != NULL) {
        refuse(self, client, &request->id, IWN_DENIED, why);
    } else {
        connection->owed = true;
        gw_answers_served(self, connection)->read_id = request->id;
    }
}

void gw_recordings_record(gw_answers_t *self, iwn_client_t *client) {
    const iwn_request_t *request = &self->server.request;
    char who[GW_CLIENT_TEXT_SIZE];
    gw_answers_describe(self, client->id, who);
    const char *why = gw_record_request(self->box, request->on, who, self->server.now_us);
    if (why != NULL) {
        refuse(self, client, &request->id, IWN_DENIED, why);
        return;
    }
    iwn_out_t json = iwn_server_begin_reply(&self->server, &request->id);
    gw_record_write_request(self->box, &json);
    iwn_server_send_reply(&self->server, client, &json);
}

/// Marks the question of a client as answered. A client that has ended is served again, because its slot was retained
/// only for this.
static void settle(sock_client_t *connection) {
    connection->owed = false;
    if (connection->phase == SOCK_ENDED) {
        connection->readable = true;
    }
}

static void pass_on(gw_answers_t *self, const gw_box_answer_t *answer) {
    sock_client_t *connection = sock_clients_find(self->clients, answer->client);
    if (connection == NULL || !connection->owed) {
        return; // The client did not wait for it.
    }
    gw_served_t *served = gw_answers_served(self, connection);
    settle(connection);
    if (answer->error != IWN_OK) {
        refuse(self, &served->client, &served->read_id, answer->error, answer->text);
        return;
    }
    iwn_out_t json = iwn_server_begin_reply(&self->server, &served->read_id);
    iwn_out_span(&json, iwn_span(NULL), (iwn_span_t){answer->text, answer->length});
    if (answer->list) {
        iwn_out_open(&json, "on_request", '{');
        gw_record_write_request(self->box, &json);
        iwn_out_close(&json, '}');
    }
    iwn_server_send_reply(&self->server, &served->client, &json);
}

static void give_up(gw_answers_t *self) {
    sock_clients_t *clients = self->clients;
    for (uint32_t i = sock_clients_from(clients, 0U); i < SOCK_CLIENTS_MAX; i = sock_clients_from(clients, i + 1U)) {
        sock_client_t *connection = &clients->client[i];
        if (connection->owed) {
            settle(connection);
            refuse(self, &self->served[i].client, &self->served[i].read_id, IWN_DENIED,
                   "the process that reads recordings has ended; ask again after 10 s");
        }
    }
}

bool gw_recordings_take(gw_answers_t *self) {
    const gw_child_news_t news = gw_box_receive(self->box);
    if (news == GW_CHILD_MESSAGE) {
        pass_on(self, &self->box->answer);
    } else if (news == GW_CHILD_ENDED) {
        give_up(self);
    }
    return news != GW_CHILD_ENDED;
}
