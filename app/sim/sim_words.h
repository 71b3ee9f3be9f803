// SPDX-License-Identifier: MIT
/// A command line split into words, and readers for the kinds of words in commands.
///
/// Every reader returns false and leaves its output unchanged for a word that is not exactly of its kind.
#ifndef SIM_WORDS_H
#define SIM_WORDS_H

#include "iwheel/can_frame.h"
#include "iwheel/types.h"

#define SIM_WORDS_MAX  64U
#define SIM_LINE_BYTES 256U

typedef struct {
    char text[SIM_LINE_BYTES]; ///< The line, with a NUL after each word.
    const char *word[SIM_WORDS_MAX];
    unsigned count;
} sim_words_t;

/// A range; both bounds belong to it.
typedef struct {
    int64_t min;
    int64_t max;
} sim_range_t;

/// Splits a line. Returns false if it is too long, has more than SIM_WORDS_MAX words, or bytes that are not printable
/// ASCII.
bool sim_words_split(sim_words_t *self, const char *line);

/// A choice of two words. sim_words_choice returns true if `word` is one of them; `*out_one` is true for `one`.
typedef struct {
    const char *one;
    const char *other;
} sim_choice_t;
bool sim_words_choice(const char *word, sim_choice_t choice, bool *out_one);

/// Reads left, right or both as a mask: bit n is side n.
bool sim_words_sides(const char *word, unsigned *out_mask);

bool sim_words_integer(const char *word, sim_range_t range, int64_t *out_value);

/// Reads a decimal number with at most three digits after the point, in thousandths; `range` is in thousandths too.
bool sim_words_milli(const char *word, sim_range_t range, int64_t *out_milli);

/// Reads a frame as candump logs it: ID#DATA, ID#R for remote; 3 hexadecimal digits are an 11-bit id, 8 a 29-bit id.
bool sim_words_frame(const char *word, iw_can_frame_t *out_frame);

#endif
