// SPDX-License-Identifier: MIT
/// Text for people: safe on a terminal, with units, `--` for what is not known.
#ifndef CTL_TEXT_H
#define CTL_TEXT_H

#include "iwheel/config.h"
#include "iwheel_northbound/text.h"

#include <jansson.h>
#include <stdarg.h>
#include <stdbool.h>
#include <stdio.h>

/// Long enough for every cell.
#define TEXT_CELL 48U

/// Writes `text` without what moves a terminal (iwheel_northbound/text.h): names and reasons come from other people's programs.
void text_safe(const char *text, FILE *out);

/// The same into a buffer; what does not fit is left out.
void text_clean(const char *text, char *out, size_t size);

/// The same of a formatted text, as a line of its own.
__attribute__((format(printf, 2, 3))) void text_line(FILE *out, const char *format, ...);
__attribute__((format(printf, 2, 0))) void text_vline(FILE *out, const char *format, va_list list);

/// Writes a line of JSON, which may come from a hostile program, as it is but for such characters: these by number.
void text_json(const char *line, FILE *out);

/// The same of a value. False if there is not enough memory.
bool text_json_value(const json_t *value, FILE *out);

/// True if `out` is a terminal that wants colours (NO_COLOR and TERM=dumb say no).
bool text_wants_colour(FILE *out);

/// How many columns of a line may be written over and over on `out`; 0 if it is no terminal, or one that cannot (TERM=dumb).
unsigned text_live_columns(FILE *out);

/// "%lld unit", or "--" if `value` is no integer.
void text_integer(const json_t *value, const char *unit, char out[TEXT_CELL]);

/// The integer divided by 10 to the power of `digits`, with that many decimals and the unit; "--" if it is none.
void text_decimal(const json_t *value, unsigned digits, const char *unit, char out[TEXT_CELL]);

/// The same of a number that is known.
void text_number(long long number, unsigned digits, const char *unit, char out[TEXT_CELL]);

/// The same without a unit, to a text.
void text_add_number(iwn_text_t *text, long long number, unsigned digits);

/// An age in ms in the unit that suits it: "12 ms", "3.4 s", "5 min", "7 h", "2 days"; "--" if it is none.
void text_age(const json_t *age_ms, char out[TEXT_CELL]);

/// The string of that field, or "--".
const char *text_word(const json_t *object, const char *field);

/// "left" or "right".
const char *text_side(unsigned side);

/// How much of the text stands in a line of so many columns: broken between words, if there is more than one.
size_t text_cut(const char *text, size_t room);

/// Date and time of day here; "--" if there are none.
void text_when(json_int_t wall_us, char out[TEXT_CELL]);

// --- labelled lines on a terminal or in a pipe: widths, tones, safe texts ----------------------------------------

#define PAPER_WIDTH 80U
/// Labels stand before this column.
#define PAPER_LABEL 14U
/// Width of one wheel's column.
#define PAPER_CELL 33U

typedef enum { TONE_PLAIN = 0, TONE_TITLE, TONE_GOOD, TONE_CARE, TONE_BAD, TONE_FAINT } tone_t;

typedef struct {
    FILE *out;
    bool colour;
} paper_t;

/// Text in a tone, padded to `width` (0: as it is); what could command a terminal is replaced.
void paper_text(const paper_t *self, tone_t tone, unsigned width, const char *text);

/// The same of a formatted text, not padded.
__attribute__((format(printf, 3, 4))) void paper_say(const paper_t *self, tone_t tone, const char *format, ...);

/// Begins a line: the label, padded.
void paper_label(const paper_t *self, const char *label);

/// A whole line: label and text, broken between words into the column after the labels.
void paper_wrap(const paper_t *self, const char *label, tone_t tone, const char *text);

void paper_end(const paper_t *self);

#endif
