// SPDX-License-Identifier: MIT
#include "value.h"

#include <stdarg.h>
#include <string.h>

#define GROUP_NAME_MAX   32U
#define OWNER_READ_WRITE 0600U

const settings_word_t settings_no_yes[] = {{"no", 0}, {"yes", 1}, {NULL, 0}};

bool settings_wrong(char out_why[SETTINGS_MESSAGE_SIZE], const char *format, ...) {
    va_list list;
    va_start(list, format);
    (void)vsnprintf(out_why, SETTINGS_MESSAGE_SIZE, format, list);
    va_end(list);
    return false;
}

static bool read_digits(const char *text, size_t length, uint32_t base, uint32_t *out_number) {
    uint32_t number = 0;
    for (size_t i = 0; i < length; i++) {
        const uint32_t digit = (uint32_t)(unsigned char)text[i] - (uint32_t)'0';
        if (digit >= base) {
            return false;
        }
        if (number <= UINT32_MAX / 16U) {
            number = number * base + digit;
        }
    }
    *out_number = number;
    return length > 0;
}

bool settings_digits(const char *text, size_t length, uint32_t *out_number) {
    return read_digits(text, length, 10U, out_number);
}

static void store(const settings_key_t *row, void *values, uint32_t number) {
    unsigned char *field = (unsigned char *)values + row->offset;
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

static uint32_t load(const settings_key_t *row, const void *values) {
    const unsigned char *field = (const unsigned char *)values + row->offset;
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

static void find_range(const settings_form_t *form, const settings_key_t *row, uint32_t *out_min, uint32_t *out_max) {
    *out_min = row->min;
    *out_max = row->max;
    if (row->range != 0U) {
        form->range(row->range, out_min, out_max);
    }
}

/// Lists the values that may be written: "20..500 ms", "cN or dN". Empty if the help lists them.
static void settings_value_choices(const settings_form_t *form, const settings_key_t *row, char *out, size_t size) {
    uint32_t min = 0;
    uint32_t max = 0;
    out[0] = '\0';
    if (row->kind == SETTINGS_NUMBER) {
        find_range(form, row, &min, &max);
        (void)snprintf(out, size, "%u..%u%s", (unsigned)min, (unsigned)max, row->unit);
    } else if (row->kind == SETTINGS_WORD) {
        size_t used = 0;
        for (const settings_word_t *word = row->words; word->word != NULL && used < size; word++) {
            const int n = snprintf(out + used, size - used, "%s%s", (used > 0) ? " or " : "", word->word);
            used += (n > 0) ? (size_t)n : size;
        }
    }
}

static bool parse_number(const settings_form_t *form, const settings_key_t *row, const char *text, uint32_t *out_number,
                         char out_why[SETTINGS_MESSAGE_SIZE]) {
    char choices[64];
    uint32_t min = 0;
    uint32_t max = 0;
    const bool negative = text[0] == '-';
    find_range(form, row, &min, &max);
    settings_value_choices(form, row, choices, sizeof choices);
    if (!read_digits(text + (negative ? 1 : 0), strlen(text) - (negative ? 1U : 0U), 10U, out_number)) {
        return settings_wrong(
            out_why,
            "%s = %s is not a whole decimal number; write digits alone (%s), the unit belongs to the key's name",
            row->key, text, choices);
    }
    if (row->not_zero != NULL && *out_number == 0) {
        return settings_wrong(out_why, "%s = %s: %s; write %s", row->key, text, row->not_zero, choices);
    }
    if (negative || *out_number < min || *out_number > max) {
        return settings_wrong(out_why, "%s = %s is out of range%s%s; write %s", row->key, text,
                              (row->rule != NULL) ? ": " : "", (row->rule != NULL) ? row->rule : "", choices);
    }
    return true;
}

static bool parse_word(const settings_form_t *form, const settings_key_t *row, const char *text, uint32_t *out_number,
                       char out_why[SETTINGS_MESSAGE_SIZE]) {
    char choices[SETTINGS_MESSAGE_SIZE / 2U];
    for (const settings_word_t *word = row->words; word->word != NULL; word++) {
        if (strcmp(word->word, text) == 0) {
            *out_number = word->value;
            return true;
        }
    }
    settings_value_choices(form, row, choices, sizeof choices);
    return settings_wrong(out_why, "%s = %s is not understood; write %s", row->key, text, choices);
}

static bool parse_mode(const settings_key_t *row, const char *text, uint32_t *out_number,
                       char out_why[SETTINGS_MESSAGE_SIZE]) {
    if (!read_digits(text, strlen(text), 8U, out_number) || *out_number > 0777U) {
        return settings_wrong(out_why, "%s = %s is not an octal file mode; write for example 0660", row->key, text);
    }
    if ((*out_number & OWNER_READ_WRITE) != OWNER_READ_WRITE) {
        return settings_wrong(out_why, "%s = %s locks the owner out of the socket; write for example 0660", row->key,
                              text);
    }
    return true;
}

/// Returns why a text cannot be written to the file, read again, or shown; NULL if it can.
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

const char *settings_wrong_socket(const char *text) {
    return (strlen(text) > 1U && text[strlen(text) - 1U] == '/') ? "is a directory, not a socket"
                                                                 : settings_wrong_address(text);
}

const char *settings_wrong_group(const char *text) {
    return (strlen(text) <= GROUP_NAME_MAX && strpbrk(text, " /:") == NULL) ? NULL : "is not a group name";
}

const char *settings_wrong_address(const char *text) {
    return (strcmp(text, "unix:") == 0) ? "has no path after unix:" : NULL;
}

static bool parse_text(const settings_key_t *row, const char *text, void *values, char out_why[SETTINGS_MESSAGE_SIZE]) {
    const char *reason = unfit(text);
    if (reason == NULL && row->wrong != NULL) {
        reason = row->wrong(text);
    }
    if (reason == NULL && strlen(text) >= row->size) {
        reason = (row->size < SETTINGS_PATH_SIZE) ? "is too long" : "is too long for a socket address (107 characters)";
    }
    if (reason != NULL) {
        return settings_wrong(out_why, "%s = %.130s %s; write another", row->key, text, reason);
    }
    char *field = (char *)values + row->offset;
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

bool settings_value_parse(const settings_form_t *form, const settings_key_t *row, const char *text, void *values,
                          char out_why[SETTINGS_MESSAGE_SIZE]) {
    uint32_t number = 0;
    bool good = false;
    if (text[0] == '\0') {
        return settings_wrong(out_why, "%s has no value; write one, or leave the key out to have its default",
                              row->key);
    }
    if (is_quoted(text)) {
        return settings_wrong(out_why, "%s = %.130s: quotes would be part of the value; write it without them",
                              row->key, text);
    }
    switch (row->kind) {
    case SETTINGS_NUMBER:
        good = parse_number(form, row, text, &number, out_why);
        break;
    case SETTINGS_WORD:
        good = parse_word(form, row, text, &number, out_why);
        break;
    case SETTINGS_MODE:
        good = parse_mode(row, text, &number, out_why);
        break;
    case SETTINGS_TEXT:
        return parse_text(row, text, values, out_why);
    case SETTINGS_OWN:
        return row->parse(text, values, out_why);
    }
    if (good) {
        store(row, values, number);
        if (row->set != 0U) {
            ((unsigned char *)values)[row->set] = true;
        }
    }
    return good;
}

/// Writes the value as in the file. Returns false if the key is not set.
static bool settings_value_format(const settings_key_t *row, const void *values, char out[SETTINGS_MESSAGE_SIZE]) {
    out[0] = '\0';
    switch (row->kind) {
    case SETTINGS_NUMBER:
        if ((row->set != 0U && ((const unsigned char *)values)[row->set] == 0U) ||
            (row->unset_is_0 && load(row, values) == 0U)) {
            return false;
        }
        (void)snprintf(out, SETTINGS_MESSAGE_SIZE, "%u", (unsigned)load(row, values));
        return true;
    case SETTINGS_MODE:
        (void)snprintf(out, SETTINGS_MESSAGE_SIZE, "%04o", (unsigned)load(row, values));
        return true;
    case SETTINGS_WORD:
        for (const settings_word_t *word = row->words; word->word != NULL; word++) {
            if (word->value == load(row, values)) {
                (void)snprintf(out, SETTINGS_MESSAGE_SIZE, "%s", word->word);
            }
        }
        return out[0] != '\0';
    case SETTINGS_TEXT:
        (void)snprintf(out, SETTINGS_MESSAGE_SIZE, "%s", (const char *)values + row->offset);
        return true;
    case SETTINGS_OWN:
        row->format(values, out);
        return true;
    }
    return false;
}

/// Column of the remark after a value.
#define REMARK_COLUMN 34

static const char *help_of(const settings_form_t *form, const settings_key_t *row) {
    const settings_help_t *help = form->help;
    while (help->section != NULL && (strcmp(help->section, row->section) != 0 || strcmp(help->key, row->key) != 0)) {
        help++;
    }
    return (help->section != NULL) ? help->text : "";
}

static void print_key(const settings_form_t *form, const settings_key_t *row, const void *values, const void *defaults,
                      FILE *out) {
    char choices[64];
    char value[SETTINGS_MESSAGE_SIZE];
    (void)fputs(help_of(form, row), out);
    const bool set = settings_value_format(row, values, value);
    const int width = fprintf(out, "%s%s = %s", set ? "" : ";", row->key, set ? value : "?");
    settings_value_choices(form, row, choices, sizeof choices);
    const bool has_default = settings_value_format(row, defaults, value);
    (void)fprintf(out, "%*s ; %s%s%s%s\n", (width < REMARK_COLUMN) ? REMARK_COLUMN - width : 0, "", choices,
                  (choices[0] != '\0') ? ", " : "", has_default ? "default " : "no default", value);
}

void settings_print(const settings_form_t *form, const void *values, const void *defaults, const settings_note_t *note,
                    FILE *out) {
    const char *section = "";
    for (size_t i = 0; i < form->count; i++) {
        const settings_key_t *row = &form->keys[i];
        if (strcmp(row->section, section) != 0) {
            section = row->section;
            (void)fprintf(out, "\n[%s]\n", section);
        }
        const char *noted = (note != NULL) ? note->say(note->context, section, row->key) : NULL;
        if (noted != NULL) {
            (void)fprintf(out, "; %s\n", noted);
        }
        print_key(form, row, values, defaults, out);
    }
}
