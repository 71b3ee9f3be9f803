// SPDX-License-Identifier: MIT
/// "Did you mean ...?": how far a mistyped word is from a known one. For messages only, nothing is guessed and then done.
#ifndef GATEWAY_SIMILAR_H
#define GATEWAY_SIMILAR_H

#include <stddef.h>

/// Not worth a question.
#define SETTINGS_WORD_STRANGE ((size_t)-1)

/// How many letters are to be changed, put in or taken out; 0 for the beginning of the known word, from three letters on.
/// SETTINGS_WORD_STRANGE if more than three, or more than half of the known word's letters.
size_t settings_word_distance(const char *typed, const char *known);

#endif
