// SPDX-License-Identifier: MIT
/// @file
/// Writes one JSON object as one line into a buffer of fixed size.
///
/// The functions write the commas. Elements of a list have the name NULL. An element that does not fit sets `overflow`,
/// and the caller must not use the line. Strings are escaped: `\uXXXX` for characters that are not plain (text.h), and
/// U+FFFD for bytes that are not UTF-8. Names are constants of the program that need no escape. No heap, no stdio.
///
/// Each element is written as a whole and in place. The functions with a name argument are inline, so that a literal is
/// written by a few stores, unless the program is compiled for size.
#ifndef IWHEEL_NORTHBOUND_JSON_OUT_H
#define IWHEEL_NORTHBOUND_JSON_OUT_H

#include "iwheel/can_frame.h"
#include "iwheel/types.h"
#include "iwheel_northbound/text.h"

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>
#include <string.h>

#ifdef __cplusplus
extern "C" {
#endif

/// A line that is being written, in a buffer of the owner.
typedef struct {
    char *data;    ///< The buffer.
    size_t size;   ///< Size of the buffer in bytes.
    size_t length; ///< Bytes written.
    bool comma;    ///< The next element needs a comma before it.
    bool overflow; ///< An element did not fit: the caller must not use the line.
} iwn_out_t;

/// Part of a text, not terminated.
typedef struct {
    const char *text; ///< First byte.
    size_t length;    ///< Length in bytes.
} iwn_span_t;

/// Begins a line without an open object.
void iwn_out_init(iwn_out_t *self, char *data, size_t size);

/// Ends the line. Returns its length with the newline; 0 if it did not fit.
size_t iwn_out_finish(iwn_out_t *self);

/// Closes an object or list. `bracket` is the opening or the closing bracket.
void iwn_out_close(iwn_out_t *self, char bracket);

/// Writes the fields of a frame to an open object, for `why` and the event `frame`.
void iwn_out_frame(const iw_can_frame_t *frame, iw_time_us_t at_us, iwn_out_t *json);

/// Writes a value that is JSON: `true`, a number, an object written before.
void iwn_out_span(iwn_out_t *self, iwn_span_t name, iwn_span_t value);
/// Writes several integers. Each of `names` ends with a zero byte, and the last with another one.
void iwn_out_numbers(iwn_out_t *self, const char *names, const uint32_t *values);
/// Does the same with the values as arguments: IWN_OUT_NUMBERS(json, "first\0second\0", 1, 2). The terminator of the
/// literal is the last byte.
#define IWN_OUT_NUMBERS(self, names, ...) iwn_out_numbers((self), (names), (const uint32_t[]){__VA_ARGS__})
/// Writes a string; `null` for NULL.
void iwn_out_string(iwn_out_t *self, iwn_span_t name, const char *text);

/// Returns the span of a terminated text; empty for NULL.
static inline iwn_span_t iwn_span(const char *text) {
    const iwn_span_t span = {text, (text != NULL) ? strlen(text) : 0U};
    return span;
}

#ifdef __OPTIMIZE_SIZE__
/// The functions with a name argument are compiled once, in json_out.c.
#define IWN_OUT_INLINE
#else
/// The functions with a name argument are inline.
#define IWN_OUT_INLINE static inline
#endif

/// Writes comma, name and colon, and reserves `length` bytes for the value. Returns their position; NULL: the element
/// does not fit.
IWN_OUT_INLINE char *iwn_out_begin(iwn_out_t *self, iwn_span_t name, size_t length);

/// Opens an object or list. `bracket` is '{' or '['; close it with '}' or ']'.
IWN_OUT_INLINE void iwn_out_open(iwn_out_t *self, const char *name, char bracket);

/// Writes an integer.
IWN_OUT_INLINE void iwn_out_int(iwn_out_t *self, const char *name, int64_t value);

/// Writes `true` or `false`.
IWN_OUT_INLINE void iwn_out_bool(iwn_out_t *self, const char *name, bool value);

/// Writes `null`.
IWN_OUT_INLINE void iwn_out_null(iwn_out_t *self, const char *name);

/// Writes an integer of 32 bits, or `null` unless known. Without a 64-bit value each argument is in a register.
IWN_OUT_INLINE void iwn_out_known32(iwn_out_t *self, const char *name, bool known, int32_t value);

/// Writes an integer, or `null` unless known.
IWN_OUT_INLINE void iwn_out_known(iwn_out_t *self, const char *name, bool known, int64_t value);

/// Writes a string; `null` for NULL.
IWN_OUT_INLINE void iwn_out_text(iwn_out_t *self, const char *name, const char *text);

#ifndef __OPTIMIZE_SIZE__
#include "iwheel_northbound/json_out_inline.h"
#endif

#ifdef __cplusplus
}
#endif
#endif
