// SPDX-License-Identifier: MIT
/// Words after a verb: options with or without a value, and at most one other word.
#ifndef CTL_WORDS_H
#define CTL_WORDS_H

#include "text/duration.h"

typedef struct option {
    const char *name; ///< Such as "--for"; NULL ends a list.
    /// Writes the value of the option, the next word, to `out`; `value` is NULL if there is no next word. Returns an
    /// exit code, after it has reported what is wrong. NULL: the option has no value and sets the bool `out`.
    int (*read)(const struct option *option, const char *verb, const char *value);
    void *out;
    const char *wants;      ///< For a text: description of the value; NULL: see the verb's page.
    duration_range_t range; ///< For a time.
} option_t;

/// A row of a list of options.
#define OPTION(name_, read_, out_) .name = (name_), .read = (read_), .out = (out_)

/// Reads a text; `out` is a `const char *`.
int option_text(const option_t *option, const char *verb, const char *value);
/// Reads a time; `out` is an int64_t in microseconds.
int option_time(const option_t *option, const char *verb, const char *value);

typedef struct {
    const char *verb;
    const option_t *options;
    bool (*is_word)(const char *word); ///< True if this can be the other word.
    const char **word;                 ///< Unchanged if there is none.
} words_syntax_t;

/// Reads the words. Returns an exit code, after it has reported what is wrong.
int words_read(const words_syntax_t *self, int count, char **words);

/// Returns true for a word that is not an option; `-` counts as an option.
bool words_is_name(const char *word);
/// Returns true for a word that is not an option; `-` is accepted too.
bool words_is_file(const char *word);

/// Returns true if there are at most `most` words; otherwise reports the first one too many and returns false.
bool words_at_most(const char *verb, int count, int most, char **words);

#endif
