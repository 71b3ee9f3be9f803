// SPDX-License-Identifier: MIT
// Adds lengths and paths to the JSON reader of the protocol library, which checks the messages.
#include "json.h"

#include "iwheel_northbound/json_in.h"

#include <string.h>

/// Every integer with at most this many digits has 64 bits.
#define DIGITS_MAX 18U

static const iwc_span_t NOTHING = {NULL, 0};

bool iwc_json_is_object(const char *text, size_t length) {
    char reason[1]; // The reason is not used.
    iwn_text_t fault = iwn_text_begin(reason, sizeof reason);
    iwn_work_t work;
    iwn_json_t root;
    return iwn_json_check(text, length, &work, &root, &fault) && iwn_json_kind(root) == IWN_JSON_OBJECT;
}

static bool is_digit(char c) {
    return c >= '0' && c <= '9';
}

/// Returns the length of the equal beginning of both texts.
static size_t equal_length(const char *one, const char *other, size_t length) {
    size_t at = 0;
    while (at + 8U <= length && memcmp(one + at, other + at, 8U) == 0) { // The compiler makes this one comparison.
        at += 8U;
    }
    while (at < length && one[at] == other[at]) {
        at++;
    }
    return at;
}

/// Returns the length of an integer with another mark behind it; 0: there is none.
static size_t integer_length(iwc_span_t text) {
    const size_t sign = (text.length > 0U && text.at[0] == '-') ? 1U : 0U;
    size_t at = sign;
    while (at < text.length && is_digit(text.at[at])) {
        at++;
    }
    const size_t digits = at - sign;
    const bool ends = at < text.length && (text.at[at] == ',' || text.at[at] == '}' || text.at[at] == ']');
    const bool good = digits == 1U || (digits > 1U && digits <= DIGITS_MAX && text.at[sign] != '0');
    return (ends && good) ? at : 0U;
}

/// Returns true if the text differs from a checked one only in integers, each behind a mark and before a mark. Outside
/// of strings such an integer is a whole value. In a string it is not part of an escape, and any other digits are valid
/// there too. The text is therefore valid.
static bool has_other_integers(iwc_span_t text, iwc_span_t checked) {
    for (;;) {
        size_t equal = equal_length(text.at, checked.at, (text.length < checked.length) ? text.length : checked.length);
        if (equal == text.length || equal == checked.length) {
            return text.length == checked.length;
        }
        while (equal > 0U && (is_digit(text.at[equal - 1U]) || text.at[equal - 1U] == '-')) {
            equal--; // To the beginning of the integer.
        }
        if (equal == 0U || (text.at[equal - 1U] != ':' && text.at[equal - 1U] != ',' && text.at[equal - 1U] != '[')) {
            return false;
        }
        text = (iwc_span_t){text.at + equal, text.length - equal};
        checked = (iwc_span_t){checked.at + equal, checked.length - equal};
        const size_t here = integer_length(text);
        const size_t there = integer_length(checked);
        if (here == 0U || there == 0U) {
            return false;
        }
        text = (iwc_span_t){text.at + here, text.length - here};
        checked = (iwc_span_t){checked.at + there, checked.length - there};
    }
}

bool iwc_json_is_trusted_object(const char *text, size_t length, iwc_stored_t *stored) {
    if (length <= IWC_STORED_MAX && stored->text_length > 0U &&
        has_other_integers((iwc_span_t){text, length}, (iwc_span_t){stored->text, stored->text_length})) {
        return true;
    }
    char reason[1];
    iwn_text_t fault = iwn_text_begin(reason, sizeof reason);
    iwn_repeated_t repeated = {.value = stored->value, .length = stored->length};
    iwn_json_t root;
    if (!iwn_json_check_again(text, length, &repeated, &root, &fault) || iwn_json_kind(root) != IWN_JSON_OBJECT) {
        return false;
    }
    const iwc_span_t value = repeated.met ? NOTHING : iwc_json_find((iwc_span_t){text, length}, "ledger");
    if (value.length > 0 && value.length <= IWC_STORED_MAX && value.at[0] == '{') {
        memcpy(stored->value, value.at, value.length);
        stored->length = value.length;
        repeated.met = true;
    }
    if (repeated.met && length <= IWC_STORED_MAX) {
        memcpy(stored->text, text, length);
        stored->text_length = length;
    }
    return true;
}

static iwc_span_t skip_blanks(iwc_span_t text) {
    while (text.length > 0 && strchr(" \t\r\n", text.at[0]) != NULL) {
        text = (iwc_span_t){text.at + 1, text.length - 1U};
    }
    return text;
}

/// Searches from `*rest` to the end of the object, and moves `*rest` behind the value.
static iwc_span_t find_key(const char **rest, const char *key, size_t length) {
    iwn_json_t left = {*rest};
    iwn_json_t name;
    iwn_json_t value;
    while (iwn_json_next(&left, &name, &value)) {
        if (strncmp(name.at + 1, key, length) == 0 && name.at[length + 1U] == '"') {
            *rest = left.at;
            return (iwc_span_t){value.at, (size_t)(left.at - value.at)};
        }
    }
    return NOTHING;
}

iwc_span_t iwc_json_walk(iwc_walk_t *self, const char *key, size_t length) {
    const iwc_span_t object = skip_blanks(self->object);
    if (object.length == 0 || object.at[0] != '{') {
        return NOTHING;
    }
    const iwc_span_t value = (self->rest != NULL) ? find_key(&self->rest, key, length) : NOTHING;
    if (value.at != NULL) {
        return value;
    }
    self->rest = object.at + 1;
    return find_key(&self->rest, key, length);
}

iwc_span_t iwc_json_find(iwc_span_t object, const char *path) {
    size_t length = strcspn(path, ".");
    if (path[0] == '\0') {
        return object;
    }
    while (path[length] == '.') {
        object = iwc_json_walk(&(iwc_walk_t){object, NULL}, path, length);
        path += length + 1U;
        length = strcspn(path, ".");
    }
    return iwc_json_walk(&(iwc_walk_t){object, NULL}, path, length);
}

bool iwc_json_is_text(iwc_span_t value, const char *text) {
    const size_t length = strlen(text);
    return value.length == length + 2U && value.at[0] == '"' && memcmp(value.at + 1, text, length) == 0;
}

bool iwc_json_integer(iwc_span_t value, int64_t *out_number) {
    if (value.length == 0 || iwn_json_kind((iwn_json_t){value.at}) != IWN_JSON_INTEGER) {
        return false;
    }
    *out_number = iwn_json_integer((iwn_json_t){value.at});
    return true;
}
