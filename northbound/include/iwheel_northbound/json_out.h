// SPDX-License-Identifier: MIT
/// Writes one JSON object as one line into a buffer of fixed size.
///
/// Commas are placed by the writer. A name of NULL is for array elements. What does not fit sets `overflow` and the
/// line must not be used. Texts are escaped: what moves a terminal (plain.h) stands as \uXXXX, and what is no UTF-8 as U+FFFD.
/// No heap.
#ifndef IWHEEL_NORTHBOUND_JSON_OUT_H
#define IWHEEL_NORTHBOUND_JSON_OUT_H

#include "iwheel/can_frame.h"
#include "iwheel/types.h"

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

typedef struct {
    char *data;
    size_t size;
    size_t length;
    bool comma; ///< The next element needs one before it.
    bool overflow;
} iwn_out_t;

void iwn_out_init(iwn_out_t *self, char *data, size_t size);

/// `bracket` is '{' or '['; close with the matching '}' or ']'.
void iwn_out_open(iwn_out_t *self, const char *name, char bracket);
void iwn_out_close(iwn_out_t *self, char bracket);

void iwn_out_int(iwn_out_t *self, const char *name, int64_t value);
void iwn_out_bool(iwn_out_t *self, const char *name, bool value);
void iwn_out_null(iwn_out_t *self, const char *name);

/// `null` unless known.
void iwn_out_known(iwn_out_t *self, const char *name, bool known, int64_t value);

/// A NULL text is `null`.
void iwn_out_text(iwn_out_t *self, const char *name, const char *text);

/// The fields of a frame, into an object that is open: for `why` and the event `frame`.
void iwn_out_frame(const iw_can_frame_t *frame, iw_time_us_t at_us, iwn_out_t *json);

/// Ends the line. Its length with the newline; 0 if it did not fit.
size_t iwn_out_finish(iwn_out_t *self);

#endif
