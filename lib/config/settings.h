// SPDX-License-Identifier: MIT
/// Configuration files that a table describes: read, checked as a whole, printed back.
///
/// Link `iwheel_settings` and include "config/settings.h". A program says its keys once (`settings_form_t`); reading, range checks,
/// messages and printing need no code per key. Every error is told as `FILE:LINE: what is wrong; what to do`, the first 20 of
/// them. Used at start only: it reads a file and writes to a stream, so it may block.
#ifndef IWHEEL_SETTINGS_H
#define IWHEEL_SETTINGS_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>

/// What reading returns on any error: EX_CONFIG of sysexits.
#define SETTINGS_ERROR 78
/// A longer file is refused.
#define SETTINGS_FILE_MAX 65536U
/// Long enough for every message and every value.
#define SETTINGS_MESSAGE_SIZE 512U
/// A table has no more rows.
#define SETTINGS_KEYS_MAX 64U
/// The first of these errors are written, the others counted.
#define SETTINGS_ERRORS_SHOWN 20U
/// A path that fits a unix socket address, with its terminator.
#define SETTINGS_PATH_SIZE 108U

/// How a value is written.
typedef enum {
    SETTINGS_NUMBER, ///< Decimal, within the range of the row.
    SETTINGS_WORD,   ///< One of `words`.
    SETTINGS_MODE,   ///< Octal permission bits; the owner's read and write are always among them.
    SETTINGS_TEXT,   ///< Printable, without `;`, not empty, as long as the field; `wrong` may know more.
    SETTINGS_OWN,    ///< `parse` and `format`.
} settings_kind_t;

typedef struct {
    const char *word;
    uint8_t value;
} settings_word_t;

/// The words of a switch.
extern const settings_word_t settings_no_yes[];

/// One key. Where its value lives is told as a place in the program's structure of values.
typedef struct {
    const char *section;
    const char *key;
    const char *unit; ///< For messages, with a leading space; may be empty.
    settings_kind_t kind;
    uint16_t offset; ///< Into the values.
    uint16_t size;   ///< Of the field: a number of 1, 2 or 4 bytes, or a text with its terminator.
    uint16_t set; ///< SETTINGS_NUMBER: offset of a bool that is true once the key is given; 0: it always has a value.
    bool unset_is_0; ///< SETTINGS_NUMBER: while it is 0, which is outside its range, the key is not given.
    uint16_t range;  ///< SETTINGS_NUMBER: passed to the form's `range`; 0: `min` and `max` apply.
    uint32_t min;
    uint32_t max;
    const char *not_zero;         ///< SETTINGS_NUMBER: why 0 is refused, if it is worth a sentence.
    const char *rule;             ///< SETTINGS_NUMBER: the rule that bounds the range, named in a refusal; null: none.
    const settings_word_t *words; ///< SETTINGS_WORD: two or more, ends with a null word.
    /// SETTINGS_TEXT: what is wrong with it, as in "TEXT is no socket"; null: nothing.
    const char *(*wrong)(const char *text);
    /// SETTINGS_OWN: stores the value. False, with the values untouched and a message in `out_why`, if it is none of this key's.
    bool (*parse)(const char *text, void *values, char out_why[SETTINGS_MESSAGE_SIZE]);
    /// SETTINGS_OWN: writes the value as the file has it.
    void (*format)(const void *values, char out[SETTINGS_MESSAGE_SIZE]);
} settings_key_t;

/// The comment above one key, as in its file in share/, from which it is made (iwheel_keys in cmake/iwheel_texts.cmake).
typedef struct {
    const char *section;
    const char *key;
    const char *text; ///< Whole lines, each with its "; ".
} settings_help_t;

/// Where complaints go.
typedef struct {
    const char *name; ///< The file, or where else the value came from.
    FILE *err;
    unsigned errors;
} settings_report_t;

/// All that may stand in one file.
typedef struct settings_form {
    const settings_key_t *keys;  ///< In the order in which they are printed.
    const settings_help_t *help; ///< Has every key; ends with a null section.
    size_t count;                ///< At most SETTINGS_KEYS_MAX.
    const char *program;         ///< Whose file it is, as in "no configuration of the gateway".
    const char *missing;         ///< What to do if there is no file: "create it from share/gateway.conf".
    /// The range of rows that name one; null: none does.
    void (*range)(uint16_t range, uint32_t *out_min, uint32_t *out_max);
    /// Why this key cannot be and what to do, for keys that people look for; null: nothing to say.
    const char *(*hint)(const char *key);
    /// Fills in what was not given and follows from other values; null: nothing does. `lines` as below.
    void (*complete)(void *values, const unsigned *lines);
    /// Complains where values do not fit together. `lines` has the line of every row, 0 if it was not given.
    void (*relate)(settings_report_t *report, const void *values, const unsigned *lines);
} settings_form_t;

/// Reads the file at `path` over `values`, which hold the defaults. 0, or SETTINGS_ERROR with what is wrong on `err`; the values
/// are of no use then.
int settings_load(const settings_form_t *form, const char *path, void *values, FILE *err);

/// The same for a text in memory of `size` bytes; `report` has the name that stands for the file in messages.
int settings_parse(const settings_form_t *form, settings_report_t *report, const char *text, size_t size, void *values);

/// One key changed after loading, by the same rules, as the command line does. `name` is "SECTION.KEY"; the report's name (for
/// example "--estop") begins the message. Returns as `settings_load`.
int settings_override(const settings_form_t *form, settings_report_t *report, const char *name, const char *value,
                      void *values);

/// Says what is to be written above a key besides its help, in one line; null: nothing.
typedef struct {
    const char *(*say)(const void *context, const char *section, const char *key);
    const void *context;
} settings_note_t;

/// Writes everything in force as a commented file. Loading it gives the same values and prints the same bytes. `note` may be
/// null.
void settings_print(const settings_form_t *form, const void *values, const void *defaults, const settings_note_t *note,
                    FILE *out);

/// The row, in any section if `section` is null; or a null pointer.
const settings_key_t *settings_find(const settings_form_t *form, const char *section, const char *key);

/// Writes `NAME:LINE: message`, or `NAME: message` with line 0, and counts it.
__attribute__((format(printf, 3, 4))) void settings_complain(settings_report_t *report, unsigned line,
                                                             const char *format, ...);

/// Writes a message into `out_why`. False, so that it can be returned.
__attribute__((format(printf, 2, 3))) bool settings_wrong(char out_why[SETTINGS_MESSAGE_SIZE], const char *format, ...);

/// True for decimal digits and nothing else. The result stops growing above UINT32_MAX / 16.
bool settings_digits(const char *text, size_t length, uint32_t *out_number);

/// For `wrong`: the path of a unix socket; a group's name, or `none`; any path, or an address `unix:PATH`.
const char *settings_wrong_socket(const char *text);
const char *settings_wrong_group(const char *text);
const char *settings_wrong_address(const char *text);

/// Where a member of the program's structure lives, for a row.
#define SETTINGS_FIELD(type, member) .offset = offsetof(type, member), .size = sizeof(((type *)0)->member)

#endif
