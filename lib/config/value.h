// SPDX-License-Identifier: MIT
/// One value of a configuration: from text to its field and back. Private to the reader and the printer.
///
/// Nothing is guessed: trailing characters, signs, units and other bases are refused.
#ifndef IWHEEL_SETTINGS_VALUE_H
#define IWHEEL_SETTINGS_VALUE_H

#include "settings.h"

/// Stores the value. False, with `values` untouched and what is wrong with it and what to write in `out_why`, if it is not one
/// of this key's values.
bool settings_value_parse(const settings_form_t *form, const settings_key_t *row, const char *text, void *values,
                          char out_why[SETTINGS_MESSAGE_SIZE]);

#endif
