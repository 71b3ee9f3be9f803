// SPDX-License-Identifier: MIT
/// One value of the configuration: from text to its field and back.
///
/// Private to the configuration reader. Nothing is guessed: trailing characters, signs, units and other bases are
/// refused.
#ifndef CONFIG_VALUE_H
#define CONFIG_VALUE_H

#include "config_keys.h"

/// Long enough for every message and every value.
#define CONFIG_MESSAGE_SIZE 512U

/// Stores the value. False, with `config` untouched and what is wrong with it and what to write in `out_why` (of
/// CONFIG_MESSAGE_SIZE bytes), if it is not one of this key's values.
bool config_value_parse(const config_key_t *row, const char *text, gateway_config_t *config, char *out_why);

/// Writes the value as the file has it into `out` (of CONFIG_MESSAGE_SIZE bytes). False if the key is unset.
bool config_value_format(const config_key_t *row, const gateway_config_t *config, char *out);

/// The inclusive range of a CONFIG_NUMBER or CONFIG_TYPE.
void config_value_range(const config_key_t *row, uint32_t *out_min, uint32_t *out_max);

/// What may be written, for a human: "20..500 ms", "cN or dN"; empty where the help says it.
void config_value_choices(const config_key_t *row, char *out, size_t size);

#endif
