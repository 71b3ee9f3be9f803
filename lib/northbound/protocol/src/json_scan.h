// SPDX-License-Identifier: MIT
/// Reads the tokens of a JSON text, checks every byte of them, and reports the first fault.
#ifndef IWHEEL_NORTHBOUND_JSON_SCAN_H
#define IWHEEL_NORTHBOUND_JSON_SCAN_H

#include "iwheel_northbound/json_in.h"

/// Results of `iwn_scan`: a punctuation mark as itself, or one of these. A scalar is a number, true, false or null.
enum { IWN_TOKEN_END = 0, IWN_TOKEN_INVALID = 1, IWN_TOKEN_TEXT = '"', IWN_TOKEN_SCALAR = '0' };

typedef struct {
    const char *text;
    const char *end;
    const char *at;    ///< Next byte.
    const char *token; ///< Beginning of the token that `at` is in or behind.
    iwn_text_t *fault;
    bool failed;  ///< A fault has been reported. Only the first one is.
    bool has_nul; ///< The token is a string with \u0000 in it.
} iwn_scan_t;

/// Reads the next token. Reports a fault in it, if its message is more precise than that of the caller.
int iwn_scan(iwn_scan_t *self);

/// Reports a fault and the token near it, unless a fault has been reported already. Returns false.
bool iwn_scan_fail(iwn_scan_t *self, const char *what);

/// Reads the next code point of a string with valid escapes; 0 at its end.
uint32_t iwn_scan_character(const char **at);

/// Skips the mark if it is the next byte.
static inline bool iwn_scan_skip(iwn_scan_t *self, char mark) {
    const bool there = self->at < self->end && *self->at == mark;
    self->at += there ? 1 : 0;
    return there;
}

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
