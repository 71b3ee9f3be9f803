// SPDX-License-Identifier: MIT
/// @file
/// Writes one JSON object as one line into a buffer of fixed size.
///
/// Commas are placed by the writer. A name of NULL is for elements of a list. What does not fit sets `overflow` and the
/// line must not be used. Texts are escaped: what moves a terminal (text.h) stands as `\uXXXX`, and what is no UTF-8 as
/// U+FFFD. Names are words of ours, in which nothing is to be escaped. No heap, no stdio.
///
/// Each element is written as a whole, in one or two copies. The functions that take a name are inline, so that the
/// compiler knows how long a literal one is, unless the program is compiled for size.
#ifndef IWHEEL_NORTHBOUND_JSON_OUT_H
#define IWHEEL_NORTHBOUND_JSON_OUT_H

#include "iwheel/can_frame.h"
#include "iwheel/types.h"

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>
#include <string.h>

/// A line that is being written, in a buffer of the owner's.
typedef struct {
    char *data;    ///< The buffer.
    size_t size;   ///< Of the buffer, bytes.
    size_t length; ///< Written so far, bytes.
    bool comma;    ///< The next element needs one before it.
    bool overflow; ///< Something did not fit: the line must not be used.
} iwn_out_t;

/// Part of a text, not terminated.
typedef struct {
    const char *text; ///< Its first byte.
    size_t length;    ///< Bytes.
} iwn_span_t;

/// Begins a line, with nothing open.
void iwn_out_init(iwn_out_t *self, char *data, size_t size);

/// Ends the line. Its length with the newline; 0 if it did not fit.
size_t iwn_out_finish(iwn_out_t *self);

/// `bracket` is the one that was opened, or its counterpart.
void iwn_out_close(iwn_out_t *self, char bracket);

/// The fields of a frame, into an object that is open: for `why` and the event `frame`.
void iwn_out_frame(const iw_can_frame_t *frame, iw_time_us_t at_us, iwn_out_t *json);

/// A value that is JSON already: `true`, a number, a whole object written before.
void iwn_out_span(iwn_out_t *self, iwn_span_t name, iwn_span_t value);
/// A whole number.
void iwn_out_number(iwn_out_t *self, iwn_span_t name, int64_t value);
/// Whole numbers one after the other. Each of `names` ends with a zero byte, and the last with another one.
void iwn_out_numbers(iwn_out_t *self, const char *names, const uint32_t *values);
/// The same with the values as arguments: IWN_OUT_NUMBERS(json, "first\0second\0", 1, 2). A literal adds the last byte.
#define IWN_OUT_NUMBERS(self, names, ...) iwn_out_numbers((self), (names), (const uint32_t[]){__VA_ARGS__})
/// A NULL text is `null`.
void iwn_out_string(iwn_out_t *self, iwn_span_t name, const char *text);
/// As `iwn_out_open`, the name as a span.
void iwn_out_bracket(iwn_out_t *self, iwn_span_t name, char bracket);

/// A whole text; empty for NULL.
static inline iwn_span_t iwn_span(const char *text) {
    return (iwn_span_t){text, (text != NULL) ? strlen(text) : 0U};
}

#ifdef __OPTIMIZE_SIZE__
/// The functions that take a name are compiled once, in json_out.c.
#define IWN_OUT_INLINE
#else
/// The functions that take a name are inline.
#define IWN_OUT_INLINE static inline
#endif

/// `bracket` is '{' or '['; close with the matching '}' or ']'.
IWN_OUT_INLINE void iwn_out_open(iwn_out_t *self, const char *name, char bracket);

/// A whole number.
IWN_OUT_INLINE void iwn_out_int(iwn_out_t *self, const char *name, int64_t value);

/// `true` or `false`.
IWN_OUT_INLINE void iwn_out_bool(iwn_out_t *self, const char *name, bool value);

/// `null`.
IWN_OUT_INLINE void iwn_out_null(iwn_out_t *self, const char *name);

/// `null` unless known. For numbers of 32 bits: without a 64-bit value each argument is in a register.
IWN_OUT_INLINE void iwn_out_known32(iwn_out_t *self, const char *name, bool known, int32_t value);

/// `null` unless known.
IWN_OUT_INLINE void iwn_out_known(iwn_out_t *self, const char *name, bool known, int64_t value);

/// A NULL text is `null`.
IWN_OUT_INLINE void iwn_out_text(iwn_out_t *self, const char *name, const char *text);

#ifndef __OPTIMIZE_SIZE__
#include "iwheel_northbound/json_out_inline.h"
#endif

#endif
