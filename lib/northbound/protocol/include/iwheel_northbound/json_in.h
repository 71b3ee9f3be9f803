// SPDX-License-Identifier: MIT
/// @file
/// Reads JSON in place, without copies and without a heap, and refuses every text that is not strictly JSON (RFC 8259).
///
///     iwn_json_check     first: checks every byte of the text and finds the members of the root
///     iwn_json_name      then: reads the members of the root where the check found them
///     iwn_json_...       or: walks the checked text
///
/// It also refuses: bytes that are not UTF-8, NUL in any spelling, single surrogates, control characters in strings,
/// two equal names in one object in any spelling, integers beyond 64 bits, other numbers beyond the range of a double,
/// and nesting beyond IWN_DEPTH_MAX. The cost is bounded: it grows with the length and the logarithm of the number of
/// names. Only iwn_json_check accepts unchecked text.
#ifndef IWHEEL_NORTHBOUND_JSON_IN_H
#define IWHEEL_NORTHBOUND_JSON_IN_H

#include "iwheel_northbound/text.h"

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#ifdef __cplusplus
extern "C" {
#endif

/// Length of the longest text in bytes: a position in it has 16 bits.
#define IWN_JSON_MAX 65536U
/// Deepest nesting. Requests need 2.
#define IWN_DEPTH_MAX 8U
/// Most names in all objects that are open at the same time. A name, its colon, a value and a comma need at least five
/// bytes, so a line of 4096 bytes has no more.
#define IWN_NAMES_MAX 832U

/// Names of the open objects, sorted within each object; after a successful check the names of the root. The owner need
/// not initialize it. The next check overwrites it, so one per program is enough.
typedef struct {
    uint16_t name_at[IWN_NAMES_MAX]; ///< Offsets in the text, behind the opening quote.
    uint16_t names;                  ///< Number of offsets in use.
} iwn_work_t;

/// Type of a value.
typedef enum {
    IWN_JSON_OBJECT = 0,
    IWN_JSON_LIST,
    IWN_JSON_TEXT,
    IWN_JSON_INTEGER, ///< No fraction, no exponent.
    IWN_JSON_REAL,
    IWN_JSON_TRUE,
    IWN_JSON_FALSE,
    IWN_JSON_NULL,
} iwn_json_kind_t;

/// A value in a checked text, or the rest of an object's members or of a list's values.
typedef struct {
    const char *at; ///< First byte.
} iwn_json_t;

/// Checks a text of at most IWN_JSON_MAX bytes. Returns true and writes `*out_root` if it is one object or list.
/// Otherwise returns false and appends the reason to `fault`, in printable ASCII. With `work` NULL it does not search
/// for equal names in an object, for the line of a trusted program.
bool iwn_json_check(const char *text, size_t length, iwn_work_t *work, iwn_json_t *out_root, iwn_text_t *fault);

/// A member of a root that repeats from text to text. The owner clears it, and sets it after a check of a text that has
/// the member.
typedef struct {
    const char *value; ///< Checked object or list that a member of the root had before.
    size_t length;     ///< 0: none.
    bool met;          ///< Set by the check: a member has this value again.
} iwn_repeated_t;

/// Checks a text of a trusted program like iwn_json_check without `work`, but does not check the value `repeated` again.
bool iwn_json_check_again(const char *text, size_t length, iwn_repeated_t *repeated, iwn_json_t *out_root,
                          iwn_text_t *fault);

/// Returns the object or list of a checked text.
iwn_json_t iwn_json_root(const char *text);

/// Returns the name of a member of the root, in the order of the names. `text` and `work` are those of the check;
/// `index` is below `work->names`.
iwn_json_t iwn_json_name(const char *text, const iwn_work_t *work, unsigned index);

/// Returns the value of the member with this name.
iwn_json_t iwn_json_value(iwn_json_t name);

/// Returns the type of a value.
iwn_json_kind_t iwn_json_kind(iwn_json_t value);

/// Returns the members of an object or the values of a list, for iwn_json_next; for a string its characters.
iwn_json_t iwn_json_inside(iwn_json_t container);

/// Reads the next member or value and advances `*rest`. Returns false at the end. `out_name` is NULL for a list.
bool iwn_json_next(iwn_json_t *rest, iwn_json_t *out_name, iwn_json_t *out_value);

/// Finds the member with this name. Returns false if there is none, or if `object` is not an object.
bool iwn_json_find(iwn_json_t object, const char *name, iwn_json_t *out_value);

/// Returns true if the value is a string equal to `text`.
bool iwn_json_is(iwn_json_t value, const char *text);

/// Copies a string with a terminator to `out_text`. Returns false if the value is not a string, or does not fit.
bool iwn_json_text(iwn_json_t value, char *out_text, size_t size);

/// Returns the next code point of a string, with escapes decoded, and advances `*rest`, which begins as iwn_json_inside
/// of the string; 0 at its end.
uint32_t iwn_json_character(iwn_json_t *rest);

/// Returns the value of an integer.
int64_t iwn_json_integer(iwn_json_t value);

#ifdef __cplusplus
}
#endif
#endif
