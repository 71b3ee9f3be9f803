// SPDX-License-Identifier: MIT
#include "iwheel_northbound/request.h"

#include "json_scan.h"

#include <string.h>

typedef enum { INTEGER, RATE, TEXT, FLAG, TOPICS, SIDE, ITEM, VALUE } field_kind_t;

/// A field of some commands. `cmd` and `id` are common to all and handled separately.
typedef struct {
    const char *name;
    uint32_t allowed : 24; ///< Bit mask of iwn_cmd_t.
    uint32_t kind : 7;     ///< field_kind_t
    uint32_t required : 1;
    uint16_t offset; ///< Offset of the value in iwn_request_t.
    uint16_t max;    ///< Largest size of a text in bytes.
} field_t;

/// A checked line, and the names in it that all requests have.
typedef struct {
    const char *line;
    const iwn_work_t *work;
    iwn_json_t id;  ///< NULL if there is none.
    iwn_json_t cmd; ///< NULL if there is none.
} members_t;

#define BIT(cmd) (1U << IWN_CMD_##cmd)
#define ROW(name, member, kind, bytes, required, allowed)                                                              \
    {#name, allowed, kind, required, offsetof(iwn_request_t, member), bytes},
#define INDEX(name, member, kind, bytes, required, allowed) FIELD_##member,
#define HAS_ROOM(name, member, kind, bytes, required, allowed)                                                         \
    &&((bytes) == 0 || sizeof(((iwn_request_t *)0)->member) == (bytes) + 1U)
#define NAME(cmd, name) #name,

static const field_t fields[] = {IWN_REQUEST_FIELDS(ROW)};
enum { IWN_REQUEST_FIELDS(INDEX) FIELDS };

static const char *const cmd_names[] = {IWN_REQUEST_NAMES(NAME)};
IW_STATIC_ASSERT(true IWN_REQUEST_FIELDS(HAS_ROOM), room_for_each_text_and_its_terminator);
IW_STATIC_ASSERT(IWN_DEPTH_MAX == 8U, a_message_of_iwn_json_check_has_this_number);
IW_STATIC_ASSERT(IWN_CMDS <= 24 && FIELDS <= 32, a_bit_for_each_command_and_each_field);

#define NOT_PLAIN                                                                                                      \
    " without characters that move a terminal (control characters, line separators, marks of writing direction)"

#define EXAMPLE ", for example {\"cmd\":\"status\"}"

#define NUMBER_SIZE (IWN_DIGITS_MAX + 1U)

bool iwn_cmd_watches(iwn_cmd_t cmd) {
    const unsigned watching = BIT(HELLO) | BIT(STATUS) | BIT(WATCH) | BIT(WHY) | BIT(STOP) | BIT(DISARM) | BIT(ESTOP) |
                              BIT(RECORDINGS) | BIT(RECORDING) | BIT(RECORD);
    return (watching & 1U << cmd) != 0U;
}

bool iwn_cmd_stops(iwn_cmd_t cmd) {
    return (cmd == IWN_CMD_STOP) || (cmd == IWN_CMD_DISARM) || (cmd == IWN_CMD_ESTOP);
}

static const char *number(int64_t value, char out_digits[NUMBER_SIZE]) {
    iwn_text_t text = iwn_text_begin(out_digits, NUMBER_SIZE);
    iwn_text_int(&text, value);
    return out_digits;
}

bool iwn_refuse(iwn_refusal_t *out_refusal, iwn_error_t error, const char *const *texts) {
    iwn_text_t message = iwn_text_begin(out_refusal->message, sizeof out_refusal->message);
    out_refusal->error = error;
    iwn_text_join(&message, texts);
    return false;
}

/// Does the same, with a list of words at the end.
static bool refuse_but(iwn_refusal_t *out_refusal, iwn_error_t error, const char *text, const char *(*word)(unsigned)) {
    iwn_text_t message = iwn_text_begin(out_refusal->message, sizeof out_refusal->message);
    out_refusal->error = error;
    iwn_text_add(&message, text);
    for (unsigned i = 0; word(i) != NULL; i++) {
        IWN_TEXT_JOIN(&message, " ", word(i));
    }
    return false;
}

static const char *cmd_word(unsigned index) {
    return (index < IWN_CMDS) ? cmd_names[index] : NULL;
}

static const char *topic_word(unsigned index) {
    return (index < IWN_TOPICS) ? iwn_topic_name((iwn_topic_t)index) : NULL;
}

/// Returns the index of the word, or the number of words if it is none of them.
static unsigned find_word(iwn_json_t value, const char *(*word)(unsigned)) {
    unsigned i = 0;
    while (word(i) != NULL && !iwn_json_is(value, word(i))) {
        i++;
    }
    return i;
}

static bool read_text(const field_t *field, iwn_json_t value, char *target, iwn_refusal_t *out_refusal) {
    char digits[NUMBER_SIZE];
    if (!iwn_json_text(value, target, field->max + 1U) || *target == '\0' || !iwn_plain_text(target)) {
        return IWN_REFUSE(out_refusal, IWN_BAD_VALUE, field->name, " must be a text of 1 to ",
                          number(field->max, digits), " bytes", NOT_PLAIN);
    }
    return true;
}

static bool read_integer(const field_t *field, iwn_json_t value, int64_t *target, iwn_refusal_t *out_refusal) {
    if (iwn_json_kind(value) != IWN_JSON_INTEGER) {
        return IWN_REFUSE(out_refusal, IWN_BAD_VALUE, field->name,
                          " must be an integer: no fraction, no exponent, no quotes");
    }
    *target = iwn_json_integer(value);
    if (field->kind == RATE && *target < 1) {
        return IWN_REFUSE(out_refusal, IWN_OUT_OF_RANGE, field->name,
                          " must be at least 1; to end watching send an empty topics list");
    }
    return true;
}

static bool read_topics(iwn_json_t value, uint8_t *target, iwn_refusal_t *out_refusal) {
    bool good = iwn_json_kind(value) == IWN_JSON_LIST;
    iwn_json_t rest = iwn_json_inside(value);
    while (good && iwn_json_next(&rest, NULL, &value)) {
        const unsigned topic = find_word(value, topic_word);
        good = topic < IWN_TOPICS;
        *target |= (uint8_t)(1U << topic);
    }
    return good || refuse_but(out_refusal, IWN_BAD_VALUE, "topics must be a list of these words:", topic_word);
}

static bool read_side(iwn_json_t value, uint8_t *target, iwn_refusal_t *out_refusal) {
    if (iwn_json_is(value, "left")) {
        *target = IW_SIDES_LEFT;
    } else if (iwn_json_is(value, "right")) {
        *target = IW_SIDES_RIGHT;
    } else {
        return IWN_REFUSE(out_refusal, IWN_BAD_VALUE, "side must be \"left\" or \"right\"; leave it out for both");
    }
    return true;
}

static bool read_item(iwn_json_t value, iw_assumption_item_t *target, iwn_refusal_t *out_refusal) {
    for (unsigned item = 0; item < IW_ASSUMPTION_ITEMS; item++) {
        if (iwn_json_is(value, iwn_assumption_item_name((iw_assumption_item_t)item))) {
            *target = (iw_assumption_item_t)item;
            return true;
        }
    }
    return IWN_REFUSE(out_refusal, IWN_BAD_VALUE,
                      "item must be one of the ledger's, for example \"wheel_radius\"; see them all: iwheelctl ledger");
}

/// A number is stored as digits, so that 192 and "192" are equal.
static bool read_value(const field_t *field, iwn_json_t value, char *target, iwn_refusal_t *out_refusal) {
    if (iwn_json_kind(value) != IWN_JSON_INTEGER) {
        return read_text(field, value, target, out_refusal);
    }
    iwn_text_t text = iwn_text_begin(target, field->max + 1U);
    iwn_text_int(&text, iwn_json_integer(value));
    return true;
}

static bool read_flag(const field_t *field, iwn_json_t value, bool *target, iwn_refusal_t *out_refusal) {
    const iwn_json_kind_t kind = iwn_json_kind(value);
    *target = kind == IWN_JSON_TRUE;
    return *target || kind == IWN_JSON_FALSE ||
           IWN_REFUSE(out_refusal, IWN_BAD_VALUE, field->name, " must be true or false");
}

static bool read_field(const field_t *field, iwn_json_t value, iwn_request_t *request, iwn_refusal_t *out_refusal) {
    void *const target = (char *)request + field->offset;
    switch (field->kind) {
    case TEXT:
        return read_text(field, value, (char *)target, out_refusal);
    case FLAG:
        return read_flag(field, value, (bool *)target, out_refusal);
    case TOPICS:
        return read_topics(value, (uint8_t *)target, out_refusal);
    case SIDE:
        return read_side(value, (uint8_t *)target, out_refusal);
    case ITEM:
        return read_item(value, (iw_assumption_item_t *)target, out_refusal);
    case VALUE:
        return read_value(field, value, (char *)target, out_refusal);
    case INTEGER:
    case RATE:
    default:
        return read_integer(field, value, (int64_t *)target, out_refusal);
    }
}

static bool read_id(iwn_json_t value, iwn_id_t *out_id, iwn_refusal_t *out_refusal) {
    char digits[NUMBER_SIZE];
    if (iwn_json_kind(value) == IWN_JSON_INTEGER) {
        *out_id = (iwn_id_t){.kind = IWN_ID_NUMBER, .number = iwn_json_integer(value)};
        return true;
    }
    if (iwn_json_text(value, out_id->text, sizeof out_id->text) && iwn_plain_text(out_id->text)) {
        out_id->kind = IWN_ID_TEXT;
        return true;
    }
    return IWN_REFUSE(out_refusal, IWN_BAD_VALUE, "id must be an integer or a text of at most ",
                      number(IWN_ID_TEXT_MAX, digits), " bytes", NOT_PLAIN);
}

static bool read_cmd(iwn_json_t name, iwn_cmd_t *out_cmd, iwn_refusal_t *out_refusal) {
    if (name.at == NULL) {
        return IWN_REFUSE(out_refusal, IWN_MISSING_FIELD, "a request needs cmd", EXAMPLE);
    }
    const iwn_json_t value = iwn_json_value(name);
    if (iwn_json_kind(value) != IWN_JSON_TEXT) {
        return IWN_REFUSE(out_refusal, IWN_BAD_VALUE, "cmd must be a text", EXAMPLE);
    }
    const unsigned cmd = find_word(value, cmd_word);
    if (cmd == IWN_CMDS) {
        return refuse_but(out_refusal, IWN_UNKNOWN_CMD, "cmd must be one of", cmd_word);
    }
    *out_cmd = (iwn_cmd_t)cmd;
    return true;
}

/// Returns the name of a member; `at` is NULL if there is none.
static iwn_json_t find_name(const members_t *members, const char *text) {
    for (unsigned i = 0; i < members->work->names; i++) {
        const iwn_json_t name = iwn_json_name(members->line, members->work, i);
        if (iwn_json_is(name, text)) {
            return name;
        }
    }
    return (iwn_json_t){NULL};
}

/// Reads the members that all requests have, at any place in the object.
static bool read_common(members_t *members, iwn_request_t *request, iwn_refusal_t *out_refusal) {
    members->id = find_name(members, "id");
    members->cmd = find_name(members, "cmd");
    const bool known = read_cmd(members->cmd, &request->cmd, out_refusal);
    // The refusal of the id replaces that of the command.
    const bool good = members->id.at == NULL || read_id(iwn_json_value(members->id), &request->id, out_refusal);
    return known && (good || iwn_cmd_stops(request->cmd));
}

static const field_t *find_field(iwn_json_t name, iwn_cmd_t cmd) {
    for (unsigned i = 0; i < FIELDS; i++) {
        if ((fields[i].allowed & 1U << cmd) != 0U && iwn_json_is(name, fields[i].name)) {
            return &fields[i];
        }
    }
    return NULL;
}

/// Reports an unknown name with up to 64 characters, if all of them can be shown.
static bool refuse_unknown(iwn_cmd_t cmd, iwn_json_t name, iwn_refusal_t *out_refusal) {
    iwn_text_t message = iwn_text_begin(out_refusal->message, sizeof out_refusal->message);
    iwn_json_t rest = iwn_json_inside(name);
    out_refusal->error = IWN_UNKNOWN_FIELD;
    IWN_TEXT_JOIN(&message, cmd_names[cmd], " has no field \"");
    const size_t begin = message.length;
    for (uint32_t c = iwn_json_character(&rest); c != 0U; c = iwn_json_character(&rest)) {
        const char character = (char)c;
        if (c < 0x20U || c > 0x7EU) {
            message.length = begin;
            iwn_text_add(&message, "?");
            break;
        }
        iwn_text_span(&message, &character, (message.length < begin + 64U) ? 1U : 0U);
    }
    iwn_text_add(&message, "\"; leave it out");
    return false;
}

/// Reads the fields. If one is unknown or invalid, the refusal names the first of these in the line. `*out_seen` has a
/// bit for each field. A stop ignores such fields; of an invalid reason it has the usable part.
static bool read_fields(const members_t *members, iwn_request_t *request, uint32_t *out_seen,
                        iwn_refusal_t *out_refusal) {
    iwn_json_t wrong = {NULL};
    bool unknown = false;
    for (unsigned i = 0; i < members->work->names; i++) {
        const iwn_json_t name = iwn_json_name(members->line, members->work, i);
        if (name.at == members->id.at || name.at == members->cmd.at || (wrong.at != NULL && name.at > wrong.at)) {
            continue;
        }
        const field_t *const field = find_field(name, request->cmd);
        if (field != NULL && read_field(field, iwn_json_value(name), request, out_refusal)) {
            *out_seen |= 1U << (field - fields);
        } else if (iwn_cmd_stops(request->cmd)) {
            iwn_plain_blank(request->reason);
        } else {
            wrong = name;
            unknown = field == NULL;
        }
    }
    if (unknown) {
        return refuse_unknown(request->cmd, wrong, out_refusal);
    }
    return wrong.at == NULL;
}

/// Checks that every required field is there.
static bool is_complete(uint32_t seen, iwn_request_t *request, iwn_refusal_t *out_refusal) {
    for (unsigned i = 0; i < FIELDS; i++) {
        const bool needed = fields[i].required != 0U && (fields[i].allowed & 1U << request->cmd) != 0U;
        if (needed && (seen & 1U << i) == 0U) {
            return IWN_REFUSE(out_refusal, IWN_MISSING_FIELD, cmd_names[request->cmd], " needs ", fields[i].name);
        }
    }
    request->has_current = (seen & 1U << FIELD_left_mA) != 0U;
    request->has_commit = (seen & 1U << FIELD_commit) != 0U;
    request->has_t_us = (seen & 1U << FIELD_t_us) != 0U;
    request->has_stop = (seen & 1U << FIELD_stop) != 0U;
    if (request->has_current != ((seen & 1U << FIELD_right_mA) != 0U)) {
        return IWN_REFUSE(out_refusal, IWN_MISSING_FIELD, "send both left_mA and right_mA, or neither");
    }
    return true;
}

/// Checks that the line is one valid object.
static bool read_line(const char *line, size_t length, iwn_work_t *work, iwn_text_t *message) {
    iwn_json_t root;
    iwn_text_add(message, "not one JSON object on one line: ");
    if (iwn_json_check(line, length, work, &root, message)) {
        iwn_text_add(message, "it is not an object");
        return iwn_json_kind(root) == IWN_JSON_OBJECT;
    }
    return false;
}

/// Finds a stop in a refused line. The scanner reads from one `"cmd"` to the next one at most, so the cost grows with
/// the length.
static bool find_stop(const char *line, size_t length, iwn_request_t *out_request, iwn_text_t *message) {
    static const char name[] = "\"cmd\"";
    iwn_scan_t scan = {.end = line + length, .failed = true};
    for (; length >= sizeof name - 1U; length--, line++) {
        scan.at = line + sizeof name - 1U;
        if (memcmp(line, name, sizeof name - 1U) == 0 && iwn_scan(&scan) == ':' && iwn_scan(&scan) == IWN_TOKEN_TEXT) {
            const iwn_cmd_t cmd = (iwn_cmd_t)find_word((iwn_json_t){scan.token}, cmd_word);
            if (iwn_cmd_stops(cmd) && cmd > out_request->cmd) {
                out_request->cmd = cmd;
                out_request->refused = IWN_BAD_JSON;
            }
        }
    }
    if (out_request->refused == IWN_OK) {
        return false;
    }
    iwn_text_add(message, "; its stop is executed");
    return true;
}

bool iwn_request_read_short(const char *line, size_t length, iwn_work_t *work, iwn_request_t *out_request,
                            iwn_refusal_t *out_refusal) {
    const iwn_request_t request = {.rate_hz = IWN_RATE_DEFAULT_HZ, .sides = IW_SIDES_BOTH};
    members_t members = {.line = line, .work = work};
    uint32_t seen = 0;
    iwn_text_t message = iwn_text_begin(out_refusal->message, sizeof out_refusal->message);
    *out_request = request;
    out_refusal->error = IWN_BAD_JSON;
    if (!read_line(line, length, work, &message)) {
        return find_stop(line, length, out_request, &message);
    }
    return read_common(&members, out_request, out_refusal) && read_fields(&members, out_request, &seen, out_refusal) &&
           is_complete(seen, out_request, out_refusal);
}

bool iwn_request_read(const char *line, size_t length, iwn_work_t *work, iwn_request_t *out_request,
                      iwn_refusal_t *out_refusal) {
    if (length <= IWN_LINE_MAX) {
        return iwn_request_read_short(line, length, work, out_request, out_refusal);
    }
    iwn_text_t message = iwn_text_begin(out_refusal->message, sizeof out_refusal->message);
    *out_request = (iwn_request_t){.cmd = IWN_CMD_HELLO};
    out_refusal->error = IWN_LINE_TOO_LONG;
    iwn_text_add(&message, "a request has at most ");
    iwn_text_int(&message, IWN_LINE_MAX);
    iwn_text_add(&message, " bytes; end each with a newline");
    if (!find_stop(line, length, out_request, &message)) {
        return false;
    }
    out_request->refused = IWN_LINE_TOO_LONG;
    return true;
}
