// SPDX-License-Identifier: MIT
// Adds lengths and paths to the JSON reader of the protocol library, which checks the messages.
#include "json.h"

#include "iwheel_northbound/json_in.h"

#include <string.h>

static const iwc_span_t NOTHING = {NULL, 0};

bool iwc_json_is_object(const char *text, size_t length) {
    char reason[1]; // The reason is not used.
    iwn_text_t fault = iwn_text_begin(reason, sizeof reason);
    iwn_work_t work;
    iwn_json_t root;
    return iwn_json_check(text, length, &work, &root, &fault) && iwn_json_kind(root) == IWN_JSON_OBJECT;
}

bool iwc_json_is_trusted_object(const char *text, size_t length, iwc_stored_t *stored) {
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
