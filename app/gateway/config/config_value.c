// SPDX-License-Identifier: MIT
#include "config_value.h"

#include <stdarg.h>
#include <string.h>

#define GEAR_TERM_MAX      1000U
#define INTERFACE_NAME_MAX 15U
#define GROUP_NAME_MAX     32U
#define OWNER_READ_WRITE   0600U

__attribute__((format(printf, 2, 3))) static bool wrong(char *out_why, const char *format, ...) {
    va_list list;
    va_start(list, format);
    (void)vsnprintf(out_why, CONFIG_MESSAGE_SIZE, format, list);
    va_end(list);
    return false;
}

/// True for digits of that base and nothing else. The result stops growing above UINT32_MAX / 16.
static bool read_digits(const char *text, size_t length, uint32_t base, uint32_t *out_number) {
    uint32_t number = 0;
    for (size_t i = 0; i < length; i++) {
        const uint32_t digit = (uint32_t)(unsigned char)text[i] - (uint32_t)'0';
        if (digit >= base) {
            return false;
        }
        number = (number > UINT32_MAX / 16U) ? number : number * base + digit;
    }
    *out_number = number;
    return length > 0;
}

static void store(const config_key_t *row, gateway_config_t *config, uint32_t number) {
    unsigned char *field = (unsigned char *)config + row->offset;
    const uint8_t narrow = (uint8_t)number;
    const uint16_t middle = (uint16_t)number;
    if (row->size == sizeof narrow) {
        memcpy(field, &narrow, sizeof narrow);
    } else if (row->size == sizeof middle) {
        memcpy(field, &middle, sizeof middle);
    } else {
        memcpy(field, &number, sizeof number);
    }
}

static uint32_t load(const config_key_t *row, const gateway_config_t *config) {
    const unsigned char *field = (const unsigned char *)config + row->offset;
    uint8_t narrow = 0;
    uint16_t middle = 0;
    uint32_t number = 0;
    if (row->size == sizeof narrow) {
        memcpy(&narrow, field, sizeof narrow);
        return narrow;
    }
    if (row->size == sizeof middle) {
        memcpy(&middle, field, sizeof middle);
        return middle;
    }
    memcpy(&number, field, sizeof number);
    return number;
}

void config_value_range(const config_key_t *row, uint32_t *out_min, uint32_t *out_max) {
    *out_min = row->min;
    *out_max = row->max;
    if (row->range_of != IW_CONFIG_OK) {
        const iw_config_range_t range = iw_config_range(row->range_of);
        *out_min = range.min;
        *out_max = range.max;
    }
}

void config_value_choices(const config_key_t *row, char *out, size_t size) {
    uint32_t min = 0;
    uint32_t max = 0;
    out[0] = '\0';
    if (row->kind == CONFIG_NUMBER || row->kind == CONFIG_TYPE) {
        config_value_range(row, &min, &max);
        (void)snprintf(out, size, "%u..%u%s", (unsigned)min, (unsigned)max, row->unit);
    } else if (row->kind == CONFIG_WORD) {
        (void)snprintf(out, size, "%s or %s", row->words[0].word, row->words[1].word);
    }
}

static bool parse_number(const config_key_t *row, const char *text, uint32_t *out_number, char *out_why) {
    char choices[64];
    uint32_t min = 0;
    uint32_t max = 0;
    const bool negative = text[0] == '-';
    config_value_range(row, &min, &max);
    config_value_choices(row, choices, sizeof choices);
    if (!read_digits(text + (negative ? 1 : 0), strlen(text) - (negative ? 1U : 0U), 10U, out_number)) {
        return wrong(
            out_why,
            "%s = %s is not a whole decimal number; write digits alone (%s), the unit belongs to the key's name",
            row->key, text, choices);
    }
    if (row->range_of == IW_CONFIG_LEASE && *out_number == 0) {
        return wrong(out_why,
                     "%s = %s: the lease cannot be disabled, it stops the wheels when the client dies; write %s",
                     row->key, text, choices);
    }
    if (negative || *out_number < min || *out_number > max) {
        return wrong(out_why, "%s = %s is out of range; write %s", row->key, text, choices);
    }
    return true;
}

static bool parse_word(const config_key_t *row, const char *text, uint32_t *out_number, char *out_why) {
    for (const config_word_t *word = row->words; word->word != NULL; word++) {
        if (strcmp(word->word, text) == 0) {
            *out_number = word->value;
            return true;
        }
    }
    return wrong(out_why, "%s = %s is not understood; write %s or %s", row->key, text, row->words[0].word,
                 row->words[1].word);
}

static bool parse_mode(const config_key_t *row, const char *text, uint32_t *out_number, char *out_why) {
    if (!read_digits(text, strlen(text), 8U, out_number) || *out_number > 0777U) {
        return wrong(out_why, "%s = %s is not an octal file mode; write for example 0660", row->key, text);
    }
    if ((*out_number & OWNER_READ_WRITE) != OWNER_READ_WRITE) {
        return wrong(out_why, "%s = %s takes the socket from its owner; write for example 0660", row->key, text);
    }
    return true;
}

static bool parse_ratio(const config_key_t *row, const char *text, gateway_config_t *config, char *out_why) {
    const char *slash = strchr(text, '/');
    uint32_t turns = 0;
    uint32_t per = 1;
    const size_t first = (slash != NULL) ? (size_t)(slash - text) : strlen(text);
    if (!read_digits(text, first, 10U, &turns) ||
        (slash != NULL && !read_digits(slash + 1, strlen(slash + 1), 10U, &per))) {
        return wrong(out_why, "%s = %s is not N or N/M; write rotor turns per wheel turn, for example 1 or 27/2",
                     row->key, text);
    }
    if (turns < 1U || turns > GEAR_TERM_MAX || per < 1U || per > GEAR_TERM_MAX) {
        return wrong(out_why, "%s = %s is out of range; write N and M within 1..1000", row->key, text);
    }
    iw_config_t trial;
    iw_config_default(&trial);
    trial.gear_turns = (uint16_t)turns;
    trial.gear_per = (uint16_t)per;
    if (iw_config_check(&trial) != IW_CONFIG_OK) {
        return wrong(out_why, "%s = %s is out of range; rotor turns per wheel turn must lie within 1..100", row->key,
                     text);
    }
    config->core.gear_turns = trial.gear_turns;
    config->core.gear_per = trial.gear_per;
    return true;
}

/// What makes a text unfit to be written into the file and read again, or shown; a null pointer if nothing.
static const char *unfit(const char *text) {
    const size_t length = strlen(text);
    if (length == 0 || text[0] == ' ' || text[length - 1U] == ' ') {
        return "begins or ends with a space, or is empty";
    }
    for (size_t i = 0; i < length; i++) {
        const unsigned char c = (unsigned char)text[i];
        if (c < 0x20U || c > 0x7EU) {
            return "holds a character that is not printable ASCII";
        }
        if (c == ';') {
            return "holds a semicolon, which begins a comment";
        }
    }
    return NULL;
}

static const char *wrong_address(const char *text, size_t size) {
    if (strncmp(text, "unix:", 5) == 0 && text[5] == '\0') {
        return "has no path after unix:";
    }
    return (strlen(text) < size) ? NULL : "is too long for a socket address (107 characters)";
}

/// What is wrong with a text, or a null pointer.
static const char *wrong_text(const config_key_t *row, const char *text) {
    const size_t length = strlen(text);
    const char *reason = unfit(text);
    if (reason != NULL) {
        return reason;
    }
    if (row->kind == CONFIG_PATH && text[length - 1U] == '/' && length > 1U && strcmp(row->key, "socket") == 0) {
        return "is a directory, not a socket";
    }
    if (row->kind == CONFIG_GROUP) {
        return (length <= GROUP_NAME_MAX && strpbrk(text, " /:") == NULL) ? NULL : "is not a group name";
    }
    if (row->kind == CONFIG_INTERFACE && strncmp(text, "unix:", 5) != 0) {
        return (length <= INTERFACE_NAME_MAX && strpbrk(text, " /:") == NULL)
                   ? NULL
                   : "is neither an interface name (at most 15 characters, such as can0) nor unix:PATH";
    }
    return wrong_address(text, row->size);
}

static bool parse_text(const config_key_t *row, const char *text, gateway_config_t *config, char *out_why) {
    const char *reason = wrong_text(row, text);
    if (reason != NULL) {
        return wrong(out_why, "%s = %.130s %s; write another", row->key, text, reason);
    }
    char *field = (char *)config + row->offset;
    memset(field, 0, row->size);
    memcpy(field, text, strlen(text) + 1U);
    return true;
}

static bool is_quote(char c) {
    return c == '"' || c == '\'';
}

static bool is_quoted(const char *text) {
    return is_quote(text[0]) || is_quote(text[strlen(text) - 1U]);
}

bool config_value_parse(const config_key_t *row, const char *text, gateway_config_t *config, char *out_why) {
    uint32_t number = 0;
    bool good = false;
    if (text[0] == '\0') {
        return wrong(out_why, "%s has no value; write one, or leave the key out to have its default", row->key);
    }
    if (is_quoted(text)) {
        return wrong(out_why, "%s = %.130s: quotes would be part of the value; write it without them", row->key, text);
    }
    switch (row->kind) {
    case CONFIG_NUMBER:
    case CONFIG_TYPE:
        good = parse_number(row, text, &number, out_why);
        break;
    case CONFIG_WORD:
        good = parse_word(row, text, &number, out_why);
        break;
    case CONFIG_MODE:
        good = parse_mode(row, text, &number, out_why);
        break;
    case CONFIG_RATIO:
        return parse_ratio(row, text, config, out_why);
    case CONFIG_INTERFACE:
    case CONFIG_LINE:
    case CONFIG_PATH:
    case CONFIG_GROUP:
        return parse_text(row, text, config, out_why);
    }
    if (good) {
        store(row, config, number);
        config->core.setpoint_type_set = config->core.setpoint_type_set || row->kind == CONFIG_TYPE;
    }
    return good;
}

bool config_value_format(const config_key_t *row, const gateway_config_t *config, char *out) {
    const iw_config_t *core = &config->core;
    out[0] = '\0';
    switch (row->kind) {
    case CONFIG_TYPE:
        if (!core->setpoint_type_set) {
            return false;
        }
        (void)snprintf(out, CONFIG_MESSAGE_SIZE, "%u", (unsigned)core->setpoint_type);
        return true;
    case CONFIG_NUMBER:
        (void)snprintf(out, CONFIG_MESSAGE_SIZE, "%u", (unsigned)load(row, config));
        return true;
    case CONFIG_MODE:
        (void)snprintf(out, CONFIG_MESSAGE_SIZE, "%04o", (unsigned)load(row, config));
        return true;
    case CONFIG_RATIO:
        (void)snprintf(out, CONFIG_MESSAGE_SIZE, (core->gear_per == 1U) ? "%u" : "%u/%u", (unsigned)core->gear_turns,
                       (unsigned)core->gear_per);
        return true;
    case CONFIG_WORD:
        for (const config_word_t *word = row->words; word->word != NULL; word++) {
            if (word->value == load(row, config)) {
                (void)snprintf(out, CONFIG_MESSAGE_SIZE, "%s", word->word);
            }
        }
        return out[0] != '\0';
    case CONFIG_INTERFACE:
    case CONFIG_LINE:
    case CONFIG_PATH:
    case CONFIG_GROUP:
        (void)snprintf(out, CONFIG_MESSAGE_SIZE, "%s", (const char *)config + row->offset);
        return true;
    }
    return false;
}
