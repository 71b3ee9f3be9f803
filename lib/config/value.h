// SPDX-License-Identifier: MIT
/// Conversion of one value of a configuration between text and field. For the reader and the printer only.
///
/// Trailing characters, signs, units and other bases are refused.
#ifndef IWHEEL_SETTINGS_VALUE_H
#define IWHEEL_SETTINGS_VALUE_H

#include "settings.h"

/// Stores the value. Returns false and leaves `values` unchanged if it is not valid for this key; `out_why` then has
/// what is wrong and what to write.
bool settings_value_parse(const settings_form_t *form, const settings_key_t *row, const char *text, void *values,
                          char out_why[SETTINGS_MESSAGE_SIZE]);

#endif
