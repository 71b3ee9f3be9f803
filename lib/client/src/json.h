// SPDX-License-Identifier: MIT
/// Checks a JSON object and finds its fields in place. No copy, no heap. `iwheel_northbound/json_in.h` defines which
/// JSON it refuses.
#ifndef IWC_JSON_H
#define IWC_JSON_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

typedef struct {
    const char *at; ///< NULL: not found.
    size_t length;
} iwc_span_t;

/// Size of the longest stored value, and of the longest stored text.
#define IWC_STORED_MAX 8192U

/// An event `state`, and the value of its field `ledger`: half of the event, and mostly equal to the one before.
typedef struct {
    size_t length; ///< 0: none.
    char value[IWC_STORED_MAX];
    size_t text_length; ///< 0: none.
    char text[IWC_STORED_MAX];
} iwc_stored_t;

/// Returns true if the text is one object and otherwise only blanks.
bool iwc_json_is_object(const char *text, size_t length);

/// The same for a text of a trusted program: it does not search for equal names, and does not check the stored value
/// again. A text that differs from the stored one only in the digits and signs of integers is not checked again at all.
/// Stores what has changed otherwise.
bool iwc_json_is_trusted_object(const char *text, size_t length, iwc_stored_t *stored);

/// Returns the value at a path of keys, "left.speed_mm_s", or the object itself for "". `iwc_json_is_object` must be true for the object. Compares
/// keys byte by byte.
iwc_span_t iwc_json_find(iwc_span_t object, const char *path);

/// An object whose fields a caller reads in their order.
typedef struct {
    iwc_span_t object;
    const char *rest; ///< Position behind the last value; NULL before the first.
} iwc_walk_t;

/// Returns the value of a key like `iwc_json_find`, but searches behind the last value first.
iwc_span_t iwc_json_walk(iwc_walk_t *self, const char *key, size_t length);

/// Returns true if the value is this string, byte by byte between its quotes.
bool iwc_json_is_text(iwc_span_t value, const char *text);

/// Returns true and writes `*out_number` if the value is an integer of 64 bits.
bool iwc_json_integer(iwc_span_t value, int64_t *out_number);

#endif
