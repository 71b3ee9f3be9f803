// SPDX-License-Identifier: MIT
#include "json_scan.h"

#include <string.h>

/// Most bytes of a wrong token that a message repeats.
#define NEAR_MAX 20U
/// Decimal exponent of the largest double.
#define REAL_EXPONENT_MAX 308
/// A larger exponent has the same result as this one, however many digits come before it.
#define EXPONENT_FAR 1000000
/// An integer with fewer digits has at most 64 bits.
#define INTEGER_CERTAIN 19

/// Results of `peek` other than a byte.
enum { PEEK_END = -1, PEEK_BROKEN = -2 };

/// Returns the value of a hexadecimal digit; -1: not a digit.
static int hex_value(int c) {
    if (iwn_scan_is_digit(c)) {
        return c - '0';
    }
    const int lower = c | 0x20;
    return (lower >= 'a' && lower <= 'f') ? lower - 'a' + 10 : -1;
}

// Messages about faults ---------------------------------------------------------------------------------------------

static bool is_printable(const char *text, size_t length) {
    for (size_t i = 0; i < length; i++) {
        if (text[i] < 0x20 || text[i] > 0x7E) {
            return false;
        }
    }
    return true;
}

/// Reports the fault with the token in which it was found, as far as the token is printable.
static bool fail_with(iwn_scan_t *self, const char *what, const char *more, const char *nowhere) {
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
        iwn_text_add(self->fault, "unreadable");
    } else {
        IWN_TEXT_JOIN(self->fault, what, more, " near '");
        iwn_text_span(self->fault, self->token, length);
        iwn_text_add(self->fault, "'");
    }
    return false;
}

bool iwn_scan_fail(iwn_scan_t *self, const char *what) {
    return fail_with(self, what, "", " near end of file");
}

static int fail_byte(iwn_scan_t *self, const char *what, unsigned char byte, const char *nowhere) {
    static const char digits[] = "0123456789abcdef";
    const char hex[] = {digits[byte >> 4], digits[byte & 15U], '\0'};
    (void)fail_with(self, what, (byte < 16U) ? &hex[1] : hex, nowhere);
    return IWN_TOKEN_INVALID;
}

// Tokens ------------------------------------------------------------------------------------------------------------

/// Returns the number of bytes of the next character; 0: it is not UTF-8.
static size_t character_length(const iwn_scan_t *self) {
    size_t bytes;
    char copy[5] = "";
    const size_t left = (size_t)(self->end - self->at);
    memcpy(copy, self->at, (left < 4U) ? left : 4U);
    return (iwn_plain_read(copy, &bytes) != IWN_PLAIN_BROKEN) ? bytes : 0U;
}

/// Returns the next byte, which is not ASCII. If it does not begin a UTF-8 character, reports it and returns
/// PEEK_BROKEN.
static int peek_wide(iwn_scan_t *self) {
    const unsigned char byte = (unsigned char)*self->at;
    if (character_length(self) == 0U) {
        (void)fail_byte(self, "unable to decode byte 0x", byte, "");
        return PEEK_BROKEN;
    }
    return byte;
}

/// Returns the next byte, which begins a character or belongs to a checked one.
static inline int peek(iwn_scan_t *self) {
    if (self->at == self->end) {
        return PEEK_END;
    }
    const unsigned char byte = (unsigned char)*self->at;
    return (byte < 0x80U) ? byte : peek_wide(self);
}

static int step(iwn_scan_t *self) {
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

/// Reports a surrogate without its counterpart.
static bool fail_unit(iwn_scan_t *self, uint32_t unit, const char *second) {
    char units[sizeof "\\uD800\\uD800'"];
    iwn_text_t text = iwn_text_begin(units, sizeof units);
    iwn_text_add(&text, "\\u");
    iwn_text_hex(&text, unit, 4U);
    if (second != NULL) {
        iwn_text_add(&text, "\\u");
        iwn_text_hex(&text, read_hex4(second), 4U);
    }
    iwn_text_add(&text, "'");
    return fail_with(self, "invalid Unicode '", units, "");
}

/// Checks the surrogate with its `u` at `c`. Returns false and reports it if it is not the first of a pair.
static bool check_pair(iwn_scan_t *self, const char *c, uint32_t unit) {
    const bool followed = is_high(unit) && c[5] == '\\' && c[6] == 'u';
    if (followed && is_low(read_hex4(c + 7))) {
        return true;
    }
    return fail_unit(self, unit, followed ? c + 7 : NULL);
}

/// Checks that surrogates come in pairs, in a whole string in which every single escape is valid.
static int check_units(iwn_scan_t *self) {
    for (const char *c = self->token + 1; c < self->at - 1; c++) {
        if (*c != '\\') {
            continue;
        }
        c++;
        if (*c == 'u') {
            const uint32_t unit = read_hex4(c + 1);
            const bool paired = is_high(unit) || is_low(unit);
            if (paired && !check_pair(self, c, unit)) {
                return IWN_TOKEN_INVALID;
            }
            self->has_nul = self->has_nul || unit == 0U;
            c += paired ? 10 : 4;
        }
    }
    return IWN_TOKEN_TEXT;
}

/// Skips the escape whose backslash is at `at`. Returns false and reports it if it is invalid.
static bool skip_escape(iwn_scan_t *self, bool *out_unit) {
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
        self->at += (c >= 0) ? 1 : 0; // The message shows the wrong byte.
        (void)iwn_scan_fail(self, "invalid escape");
    }
    return good;
}

/// Skips plain bytes. Returns the next one.
static int skip_plain(iwn_scan_t *self) {
    self->at += iwn_plain_length(self->at, (size_t)(self->end - self->at));
    return peek(self);
}

static int scan_text(iwn_scan_t *self) {
    bool units = false;
    self->has_nul = false;
    self->at++;
    for (int c = skip_plain(self); c != '"'; c = skip_plain(self)) {
        if (c == PEEK_END) {
            (void)iwn_scan_fail(self, "premature end of input");
            return IWN_TOKEN_INVALID;
        }
        if (c >= 0 && c < 0x20) {
            return fail_byte(self, "control character 0x", (unsigned char)c, "");
        }
        if (c == PEEK_BROKEN || (c == '\\' && !skip_escape(self, &units))) {
            return IWN_TOKEN_INVALID;
        }
        self->at += (c != '\\') ? character_length(self) : 0U;
    }
    self->at++;
    return units ? check_units(self) : IWN_TOKEN_TEXT;
}

/// Skips digits, at least one. `*c` is the first byte before the call, and the byte behind the digits after it.
static bool skip_digits(iwn_scan_t *self, int *c) {
    const char *const begin = self->at;
    while (self->at < self->end && iwn_scan_is_digit(*self->at)) {
        self->at++;
    }
    *c = peek(self);
    return self->at > begin;
}

/// Checks that the integer has at most 64 bits.
static int check_integer(iwn_scan_t *self) {
    if (self->at - self->token < INTEGER_CERTAIN) {
        return IWN_TOKEN_SCALAR;
    }
    const bool negative = *self->token == '-';
    const uint64_t most = negative ? (uint64_t)INT64_MAX + 1U : (uint64_t)INT64_MAX;
    uint64_t number = 0;
    for (const char *c = self->token + (negative ? 1 : 0); c < self->at; c++) {
        const unsigned digit = (unsigned)(*c - '0');
        if (number > (most - digit) / 10U) {
            (void)iwn_scan_fail(self, negative ? "too big negative integer" : "too big integer");
            return IWN_TOKEN_INVALID;
        }
        number = number * 10U + digit;
    }
    return IWN_TOKEN_SCALAR;
}

/// Returns the number behind `e`, limited to about EXPONENT_FAR.
static int32_t read_exponent(const char *c, const char *end) {
    const bool negative = *c == '-';
    int32_t exponent = 0;
    for (c += (iwn_scan_is_digit(*c) ? 0 : 1); c < end; c++) {
        if (exponent < EXPONENT_FAR) {
            exponent = exponent * 10 + (*c - '0');
        }
    }
    return negative ? -exponent : exponent;
}

/// Returns true if the digits from `c` on, of which the first is not zero, are beyond the range of a double: from
/// halfway between the largest double and the next power of two. Of the 309 digits of that limit it compares the first
/// 24, which is precise enough.
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

/// Returns the first digit that is not zero; `end`: none.
static const char *find_first(const char *c, const char *end) {
    while (c < end && !(*c >= '1' && *c <= '9')) {
        c++;
    }
    return c;
}

/// Returns the position of that byte in either case; `end`: none.
static const char *find(const char *c, const char *end, char lower) {
    while (c < end && (*c | 0x20) != lower) {
        c++;
    }
    return c;
}

/// Checks that a double can hold the number. A number that is too small counts as zero and is not a fault.
static int check_real(iwn_scan_t *self) {
    const char *const end = find(self->token, self->at, 'e');
    const char *const first = find_first(self->token, end);
    const char *const point = find(self->token, end, '.' | 0x20);
    if (first == end) {
        return IWN_TOKEN_SCALAR;
    }
    const int32_t before = (int32_t)(point - first) - ((first < point) ? 1 : 0);
    const int32_t exponent = before + ((end < self->at) ? read_exponent(end + 1, self->at) : 0);
    if (exponent > REAL_EXPONENT_MAX || (exponent == REAL_EXPONENT_MAX && is_beyond(first, end))) {
        (void)iwn_scan_fail(self, "real number overflow");
        return IWN_TOKEN_INVALID;
    }
    return IWN_TOKEN_SCALAR;
}

/// Reads a number from its point or `e` on.
static int scan_real(iwn_scan_t *self, int c) {
    if (c == '.') {
        c = step(self);
        if (!skip_digits(self, &c)) {
            return IWN_TOKEN_INVALID;
        }
    }
    if (c == 'e' || c == 'E') {
        c = step(self);
        if (c == '+' || c == '-') {
            c = step(self);
        }
        if (!skip_digits(self, &c)) {
            return IWN_TOKEN_INVALID;
        }
    }
    return check_real(self);
}

static int scan_number(iwn_scan_t *self) {
    int c = (*self->at == '-') ? step(self) : peek(self);
    if (c == '0') {
        c = step(self);
        if (iwn_scan_is_digit(c)) {
            return IWN_TOKEN_INVALID;
        }
    } else if (!skip_digits(self, &c)) {
        return IWN_TOKEN_INVALID;
    }
    return (c == '.' || c == 'e' || c == 'E') ? scan_real(self, c) : check_integer(self);
}

static int scan_word(iwn_scan_t *self) {
    while (self->at < self->end && iwn_scan_is_letter(*self->at)) {
        self->at++;
    }
    const size_t length = (size_t)(self->at - self->token);
    const bool four = length == 4U && (memcmp(self->token, "true", 4U) == 0 || memcmp(self->token, "null", 4U) == 0);
    const bool known = four || (length == 5U && memcmp(self->token, "false", 5U) == 0);
    return (peek(self) != PEEK_BROKEN && known) ? IWN_TOKEN_SCALAR : IWN_TOKEN_INVALID;
}

static bool is_mark(int c) {
    return c == ',' || c == ':' || c == '{' || c == '}' || c == '[' || c == ']';
}

int iwn_scan(iwn_scan_t *self) {
    while (self->at < self->end && iwn_scan_is_blank(*self->at)) {
        self->at++;
    }
    self->token = self->at;
    const int c = peek(self);
    if (c < 0) {
        return (c == PEEK_END) ? IWN_TOKEN_END : IWN_TOKEN_INVALID;
    }
    if (c == '"') {
        return scan_text(self);
    }
    if (iwn_scan_is_digit(c) || c == '-') {
        return scan_number(self);
    }
    if (iwn_scan_is_letter(c)) {
        return scan_word(self);
    }
    if (is_mark(c)) {
        self->at++;
        return c;
    }
    self->at += character_length(self);
    return IWN_TOKEN_INVALID;
}

/// Returns the code point of the escape whose backslash is at `*at`, and advances `*at`.
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

uint32_t iwn_scan_character(const char **at) {
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
