// SPDX-License-Identifier: MIT
/// A command line taken apart into words, and the kinds of words that commands have.
///
/// Every reader returns false, leaving its output alone, for anything that is not exactly of its kind.
#ifndef SIM_WORDS_H
#define SIM_WORDS_H

#include "iwheel/can_frame.h"
#include "iwheel/types.h"

#define SIM_WORDS_MAX  64U
#define SIM_LINE_BYTES 256U

typedef struct {
    char text[SIM_LINE_BYTES]; ///< Taken apart.
    const char *word[SIM_WORDS_MAX];
    unsigned count;
} sim_words_t;

/// Inclusive.
typedef struct {
    int64_t min;
    int64_t max;
} sim_range_t;

/// False if the line is too long, has more than SIM_WORDS_MAX words, or bytes that are no printable ASCII.
bool sim_words_split(sim_words_t *self, const char *line);

/// True if `word` is `one` or `other`; `*out_one` tells which.
typedef struct {
    const char *one;
    const char *other;
} sim_choice_t;
bool sim_words_choice(const char *word, sim_choice_t choice, bool *out_one);

/// left, right or both, as a mask: bit n is side n. The other accepts no both.
bool sim_words_sides(const char *word, unsigned *out_mask);

bool sim_words_integer(const char *word, sim_range_t range, int64_t *out_value);

/// A decimal number with at most three digits behind the point, in thousandths. The range too.
bool sim_words_milli(const char *word, sim_range_t range, int64_t *out_milli);

/// A frame as candump logs it: ID#DATA, ID#R for remote; 3 hexadecimal digits are an 11-bit id, 8 a 29-bit id.
bool sim_words_frame(const char *word, iw_can_frame_t *out_frame);

#endif
