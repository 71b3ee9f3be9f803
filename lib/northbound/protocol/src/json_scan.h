// SPDX-License-Identifier: MIT
/// The tokens of a JSON text, each judged to its last byte, and what is told of the first that is wrong.
#ifndef IWHEEL_NORTHBOUND_JSON_SCAN_H
#define IWHEEL_NORTHBOUND_JSON_SCAN_H

#include "iwheel_northbound/json_in.h"

/// What `iwn_scan` finds: a punctuation mark as itself, or one of these. A scalar is a number or one of true, false,
/// null.
enum { IWN_TOKEN_END = 0, IWN_TOKEN_INVALID = 1, IWN_TOKEN_TEXT = '"', IWN_TOKEN_SCALAR = '0' };

typedef struct {
    const char *text;
    const char *end;
    const char *at;    ///< What comes next.
    const char *token; ///< Where the token begins that `at` is in, or behind.
    iwn_text_t *fault;
    bool failed;  ///< The first reason is told, no later one.
    bool has_nul; ///< The token is a text with \u0000 in it.
} iwn_scan_t;

/// The next token. What is wrong in it is told, if that can be said better than by the token itself.
int iwn_scan(iwn_scan_t *self);

/// Tells that this is wrong, and near which token, unless something has been told already. False, always.
bool iwn_scan_fail(iwn_scan_t *self, const char *what);

/// The next code point of a text whose escapes are right; 0 behind it.
uint32_t iwn_scan_character(const char **at);

static inline bool iwn_scan_is_blank(char c) {
    return c == ' ' || c == '\t' || c == '\n' || c == '\r';
}

static inline bool iwn_scan_is_digit(int c) {
    return c >= '0' && c <= '9';
}

static inline bool iwn_scan_is_letter(int c) {
    return (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z');
}

#endif
