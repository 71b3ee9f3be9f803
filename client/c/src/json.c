// SPDX-License-Identifier: MIT
#include "json.h"

#include <string.h>

// Each `skip_` takes the rest of the text and returns what follows the thing skipped; `at` NULL: it is none.
static const iwc_span_t NOTHING = {NULL, 0};

static iwc_span_t forward(iwc_span_t rest, size_t count) {
    return (iwc_span_t){rest.at + count, rest.length - count};
}

static bool begins_with(iwc_span_t rest, char wanted) {
    return rest.at != NULL && rest.length > 0 && rest.at[0] == wanted;
}

static iwc_span_t skip_blanks(iwc_span_t rest) {
    while (rest.at != NULL && rest.length > 0 && rest.at[0] != '\0' && strchr(" \t\r\n", rest.at[0]) != NULL) {
        rest = forward(rest, 1);
    }
    return rest;
}

static size_t count_digits(iwc_span_t rest) {
    size_t count = 0;
    while (count < rest.length && rest.at[count] >= '0' && rest.at[count] <= '9') {
        count++;
    }
    return count;
}

/// Whether the second byte may follow the first (RFC 3629: no overlong form, no surrogate, nothing above U+10FFFF).
static bool may_follow(unsigned char first, unsigned char second) {
    const unsigned low = (first == 0xE0U) ? 0xA0U : (first == 0xF0U) ? 0x90U : 0x80U;
    const unsigned high = (first == 0xEDU) ? 0x9FU : (first == 0xF4U) ? 0x8FU : 0xBFU;
    return second >= low && second <= high;
}

/// Bytes of the character in UTF-8; 0: it is none.
static size_t character_length(iwc_span_t rest) {
    const unsigned char *byte = (const unsigned char *)rest.at;
    if (byte[0] < 0x80U) {
        return 1;
    }
    const size_t length = (byte[0] >= 0xF0U) ? 4 : (byte[0] >= 0xE0U) ? 3 : 2;
    if (byte[0] < 0xC2U || byte[0] > 0xF4U || rest.length < length || !may_follow(byte[0], byte[1])) {
        return 0;
    }
    for (size_t i = 2; i < length; i++) {
        if ((byte[i] & 0xC0U) != 0x80U) {
            return 0;
        }
    }
    return length;
}

static bool is_hex(char digit) {
    return digit != '\0' && strchr("0123456789abcdefABCDEF", digit) != NULL;
}

/// Bytes of what stands at `rest` inside a string; 0: it may not stand there.
static size_t piece_length(iwc_span_t rest) {
    if ((unsigned char)rest.at[0] < 0x20U) {
        return 0;
    }
    if (rest.at[0] != '\\') {
        return character_length(rest);
    }
    if (rest.length < 2) {
        return 0;
    }
    if (rest.at[1] != 'u') {
        return (rest.at[1] != '\0' && strchr("\"\\/bfnrt", rest.at[1]) != NULL) ? 2 : 0;
    }
    for (size_t i = 2; i < 6; i++) {
        if (i >= rest.length || !is_hex(rest.at[i])) {
            return 0;
        }
    }
    return 6;
}

static iwc_span_t skip_string(iwc_span_t rest) {
    if (!begins_with(rest, '"')) {
        return NOTHING;
    }
    rest = forward(rest, 1);
    while (rest.length > 0 && rest.at[0] != '"') {
        const size_t length = piece_length(rest);
        if (length == 0) {
            return NOTHING;
        }
        rest = forward(rest, length);
    }
    return (rest.length > 0) ? forward(rest, 1) : NOTHING;
}

/// Behind the digits, of which there must be one at least.
static iwc_span_t skip_digits(iwc_span_t rest) {
    const size_t count = count_digits(rest);
    return (count > 0) ? forward(rest, count) : NOTHING;
}

static iwc_span_t skip_number(iwc_span_t rest) {
    rest = begins_with(rest, '-') ? forward(rest, 1) : rest;
    const bool leading_zero = begins_with(rest, '0');
    rest = leading_zero ? forward(rest, 1) : skip_digits(rest);
    if (begins_with(rest, '.')) {
        rest = skip_digits(forward(rest, 1));
    }
    if (begins_with(rest, 'e') || begins_with(rest, 'E')) {
        rest = forward(rest, 1);
        rest = (begins_with(rest, '+') || begins_with(rest, '-')) ? forward(rest, 1) : rest;
        rest = skip_digits(rest);
    }
    return rest;
}

static iwc_span_t skip_word(iwc_span_t rest) {
    static const char *const words[] = {"true", "false", "null"};
    for (size_t i = 0; i < sizeof words / sizeof words[0]; i++) {
        const size_t length = strlen(words[i]);
        if (rest.length >= length && memcmp(rest.at, words[i], length) == 0) {
            return forward(rest, length);
        }
    }
    return NOTHING;
}

/// A key and its colon.
static iwc_span_t skip_key(iwc_span_t rest) {
    rest = skip_blanks(skip_string(rest));
    return begins_with(rest, ':') ? skip_blanks(forward(rest, 1)) : NOTHING;
}

/// An object or array that is open.
typedef struct {
    char close;
    unsigned keys;
    iwc_span_t key[IWC_JSON_KEYS];
} level_t;

/// False if the key at `rest`, which ends where `behind` begins, was there before.
static bool note_key(level_t *self, iwc_span_t rest, iwc_span_t behind) {
    const iwc_span_t key = {rest.at, (size_t)(behind.at - rest.at)};
    for (unsigned i = 0; i < self->keys; i++) {
        if (self->key[i].length == key.length && memcmp(self->key[i].at, key.at, key.length) == 0) {
            return false;
        }
    }
    if (self->keys < IWC_JSON_KEYS) {
        self->key[self->keys] = key;
        self->keys++;
    }
    return true;
}

/// Up to the value of the next member: in an object behind its key, which must be new.
static iwc_span_t skip_to_member(level_t *self, iwc_span_t rest) {
    rest = skip_blanks(rest);
    if (self->close == ']') {
        return rest;
    }
    const iwc_span_t behind = skip_string(rest);
    return (behind.at != NULL && note_key(self, rest, behind)) ? skip_key(rest) : NOTHING;
}

static iwc_span_t skip_scalar(iwc_span_t rest) {
    if (begins_with(rest, '"')) {
        return skip_string(rest);
    }
    if (begins_with(rest, 't') || begins_with(rest, 'f') || begins_with(rest, 'n')) {
        return skip_word(rest);
    }
    return skip_number(rest);
}

/// Behind a value: closes what ends there, and goes to the next one in what does not. `*depth` 0: all is closed.
static iwc_span_t skip_closings(level_t *level, unsigned *depth, iwc_span_t rest) {
    while (*depth > 0) {
        level_t *inner = &level[*depth - 1U];
        rest = skip_blanks(rest);
        if (begins_with(rest, inner->close)) {
            rest = forward(rest, 1);
            (*depth)--;
        } else {
            return begins_with(rest, ',') ? skip_to_member(inner, forward(rest, 1)) : NOTHING;
        }
    }
    return rest;
}

static iwc_span_t skip_value(iwc_span_t rest) {
    level_t level[IWC_JSON_DEPTH];
    unsigned depth = 0;
    do {
        if (begins_with(rest, '{') || begins_with(rest, '[')) {
            if (depth == IWC_JSON_DEPTH) {
                return NOTHING;
            }
            level_t *inner = &level[depth];
            depth++;
            inner->close = (rest.at[0] == '{') ? '}' : ']';
            inner->keys = 0;
            rest = skip_blanks(forward(rest, 1));
            if (!begins_with(rest, inner->close)) {
                rest = skip_to_member(inner, rest);
                continue;
            }
        } else {
            rest = skip_scalar(rest);
        }
        rest = skip_closings(level, &depth, rest);
    } while (depth > 0 && rest.at != NULL && rest.length > 0);
    return (depth == 0) ? rest : NOTHING;
}

bool iwc_json_is_object(const char *text, size_t length) {
    iwc_span_t rest = skip_blanks((iwc_span_t){text, length});
    if (!begins_with(rest, '{')) {
        return false;
    }
    rest = skip_blanks(skip_value(rest));
    return rest.at != NULL && rest.length == 0;
}

/// The value of one key.
static iwc_span_t find_key(iwc_span_t object, const char *key, size_t length) {
    iwc_span_t rest = skip_blanks(object);
    if (!begins_with(rest, '{')) {
        return NOTHING;
    }
    rest = skip_blanks(forward(rest, 1));
    while (begins_with(rest, '"')) {
        const bool found =
            rest.length > length + 1U && memcmp(rest.at + 1, key, length) == 0 && rest.at[length + 1U] == '"';
        const iwc_span_t value = skip_key(rest);
        rest = skip_value(value);
        if (found && rest.at != NULL) {
            return (iwc_span_t){value.at, (size_t)(rest.at - value.at)};
        }
        rest = skip_blanks(rest);
        rest = begins_with(rest, ',') ? skip_blanks(forward(rest, 1)) : NOTHING;
    }
    return NOTHING;
}

iwc_span_t iwc_json_find(iwc_span_t object, const char *path) {
    while (object.at != NULL) {
        const size_t length = strcspn(path, ".");
        object = find_key(object, path, length);
        if (path[length] == '\0') {
            break;
        }
        path += length + 1U;
    }
    return object;
}

bool iwc_json_is_text(iwc_span_t value, const char *text) {
    const size_t length = strlen(text);
    return begins_with(value, '"') && value.length == length + 2U && memcmp(value.at + 1, text, length) == 0;
}

bool iwc_json_integer(iwc_span_t value, int64_t *out_number) {
    const bool negative = begins_with(value, '-');
    const iwc_span_t digits = negative ? forward(value, 1) : value;
    const uint64_t limit = (uint64_t)INT64_MAX + (negative ? 1U : 0U);
    uint64_t number = 0;
    if (value.at == NULL || digits.length == 0 || count_digits(digits) != digits.length) {
        return false;
    }
    for (size_t i = 0; i < digits.length; i++) {
        const unsigned digit = (unsigned)(digits.at[i] - '0');
        if (number > (limit - digit) / 10U) {
            return false;
        }
        number = number * 10U + digit;
    }
    *out_number = (int64_t)(negative ? 0U - number : number);
    return true;
}
