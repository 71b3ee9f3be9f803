// SPDX-License-Identifier: MIT
#include "fetch.h"

#include "iwheel_northbound/json_out.h"
#include "iwheel_northbound/text.h"

#include <inttypes.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sysexits.h>

#define MACHINE_REFUSES 1
/// After this time an answer is lost or late.
#define ANSWER_US 2000000U
/// An older quote is not used, because the way to the machine also counts as age, and the largest age is one second.
#define QUOTE_US 300000U
/// Pause after a refusal that may be temporary.
#define PAUSE_US 500000U
/// Number of refusals in a row after which the fetch fails.
#define REFUSED_MAX 6U
/// A machine that is at this broker answers `hello` within this time.
#define STRANGE_US 6000000U

const char *const fetch_endings[FETCH_FILES] = {".conf", ".jsonl", ".log"};

__attribute__((format(printf, 3, 4))) static void fail(fetch_t *self, int code, const char *format, ...) {
    va_list list;
    va_start(list, format);
    (void)vsnprintf(self->why, sizeof self->why, format, list);
    va_end(list);
    self->code = code;
    self->stage = FETCH_FAILED;
}

void fetch_begin(fetch_t *self, const char *id, const char *from, uint64_t patience_us, uint64_t now_us) {
    memset(self, 0, sizeof *self);
    (void)snprintf(self->id, sizeof self->id, "%s", id);
    (void)snprintf(self->from, sizeof self->from, "%s", from);
    self->patience_us = patience_us;
    self->begun_us = now_us;
    self->next_us = now_us;
}

/// Returns true if `name` is the full name (`stop-000017-wheel_lost`) or the number of the recording.
static bool is_meant(const fetch_recording_t *recording, const char *name) {
    const char *digits = strchr(recording->name, '-');
    return strcmp(recording->name, name) == 0 ||
           (name[0] != '\0' && strspn(name, "0123456789") == strlen(name) && digits != NULL &&
            strtoul(digits + 1, NULL, 10) == strtoul(name, NULL, 10));
}

/// Selects the next existing file from `file` on; DONE if there is none.
static void next_file(fetch_t *self, size_t file, uint64_t now_us) {
    while (file < FETCH_FILES && !self->list[self->chosen].bytes[file].known) {
        file++;
    }
    self->file = file;
    self->piece = (iwc_piece_t){.next = 0};
    self->stage = (file < FETCH_FILES) ? FETCH_FETCHING : FETCH_DONE;
    self->next_us = now_us;
}

void fetch_choose(fetch_t *self, const char *name, uint64_t now_us) {
    size_t place = self->count;
    for (size_t i = 0; i < self->count; i++) {
        if (name == NULL || is_meant(&self->list[i], name)) {
            place = i;
        }
    }
    if (place == self->count) {
        if (name == NULL) {
            fail(self, MACHINE_REFUSES,
                 "%s has no recording: it has not stopped since they were removed, or [record] blackbox_s is 0",
                 self->id);
        } else {
            fail(self, MACHINE_REFUSES, "%s has no recording %s; it has: iwheel-fleet recordings %s", self->id, name,
                 self->id);
        }
        return;
    }
    self->chosen = place;
    self->begun_us = now_us;
    next_file(self, 0, now_us);
    if (self->stage == FETCH_DONE || !self->list[place].bytes[FETCH_FILES - 1U].known) {
        fail(self, MACHINE_REFUSES, "%s has no frames of %s: they could not be written; see that machine's log",
             self->id, self->list[place].name);
    }
}

static void write_command(fetch_t *self, const char **out_verb, char out_payload[512]) {
    iwn_out_t json;
    iwn_out_init(&json, out_payload, 512);
    iwn_out_open(&json, NULL, '{');
    iwn_out_text(&json, "from", self->from);
    iwn_out_int(&json, "seq", self->seq);
    if (self->asked == FETCH_COMMAND) {
        iwn_out_text(&json, "boot", self->boot);
        iwn_out_int(&json, "t_us", self->t_us);
    }
    *out_verb = (self->asked == FETCH_HELLO) ? "hello" : (self->stage == FETCH_LISTING) ? "recordings" : "recording";
    if (self->asked == FETCH_COMMAND && self->stage == FETCH_FETCHING) {
        char name[FETCH_NAME_SIZE + 8U];
        (void)snprintf(name, sizeof name, "%s%s", self->list[self->chosen].name, fetch_endings[self->file]);
        iwn_out_text(&json, "name", name);
        iwn_out_int(&json, "offset", self->piece.next);
    }
    iwn_out_close(&json, '}');
    const size_t length = iwn_out_finish(&json);
    out_payload[(length > 0U) ? length - 1U : 0U] = '\0'; // Without the newline. All parts are bounded.
}

static void give_up(fetch_t *self) {
    if (!self->seen) {
        fail(self, EX_UNAVAILABLE, "this broker has no machine %s; list the machines: iwheel-fleet --for 5", self->id);
    } else if (self->words[0] != '\0') {
        fail(self, EX_TEMPFAIL, "%s has not sent the recording for %" PRIu64 " s; its last message: %s", self->id,
             self->patience_us / 1000000U, self->words);
    } else {
        fail(self, EX_TEMPFAIL, "%s has not answered for %" PRIu64 " s%s; try again when iwheel-fleet shows it online",
             self->id, self->patience_us / 1000000U,
             self->online ? "" : " and is offline: its bridge, gateway or network is away");
    }
}

bool fetch_step(fetch_t *self, uint64_t now_us, const char **out_verb, char out_payload[512]) {
    const bool asks = self->stage == FETCH_LISTING || self->stage == FETCH_FETCHING;
    const uint64_t patience_us = (self->seen || self->patience_us < STRANGE_US) ? self->patience_us : STRANGE_US;
    if (asks && now_us - self->begun_us >= patience_us) {
        give_up(self);
        return false;
    }
    if (!asks || now_us < self->next_us) {
        return false;
    }
    const bool again = self->asked != FETCH_NONE;
    const bool greets = again || self->boot[0] == '\0' || now_us - self->quoted_us > QUOTE_US;
    self->again += again ? 1U : 0U;
    self->asked = greets ? FETCH_HELLO : FETCH_COMMAND;
    self->seq++;
    self->next_us = now_us + ANSWER_US;
    write_command(self, out_verb, out_payload);
    return true;
}

/// Copies a text without control characters of a terminal.
static void read_text(iwn_json_t object, const char *name, char *out, size_t size) {
    char raw[256];
    iwn_json_t value;
    out[0] = '\0';
    if (iwn_json_find(object, name, &value) && iwn_json_kind(value) == IWN_JSON_TEXT &&
        iwn_json_text(value, raw, sizeof raw)) {
        iwn_plain_copy(raw, out, size);
    }
}

static iwc_value_t read_number(iwn_json_t object, const char *name) {
    iwn_json_t value;
    const bool known = iwn_json_find(object, name, &value) && iwn_json_kind(value) == IWN_JSON_INTEGER;
    return (iwc_value_t){known, known ? iwn_json_integer(value) : 0};
}

/// Checks a name of the gateway. The name becomes a file name here, so only these characters are allowed.
static bool is_name(const char *name) {
    return strncmp(name, "stop-", 5) == 0 && strlen(name) < FETCH_NAME_SIZE - 8U &&
           strspn(name, "abcdefghijklmnopqrstuvwxyz0123456789_-") == strlen(name);
}

static void take_list(fetch_t *self, iwn_json_t root) {
    static const char *const fields[FETCH_FILES] = {"conf_bytes", "jsonl_bytes", "log_bytes"};
    iwn_json_t list;
    iwn_json_t entry;
    if (!iwn_json_find(root, "recordings", &list) || iwn_json_kind(list) != IWN_JSON_LIST) {
        return;
    }
    iwn_json_t rest = iwn_json_inside(list);
    self->count = 0;
    while (self->count < FETCH_LISTED_MAX && iwn_json_next(&rest, NULL, &entry)) {
        fetch_recording_t *one = &self->list[self->count];
        read_text(entry, "name", one->name, sizeof one->name);
        read_text(entry, "cause", one->cause, sizeof one->cause);
        one->wall_us = read_number(entry, "wall_us");
        for (size_t i = 0; i < FETCH_FILES; i++) {
            one->bytes[i] = read_number(entry, fields[i]);
        }
        self->count += is_name(one->name) ? 1U : 0U;
    }
    self->stage = FETCH_LISTED;
}

/// Receives the next piece of the requested file. A damaged piece is requested again.
static fetch_news_t take_piece(fetch_t *self, const iwc_message_t *reply, uint64_t now_us) {
    iwc_piece_t piece = self->piece;
    if (!iwc_piece_take(reply, self->bytes, &piece)) {
        self->again++;
        self->refused++;
        (void)snprintf(self->words, sizeof self->words, "the checksum of a piece is wrong");
        if (self->refused >= REFUSED_MAX) {
            fail(
                self, EX_DATAERR,
                "the checksum of %s%s of %s is wrong: damaged on the way, or on that machine's disk; try again, and if "
                "the error stays, copy the file from that machine",
                self->list[self->chosen].name, fetch_endings[self->file], self->id);
        }
        return FETCH_NOTHING;
    }
    self->piece = piece;
    self->pieces++;
    self->got = piece.length;
    self->got_file = self->file;
    self->refused = 0;
    self->begun_us = now_us;
    if (piece.next == piece.size) {
        next_file(self, self->file + 1U, now_us);
    }
    return FETCH_PIECE;
}

static bool is_one_of(const char *word, const char *const words[]) {
    for (size_t i = 0; words[i] != NULL; i++) {
        if (strcmp(words[i], word) == 0) {
            return true;
        }
    }
    return false;
}

/// Handles a refusal: a temporary one leads to a new request, any other is reported and ends the fetch.
static void take_refusal(fetch_t *self, iwn_json_t root, uint64_t now_us) {
    static const char *const quotes[] = {"late", "other_boot", "early", "doubled", NULL};
    static const char *const passing[] = {"crowded", "not_delivered", NULL};
    char error[32];
    read_text(root, "error", error, sizeof error);
    read_text(root, "message", self->words, sizeof self->words);
    self->again++;
    self->refused++;
    // The answer brought a new time to quote. Repeated late answers lead to a pause.
    self->next_us = now_us + ((is_one_of(error, quotes) && self->refused < 3U) ? 0U : PAUSE_US);
    if (!is_one_of(error, quotes) && !is_one_of(error, passing) &&
        (strcmp(error, "denied") != 0 || self->refused >= REFUSED_MAX)) {
        fail(self, MACHINE_REFUSES, "%s refuses: %s", self->id, self->words);
    }
}

static bool is_true(iwn_json_t root, const char *name) {
    iwn_json_t value;
    return iwn_json_find(root, name, &value) && iwn_json_kind(value) == IWN_JSON_TRUE;
}

/// Handles an answer to the command under way. Its `boot` and `t_us` are the newest ones.
static fetch_news_t take_answer(fetch_t *self, iwn_json_t root, const iwc_message_t *reply, uint64_t now_us) {
    fetch_news_t news = FETCH_NOTHING;
    const iwc_value_t t_us = read_number(root, "t_us");
    const fetch_stage_t stage = self->stage;
    const fetch_asked_t asked = self->asked;
    if (read_number(root, "seq").value != self->seq || asked == FETCH_NONE || !t_us.known) {
        return news;
    }
    read_text(root, "boot", self->boot, sizeof self->boot);
    self->t_us = t_us.value;
    self->quoted_us = now_us;
    self->asked = FETCH_NONE;
    self->next_us = now_us;
    if (!is_true(root, "ok")) {
        take_refusal(self, root, now_us);
    } else if (asked == FETCH_COMMAND && stage == FETCH_LISTING) {
        take_list(self, root);
        self->refused = 0;
        self->begun_us = now_us;
    } else if (asked == FETCH_COMMAND && stage == FETCH_FETCHING) {
        news = take_piece(self, reply, now_us);
    }
    return news;
}

fetch_news_t fetch_take(fetch_t *self, const char *what, const char *payload, size_t length, uint64_t now_us) {
    char fault[80];
    iwn_json_t root;
    iwn_text_t words = iwn_text_begin(fault, sizeof fault);
    const bool reply = strncmp(what, "reply/", 6) == 0 && strcmp(what + 6, self->from) == 0;
    const bool asks = self->stage == FETCH_LISTING || self->stage == FETCH_FETCHING;
    if (strcmp(what, "availability") == 0) {
        self->seen = true;
        self->online = length == 6U && memcmp(payload, "online", 6) == 0;
    }
    if (!reply || !asks || !iwn_json_check(payload, length, &self->work, &root, &words) ||
        iwn_json_kind(root) != IWN_JSON_OBJECT) {
        return FETCH_NOTHING;
    }
    self->seen = true;
    return take_answer(self, root, &(iwc_message_t){.text = payload, .length = length}, now_us);
}
