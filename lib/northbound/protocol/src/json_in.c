// SPDX-License-Identifier: MIT
#include "iwheel_northbound/json_in.h"

#include "json_scan.h"

#include <string.h>

typedef struct {
    iwn_scan_t scan;
    iwn_work_t *work;              ///< NULL: do not search for equal names.
    iwn_repeated_t *repeated;      ///< NULL: check every value.
    uint16_t names;                ///< Number of names in all open objects.
    uint16_t first[IWN_DEPTH_MAX]; ///< Index of the first name, per object.
    bool is_list[IWN_DEPTH_MAX];
    unsigned depth;
} check_t;

static bool fail(check_t *self, const char *what) {
    return iwn_scan_fail(&self->scan, what);
}

// Objects and lists -------------------------------------------------------------------------------------------------

/// Compares two names, at the positions behind their opening quotes, with escapes decoded. Returns a number below
/// 0, 0 or above 0.
static int compare_names(const char *one, const char *other) {
    uint32_t a;
    uint32_t b;
    do {
        a = iwn_scan_character(&one);
        b = iwn_scan_character(&other);
    } while (a == b && a != 0U);
    return (a < b) ? -1 : (a > b) ? 1 : 0;
}

/// Adds the token to the names of its object. Returns false and reports it if the object already has this name.
static bool add_name(check_t *self) {
    unsigned low = self->first[self->depth - 1U];
    uint16_t *const name_at = self->work->name_at;
    unsigned high = self->names;
    while (low < high) {
        const unsigned middle = (low + high) / 2U;
        const int order = compare_names(self->scan.token + 1, &self->scan.text[name_at[middle]]);
        if (order == 0) {
            return fail(self, "duplicate object key");
        }
        if (order > 0) {
            low = middle + 1U;
        } else {
            high = middle;
        }
    }
    if (self->names == IWN_NAMES_MAX) {
        return fail(self, "too many names");
    }
    memmove(&name_at[low + 1U], &name_at[low], (self->names - low) * sizeof name_at[0]);
    name_at[low] = (uint16_t)(self->scan.token + 1 - self->scan.text);
    self->names++;
    return true;
}

/// Skips a value of the root that was checked before: a complete object or list, so its end is that of the value.
static bool skip_repeated(check_t *self) {
    iwn_repeated_t *const repeated = self->repeated;
    if (repeated == NULL || self->depth != 1U || repeated->length == 0U ||
        (size_t)(self->scan.end - self->scan.at) < repeated->length ||
        memcmp(self->scan.at, repeated->value, repeated->length) != 0) {
        return false;
    }
    self->scan.at += repeated->length;
    repeated->met = true;
    return true;
}

/// Checks a name and its colon, and reads the first token of the value to `*token`.
static bool check_name(check_t *self, int *token) {
    if (*token != IWN_TOKEN_TEXT) {
        return fail(self, "string or '}' expected");
    }
    if (self->scan.has_nul) {
        return fail(self, "NUL byte in object key not supported");
    }
    if (self->work != NULL && !add_name(self)) {
        return false;
    }
    if (!iwn_scan_skip(&self->scan, ':') && iwn_scan(&self->scan) != ':') {
        return fail(self, "':' expected");
    }
    *token = skip_repeated(self) ? IWN_TOKEN_SCALAR : iwn_scan(&self->scan);
    return true;
}

static bool in_list(const check_t *self) {
    return self->depth > 0U && self->is_list[self->depth - 1U];
}

static int closing(const check_t *self) {
    return in_list(self) ? ']' : '}';
}

/// Closes an object or list and removes its names, except those of the root, for iwn_json_name.
static void close_container(check_t *self) {
    self->depth--;
    if (self->depth > 0U) {
        self->names = self->first[self->depth];
    }
}

/// Opens an object or list, and reads the first token of its first value to `*token`. Returns false on a fault, and if
/// it is empty, after closing it.
static bool open_container(check_t *self, int *token) {
    if (self->depth == IWN_DEPTH_MAX) {
        return fail(self, "nested more than 8 deep");
    }
    self->is_list[self->depth] = *token == '[';
    self->first[self->depth] = self->names;
    self->depth++;
    *token = iwn_scan(&self->scan);
    if (*token == closing(self)) {
        close_container(self);
        return false;
    }
    return in_list(self) || check_name(self, token);
}

static bool check_scalar(check_t *self, int token) {
    if (token == IWN_TOKEN_TEXT && self->scan.has_nul) {
        return fail(self, "\\u0000 is not allowed");
    }
    if (token == IWN_TOKEN_INVALID) {
        return fail(self, "invalid token");
    }
    if (token == IWN_TOKEN_END && in_list(self)) {
        return fail(self, "']' expected");
    }
    return token == IWN_TOKEN_TEXT || token == IWN_TOKEN_SCALAR || fail(self, "unexpected token");
}

/// Checks a scalar; or opens objects and lists down to the first scalar or to an empty one.
static bool check_value(check_t *self, int token) {
    while (token == '{' || token == '[') {
        if (!open_container(self, &token)) {
            return !self->scan.failed;
        }
    }
    return check_scalar(self, token);
}

/// Checks the text behind a value of an object or list: its end, or a comma and the next value.
static bool check_next(check_t *self) {
    int token = iwn_scan_skip(&self->scan, ',') ? ',' : iwn_scan(&self->scan);
    if (token == closing(self)) {
        close_container(self);
        return true;
    }
    if (token != ',') {
        return fail(self, in_list(self) ? "']' expected" : "'}' expected");
    }
    token = iwn_scan(&self->scan);
    return (in_list(self) || check_name(self, &token)) && check_value(self, token);
}

static bool check_root(check_t *self, size_t length, iwn_json_t *out_root) {
    const int token = (length <= IWN_JSON_MAX) ? iwn_scan(&self->scan) : IWN_TOKEN_END;
    if (token != '{' && token != '[') {
        return fail(self, "'[' or '{' expected");
    }
    out_root->at = self->scan.token;
    bool good = check_value(self, token);
    while (good && self->depth > 0U) {
        good = check_next(self);
    }
    return good && (iwn_scan(&self->scan) == IWN_TOKEN_END || fail(self, "end of file expected"));
}

static check_t begin(const char *text, size_t length, iwn_text_t *fault) {
    return (check_t){.scan = {.text = text, .end = text + length, .at = text, .token = text, .fault = fault}};
}

bool iwn_json_check(const char *text, size_t length, iwn_work_t *work, iwn_json_t *out_root, iwn_text_t *fault) {
    check_t self = begin(text, length, fault);
    self.work = work;
    const bool good = check_root(&self, length, out_root);
    if (work != NULL) {
        work->names = self.names;
    }
    return good;
}

bool iwn_json_check_again(const char *text, size_t length, iwn_repeated_t *repeated, iwn_json_t *out_root,
                          iwn_text_t *fault) {
    check_t self = begin(text, length, fault);
    self.repeated = repeated;
    repeated->met = false;
    return check_root(&self, length, out_root);
}

// Walking a checked text ----------------------------------------------------------------------------------------------

static const char *skip_blanks(const char *at) {
    while ((unsigned char)*at <= ' ') {
        at++;
    }
    return at;
}

static const char *skip_text(const char *at) {
    while (*++at != '"') {
        at += (*at == '\\') ? 1 : 0;
    }
    return at + 1;
}

/// Returns the position behind a value. A brace differs from a bracket by 0x20.
static const char *skip_value(const char *at) {
    unsigned depth = 0;
    do {
        if (*at == '"') {
            at = skip_text(at);
            continue;
        }
        depth += ((*at | 0x20) == '{') ? 1U : 0U;
        depth -= ((*at | 0x20) == '}') ? 1U : 0U;
        at++;
        while (depth == 0U && *at > ' ' && *at != ',' && (*at | 0x20) != '}') {
            at++; // Inside a number or word.
        }
    } while (depth > 0U);
    return at;
}

iwn_json_kind_t iwn_json_kind(iwn_json_t value) {
    static const char first[] = {[IWN_JSON_OBJECT] = '{', [IWN_JSON_LIST] = '[',  [IWN_JSON_TEXT] = '"',
                                 [IWN_JSON_TRUE] = 't',   [IWN_JSON_FALSE] = 'f', [IWN_JSON_NULL] = 'n'};
    for (unsigned kind = 0; kind < sizeof first; kind++) {
        if (*value.at == first[kind]) {
            return (iwn_json_kind_t)kind;
        }
    }
    do {
        value.at++;
    } while (iwn_scan_is_digit(*value.at));
    return (*value.at == '.' || *value.at == 'e' || *value.at == 'E') ? IWN_JSON_REAL : IWN_JSON_INTEGER;
}

iwn_json_t iwn_json_inside(iwn_json_t container) {
    return (iwn_json_t){container.at + 1};
}

iwn_json_t iwn_json_root(const char *text) {
    return (iwn_json_t){skip_blanks(text)};
}

iwn_json_t iwn_json_name(const char *text, const iwn_work_t *work, unsigned index) {
    return (iwn_json_t){&text[work->name_at[index]] - 1};
}

iwn_json_t iwn_json_value(iwn_json_t name) {
    return (iwn_json_t){skip_blanks(skip_blanks(skip_text(name.at)) + 1)};
}

bool iwn_json_next(iwn_json_t *rest, iwn_json_t *out_name, iwn_json_t *out_value) {
    const char *at = skip_blanks(rest->at);
    if (*at == ',') {
        at = skip_blanks(at + 1);
    }
    if (*at == '}' || *at == ']') {
        return false;
    }
    if (out_name != NULL) {
        out_name->at = at;
        at = iwn_json_value(*out_name).at;
    }
    out_value->at = at;
    rest->at = skip_value(at);
    return true;
}

bool iwn_json_find(iwn_json_t object, const char *name, iwn_json_t *out_value) {
    iwn_json_t rest = iwn_json_inside(object);
    iwn_json_t found;
    while (*object.at == '{' && iwn_json_next(&rest, &found, out_value)) {
        if (iwn_json_is(found, name)) {
            return true;
        }
    }
    return false;
}

uint32_t iwn_json_character(iwn_json_t *rest) {
    return iwn_scan_character(&rest->at);
}

bool iwn_json_is(iwn_json_t value, const char *text) {
    if (*value.at != '"') {
        return false;
    }
    const char *at = value.at + 1;
    size_t bytes = 1;
    for (; *text != '\0'; text += bytes) {
        if (*at == '\\') {
            if (iwn_scan_character(&at) != iwn_plain_read(text, &bytes)) {
                return false;
            }
        } else if (*at == *text && *at != '"') { // UTF-8 is equal byte by byte.
            at++;
            bytes = 1;
        } else {
            return false;
        }
    }
    return *at == '"';
}

bool iwn_json_text(iwn_json_t value, char *out_text, size_t size) {
    const char *at = value.at;
    if (*at != '"') {
        return false;
    }
    at++;
    while (*at != '"') {
        char bytes[4];
        const char *from = at;
        size_t length = 1; // Characters without an escape are copied byte by byte.
        if (*at == '\\') {
            length = iwn_utf8(iwn_scan_character(&at), bytes);
            from = bytes;
        } else {
            at++;
        }
        if (length >= size) {
            return false;
        }
        memcpy(out_text, from, length);
        out_text += length;
        size -= length;
    }
    *out_text = '\0';
    return true;
}

int64_t iwn_json_integer(iwn_json_t value) {
    const bool negative = *value.at == '-';
    uint64_t number = 0;
    for (const char *c = value.at + (negative ? 1 : 0); iwn_scan_is_digit(*c); c++) {
        number = number * 10U + (unsigned)(*c - '0');
    }
    return (int64_t)(negative ? 0U - number : number);
}
