// SPDX-License-Identifier: MIT
/// Labelled lines on a terminal or in a pipe: widths, tones, safe texts. No state of its own beside where it writes.
#ifndef PAPER_H
#define PAPER_H

#include <stdbool.h>
#include <stdio.h>

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
