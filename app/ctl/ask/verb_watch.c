// SPDX-License-Identifier: MIT
#include "talk/ctl.h"

#include "iwheel_northbound/text.h"
#include "iwheel_northbound/words.h"

#include <errno.h>
#include <inttypes.h>
#include <limits.h>
#include <poll.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#define RATE_MAX_HZ 100
/// Interval at which a watch without events checks that its output is still read.
#define POLL_US 500000

/// Number of topics, from the first one on, that are watched if none is named.
#define TOPICS_USUAL ((unsigned)IWN_TOPIC_STOP + 1U)

static bool is_topic(const char *word) {
    for (unsigned i = 0; i < (unsigned)IWN_TOPICS; i++) {
        if (strcmp(iwn_topic_name((iwn_topic_t)i), word) == 0) {
            return true;
        }
    }
    return false;
}

static bool parse_rate(const char *text, int *out_rate_hz) {
    char *end = NULL;
    if (text == NULL || strspn(text, "0123456789") == 0) {
        return false;
    }
    const long rate = strtol(text, &end, 10);
    if ((*end != '\0' && strcmp(end, "Hz") != 0) || rate < 1 || rate > RATE_MAX_HZ) {
        return false;
    }
    *out_rate_hz = (int)rate;
    return true;
}

/// Reads the words into the list and the rate. Returns false after it has reported what is wrong.
static bool parse_words(int count, char **words, json_t *list, int *out_rate_hz) {
    for (int i = 0; i < count; i++) {
        if (strcmp(words[i], "--rate") == 0) {
            i++;
            if (!parse_rate((i < count) ? words[i] : NULL, out_rate_hz)) {
                (void)ctl_fail(CTL_USAGE, "--rate needs a number of events per second, 1..%d", RATE_MAX_HZ);
                return false;
            }
        } else if (is_topic(words[i])) {
            (void)json_array_append_new(list, json_string(words[i]));
        } else {
            (void)ctl_fail(CTL_USAGE, "unknown topic \"%s\"; use: state bus estop lease stop force frame", words[i]);
            return false;
        }
    }
    return true;
}

/// Returns the request, or NULL after it has reported what is wrong with the words.
static json_t *compose(int count, char **words) {
    json_t *list = json_array();
    int rate_hz = 10;
    if (!parse_words(count, words, list, &rate_hz)) {
        json_decref(list);
        return NULL;
    }
    const bool usual = json_array_size(list) == 0;
    for (unsigned i = 0; usual && i < TOPICS_USUAL; i++) {
        (void)json_array_append_new(list, json_string(iwn_topic_name((iwn_topic_t)i)));
    }
    return json_pack("{s:s,s:o,s:i}", "cmd", "watch", "topics", list, "rate_hz", rate_hz);
}

typedef enum { OUTPUT_OPEN = 0, OUTPUT_SIGNAL, OUTPUT_CLOSED, OUTPUT_BROKEN } output_t;

/// Checks, or waits if `wanted`, that stdout accepts data. While it does not, its reader is slow: events that arrive in
/// this time are reduced to the latest values, so that the reader never has a backlog.
static output_t await_output(const client_t *client, bool wanted) {
    const struct timespec none = {0, 0};
    for (bool slow = false;; slow = true) {
        struct pollfd entries[2] = {{.fd = STDOUT_FILENO, .events = wanted ? POLLOUT : 0},
                                    {.fd = slow ? iwc_fd(client->gateway) : -1, .events = POLLIN}};
        const int ready = ppoll(entries, 2, slow ? NULL : &none, signals_let_in());
        if (signals_count() != client->seen_signals) {
            return OUTPUT_SIGNAL;
        }
        if (ready > 0 && (entries[0].revents & (POLLERR | POLLNVAL)) != 0) {
            return OUTPUT_CLOSED;
        }
        if (!wanted || (ready > 0 && entries[0].revents != 0)) {
            return OUTPUT_OPEN;
        }
        (void)iwc_latest(client->gateway);
    }
}

/// Writes a text in pieces that a ready pipe accepts without blocking, so that a signal is handled although the output
/// is not read.
static output_t write_text(const client_t *client, const char *text, size_t size) {
    while (size > 0) {
        const output_t state = await_output(client, true);
        if (state != OUTPUT_OPEN) {
            return state;
        }
        const ssize_t written = write(STDOUT_FILENO, text, (size < PIPE_BUF) ? size : PIPE_BUF);
        if (written < 0 && errno != EINTR && errno != EAGAIN) {
            return (errno == EPIPE) ? OUTPUT_CLOSED : OUTPUT_BROKEN;
        }
        text += (written > 0) ? written : 0;
        size -= (written > 0) ? (size_t)written : 0U;
    }
    return OUTPUT_OPEN;
}

/// Writes the number of events that were dropped before this one, in the form that the gateway uses.
static output_t write_lost(client_t *client) {
    char line[64];
    const uint64_t count = client->skipped;
    client->skipped = 0;
    const int length = snprintf(line, sizeof line, "{\"event\":\"lost\",\"count\":%" PRIu64 "}\n", count);
    return (count > 0U) ? write_text(client, line, (size_t)length) : OUTPUT_OPEN;
}

/// Writes the received line, but escapes characters that control a terminal.
static output_t write_line(const client_t *client) {
    char piece[PIPE_BUF];
    size_t length;
    const char *rest = client->line;
    output_t state = OUTPUT_OPEN;
    while (*rest != '\0' && state == OUTPUT_OPEN) {
        rest = iwn_plain_json(rest, piece, sizeof piece, &length);
        state = write_text(client, piece, length);
    }
    return (state == OUTPUT_OPEN) ? write_text(client, "\n", 1) : state;
}

/// Prints events until a signal arrives, or the output or the gateway closes.
static int pump(ctl_t *self) {
    output_t output = OUTPUT_OPEN;
    while (output == OUTPUT_OPEN) {
        json_t *line = NULL;
        const iwc_result_t result = client_receive(&self->client, client_now_us() + POLL_US, &line);
        if (result == IWC_INTERRUPTED) {
            return CTL_OK;
        }
        if (result != IWC_OK && result != IWC_TIMEOUT) {
            return ctl_lost(result);
        }
        const bool event = json_object_get(line, "event") != NULL;
        json_decref(line);
        output = event ? write_lost(&self->client) : await_output(&self->client, false);
        if (event && output == OUTPUT_OPEN) {
            output = write_line(&self->client);
        }
    }
    return (output == OUTPUT_BROKEN) ? ctl_fail(CTL_UNAVAILABLE, "cannot write: %s; free some space", strerror(errno))
                                     : CTL_OK;
}

int verb_watch(ctl_t *self, int count, char **words) {
    json_t *request = compose(count, words);
    json_t *reply = NULL;
    if (request == NULL) {
        return CTL_USAGE;
    }
    const bool json = self->json;
    self->json = false;
    signals_catch();
    const int code = ctl_ask(self, request, &reply);
    self->json = json;
    json_decref(reply);
    return (code == CTL_OK) ? pump(self) : code;
}
