// SPDX-License-Identifier: MIT
/// The table of keys: everything the configuration file may say, in the order in which it is printed.
///
/// Private to the configuration reader. A row tells where a value lives in `gateway_config_t`, so that reading, range
/// checks, messages and printing need no code per key.
#ifndef CONFIG_KEYS_H
#define CONFIG_KEYS_H

#include "gateway_config.h"

/// How a value is written.
typedef enum {
    CONFIG_NUMBER,    ///< Decimal, within the range of the row.
    CONFIG_TYPE,      ///< The setpoint type: a number that may be unset.
    CONFIG_WORD,      ///< One of `words`.
    CONFIG_RATIO,     ///< `N` or `N/M`: the gear ratio.
    CONFIG_MODE,      ///< Octal permission bits.
    CONFIG_INTERFACE, ///< SocketCAN name or `unix:PATH`.
    CONFIG_LINE,      ///< The e-stop line.
    CONFIG_PATH,
    CONFIG_GROUP,
} config_kind_t;

typedef struct {
    const char *word;
    uint8_t value;
} config_word_t;

typedef struct {
    const char *section;
    const char *key;
    const char *unit; ///< For messages, with a leading space; may be empty.
    const char *help; ///< Printed above the key; lines end with '\n' except the last.
    config_kind_t kind;
    uint16_t offset;            ///< Into gateway_config_t.
    uint16_t size;              ///< Of the field.
    iw_config_fault_t range_of; ///< The core's range applies; else IW_CONFIG_OK and `min`, `max` do.
    uint32_t min;
    uint32_t max;
    const config_word_t *words; ///< CONFIG_WORD: ends with a null word.
} config_key_t;

/// Upper bound of the number of rows, for arrays with one element per row.
#define CONFIG_KEYS_MAX 52U

/// The rows and their number.
extern const config_key_t config_keys[];
extern const size_t config_key_count;

/// The row, or a null pointer.
const config_key_t *config_key_find(const char *section, const char *key);

/// The row of this key in any section, or a null pointer.
const config_key_t *config_key_elsewhere(const char *key);

/// The row of this section whose key looks most like it, or a null pointer if none comes close.
const config_key_t *config_key_similar(const char *section, const char *key);

/// True if the section exists.
bool config_section_known(const char *section);

/// Writes the names of the sections (`section` null) or of a section's keys, separated by commas.
void config_keys_list(const char *section, char *out, size_t size);

#endif
