// SPDX-License-Identifier: MIT
#include "iwheel_northbound/json_in.h"

#include <string.h>

/// No more of a wrong token than this is repeated.
#define NEAR_MAX 20U
/// The decimal exponent of the largest double.
#define REAL_EXPONENT_MAX 308
/// No exponent beyond it means anything else, however many digits come before.
#define EXPONENT_FAR 1000000

/// What was read: a punctuation mark as itself, or one of these.
enum { END = 0, INVALID = 1, TEXT = '"', SCALAR = '0' };

/// What `peek` finds other than a byte.
enum { PEEK_END = -1, PEEK_BROKEN = -2 };

typedef struct {
    const char *text;
    const char *end;
    const char *at;    ///< What comes next.
    const char *token; ///< Where the token begins that `at` is in, or behind.
    iwn_text_t *fault;
    uint16_t *name_at;
    unsigned names;                ///< Of all objects that are open.
    uint16_t first[IWN_DEPTH_MAX]; ///< The first of them, per object.
    bool is_list[IWN_DEPTH_MAX];
    unsigned depth;
    bool failed;  ///< The first reason is told, no later one.
    bool has_nul; ///< The token is a text with \u0000 in it.
} check_t;

static bool is_digit(int c) {
    return c >= '0' && c <= '9';
}

static bool is_letter(int c) {
    return (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z');
}

/// -1: it is none.
static int hex_value(int c) {
    if (is_digit(c)) {
        return c - '0';
    }
    const int lower = c | 0x20;
    return (lower >= 'a' && lower <= 'f') ? lower - 'a' + 10 : -1;
}

// What is told of a fault -------------------------------------------------------------------------------------------

static bool is_printable(const char *text, size_t length) {
    for (size_t i = 0; i < length; i++) {
        if (text[i] < 0x20 || text[i] > 0x7E) {
            return false;
        }
    }
    return true;
}

/// The reason with the token it was found in, as far as that can be shown.
static bool fail_with(check_t *self, const char *what, const char *more, const char *nowhere) {
    const size_t length = (size_t)(self->at - self->token);
    if (self->failed) {
        return false;
    }
    self->failed = true;
    if (length > NEAR_MAX) {
        IWN_TEXT_JOIN(self->fault, what, more);
    } else if (length == 0U) {
        IWN_TEXT_JOIN(self->fault, what, more, nowhere);
    } else if (!is_printable(self->token, length)) {
        IWN_TEXT_JOIN(self->fault, "unreadable");
    } else {
        IWN_TEXT_JOIN(self->fault, what, more, " near '");
        iwn_text_span(self->fault, self->token, length);
        IWN_TEXT_JOIN(self->fault, "'");
    }
    return false;
}

static bool fail(check_t *self, const char *what) {
    return fail_with(self, what, "", " near end of file");
}

static int fail_byte(check_t *self, const char *what, unsigned char byte, const char *nowhere) {
    static const char digits[] = "0123456789abcdef";
    const char hex[] = {digits[byte >> 4], digits[byte & 15U], '\0'};
    (void)fail_with(self, what, (byte < 16U) ? &hex[1] : hex, nowhere);
    return INVALID;
}

// Tokens ------------------------------------------------------------------------------------------------------------

/// How many bytes the character has that comes next; 0: it is no UTF-8.
static size_t character_length(const check_t *self) {
    size_t bytes;
    char copy[5] = "";
    const size_t left = (size_t)(self->end - self->at);
    (void)memcpy(copy, self->at, (left < 4U) ? left : 4U);
    return (iwn_plain_read(copy, &bytes) != IWN_PLAIN_BROKEN) ? bytes : 0U;
}

/// The next byte, which begins a character or stands in one that has been looked at.
static int peek(check_t *self) {
    if (self->at == self->end) {
        return PEEK_END;
    }
    const unsigned char byte = (unsigned char)*self->at;
    if (byte >= 0x80U && character_length(self) == 0U) {
        (void)fail_byte(self, "unable to decode byte 0x", byte, "");
        return PEEK_BROKEN;
    }
    return byte;
}

static int step(check_t *self) {
    self->at++;
    return peek(self);
}

static uint32_t read_hex4(const char *digits) {
    uint32_t value = 0;
    for (unsigned i = 0; i < 4U; i++) {
        value = value << 4 | (uint32_t)hex_value(digits[i]);
    }
    return value;
}

static bool is_high(uint32_t unit) {
    return unit >= 0xD800U && unit <= 0xDBFFU;
}

static bool is_low(uint32_t unit) {
    return unit >= 0xDC00U && unit <= 0xDFFFU;
}

/// "\uD800", upper case.
static void write_unit(uint32_t unit, char out_text[7]) {
    iwn_text_t text = iwn_text_begin(out_text, 7U);
    IWN_TEXT_JOIN(&text, "\\u");
    iwn_text_hex(&text, unit, 4U);
}

static int fail_unit(check_t *self, uint32_t unit, const char *second) {
    char what[sizeof "invalid Unicode '\\uD800\\uD800'"];
    char name[7];
    char other[7] = "";
    iwn_text_t text = iwn_text_begin(what, sizeof what);
    write_unit(unit, name);
    if (second != NULL) {
        write_unit(read_hex4(second), other);
    }
    IWN_TEXT_JOIN(&text, "invalid Unicode '", name, other, "'");
    (void)fail(self, what);
    return INVALID;
}

/// The token is a whole text in which every escape is right in itself: surrogates come in pairs.
static int check_units(check_t *self) {
    for (const char *c = self->token + 1; c < self->at - 1; c++) {
        if (*c != '\\') {
            continue;
        }
        c++;
        if (*c != 'u') {
            continue;
        }
        const uint32_t unit = read_hex4(c + 1);
        c += 4;
        self->has_nul = self->has_nul || unit == 0U;
        if (is_high(unit) && c[1] == '\\' && c[2] == 'u') {
            if (!is_low(read_hex4(c + 3))) {
                return fail_unit(self, unit, c + 3);
            }
            c += 6;
        } else if (is_high(unit) || is_low(unit)) {
            return fail_unit(self, unit, NULL);
        }
    }
    return TEXT;
}

/// `at` is on the backslash. False, and that is told, if what it begins is wrong.
static bool skip_escape(check_t *self, bool *out_unit) {
    int c = step(self);
    unsigned digits = 0;
    bool good = c > 0 && strchr("\"\\/bfnrtu", c) != NULL;
    if (good && c == 'u') {
        *out_unit = true;
        for (c = step(self); digits < 4U && hex_value(c) >= 0; digits++) {
            c = step(self);
        }
        good = digits == 4U;
    } else if (good) {
        self->at++;
    }
    if (!good) {
        self->at += (c >= 0) ? 1 : 0; // The byte that is wrong is shown.
        (void)fail(self, "invalid escape");
    }
    return good;
}

/// Stands in a text and means itself alone.
static bool is_plain(unsigned char byte) {
    return byte >= 0x20U && byte < 0x80U && byte != '"' && byte != '\\';
}

/// What comes behind the bytes that need no look.
static int skip_plain(check_t *self) {
    const char *at = self->at;
    while (at < self->end && is_plain((unsigned char)*at)) {
        at++;
    }
    self->at = at;
    return peek(self);
}

static int scan_text(check_t *self) {
    bool units = false;
    self->has_nul = false;
    self->at++;
    for (int c = skip_plain(self); c != '"'; c = skip_plain(self)) {
        if (c == PEEK_END) {
            (void)fail(self, "premature end of input");
            return INVALID;
        }
        if (c >= 0 && c < 0x20) {
            return fail_byte(self, "control character 0x", (unsigned char)c, "");
        }
        if (c == PEEK_BROKEN || (c == '\\' && !skip_escape(self, &units))) {
            return INVALID;
        }
        self->at += (c >= 0x80) ? character_length(self) : 0U;
    }
    self->at++;
    return units ? check_units(self) : TEXT;
}

static int skip_digits(check_t *self) {
    int c = step(self);
    while (is_digit(c)) {
        c = step(self);
    }
    return c;
}

/// 64 bits.
static int check_integer(check_t *self) {
    const bool negative = *self->token == '-';
    const uint64_t most = negative ? (uint64_t)INT64_MAX + 1U : (uint64_t)INT64_MAX;
    uint64_t number = 0;
    for (const char *c = self->token + (negative ? 1 : 0); c < self->at; c++) {
        const unsigned digit = (unsigned)(*c - '0');
        if (number > (most - digit) / 10U) {
            (void)fail(self, negative ? "too big negative integer" : "too big integer");
            return INVALID;
        }
        number = number * 10U + digit;
    }
    return SCALAR;
}

/// The number behind `e`, or about as far away as it gets.
static int32_t read_exponent(const char *c, const char *end) {
    const bool negative = *c == '-';
    int32_t exponent = 0;
    for (c += (is_digit(*c) ? 0 : 1); c < end; c++) {
        exponent = (exponent < EXPONENT_FAR) ? exponent * 10 + (*c - '0') : exponent;
    }
    return negative ? -exponent : exponent;
}

/// Whether the digits from `c` on, whose first is not zero, are at least those of what is no double any more: halfway between
/// the largest one and the power of two behind it. Nobody writes more of its 309 digits than these.
static bool is_beyond(const char *c, const char *end) {
    static const char limit[] = "179769313486231580793728";
    for (const char *wanted = limit; *wanted != '\0'; wanted++) {
        c += (c < end && *c == '.') ? 1 : 0;
        const char digit = (c < end) ? *c++ : '0';
        if (digit != *wanted) {
            return digit > *wanted;
        }
    }
    return true;
}

/// Within what a double holds. Too small is zero, and no fault.
static int check_real(check_t *self) {
    const char *point = NULL;
    const char *first = NULL; // The first digit that counts.
    const char *c = self->token;
    for (; c < self->at && *c != 'e' && *c != 'E'; c++) {
        point = (*c == '.') ? c : point;
        first = (first == NULL && *c >= '1' && *c <= '9') ? c : first;
    }
    const char *const end = c;
    if (first == NULL) {
        return SCALAR;
    }
    point = (point == NULL) ? end : point;
    const int32_t before = (int32_t)(point - first) - ((first < point) ? 1 : 0);
    const int32_t exponent = before + ((c < self->at) ? read_exponent(c + 1, self->at) : 0);
    if (exponent > REAL_EXPONENT_MAX || (exponent == REAL_EXPONENT_MAX && is_beyond(first, end))) {
        (void)fail(self, "real number overflow");
        return INVALID;
    }
    return SCALAR;
}

static int scan_number(check_t *self) {
    int c = (*self->at == '-') ? step(self) : peek(self);
    if (!is_digit(c)) {
        return INVALID;
    }
    c = (c == '0') ? step(self) : skip_digits(self);
    if (is_digit(c)) {
        return INVALID; // Behind a leading zero.
    }
    if (c != '.' && c != 'e' && c != 'E') {
        return check_integer(self);
    }
    if (c == '.') {
        if (!is_digit(step(self))) {
            return INVALID;
        }
        c = skip_digits(self);
    }
    if (c == 'e' || c == 'E') {
        c = step(self);
        c = (c == '+' || c == '-') ? step(self) : c;
        if (!is_digit(c)) {
            return INVALID;
        }
        (void)skip_digits(self);
    }
    return check_real(self);
}

static int scan_word(check_t *self) {
    static const char *const words[] = {"true", "false", "null"};
    while (is_letter(step(self))) {
    }
    const size_t length = (size_t)(self->at - self->token);
    for (size_t i = 0; i < sizeof words / sizeof words[0]; i++) {
        if (length == strlen(words[i]) && memcmp(self->token, words[i], length) == 0) {
            return SCALAR;
        }
    }
    return INVALID;
}

static bool is_blank(char c) {
    return c == ' ' || c == '\t' || c == '\n' || c == '\r';
}

static int scan(check_t *self) {
    while (self->at < self->end && is_blank(*self->at)) {
        self->at++;
    }
    self->token = self->at;
    const int c = peek(self);
    switch (c) {
    case PEEK_END:
        return END;
    case PEEK_BROKEN:
        return INVALID;
    case '{':
    case '}':
    case '[':
    case ']':
    case ':':
    case ',':
        self->at++;
        return c;
    case '"':
        return scan_text(self);
    default:
        break;
    }
    if (is_digit(c) || c == '-') {
        return scan_number(self);
    }
    if (is_letter(c)) {
        return scan_word(self);
    }
    self->at += character_length(self);
    return INVALID;
}

// Objects and lists -------------------------------------------------------------------------------------------------

static uint32_t next_character(const char **at);

/// Below 0, 0 or above 0: the names that begin behind their quotes there, by what they mean.
static int compare_names(const char *one, const char *other) {
    uint32_t a;
    uint32_t b;
    do {
        a = next_character(&one);
        b = next_character(&other);
    } while (a == b && a != 0U);
    return (a < b) ? -1 : (a > b) ? 1 : 0;
}

/// Puts the token among the names of its object. False, and that is told, if it is there already.
static bool add_name(check_t *self) {
    unsigned low = self->first[self->depth - 1U];
    unsigned high = self->names;
    while (low < high) {
        const unsigned middle = (low + high) / 2U;
        const int order = compare_names(self->token + 1, &self->text[self->name_at[middle]]);
        if (order == 0) {
            return fail(self, "duplicate object key");
        }
        low = (order > 0) ? middle + 1U : low;
        high = (order < 0) ? middle : high;
    }
    if (self->names == IWN_NAMES_MAX) {
        return fail(self, "too many names");
    }
    (void)memmove(&self->name_at[low + 1U], &self->name_at[low], (self->names - low) * sizeof self->name_at[0]);
    self->name_at[low] = (uint16_t)(self->token + 1 - self->text);
    self->names++;
    return true;
}

/// A name and its colon; `*token` is then the value's.
static bool check_name(check_t *self, int *token) {
    if (*token != TEXT) {
        return fail(self, "string or '}' expected");
    }
    if (self->has_nul) {
        return fail(self, "NUL byte in object key not supported");
    }
    if (!add_name(self)) {
        return false;
    }
    if (scan(self) != ':') {
        return fail(self, "':' expected");
    }
    *token = scan(self);
    return true;
}

static bool in_list(const check_t *self) {
    return self->depth > 0U && self->is_list[self->depth - 1U];
}

static int closing(const check_t *self) {
    return in_list(self) ? ']' : '}';
}

static void close_container(check_t *self) {
    self->depth--;
    self->names = self->first[self->depth];
}

/// The token opens an object or list; `*token` is then the first value's. False: it failed, or there is none, which closes it.
static bool open_container(check_t *self, int *token) {
    if (self->depth == IWN_DEPTH_MAX) {
        return fail(self, "nested too deeply");
    }
    self->is_list[self->depth] = *token == '[';
    self->first[self->depth] = (uint16_t)self->names;
    self->depth++;
    *token = scan(self);
    if (*token == closing(self)) {
        close_container(self);
        return false;
    }
    return in_list(self) || check_name(self, token);
}

/// A whole scalar, or the beginning of objects and lists down to the first scalar, or the end of an empty one of them.
static bool check_value(check_t *self, int token) {
    while (token == '{' || token == '[') {
        if (!open_container(self, &token)) {
            return !self->failed;
        }
    }
    if (token == TEXT && self->has_nul) {
        return fail(self, "\\u0000 is not allowed without JSON_ALLOW_NUL");
    }
    if (token == TEXT || token == SCALAR) {
        return true;
    }
    return fail(self, (token == INVALID)                ? "invalid token"
                      : (token == END && in_list(self)) ? "']' expected"
                                                        : "unexpected token");
}

bool iwn_json_check(const char *text, size_t length, iwn_work_t *work, iwn_json_t *out_root, iwn_text_t *fault) {
    check_t self = {.text = text, .end = text + length, .at = text, .fault = fault, .name_at = work->name_at};
    int token = (length <= UINT16_MAX) ? scan(&self) : END;
    if (token != '{' && token != '[') {
        return fail(&self, "'[' or '{' expected");
    }
    out_root->at = self.token;
    bool good = check_value(&self, token);
    while (good && self.depth > 0U) { // Behind a value.
        token = scan(&self);
        if (token == closing(&self)) {
            close_container(&self);
        } else if (token == ',') {
            token = scan(&self);
            good = (in_list(&self) || check_name(&self, &token)) && check_value(&self, token);
        } else {
            good = fail(&self, in_list(&self) ? "']' expected" : "'}' expected");
        }
    }
    return good && (scan(&self) == END || fail(&self, "end of file expected"));
}

// Walking what has been checked ---------------------------------------------------------------------------------------

static const char *skip_blanks(const char *at) {
    while (is_blank(*at)) {
        at++;
    }
    return at;
}

static const char *skip_text(const char *at) {
    for (at++; *at != '"'; at++) {
        at += (*at == '\\') ? 1 : 0;
    }
    return at + 1;
}

static const char *skip_scalar(const char *at) {
    while (is_digit(*at) || is_letter(*at) || *at == '-' || *at == '+' || *at == '.') {
        at++;
    }
    return at;
}

static const char *skip_value(const char *at) {
    unsigned depth = 0;
    do {
        if (*at == '"') {
            at = skip_text(at);
        } else if (*at == '{' || *at == '[') {
            depth++;
            at++;
        } else if (*at == '}' || *at == ']') {
            depth--;
            at++;
        } else {
            const char *const behind = skip_scalar(at);
            at = (behind > at) ? behind : at + 1; // Or a comma, a colon, a blank.
        }
    } while (depth > 0U);
    return at;
}

iwn_json_kind_t iwn_json_kind(iwn_json_t value) {
    switch (*value.at) {
    case '{':
        return IWN_JSON_OBJECT;
    case '[':
        return IWN_JSON_LIST;
    case '"':
        return IWN_JSON_TEXT;
    case 't':
        return IWN_JSON_TRUE;
    case 'f':
        return IWN_JSON_FALSE;
    case 'n':
        return IWN_JSON_NULL;
    default:
        break;
    }
    for (value.at++; is_digit(*value.at); value.at++) {
    }
    return (*value.at == '.' || *value.at == 'e' || *value.at == 'E') ? IWN_JSON_REAL : IWN_JSON_INTEGER;
}

iwn_json_t iwn_json_inside(iwn_json_t container) {
    return (iwn_json_t){container.at + 1};
}

bool iwn_json_next(iwn_json_t *rest, iwn_json_t *out_name, iwn_json_t *out_value) {
    const char *at = skip_blanks(rest->at);
    at = (*at == ',') ? skip_blanks(at + 1) : at;
    if (*at == '}' || *at == ']') {
        return false;
    }
    if (out_name != NULL) {
        out_name->at = at;
        at = skip_blanks(skip_blanks(skip_text(at)) + 1);
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

/// What the escape means that begins at the backslash there.
static uint32_t read_escape(const char **at) {
    static const char letters[] = "bfnrt";
    static const char meanings[] = "\b\f\n\r\t";
    const char *c = *at + 1;
    if (*c != 'u') {
        const char *const letter = strchr(letters, *c);
        *at = c + 1;
        return (letter != NULL) ? (unsigned char)meanings[letter - letters] : (unsigned char)*c;
    }
    uint32_t unit = read_hex4(c + 1);
    c += 5;
    if (is_high(unit)) {
        unit = 0x10000U + ((unit - 0xD800U) << 10) + (read_hex4(c + 2) - 0xDC00U);
        c += 6;
    }
    *at = c;
    return unit;
}

static uint32_t next_character(const char **at) {
    const unsigned char byte = (unsigned char)**at;
    size_t bytes = 1;
    if (byte == '"') {
        return 0;
    }
    if (byte == '\\') {
        return read_escape(at);
    }
    const uint32_t code_point = (byte < 0x80U) ? byte : iwn_plain_read(*at, &bytes);
    *at += bytes;
    return code_point;
}

uint32_t iwn_json_character(iwn_json_t *rest) {
    return next_character(&rest->at);
}

bool iwn_json_is(iwn_json_t value, const char *text) {
    if (*value.at != '"') {
        return false;
    }
    const char *at = value.at + 1;
    size_t bytes = 1;
    for (; *text != '\0'; text += bytes) {
        if (*at == '\\') {
            if (next_character(&at) != iwn_plain_read(text, &bytes)) {
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
    if (*value.at != '"') {
        return false;
    }
    const char *at = value.at + 1;
    size_t used = 0;
    for (uint32_t code_point = next_character(&at); code_point != 0U; code_point = next_character(&at)) {
        char bytes[4];
        const size_t length = iwn_utf8(code_point, bytes);
        if (used + length >= size) {
            return false;
        }
        (void)memcpy(&out_text[used], bytes, length);
        used += length;
    }
    out_text[used] = '\0';
    return true;
}

int64_t iwn_json_integer(iwn_json_t value) {
    const bool negative = *value.at == '-';
    uint64_t number = 0;
    for (const char *c = value.at + (negative ? 1 : 0); is_digit(*c); c++) {
        number = number * 10U + (unsigned)(*c - '0');
    }
    return (int64_t)(negative ? 0U - number : number);
}
