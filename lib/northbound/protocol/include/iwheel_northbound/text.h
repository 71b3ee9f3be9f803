// SPDX-License-Identifier: MIT
/// @file
/// Texts: which are fit to be shown, and how one is put together from parts, without stdio.
///
/// A plain text: nothing in it moves a terminal's cursor, changes its state, or turns the order of what is shown.
///
/// Not plain are the control characters (U+0000-001F, U+007F-009F), the separators of lines and paragraphs (U+2028,
/// U+2029), Unicode's bidirectional controls (U+061C, U+200E, U+200F, U+202A-202E, U+2066-2069), and bytes that are
/// no UTF-8, which an old terminal takes for control characters. Such a text is refused where it comes in, and nothing of
/// it is printed raw. Pure functions.
#ifndef IWHEEL_NORTHBOUND_TEXT_H
#define IWHEEL_NORTHBOUND_TEXT_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

/// What a byte that is no UTF-8 reads as.
#define IWN_PLAIN_BROKEN UINT32_MAX

/// The code point that begins at `text`, which ends with a zero byte, and how many bytes it has: 1 with IWN_PLAIN_BROKEN.
uint32_t iwn_plain_read(const char *text, size_t *out_bytes);

/// True if it is plain: not for IWN_PLAIN_BROKEN.
bool iwn_plain_is(uint32_t code_point);

/// True if all of it is plain.
bool iwn_plain_text(const char *text);

/// How many of the bytes from there on stand in JSON as they are: ASCII that moves nothing, no quote, no backslash.
size_t iwn_plain_length(const char *text, size_t length);

/// Copies with a `?` in place of each character that is not plain; what does not fit is left out, never half a character.
void iwn_plain_copy(const char *text, char *out, size_t size);

/// Copies a line of JSON that is right in form, as much of it as fits, with such characters as `\uXXXX` (a space between
/// values). Returns where to go on; `*out_length` bytes were written. 12 bytes are enough to go on at all.
const char *iwn_plain_json(const char *line, char *out, size_t size, size_t *out_length);

/// The bytes of a code point that is one; how many, 1 to 4.
size_t iwn_utf8(uint32_t code_point, char out_bytes[4]);

/// Writes the decimal digits of a number so that they end at `end`, which 20 bytes must lie before. Where they begin.
char *iwn_digits(int64_t number, char *end);
#define IWN_DIGITS_MAX 20U ///< Bytes of the longest number, with its sign.

/// A text being put together in a buffer of its owner's. It ends with a zero byte at any time; what does not fit is left out.
typedef struct {
    char *data;    ///< The buffer.
    size_t size;   ///< Of the buffer, at least 1.
    size_t length; ///< Without the zero byte.
} iwn_text_t;

/// Empty. The size is at least 1.
iwn_text_t iwn_text_begin(char *data, size_t size);
/// Adds `length` bytes.
void iwn_text_span(iwn_text_t *self, const char *text, size_t length);
/// Adds a whole text.
void iwn_text_add(iwn_text_t *self, const char *text);
/// Adds decimal digits.
void iwn_text_int(iwn_text_t *self, int64_t number);
/// So many hexadecimal digits, upper case.
void iwn_text_hex(iwn_text_t *self, uint32_t number, unsigned digits);

/// Adds texts: IWN_TEXT_JOIN(&text, name, " needs ", field).
#define IWN_TEXT_JOIN(self, ...) iwn_text_join((self), (const char *const[]){__VA_ARGS__, NULL})
/// Adds texts, the last of which is NULL.
void iwn_text_join(iwn_text_t *self, const char *const *texts);

#endif
