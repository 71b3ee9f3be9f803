// SPDX-License-Identifier: MIT
// The gateway's reader of requests until version 0.1, on jansson, with the requests that were added later, and with stops that nothing in the object
// makes invalid: the new reader must return the same results. For tests only.
#include "old_reader.h"

#include "iwheel_northbound/text.h"

#include <inttypes.h>
#include <jansson.h>
#include <stdalign.h>
#include <stdarg.h>
#include <stdio.h>
#include <string.h>

static alignas(max_align_t) uint8_t arena[524288];
static size_t used;

static void *arena_take(size_t size) {
    const size_t step = alignof(max_align_t);
    if (size > sizeof arena) {
        return NULL;
    }
    const size_t rounded = (size + step - 1U) / step * step;
    if (rounded > sizeof arena - used) {
        return NULL;
    }
    void *block = &arena[used];
    used += rounded;
    return block;
}

static void arena_leave(void *block) {
    (void)block; // json_arena_reset releases everything together.
}

static void install(void) {
    json_set_alloc_funcs(arena_take, arena_leave);
    json_object_seed(0);
}

typedef enum {
    FIELD_INTEGER,
    FIELD_RATE,
    FIELD_TEXT,
    FIELD_FLAG,
    FIELD_TOPICS,
    FIELD_SIDE,
    FIELD_ITEM,
    FIELD_VALUE
} field_kind_t;

/// A field of some commands. `cmd` and `id` are common to all and handled separately.
typedef struct {
    const char *name;
    size_t offset;    ///< Offset of the value in iwn_request_t.
    size_t max;       ///< Maximum length of a text in bytes.
    uint32_t allowed; ///< One bit per iwn_cmd_t.
    bool required;
    field_kind_t kind;
} field_t;

#define BIT(cmd)   (1U << (cmd))
#define IN(member) offsetof(iwn_request_t, member)

static const field_t fields[] = {
    {"left_mm_s", IN(left_mm_s), 0, BIT(IWN_CMD_DRIVE), true, FIELD_INTEGER},
    {"right_mm_s", IN(right_mm_s), 0, BIT(IWN_CMD_DRIVE), true, FIELD_INTEGER},
    {"left_mA", IN(left_mA), 0, BIT(IWN_CMD_DRIVE), false, FIELD_INTEGER},
    {"right_mA", IN(right_mA), 0, BIT(IWN_CMD_DRIVE), false, FIELD_INTEGER},
    {"v_mm_s", IN(v_mm_s), 0, BIT(IWN_CMD_TWIST), true, FIELD_INTEGER},
    {"yaw_mrad_s", IN(yaw_mrad_s), 0, BIT(IWN_CMD_TWIST), true, FIELD_INTEGER},
    {"topics", IN(topics), 0, BIT(IWN_CMD_WATCH), true, FIELD_TOPICS},
    {"rate_hz", IN(rate_hz), 0, BIT(IWN_CMD_WATCH), false, FIELD_RATE},
    {"name", IN(name), IWN_NAME_MAX, BIT(IWN_CMD_ARM), false, FIELD_TEXT},
    {"takeover", IN(takeover), 0, BIT(IWN_CMD_ARM), false, FIELD_FLAG},
    {"t_us", IN(t_us), 0, BIT(IWN_CMD_ARM) | BIT(IWN_CMD_RESET) | BIT(IWN_CMD_RELEASE) | BIT(IWN_CMD_CONFIRM), false,
     FIELD_INTEGER},
    {"stop", IN(stop), 0, BIT(IWN_CMD_RESET), false, FIELD_INTEGER},
    {"key", IN(lease_key), IWN_LEASE_KEY_MAX, BIT(IWN_CMD_DRIVE) | BIT(IWN_CMD_TWIST), false, FIELD_TEXT},
    {"reason", IN(reason), IWN_REASON_MAX, BIT(IWN_CMD_ESTOP), false, FIELD_TEXT},
    {"side", IN(sides), 0, BIT(IWN_CMD_TARE), false, FIELD_SIDE},
    {"item", IN(item), 0, BIT(IWN_CMD_CONFIRM), true, FIELD_ITEM},
    {"value", IN(value), IWN_VALUE_SIZE - 1U, BIT(IWN_CMD_CONFIRM) | BIT(IWN_CMD_CONFIG), false, FIELD_VALUE},
    {"how", IN(how), IWN_HOW_SIZE - 1U, BIT(IWN_CMD_CONFIRM), false, FIELD_TEXT},
    {"name", IN(file), IWN_FILE_MAX, BIT(IWN_CMD_RECORDING), true, FIELD_TEXT},
    {"offset", IN(offset), 0, BIT(IWN_CMD_RECORDING), false, FIELD_INTEGER},
    {"on", IN(on), 0, BIT(IWN_CMD_RECORD), true, FIELD_FLAG},
    {"key", IN(key), IWN_KEY_MAX, BIT(IWN_CMD_CONFIG), false, FIELD_TEXT},
    {"commit", IN(commit), 0, BIT(IWN_CMD_CONFIG), false, FIELD_FLAG},
};
#define FIELDS (sizeof fields / sizeof fields[0])

// The names are those of the description: test/northbound and the unit tests judge them.
#define NAME(cmd, name) #name,
#define WORD(cmd, name) " " #name
static const char *const cmd_names[IWN_CMDS] = {IWN_REQUEST_NAMES(NAME)};

__attribute__((format(printf, 3, 4))) static bool refuse(iwn_refusal_t *out_refusal, iwn_error_t error,
                                                         const char *format, ...) {
    va_list arguments;
    va_start(arguments, format);
    out_refusal->error = error;
    (void)vsnprintf(out_refusal->message, sizeof out_refusal->message, format, arguments);
    va_end(arguments);
    return false;
}

/// Nesting is counted before jansson recurses. Brackets in texts do not count.
static bool too_deep(const char *line, size_t length) {
    unsigned depth = 0;
    bool in_text = false;
    for (size_t i = 0; i < length; i++) {
        const char c = line[i];
        if (in_text) {
            in_text = c != '"';
            i += (c == '\\') ? 1U : 0U;
        } else if (c == '"') {
            in_text = true;
        } else if (c == '{' || c == '[') {
            if (++depth > IWN_DEPTH_MAX) {
                return true;
            }
        } else if ((c == '}' || c == ']') && depth > 0U) {
            depth--;
        }
    }
    return false;
}

/// True if the text is short enough and has no special characters. jansson has checked the UTF-8 and refuses \u0000.
static bool is_plain(const char *text, size_t max) {
    return strlen(text) <= max && iwn_plain_text(text);
}

/// Returns the text if a message may quote it: no text that could be cut inside a character.
static const char *quotable(const char *text, const char *otherwise) {
    for (const char *c = text; *c != '\0'; c++) {
        if (*c < 0x20 || *c > 0x7E) {
            return otherwise;
        }
    }
    return text;
}

static bool read_text(const field_t *field, const json_t *value, char *target, iwn_refusal_t *out_refusal) {
    const char *text = json_string_value(value);
    if (text == NULL || *text == '\0' || !is_plain(text, field->max)) {
        return refuse(
            out_refusal, IWN_BAD_VALUE,
            "%s must be a text of 1 to %zu bytes without characters that move a terminal (control characters, "
            "line separators, marks of writing direction)",
            field->name, field->max);
    }
    memcpy(target, text, strlen(text) + 1U);
    return true;
}

static bool read_integer(const field_t *field, const json_t *value, int64_t *target, iwn_refusal_t *out_refusal) {
    if (!json_is_integer(value)) {
        return refuse(out_refusal, IWN_BAD_VALUE, "%s must be an integer: no fraction, no exponent, no quotes",
                      field->name);
    }
    *target = json_integer_value(value);
    if (field->kind == FIELD_RATE && *target < 1) {
        return refuse(out_refusal, IWN_OUT_OF_RANGE, "%s must be at least 1; to end watching send an empty topics list",
                      field->name);
    }
    return true;
}

static bool read_topics(const json_t *value, uint8_t *target, iwn_refusal_t *out_refusal) {
    static const char advice[] = "topics must be a list of these words: state bus estop lease stop force frame";
    if (!json_is_array(value)) {
        return refuse(out_refusal, IWN_BAD_VALUE, "%s", advice);
    }
    for (size_t i = 0; i < json_array_size(value); i++) {
        const char *word = json_string_value(json_array_get(value, i));
        unsigned topic = 0;
        while (word != NULL && topic < IWN_TOPICS && strcmp(word, iwn_topic_name((iwn_topic_t)topic)) != 0) {
            topic++;
        }
        if (word == NULL || topic == IWN_TOPICS) {
            return refuse(out_refusal, IWN_BAD_VALUE, "%s", advice);
        }
        *target |= (uint8_t)(1U << topic);
    }
    return true;
}

static bool read_side(const json_t *value, uint8_t *target, iwn_refusal_t *out_refusal) {
    const char *word = json_string_value(value);
    if (word != NULL && strcmp(word, "left") == 0) {
        *target = IW_SIDES_LEFT;
    } else if (word != NULL && strcmp(word, "right") == 0) {
        *target = IW_SIDES_RIGHT;
    } else {
        return refuse(out_refusal, IWN_BAD_VALUE, "side must be \"left\" or \"right\"; leave it out for both");
    }
    return true;
}

static bool read_item(const json_t *value, iw_assumption_item_t *target, iwn_refusal_t *out_refusal) {
    const char *name = json_string_value(value);
    if (name == NULL || !iwn_assumption_item_of(name, target)) {
        return refuse(out_refusal, IWN_BAD_VALUE,
                      "item must be one of the ledger's, for example \"wheel_radius\"; see them all: iwheelctl ledger");
    }
    return true;
}

/// A number becomes its digits, so that 192 and "192" are the same.
static bool read_value(const field_t *field, const json_t *value, char *target, iwn_refusal_t *out_refusal) {
    if (json_is_integer(value)) {
        (void)snprintf(target, IWN_VALUE_SIZE, "%" PRId64, (int64_t)json_integer_value(value));
        return true;
    }
    return read_text(field, value, target, out_refusal);
}

static bool read_flag(const field_t *field, const json_t *value, bool *target, iwn_refusal_t *out_refusal) {
    if (!json_is_boolean(value)) {
        return refuse(out_refusal, IWN_BAD_VALUE, "%s must be true or false", field->name);
    }
    *target = json_is_true(value);
    return true;
}

static bool read_field(const field_t *field, const json_t *value, iwn_request_t *request, iwn_refusal_t *out_refusal) {
    void *target = (char *)request + field->offset;
    switch (field->kind) {
    case FIELD_TEXT:
        return read_text(field, value, (char *)target, out_refusal);
    case FIELD_FLAG:
        return read_flag(field, value, (bool *)target, out_refusal);
    case FIELD_TOPICS:
        return read_topics(value, (uint8_t *)target, out_refusal);
    case FIELD_SIDE:
        return read_side(value, (uint8_t *)target, out_refusal);
    case FIELD_ITEM:
        return read_item(value, (iw_assumption_item_t *)target, out_refusal);
    case FIELD_VALUE:
        return read_value(field, value, (char *)target, out_refusal);
    case FIELD_INTEGER:
    case FIELD_RATE:
    default:
        return read_integer(field, value, (int64_t *)target, out_refusal);
    }
}

static bool read_id(const json_t *root, iwn_id_t *out_id, iwn_refusal_t *out_refusal) {
    const json_t *value = json_object_get(root, "id");
    const char *text = json_string_value(value);
    if (json_is_integer(value)) {
        *out_id = (iwn_id_t){.kind = IWN_ID_NUMBER, .number = json_integer_value(value)};
    } else if (text != NULL && is_plain(text, IWN_ID_TEXT_MAX)) {
        out_id->kind = IWN_ID_TEXT;
        memcpy(out_id->text, text, strlen(text) + 1U);
    } else if (value != NULL) {
        return refuse(out_refusal, IWN_BAD_VALUE,
                      "id must be an integer or a text of at most %u bytes without characters that move a terminal "
                      "(control characters, line separators, marks of writing direction)",
                      IWN_ID_TEXT_MAX);
    }
    return true;
}

static bool read_cmd(const json_t *root, iwn_cmd_t *out_cmd, iwn_refusal_t *out_refusal) {
    const json_t *value = json_object_get(root, "cmd");
    const char *name = json_string_value(value);
    if (value == NULL) {
        return refuse(out_refusal, IWN_MISSING_FIELD, "a request needs cmd, for example {\"cmd\":\"status\"}");
    }
    if (name == NULL) {
        return refuse(out_refusal, IWN_BAD_VALUE, "cmd must be a text, for example {\"cmd\":\"status\"}");
    }
    for (unsigned i = 0; i < IWN_CMDS; i++) {
        if (strcmp(name, cmd_names[i]) == 0) {
            *out_cmd = (iwn_cmd_t)i;
            return true;
        }
    }
    return refuse(out_refusal, IWN_UNKNOWN_CMD, "cmd must be one of" IWN_REQUEST_NAMES(WORD));
}

static const field_t *find_field(const char *name, iwn_cmd_t cmd) {
    for (size_t i = 0; i < FIELDS; i++) {
        if ((fields[i].allowed & BIT(cmd)) != 0U && strcmp(name, fields[i].name) == 0) {
            return &fields[i];
        }
    }
    return NULL;
}

static bool is_stop(const iwn_request_t *request) {
    return request->cmd == IWN_CMD_STOP || request->cmd == IWN_CMD_DISARM || request->cmd == IWN_CMD_ESTOP;
}

/// Reads the part of a text that can be used: the characters that fit, and spaces for the others.
static void read_usable(const char *text, char *target, size_t max) {
    size_t bytes;
    for (size_t length = 0; text != NULL && *text != '\0'; length += bytes, text += bytes) {
        const bool plain = iwn_plain_is(iwn_plain_read(text, &bytes));
        if (length + bytes > max) {
            return;
        }
        memset(&target[length], ' ', bytes);
        memcpy(&target[length], text, plain ? bytes : 0U);
    }
}

/// Judges every field of the request: known and valid.
static bool read_fields(json_t *root, iwn_request_t *request, iwn_refusal_t *out_refusal) {
    if (is_stop(request)) {
        const json_t *reason = (request->cmd == IWN_CMD_ESTOP) ? json_object_get(root, "reason") : NULL;
        read_usable(json_string_value(reason), request->reason, IWN_REASON_MAX);
        return true;
    }
    for (void *it = json_object_iter(root); it != NULL; it = json_object_iter_next(root, it)) {
        const char *name = json_object_iter_key(it);
        if (strcmp(name, "id") == 0 || strcmp(name, "cmd") == 0) {
            continue;
        }
        const field_t *field = find_field(name, request->cmd);
        if (field == NULL) {
            return refuse(out_refusal, IWN_UNKNOWN_FIELD, "%s has no field \"%.64s\"; leave it out",
                          cmd_names[request->cmd], quotable(name, "?"));
        }
        if (!read_field(field, json_object_iter_value(it), request, out_refusal)) {
            return false;
        }
    }
    return true;
}

/// Judges whether every required field is present.
static bool is_complete(const json_t *root, const iwn_request_t *request, iwn_refusal_t *out_refusal) {
    for (size_t i = 0; i < FIELDS; i++) {
        const bool needed = fields[i].required && (fields[i].allowed & BIT(request->cmd)) != 0U;
        if (needed && json_object_get(root, fields[i].name) == NULL) {
            return refuse(out_refusal, IWN_MISSING_FIELD, "%s needs %s", cmd_names[request->cmd], fields[i].name);
        }
    }
    if ((json_object_get(root, "left_mA") == NULL) != (json_object_get(root, "right_mA") == NULL)) {
        return refuse(out_refusal, IWN_MISSING_FIELD, "send both left_mA and right_mA, or neither");
    }
    return true;
}

/// Removes the name of an option of jansson, which has no meaning for a client.
static void drop_option(char *text) {
    static const char option[] = " without JSON_ALLOW_NUL";
    char *const found = strstr(text, option);
    if (found != NULL) {
        memmove(found, &found[sizeof option - 1U], strlen(&found[sizeof option - 1U]) + 1U);
    }
}

bool old_request_read(const char *line, size_t length, iwn_request_t *out_request, iwn_refusal_t *out_refusal) {
    *out_request = (iwn_request_t){.rate_hz = IWN_RATE_DEFAULT_HZ, .sides = IW_SIDES_BOTH};
    if (length > IWN_LINE_MAX) {
        return refuse(out_refusal, IWN_LINE_TOO_LONG, "a request has at most %u bytes; end each with a newline",
                      IWN_LINE_MAX);
    }
    if (too_deep(line, length)) {
        return refuse(out_refusal, IWN_BAD_JSON, "nested more than %u deep", IWN_DEPTH_MAX);
    }
    json_error_t error;
    static bool installed;
    if (!installed) {
        install();
        installed = true;
    }
    used = 0;
    json_t *root = json_loadb(line, length, JSON_REJECT_DUPLICATES, &error);
    drop_option(error.text);
    if (!json_is_object(root)) {
        const char *reason = (root == NULL) ? error.text : "it is not an object";
        return refuse(out_refusal, IWN_BAD_JSON, "not one JSON object on one line: %s", quotable(reason, "unreadable"));
    }
    const bool known = read_cmd(root, &out_request->cmd, out_refusal);
    const bool good = read_id(root, &out_request->id, out_refusal);
    if (!known || !(good || is_stop(out_request)) || !read_fields(root, out_request, out_refusal)) {
        return false;
    }
    if (is_stop(out_request)) {
        return true; // Its other fields are ignored.
    }
    if (!is_complete(root, out_request, out_refusal)) {
        return false;
    }
    out_request->has_current = json_object_get(root, "left_mA") != NULL;
    out_request->has_commit = json_object_get(root, "commit") != NULL;
    out_request->has_t_us = json_object_get(root, "t_us") != NULL;
    out_request->has_stop = json_object_get(root, "stop") != NULL;
    return true;
}
