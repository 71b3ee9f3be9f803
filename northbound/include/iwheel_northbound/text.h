// SPDX-License-Identifier: MIT
/// Plain text: nothing in it moves a terminal's cursor, changes its state, or turns the order of what is shown.
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

bool iwn_plain_is(uint32_t code_point);

/// True if all of it is plain.
bool iwn_plain_text(const char *text);

/// Copies with a `?` in place of each character that is not plain; what does not fit is left out, never half a character.
void iwn_plain_copy(const char *text, char *out, size_t size);

/// Copies a line of JSON that is right in form, as much of it as fits, with such characters as \uXXXX (a space between
/// values). Returns where to go on; `*out_length` bytes were written. 12 bytes are enough to go on at all.
const char *iwn_plain_json(const char *line, char *out, size_t size, size_t *out_length);

#endif
