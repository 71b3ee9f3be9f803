// SPDX-License-Identifier: MIT
/// @file
/// Reads JSON where it lies: nothing is copied, nothing is allocated, and what is not JSON to the letter (RFC 8259) is
/// refused.
///
///     iwn_json_check     once, judges every byte of the text and finds the members of the root
///     iwn_json_name      then reads the members of the root where the check found them
///     iwn_json_...       or walks what has been checked, and only that
///
/// Refused are, beside wrong syntax: bytes that are no UTF-8, NUL in any spelling, single surrogates, control
/// characters in texts, a name twice in one object however it is spelt, integers beyond 64 bits, other numbers beyond
/// what a double holds, and nesting beyond IWN_DEPTH_MAX. The cost is bounded: it grows with the length and the
/// logarithm of the number of names.
#ifndef IWHEEL_NORTHBOUND_JSON_IN_H
#define IWHEEL_NORTHBOUND_JSON_IN_H

#include "iwheel_northbound/text.h"

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

/// Longest text that is read at all: a place in it has 16 bits.
#define IWN_JSON_MAX 65536U
/// Deepest nesting that is read at all; requests need 2.
#define IWN_DEPTH_MAX 8U
/// Names in objects that are open at one time. A name, its colon, a value and what follows take five bytes at least, so
/// no line of 4096 bytes holds more.
#define IWN_NAMES_MAX 832U

/// The names of the open objects, sorted within each object; after a check that returned true, those of the root. Its
/// owner need not set anything. The next check overwrites it, so one for all of a program will do.
typedef struct {
    uint16_t name_at[IWN_NAMES_MAX]; ///< Offsets in the text, behind the first quote.
    uint16_t names;                  ///< How many of these are in use.
} iwn_work_t;

/// What a value is.
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

/// A value in a text that has been checked, or the rest of an object's members or a list's values.
typedef struct {
    const char *at; ///< Its first byte.
} iwn_json_t;

/// True: the text, of at most IWN_JSON_MAX bytes, is one object or list, and `*out_root` is that. False: the reason is
/// added to `fault`, in printable ASCII.
bool iwn_json_check(const char *text, size_t length, iwn_work_t *work, iwn_json_t *out_root, iwn_text_t *fault);

/// The object or list of a text that has been checked.
iwn_json_t iwn_json_root(const char *text);

/// The name of a member of the root, in the order of the names. `text` and `work` are those of the check; `index` is
/// below `work->names`.
iwn_json_t iwn_json_name(const char *text, const iwn_work_t *work, unsigned index);

/// The value that belongs to a name.
iwn_json_t iwn_json_value(iwn_json_t name);

/// What it is, by its first bytes.
iwn_json_kind_t iwn_json_kind(iwn_json_t value);

/// What there is to walk in an object or list.
iwn_json_t iwn_json_inside(iwn_json_t container);

/// Takes the next member off `*rest`; false at the end. `out_name` is NULL for a list.
bool iwn_json_next(iwn_json_t *rest, iwn_json_t *out_name, iwn_json_t *out_value);

/// The member with this name; false if there is none, or it is no object.
bool iwn_json_find(iwn_json_t object, const char *name, iwn_json_t *out_value);

/// True if it is a text, and this one.
bool iwn_json_is(iwn_json_t value, const char *text);

/// True if it is a text that fits, with its terminator, which is then in `out_text`.
bool iwn_json_text(iwn_json_t value, char *out_text, size_t size);

/// The next code point of a text's, from `inside` of it on; 0 at its end. What is escaped comes as what it means.
uint32_t iwn_json_character(iwn_json_t *rest);

/// Of an integer.
int64_t iwn_json_integer(iwn_json_t value);

#endif
