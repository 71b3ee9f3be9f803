// SPDX-License-Identifier: MIT
#include "dispatch.h"

#include "box/box.h"
#include "sockets/clients.h"

#include <stdio.h>
#include <string.h>

static void refuse(gw_clients_t *clients, gw_client_t *client, const iwn_id_t *id, iwn_error_t error,
                   const char *words) {
    iwn_refusal_t refusal = {.error = error};
    (void)snprintf(refusal.message, sizeof refusal.message, "%s", words);
    gw_clients_refuse(clients, client, id, &refusal);
}

void gw_recordings_ask(const gw_call_t *call) {
    gw_client_t *client = call->client;
    gw_box_t *box = call->answers->box;
    const iwn_request_t *request = call->request;
    const char *why = NULL;
    gw_box_question_t question = {
        .client = client->id, .list = request->cmd == IWN_CMD_RECORDINGS, .offset = request->offset};
    memcpy(question.name, request->file, sizeof question.name);
    if (client->reading) {
        why = "the recording asked for before is still being read; wait for that reply, then ask again";
    } else if (box->wish.blackbox_s == 0U) {
        why = "nothing is recorded: [record] blackbox_s is 0; set it, then restart the gateway";
    } else if (!gw_box_ask(box, &question)) {
        why = "the process that reads recordings is gone or too far behind; ask again after 10 s";
    }
    if (why != NULL) {
        refuse(call->answers->clients, client, &request->id, IWN_DENIED, why);
    } else {
        client->reading = true;
        client->read_id = request->id;
    }
}

/// Its question is answered. A client that has ended is looked at again: it was kept for this only.
static void settle(gw_client_t *client) {
    client->reading = false;
    if (client->ended) {
        client->readable = true;
    }
}

static void pass_on(gw_clients_t *clients, const gw_box_answer_t *answer) {
    gw_client_t *client = gw_clients_find(clients, answer->client);
    if (client == NULL || !client->reading) {
        return; // It did not wait for it.
    }
    settle(client);
    if (answer->error != IWN_OK) {
        refuse(clients, client, &client->read_id, answer->error, answer->text);
        return;
    }
    iwn_out_t json = gw_clients_begin_reply(clients, &client->read_id);
    iwn_out_span(&json, iwn_span(NULL), (iwn_span_t){answer->text, answer->length});
    gw_clients_send_reply(client, &json);
}

static void give_up(gw_clients_t *clients) {
    for (uint32_t i = gw_clients_from(clients, 0U); i < GW_CLIENTS_MAX; i = gw_clients_from(clients, i + 1U)) {
        gw_client_t *client = &clients->client[i];
        if (client->reading) {
            settle(client);
            refuse(clients, client, &client->read_id, IWN_DENIED,
                   "the process that reads recordings has ended; ask again after 10 s");
        }
    }
}

bool gw_recordings_take(gw_box_t *box, gw_clients_t *clients) {
    const gw_child_news_t news = gw_box_hear(box);
    if (news == GW_CHILD_SAID) {
        pass_on(clients, &box->answer);
    } else if (news == GW_CHILD_ENDED) {
        give_up(clients);
    }
    return news != GW_CHILD_ENDED;
}
