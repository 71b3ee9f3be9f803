// SPDX-License-Identifier: MIT
/// Distance between a mistyped word and a known one, for "did you mean" messages. Nothing is done by a guess.
#ifndef GATEWAY_SIMILAR_H
#define GATEWAY_SIMILAR_H

#include <stddef.h>

/// Result for words that are not similar.
#define SETTINGS_WORD_STRANGE ((size_t)-1)

/// Returns the number of letters to change, insert or remove. The result is 0 for the beginning of the known word, from
/// three letters on, and SETTINGS_WORD_STRANGE above three, or above half of the known word's letters.
size_t settings_word_distance(const char *typed, const char *known);

#endif
