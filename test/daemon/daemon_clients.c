// SPDX-License-Identifier: MIT
#include "daemon_clients.h"

#include "daemon_judge.h"
#include "kernel.h"

#include "iwheel_northbound/json_in.h"
#include "iwheel_northbound/request.h"

#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#define MS       1000U
#define CLIENTS  VK_STREAMS
#define MARKS    64U
#define PATIENCE (400U * MS)
#define AGAIN    (700U * MS) ///< Pause after a refusal; longer than the age of a stale command.

typedef enum { STEP_RESET, STEP_ARM, STEP_ARMING, STEP_DRIVE, STEP_END } step_t;

/// The end of a request in the sent bytes.
typedef struct {
    uint64_t end;
    said_t what;
    int32_t left;
    int32_t right;
} mark_t;

typedef struct {
    bool lives;
    bool reads;
    event_t task;
    int stream; ///< -1: not connected.
    step_t step;
    iw_time_us_t until_us;
    iw_time_us_t next_us;
    iw_time_us_t asked_us;
    iw_time_us_t driving_us;
    uint32_t period_us;
    uint32_t id;
    uint64_t sent; ///< Bytes sent on this connection.
    mark_t mark[MARKS];
    unsigned marks;
    int answer; ///< Reply to `id`: 1 ok, 0 refused, -1 none yet.
} client_t;

static client_t clients[CLIENTS];
static sim_random_t dice;

void clients_begin(uint64_t seed) {
    memset(clients, 0, sizeof clients);
    sim_random_init(&dice, seed ^ UINT64_C(0xC11E));
}

/// Reports requests that wait: from now on the client does not know what the process reads, and an unread arm may still be carried out.
static void print_waiting(const client_t *client) {
    for (unsigned i = 0; i < client->marks; i++) {
        if (client->mark[i].what == SAID_ARM) {
            judge_said((unsigned)client->stream, SAID_ARM);
        }
    }
}

static void hang_up(client_t *client, bool half) {
    if (client->stream >= 0) {
        print_waiting(client);
        vk_stream_t *stream = &vk.stream[client->stream];
        stream->shut = true;
        stream->client_end = stream->client_end || !half;
        judge_gone((unsigned)client->stream);
        if (!half) {
            stream->used = stream->used && !stream->closed;
            client->stream = -1;
        }
    }
    client->driving_us = IW_NEVER;
}

/// Frees connections that are closed on both sides.
static void collect(void) {
    for (unsigned i = 0; i < VK_STREAMS; i++) {
        vk_stream_t *stream = &vk.stream[i];
        stream->used = stream->used && !(stream->closed && stream->client_end);
    }
}

void clients_start(const event_t *event) {
    for (unsigned i = 0; i < CLIENTS; i++) {
        client_t *client = &clients[i];
        if (!client->lives) {
            *client = (client_t){.lives = true,
                                 .reads = event->kind != EV_WATCHER || (event->style & 1U) == 0U,
                                 .task = *event,
                                 .stream = -1,
                                 .driving_us = IW_NEVER,
                                 .until_us = vk.now_us + event->span_us,
                                 .next_us = vk.now_us,
                                 .period_us = (15U + sim_random_below(&dice, 40U)) * MS,
                                 .answer = -1};
            return;
        }
    }
}

void clients_all_gone(void) {
    for (unsigned i = 0; i < CLIENTS; i++) {
        if (clients[i].lives) {
            hang_up(&clients[i], false);
            clients[i].lives = false;
        }
    }
}

iw_time_us_t clients_next_us(void) {
    iw_time_us_t next_us = IW_NEVER;
    for (unsigned i = 0; i < CLIENTS; i++) {
        next_us = (clients[i].lives && clients[i].next_us < next_us) ? clients[i].next_us : next_us;
    }
    return next_us;
}

iw_time_us_t clients_driving_us(void) {
    iw_time_us_t since_us = IW_NEVER;
    for (unsigned i = 0; i < CLIENTS; i++) {
        since_us = (clients[i].lives && clients[i].driving_us < since_us) ? clients[i].driving_us : since_us;
    }
    return since_us;
}

// ---- requests ----------------------------------------------------------------------------------------------------

/// Sends bytes unchanged. Returns false if they do not fit.
static bool put(client_t *client, const char *bytes, size_t length) {
    vk_stream_t *stream = (client->stream < 0) ? NULL : &vk.stream[client->stream];
    if (stream == NULL || stream->closed || stream->shut || length > VK_IN_SIZE - stream->in_length) {
        return false;
    }
    memcpy(&stream->in[stream->in_length], bytes, length);
    stream->in_length += length;
    client->sent += length;
    return true;
}

__attribute__((format(printf, 3, 4))) static void send_request(client_t *client, said_t what, const char *format, ...) {
    char line[160];
    va_list arguments;
    va_start(arguments, format);
    const int length = vsnprintf(line, sizeof line, format, arguments);
    va_end(arguments);
    if (client->marks < MARKS && put(client, line, (size_t)length)) {
        client->mark[client->marks++] = (mark_t){client->sent, what, client->task.a, client->task.b};
        client->answer = -1;
        client->asked_us = vk.now_us;
    }
}

void clients_taken(int number) {
    const uint64_t received = vk.stream[number].in_total;
    for (unsigned i = 0; i < CLIENTS; i++) {
        client_t *client = &clients[i];
        if (!client->lives || client->stream != number) {
            continue;
        }
        unsigned done = 0;
        while (done < client->marks && client->mark[done].end <= received) {
            const mark_t *mark = &client->mark[done++];
            if (mark->what == SAID_DRIVE) {
                judge_wanted((unsigned)number, mark->left, mark->right);
            }
            judge_said((unsigned)number, mark->what);
        }
        client->marks -= done;
        memmove(&client->mark[0], &client->mark[done], client->marks * sizeof client->mark[0]);
    }
}

/// Checks lines only soon after a failed call: a line that was sent in part may be torn.
static void judge_line(const char *line, size_t length) {
    static iwn_work_t work;
    char why[128];
    iwn_text_t text = iwn_text_begin(why, sizeof why);
    iwn_json_t root;
    if (vk.failed_us != 0U && vk.now_us - vk.failed_us < 1000U * MS &&
        !iwn_json_check(line, length, &work, &root, &text)) {
        judge_break(14, "an invalid line to a client: %.60s", line);
    }
}

/// Searches the reply to the last request and skips everything else.
static void listen(client_t *client) {
    char wanted[32];
    vk_stream_t *stream = (client->stream < 0) ? NULL : &vk.stream[client->stream];
    if (stream == NULL || !client->reads) {
        return;
    }
    (void)snprintf(wanted, sizeof wanted, "\"id\":%u,", (unsigned)client->id);
    size_t from = 0;
    const char *end;
    while ((end = (const char *)memchr(&stream->out[from], '\n', stream->out_length - from)) != NULL) {
        char head[128];
        const size_t length = (size_t)(end - &stream->out[from]);
        (void)snprintf(head, sizeof head, "%.*s", (int)((length < sizeof head) ? length : sizeof head - 1U),
                       &stream->out[from]);
        judge_line(&stream->out[from], length);
        if (strstr(head, wanted) != NULL) {
            client->answer = strstr(head, "\"ok\":true") != NULL;
        }
        from += length + 1U;
    }
    stream->out_length -= from;
    memmove(stream->out, &stream->out[from], stream->out_length);
}

// ---- a driver ----------------------------------------------------------------------------------------------------

static void ask(client_t *client, said_t what, const char *verb, step_t next) {
    client->id++;
    send_request(client, what, "{\"cmd\":\"%s\",\"id\":%u}\n", verb, (unsigned)client->id);
    client->step = next;
}

static void drive(client_t *client) {
    const bool nonzero = client->task.a != 0 || client->task.b != 0;
    client->id++;
    send_request(client, nonzero ? SAID_DRIVE : SAID_ZERO,
                 "{\"cmd\":\"drive\",\"id\":%u,\"left_mm_s\":%d,\"right_mm_s\":%d}\n", (unsigned)client->id,
                 client->task.a, client->task.b);
}

static void begin_again(client_t *client) {
    client->step = STEP_RESET;
    client->driving_us = IW_NEVER;
    client->next_us = vk.now_us + AGAIN;
}

static void end_drive(client_t *client) {
    switch (client->task.style % 6U) {
    case 0:
        ask(client, SAID_STOP, "stop", STEP_END);
        break;
    case 1:
        hang_up(client, false);
        client->lives = false;
        break;
    case 2: // Sends no more; its connection stays.
        client->step = STEP_END;
        client->driving_us = IW_NEVER;
        client->next_us = vk.now_us + 3000U * MS;
        return;
    case 3:
        ask(client, SAID_ESTOP, "estop", STEP_END);
        break;
    case 4:
        hang_up(client, true);
        break;
    default:
        ask(client, SAID_STOP, "disarm", STEP_END);
        break;
    }
    client->step = STEP_END;
    client->driving_us = IW_NEVER;
    client->next_us = vk.now_us + 800U * MS;
}

static void run_driver(client_t *client) {
    const bool waits = client->answer < 0 && vk.now_us < client->asked_us + PATIENCE;
    client->next_us = vk.now_us + client->period_us;
    if (vk.now_us >= client->until_us && client->step != STEP_END) {
        end_drive(client);
        return;
    }
    switch (client->step) {
    case STEP_RESET:
        ask(client, SAID_RESET, "reset", STEP_ARM);
        break;
    case STEP_ARM:
        if (!waits) {
            ask(client, SAID_ARM, "arm", STEP_ARMING);
        }
        break;
    case STEP_ARMING:
        if (client->answer == 1) {
            client->step = STEP_DRIVE;
            client->driving_us = vk.now_us;
            drive(client);
        } else if (!waits) {
            begin_again(client);
        }
        break;
    case STEP_DRIVE:
        if (client->answer == 0 || (client->answer < 0 && !waits)) {
            begin_again(client);
        } else {
            drive(client);
        }
        break;
    default:
        hang_up(client, false);
        client->lives = false;
        break;
    }
}

// ---- the others --------------------------------------------------------------------------------------------------

static void run_blind(client_t *client) {
    drive(client);
    client->next_us = vk.now_us + client->period_us;
}

static void run_watcher(client_t *client) {
    if (client->step == STEP_RESET) {
        send_request(
            client, SAID_ZERO,
            "{\"cmd\":\"watch\",\"id\":1,\"topics\":[\"state\",\"stop\",\"status\",\"frame\"],\"rate_hz\":%d}\n",
            5 + client->task.b % 50);
        client->step = STEP_ARM;
    }
    client->next_us = vk.now_us + 30U * MS;
}

/// Unusual or invalid requests; some of them stop or reset.
static void run_noise(client_t *client) {
    static const struct {
        const char *text;
        said_t what;
        int32_t left;
        int32_t right;
    } words[] = {{"{\"cmd\":\"status\",\"id\":1}\n", SAID_ZERO, 0, 0},
                 {"{\"cmd\":\"why\"}\n", SAID_ZERO, 0, 0},
                 {"{\"cmd\":\"arm\",\"takeover\":true}\n", SAID_ARM, 0, 0},
                 {"{\"cmd\":\"arm\",\"id\":7}\n", SAID_ARM, 0, 0},
                 {"{\"cmd\":\"drive\",\"left_mm_s\":300,\"right_mm_s\":-200}\n", SAID_DRIVE, 300, -200},
                 {"{\"cmd\":\"twist\",\"v_mm_s\":200,\"yaw_mrad_s\":300}\n", SAID_DRIVE, 119, 281},
                 {"{\"cmd\":\"reset\"}\n", SAID_RESET, 0, 0},
                 {"{\"cmd\":\"stop\"}\n", SAID_STOP, 0, 0},
                 {"{\"cmd\":\"disarm\"}\n", SAID_STOP, 0, 0},
                 {"{\"cmd\":\"hello\"}\n{\"cmd\":\"recordings\"}\n", SAID_ZERO, 0, 0},
                 {"{\"cmd\":\"tare\",\"side\":\"left\"}\n", SAID_ZERO, 0, 0},
                 {"{\"cmd\":\"drive\",\"left_mm_s\":1e99,\"right_mm_s\":0}\n", SAID_ZERO, 0, 0},
                 {"no json at all\n\n\n", SAID_ZERO, 0, 0}};
    static char flood[VK_IN_SIZE / 2U];
    const unsigned choice = sim_random_below(&dice, sizeof words / sizeof words[0] + 2U);
    client->next_us = vk.now_us + sim_random_below(&dice, 120U) * MS;
    if (client->step == STEP_END) {
        return;
    }
    if (choice < sizeof words / sizeof words[0]) {
        // The request comes in two pieces, as over a network.
        const char *text = words[choice].text;
        const size_t first = sim_random_below(&dice, (uint32_t)strlen(text));
        if (put(client, text, first) && put(client, &text[first], strlen(text) - first) && client->marks < MARKS) {
            client->mark[client->marks++] =
                (mark_t){client->sent, words[choice].what, words[choice].left, words[choice].right};
        }
    } else if (choice == sizeof words / sizeof words[0]) {
        // An invalid line; one that is too long is the last that the gateway reads from this connection.
        memset(flood, 'x', sizeof flood);
        const size_t length = 1U + sim_random_below(&dice, sizeof flood);
        flood[length - 1U] = '\n';
        (void)put(client, flood, length);
        client->step = (length > IWN_LINE_MAX) ? STEP_END : client->step;
    } else {
        hang_up(client, sim_random_below(&dice, 2U) == 0U);
    }
}

static void run_one(client_t *client) {
    static void (*const run[EV_KINDS])(client_t *) = {
        [EV_DRIVER] = run_driver, [EV_BLIND] = run_blind, [EV_NOISE] = run_noise, [EV_WATCHER] = run_watcher};
    const bool gone = client->stream >= 0 && vk.stream[client->stream].closed;
    if (gone) {
        vk.stream[client->stream].client_end = true;
        client->stream = -1;
        client->step = STEP_RESET;
        client->driving_us = IW_NEVER;
    }
    collect();
    if (client->task.kind != EV_DRIVER && vk.now_us >= client->until_us) {
        hang_up(client, false);
        client->lives = false;
        return;
    }
    if (client->stream < 0) {
        const bool watches = client->task.kind == EV_WATCHER && (client->task.style & 2U) != 0U;
        client->stream = vk_connect(watches);
        client->next_us = vk.now_us + 50U * MS;
        client->sent = 0;
        client->marks = 0;
        client->lives = client->lives && (client->stream >= 0 || vk.now_us < client->until_us);
        return;
    }
    listen(client);
    run[client->task.kind](client);
}

void clients_run(void) {
    for (unsigned i = 0; i < CLIENTS; i++) {
        if (clients[i].lives && clients[i].next_us <= vk.now_us) {
            run_one(&clients[i]);
        }
    }
}
