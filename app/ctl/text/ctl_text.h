// SPDX-License-Identifier: MIT
/// Text output: safe on a terminal, with units, `--` for unknown values.
#ifndef CTL_TEXT_H
#define CTL_TEXT_H

#include "iwheel/config.h"
#include "iwheel_northbound/text.h"

#include <jansson.h>
#include <stdarg.h>
#include <stdbool.h>
#include <stdio.h>

/// Size of the longest cell.
#define TEXT_CELL 48U

/// Writes `text` without characters that control a terminal (iwheel_northbound/text.h): names and reasons come from
/// other programs.
void text_safe(const char *text, FILE *out);

/// Writes to a buffer as text_safe does; text that does not fit is left out.
void text_clean(const char *text, char *out, size_t size);

/// Write a formatted text as text_safe does, as a line of its own.
__attribute__((format(printf, 2, 3))) void text_line(FILE *out, const char *format, ...);
__attribute__((format(printf, 2, 0))) void text_vline(FILE *out, const char *format, va_list list);

/// Writes a line of JSON, which may come from a hostile program. Characters that control a terminal are escaped by
/// number.
void text_json(const char *line, FILE *out);

/// Writes a value as text_json does. Returns false if there is not enough memory.
bool text_json_value(const json_t *value, FILE *out);

/// Returns true if `out` is a terminal with colours (false with NO_COLOR or TERM=dumb).
bool text_wants_colour(FILE *out);

/// Returns the number of columns of a line that can be rewritten on `out`; 0 if it is not a terminal, or cannot do it
/// (TERM=dumb).
unsigned text_live_columns(FILE *out);

/// Writes "%lld unit", or "--" if `value` is not an integer.
void text_integer(const json_t *value, const char *unit, char out[TEXT_CELL]);

/// Writes the integer divided by 10 to the power of `digits`, with that many decimals and the unit; "--" if it is not
/// an integer.
void text_decimal(const json_t *value, unsigned digits, const char *unit, char out[TEXT_CELL]);

/// Most decimals of a number.
#define TEXT_DECIMALS_MAX 6U

/// Appends a known number as text_decimal writes it, with at most TEXT_DECIMALS_MAX decimals.
void text_add_number(long long number, unsigned digits, const char *unit, iwn_text_t *text);
/// Writes a known number as text_add_number does.
void text_number(long long number, unsigned digits, const char *unit, char out[TEXT_CELL]);

/// Writes an age in ms in a suitable unit: "12 ms", "3.4 s", "5 min", "7 h", "2 days"; "--" if it is not an age.
void text_age(const json_t *age_ms, char out[TEXT_CELL]);

/// Returns the string of that field, or "--".
const char *text_word(const json_t *object, const char *field);

/// Returns "left" or "right".
const char *text_side(unsigned side);

/// Returns the length of the text that fits in a line of `columns` columns; it is broken between words if possible.
size_t text_cut(const char *text, size_t columns);

/// Writes the local date and time; "--" if there are none.
void text_when(json_int_t wall_us, char out[TEXT_CELL]);

// --- labelled lines on a terminal or in a pipe: widths, tones, safe texts ----------------------------------------

#define PAPER_WIDTH 80U
/// Labels are written before this column.
#define PAPER_LABEL 14U
/// Width of one wheel's column.
#define PAPER_CELL 33U

typedef enum { TONE_PLAIN = 0, TONE_TITLE, TONE_GOOD, TONE_CARE, TONE_BAD, TONE_FAINT } tone_t;

typedef struct {
    FILE *out;
    bool colour;
} paper_t;

/// Writes text in a tone, padded to `width` (0: not padded); characters that control a terminal are replaced.
void paper_text(const paper_t *self, tone_t tone, unsigned width, const char *text);

/// Writes a formatted text, not padded.
__attribute__((format(printf, 3, 4))) void paper_print(const paper_t *self, tone_t tone, const char *format, ...);

/// Begins a line: writes the label, padded.
void paper_label(const paper_t *self, const char *label);

/// Writes a whole line: label and text, broken between words into the column after the labels.
void paper_wrap(const paper_t *self, const char *label, tone_t tone, const char *text);

void paper_end(const paper_t *self);

#endif
