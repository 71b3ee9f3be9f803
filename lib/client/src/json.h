// SPDX-License-Identifier: MIT
/// JSON where it lies: is it an object, and where in it is a field? No copy, no heap. `iwheel_northbound/json_in.h` says what is refused.
#ifndef IWC_JSON_H
#define IWC_JSON_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

typedef struct {
    const char *at; ///< NULL: nothing.
    size_t length;
} iwc_span_t;

/// True if the text is one object and nothing else but blanks. Names are not compared in a trusted text.
bool iwc_json_is_object(const char *text, size_t length, bool trusted);

/// The value at a path of keys, "left.speed_mm_s", in an object for which `iwc_json_is_object` holds; keys are compared as written.
iwc_span_t iwc_json_find(iwc_span_t object, const char *path);

/// An object whose fields are read in their order.
typedef struct {
    iwc_span_t object;
    const char *rest; ///< Place behind the last value; NULL before the first.
} iwc_walk_t;

/// Returns the value of a key as `iwc_json_find` does, but searches behind the last value first.
iwc_span_t iwc_json_walk(iwc_walk_t *self, const char *key, size_t length);

/// True if the value is exactly that text, as written between its quotes.
bool iwc_json_is_text(iwc_span_t value, const char *text);

/// True with the number in `*out_number` if the value is a whole one of 64 bits.
bool iwc_json_integer(iwc_span_t value, int64_t *out_number);

#endif
