// SPDX-License-Identifier: MIT
/// The words behind a verb: options, with a value or without, and at most one word that is none.
#ifndef CTL_WORDS_H
#define CTL_WORDS_H

#include "text/duration.h"

typedef struct option {
    const char *name; ///< Such as "--for"; NULL ends a list.
    /// What its value, the next word, does to `out`; NULL stands for a word that is not there. An exit code, after telling
    /// what is wrong. Without a function it has no value, and sets the bool `out`.
    int (*take)(const struct option *option, const char *verb, const char *value);
    void *out;
    const char *wants;      ///< Of a text: what to write; NULL: see the verb's page.
    duration_range_t range; ///< Of a time.
} option_t;

/// A row of a list of them.
#define OPTION(name_, take_, out_) .name = (name_), .take = (take_), .out = (out_)

/// `out` is a `const char *`.
int option_text(const option_t *option, const char *verb, const char *value);
/// `out` is an int64_t in microseconds.
int option_time(const option_t *option, const char *verb, const char *value);

typedef struct {
    const char *verb;
    const option_t *options;
    bool (*is_word)(const char *word); ///< Whether this can be the word that is no option.
    const char **word;                 ///< Stays as it is if there is none.
} words_syntax_t;

/// An exit code, after telling what is wrong.
int words_read(const words_syntax_t *self, int count, char **words);

/// What is no option; `-` alone is one all the same.
bool words_is_name(const char *word);
/// What is no option; also `-`.
bool words_is_file(const char *word);

/// True if there are no more words than `most`; else tells so.
bool words_at_most(const char *verb, int count, int most, char **words);

#endif
