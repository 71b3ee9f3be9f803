// SPDX-License-Identifier: MIT
/// @file
/// Checks whether a text is safe to show, and builds texts from parts without stdio.
///
/// A plain text contains nothing that moves the cursor of a terminal, changes its state, or reorders the shown text.
///
/// These characters are not plain: control characters (U+0000-001F, U+007F-009F), separators of lines and paragraphs
/// (U+2028, U+2029), bidirectional controls (U+061C, U+200E, U+200F, U+202A-202E, U+2066-2069), and bytes that are not
/// UTF-8, which an old terminal treats as control characters. Programs refuse such a text in their input, and never
/// print it unchanged. Pure functions.
#ifndef IWHEEL_NORTHBOUND_TEXT_H
#define IWHEEL_NORTHBOUND_TEXT_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#ifdef __cplusplus
extern "C" {
#endif

/// Code point of a byte that is not UTF-8.
#define IWN_PLAIN_BROKEN UINT32_MAX

/// Returns the code point at the beginning of the terminated `text`, and its number of bytes: 1 with IWN_PLAIN_BROKEN.
uint32_t iwn_plain_read(const char *text, size_t *out_bytes);

/// Returns true if the code point is plain. IWN_PLAIN_BROKEN is not.
bool iwn_plain_is(uint32_t code_point);

/// Returns true if all characters are plain.
bool iwn_plain_text(const char *text);

/// Replaces each byte of the characters that are not plain by a space.
void iwn_plain_blank(char *text);

/// Returns the number of leading bytes that JSON shows unchanged: printable ASCII without quote and backslash.
size_t iwn_plain_length(const char *text, size_t length);

/// Copies a text with `?` instead of each character that is not plain. Characters that do not fit are omitted as a
/// whole.
void iwn_plain_copy(const char *text, char *out, size_t size);

/// Copies the beginning of a valid line of JSON, with such characters as `\uXXXX` (a space between values). Returns the
/// rest; `*out_length` is the number of written bytes. With 12 bytes there is always progress.
const char *iwn_plain_json(const char *line, char *out, size_t size, size_t *out_length);

/// Writes the bytes of a valid code point. Returns their number, 1 to 4.
size_t iwn_utf8(uint32_t code_point, char out_bytes[4]);

/// Writes the decimal digits of a number so that they end at `end`; 20 bytes before it must be writable. Returns their
/// beginning.
char *iwn_digits(int64_t number, char *end);
/// Does the same with a number of 64 bits without a sign.
char *iwn_digits_unsigned(uint64_t number, char *end);
#define IWN_DIGITS_MAX 20U ///< Bytes of the longest number, with its sign.

/// Returns the number of bytes that `iwn_digits` writes for a number.
size_t iwn_digits_length(int64_t number);

/// Text in a buffer of its owner. It is always terminated; parts that do not fit are omitted.
typedef struct {
    char *data;    ///< The buffer.
    size_t size;   ///< Size of the buffer, at least 1.
    size_t length; ///< Length without the terminator.
} iwn_text_t;

/// Returns an empty text. `size` is at least 1.
iwn_text_t iwn_text_begin(char *data, size_t size);
/// Appends `length` bytes.
void iwn_text_span(iwn_text_t *self, const char *text, size_t length);
/// Appends a text.
void iwn_text_add(iwn_text_t *self, const char *text);
/// Appends decimal digits.
void iwn_text_int(iwn_text_t *self, int64_t number);
/// Appends decimal digits of a number of 64 bits without a sign.
void iwn_text_unsigned(iwn_text_t *self, uint64_t number);
/// Appends this number of hexadecimal digits, upper case.
void iwn_text_hex(iwn_text_t *self, uint32_t number, unsigned digits);

/// Appends texts: IWN_TEXT_JOIN(&text, name, " needs ", field).
#define IWN_TEXT_JOIN(self, ...) iwn_text_join((self), (const char *const[]){__VA_ARGS__, NULL})
/// Appends texts; the last one is NULL.
void iwn_text_join(iwn_text_t *self, const char *const *texts);

#ifdef __cplusplus
}
#endif
#endif
