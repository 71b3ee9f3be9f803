// SPDX-License-Identifier: MIT
#include "connection.h"

#include <string.h>

/// Most messages that iwc_queue_thin retains.
#define KINDS_MAX 128U
/// First byte of a line that no call will read.
#define STRUCK '\0'
static const char EVENT[] = "{\"event\":"; // Beginning of every event of the gateway.
/// Kind of the `lost` events, whose counts are added up.
#define KIND_LOST UINT64_C(0)

/// Fields that must be equal for one event to supersede another of the same name.
static const struct {
    const char *event;
    const char *fields[2];
} DISTINCTIONS[] = {
    {"fault", {"cause", NULL}},
    {"offset", {"side", NULL}},
    {"ledger", {"item", NULL}},
    {"frame", {"id", "kind"}},
};

static bool is_odd(int64_t id) {
    return id % 2 != 0;
}

/// Records that the gateway has replied to this drive command.
static void note_driven(iwc_t *self, int64_t id) {
    for (size_t i = 0; i < IWC_DRIVES_MAX; i++) {
        if (self->driven[i] == id) {
            self->driven[i] = 0;
        }
    }
}

/// Returns true if iwc_next shall return this reply. Passes the reply for which a call waits to this call, and also a
/// refusal without id, which concerns the whole connection.
static bool admit_reply(iwc_t *self, iwc_span_t line) {
    int64_t id = 0;
    const bool has_id = iwc_json_integer(iwc_json_find(line, "id"), &id);
    note_driven(self, id);
    if (self->awaited != 0 && self->answer == 0 && (!has_id || id == self->awaited)) {
        memcpy(self->line, line.at, line.length);
        self->line[line.length] = '\0';
        self->answer = line.length;
        return false;
    }
    return !has_id || is_odd(id);
}

/// Returns true if the line begins like an event of the gateway. The greeting is not trusted: another program may have
/// sent it.
static bool is_trusted(iwc_span_t line) {
    static const char hello[] = "{\"event\":\"hello\"";
    return line.length > sizeof hello && memcmp(line.at, EVENT, sizeof EVENT - 1U) == 0 &&
           memcmp(line.at, hello, sizeof hello - 1U) != 0;
}

/// Returns false if the line is not a message.
static bool admit_line(iwc_t *self, iwc_span_t line) {
    const bool trusted = is_trusted(line);
    if (line.length > IWC_LINE_MAX || !(trusted ? iwc_json_is_trusted_object(line.at, line.length, &self->stored)
                                                : iwc_json_is_object(line.at, line.length))) {
        return false;
    }
    const bool is_event = trusted || iwc_json_find(line, "event").at != NULL;
    const bool is_reply = !trusted && iwc_json_find(line, "ok").at != NULL;
    if (is_reply && !is_event && !admit_reply(self, line)) {
        self->in[line.at - self->in] = STRUCK;
    }
    return is_event != is_reply;
}

bool iwc_queue_admit(iwc_t *self) {
    size_t looked = self->whole;
    for (;;) {
        const char *newline = memchr(self->in + looked, '\n', self->end - looked);
        if (newline == NULL) {
            return self->end - self->whole <= IWC_LINE_MAX;
        }
        const iwc_span_t line = {self->in + self->whole, (size_t)(newline - self->in) - self->whole};
        if (!admit_line(self, line)) {
            return false;
        }
        looked = (size_t)(newline - self->in) + 1U;
        self->whole = looked;
    }
}

bool iwc_queue_take(iwc_t *self, iwc_message_t *out_message) {
    while (self->begin < self->whole) {
        const char *line = self->in + self->begin;
        const size_t length = (size_t)((const char *)memchr(line, '\n', self->whole - self->begin) - line);
        self->begin += length + 1U;
        if (line[0] != STRUCK) {
            memcpy(self->line, line, length);
            self->line[length] = '\0';
            const iwc_span_t span = {self->line, length};
            *out_message = (iwc_message_t){.text = self->line, .length = length, .skipped = self->skipped};
            out_message->is_event = iwc_json_find(span, "event").at != NULL;
            if (!out_message->is_event) {
                (void)iwc_json_integer(iwc_json_find(span, "id"), &out_message->id);
            }
            self->skipped = 0;
            self->answer = 0;
            return true;
        }
    }
    return false;
}

/// Adds a value to a hash (FNV-1a).
static uint64_t mix(uint64_t kind, iwc_span_t value) {
    for (size_t i = 0; i < value.length; i++) {
        kind = (kind ^ (unsigned char)value.at[i]) * UINT64_C(0x100000001B3);
    }
    return kind;
}

/// Returns the kind of a line: the newer of two lines of one kind supersedes the older. Each reply has its own kind.
static uint64_t kind_of(iwc_span_t line) {
    const iwc_span_t event = iwc_json_find(line, "event");
    uint64_t kind = mix(UINT64_C(0xCBF29CE484222325), (event.at != NULL) ? event : iwc_json_find(line, "id"));
    if (iwc_json_is_text(event, "lost")) {
        return KIND_LOST;
    }
    for (size_t i = 0; i < sizeof(DISTINCTIONS) / sizeof(DISTINCTIONS[0]); i++) {
        for (size_t k = 0; iwc_json_is_text(event, DISTINCTIONS[i].event) && k < 2; k++) {
            const char *field = DISTINCTIONS[i].fields[k];
            if (field != NULL) {
                kind = mix(kind, iwc_json_find(line, field));
            }
        }
    }
    return kind;
}

static uint64_t lost_count(iwc_span_t line) {
    int64_t count = 0;
    return (iwc_json_integer(iwc_json_find(line, "count"), &count) && count > 0) ? (uint64_t)count : 0U;
}

typedef struct {
    uint64_t kind[KINDS_MAX];
    unsigned kinds;
    size_t bytes; ///< Size of the retained lines.
} survivors_t;

/// Returns true if a line stays. The caller calls it for each line, from the newest to the oldest.
static bool keep(iwc_t *self, survivors_t *survivors, iwc_span_t line) {
    if (line.at[0] == STRUCK) {
        return false;
    }
    const uint64_t kind = kind_of(line);
    if (kind == KIND_LOST) {
        self->skipped += lost_count(line);
        return false;
    }
    bool stays = survivors->kinds < KINDS_MAX && survivors->bytes + line.length + 1U <= IWC_IN_SIZE / 2U;
    for (unsigned i = 0; i < survivors->kinds && stays; i++) {
        stays = survivors->kind[i] != kind;
    }
    if (!stays) {
        self->skipped++;
        return false;
    }
    survivors->kind[survivors->kinds] = kind;
    survivors->kinds++;
    survivors->bytes += line.length + 1U;
    return true;
}

void iwc_queue_thin(iwc_t *self) {
    survivors_t survivors = {.kinds = 0};
    size_t to = self->whole;
    for (size_t end = self->whole; end > self->begin;) {
        const char *before = memrchr(self->in + self->begin, '\n', end - 1U - self->begin);
        const size_t from = (before != NULL) ? (size_t)(before - self->in) + 1U : self->begin;
        if (keep(self, &survivors, (iwc_span_t){self->in + from, end - 1U - from})) {
            to -= end - from;
            memmove(self->in + to, self->in + from, end - from);
        }
        end = from;
    }
    self->begin = to;
}

void iwc_queue_make_room(iwc_t *self) {
    if (IWC_IN_SIZE - self->end > IWC_LINE_MAX && self->begin < self->end) {
        return;
    }
    if (self->end - self->begin > IWC_IN_SIZE - IWC_LINE_MAX - 1U) {
        iwc_queue_thin(self);
    }
    memmove(self->in, self->in + self->begin, self->end - self->begin);
    self->end -= self->begin;
    self->whole -= self->begin;
    self->begin = 0;
}
