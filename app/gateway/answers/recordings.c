// SPDX-License-Identifier: MIT
#include "recordings.h"

#include "dispatch.h"

#include <stdio.h>
#include <string.h>

static void refuse(gw_daemon_t *daemon, gw_client_t *client, const iwn_id_t *id, iwn_error_t error, const char *words) {
    iwn_refusal_t refusal = {.error = error};
    (void)snprintf(refusal.message, sizeof refusal.message, "%s", words);
    gw_client_reply(client, daemon->line, gw_dispatch_write_refusal(daemon, id, &refusal));
}

void gw_recordings_ask(gw_daemon_t *daemon, gw_client_t *client, const iwn_request_t *request) {
    gw_box_question_t question = {
        .client = client->id, .list = request->cmd == IWN_CMD_RECORDINGS, .offset = request->offset};
    memcpy(question.name, request->file, sizeof question.name);
    if (client->reading) {
        refuse(daemon, client, &request->id, IWN_DENIED,
               "the recording asked for before is still being read; wait for that reply, then ask again");
    } else if (daemon->config.record.blackbox_s == 0U) {
        refuse(daemon, client, &request->id, IWN_DENIED,
               "nothing is recorded: [record] blackbox_s is 0; set it, then restart the gateway");
    } else if (!gw_box_ask(&daemon->box, &question)) {
        refuse(daemon, client, &request->id, IWN_DENIED,
               "the process that reads recordings is gone or too far behind; ask again after 10 s");
    } else {
        client->reading = true;
        client->read_id = request->id;
    }
}

/// Its question is answered. A client that has ended is looked at again: it was kept for this only.
static void settle(gw_client_t *client) {
    client->reading = false;
    client->readable = client->readable || client->ended;
}

static void pass_on(gw_daemon_t *daemon, const gw_box_answer_t *answer) {
    gw_client_t *client = gw_daemon_client(daemon, answer->client);
    if (client == NULL || !client->reading) {
        return; // It did not wait for it.
    }
    settle(client);
    if (answer->error != IWN_OK) {
        refuse(daemon, client, &client->read_id, answer->error, answer->text);
        return;
    }
    iwn_out_t json = gw_dispatch_begin_reply(daemon, &client->read_id);
    iwn_out_span(&json, iwn_span(NULL), (iwn_span_t){answer->text, answer->length});
    iwn_out_close(&json, '}');
    gw_client_reply(client, json.data, iwn_out_finish(&json));
}

static void give_up(gw_daemon_t *daemon) {
    gw_log(&daemon->log, GW_LOG_WARNING,
           "the process that reads recordings has ended (was it killed?); it is started again with the next request");
    for (uint32_t i = 0; i < GW_CLIENTS_MAX; i++) {
        gw_client_t *client = &daemon->client[i];
        if (client->id != IW_CLIENT_NONE && client->reading) {
            settle(client);
            refuse(daemon, client, &client->read_id, IWN_DENIED,
                   "the process that reads recordings has ended; ask again after 10 s");
        }
    }
}

void gw_recordings_take(gw_daemon_t *daemon) {
    switch (gw_box_hear(&daemon->box)) {
    case GW_CHILD_SAID:
        pass_on(daemon, &daemon->box.answer);
        break;
    case GW_CHILD_ENDED:
        give_up(daemon);
        break;
    case GW_CHILD_SILENT:
        break;
    }
}
