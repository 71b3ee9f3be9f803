// SPDX-License-Identifier: MIT
/// Configuration files that a table describes: reads them, checks them as a whole, and prints them.
///
/// Link `iwheel_settings` and include "config/settings.h". A program describes its keys once (`settings_form_t`);
/// reading, range checks, messages and printing need no code per key. Errors are reported as `FILE:LINE: what is wrong;
/// what to do`, the first 20 of them. Use it at the start only: it reads a file and writes to a stream, so it may
/// block.
#ifndef IWHEEL_SETTINGS_H
#define IWHEEL_SETTINGS_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>

/// Result of reading on any error: EX_CONFIG of sysexits.
#define SETTINGS_ERROR 78
/// Largest size of a file.
#define SETTINGS_FILE_MAX 65536U
/// Size of every message and every value.
#define SETTINGS_MESSAGE_SIZE 512U
/// Largest number of rows of a table.
#define SETTINGS_KEYS_MAX 64U
/// Number of errors that are written; further ones are counted.
#define SETTINGS_ERRORS_SHOWN 20U
/// Size of a path of a unix socket, with its terminator.
#define SETTINGS_PATH_SIZE 108U

/// Form of a value.
typedef enum {
    SETTINGS_NUMBER, ///< Decimal, within the range of the row.
    SETTINGS_WORD,   ///< One of `words`.
    SETTINGS_MODE,   ///< Octal permission bits, always with read and write of the owner.
    SETTINGS_TEXT,   ///< Printable, without `;`, not empty, no longer than the field; `wrong` may check more.
    SETTINGS_OWN,    ///< Read and written by `parse` and `format`.
} settings_kind_t;

typedef struct {
    const char *word;
    uint8_t value;
} settings_word_t;

/// The words of a switch.
extern const settings_word_t settings_no_yes[];

/// One key. Its value is a field in the program's structure of values.
typedef struct {
    const char *section;
    const char *key;
    const char *unit; ///< Unit for messages, with a leading space; may be empty.
    settings_kind_t kind;
    uint16_t offset; ///< Offset of the field in the values.
    uint16_t size;   ///< Size of the field: a number of 1, 2 or 4 bytes, or a text with its terminator.
    uint16_t set; ///< SETTINGS_NUMBER: offset of a bool that is true once the key is set; 0 if it always has a value.
    bool unset_is_0; ///< SETTINGS_NUMBER: 0, which is outside the range, means that the key is not set.
    uint16_t range;  ///< SETTINGS_NUMBER: argument of the form's `range`; 0 if `min` and `max` apply.
    uint32_t min;
    uint32_t max;
    const char *not_zero; ///< SETTINGS_NUMBER: reason why 0 is refused, or NULL.
    const char *rule;     ///< SETTINGS_NUMBER: rule that limits the range, for the message; NULL if there is none.
    const settings_word_t *words; ///< SETTINGS_WORD: two or more words; the last one is NULL.
    /// SETTINGS_TEXT: returns what is wrong with the text, as in "TEXT is not a group name", or NULL.
    const char *(*wrong)(const char *text);
    /// SETTINGS_OWN: stores the value. Returns false, leaves the values unchanged and writes a message to `out_why` if
    /// the value is not valid.
    bool (*parse)(const char *text, void *values, char out_why[SETTINGS_MESSAGE_SIZE]);
    /// SETTINGS_OWN: writes the value as in the file.
    void (*format)(const void *values, char out[SETTINGS_MESSAGE_SIZE]);
} settings_key_t;

/// Comment above one key, as in its file in share/, from which it is made (iwheel_keys in cmake/iwheel_texts.cmake).
typedef struct {
    const char *section;
    const char *key;
    const char *text; ///< Whole lines, each with its "; ".
} settings_help_t;

/// Destination of error messages.
typedef struct {
    const char *name; ///< The file, or another source of the value.
    FILE *err;
    unsigned errors;
} settings_report_t;

/// Description of a configuration file.
typedef struct settings_form {
    const settings_key_t *keys;  ///< The keys in the order of printing.
    const settings_help_t *help; ///< Comments of all keys; the last one has a NULL section.
    size_t count;                ///< Number of keys, at most SETTINGS_KEYS_MAX.
    const char *program;         ///< Name of the program for messages, as in "not a configuration of the gateway".
    const char *missing;         ///< Fix for a missing file: "create it from share/gateway.conf".
    /// Returns the range of rows that have a `range`; the pointer is NULL if there is none.
    void (*range)(uint16_t range, uint32_t *out_min, uint32_t *out_max);
    /// Returns why this key does not exist and what to do, for keys that users search; NULL for all others.
    const char *(*hint)(const char *key);
    /// Sets values that are not in the file and depend on others; NULL if there are none. `lines` as below.
    void (*complete)(void *values, const unsigned *lines);
    /// Reports values that do not fit together. `lines` has the line of every row, 0 if it is not in the file.
    void (*relate)(settings_report_t *report, const void *values, const unsigned *lines);
} settings_form_t;

/// Reads the file at `path` over `values`, which have the defaults. Returns 0, or SETTINGS_ERROR with messages on
/// `err`; then the values must not be used.
int settings_load(const settings_form_t *form, const char *path, void *values, FILE *err);

/// Does the same for a text in memory of `size` bytes. The name in `report` replaces the file name in messages.
int settings_parse(const settings_form_t *form, settings_report_t *report, const char *text, size_t size, void *values);

/// Changes one key after loading, by the same rules, for the command line. `name` is "SECTION.KEY". Messages begin with
/// the report's name (for example "--estop"). Returns like `settings_load`.
int settings_override(const settings_form_t *form, settings_report_t *report, const char *name, const char *value,
                      void *values);

/// Function that returns a line to write above a key in addition to its help, or NULL.
typedef struct {
    const char *(*say)(const void *context, const char *section, const char *key);
    const void *context;
} settings_note_t;

/// Writes all values as a commented file. Loading it results in the same values, and printing it again in the same
/// bytes. `note` may be NULL.
void settings_print(const settings_form_t *form, const void *values, const void *defaults, const settings_note_t *note,
                    FILE *out);

/// Returns the row of a key, in any section if `section` is NULL, or NULL if there is none.
const settings_key_t *settings_find(const settings_form_t *form, const char *section, const char *key);

/// Writes `NAME:LINE: message`, or `NAME: message` with line 0, and counts it.
__attribute__((format(printf, 3, 4))) void settings_complain(settings_report_t *report, unsigned line,
                                                             const char *format, ...);

/// Writes a message to `out_why` and returns false, so that the caller can return it.
__attribute__((format(printf, 2, 3))) bool settings_wrong(char out_why[SETTINGS_MESSAGE_SIZE], const char *format, ...);

/// Returns true for a text of decimal digits only. The result stops growing above UINT32_MAX / 16.
bool settings_digits(const char *text, size_t length, uint32_t *out_number);

/// For `wrong`: the path of a unix socket; a group's name, or `none`; any path, or an address `unix:PATH`.
const char *settings_wrong_socket(const char *text);
const char *settings_wrong_group(const char *text);
const char *settings_wrong_address(const char *text);

/// Offset and size of a member of the values, for a row.
#define SETTINGS_FIELD(type, member) .offset = offsetof(type, member), .size = sizeof(((type *)0)->member)

#endif
