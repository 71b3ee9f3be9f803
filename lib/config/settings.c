// SPDX-License-Identifier: MIT
#include "similar.h"
#include "value.h"

#include "iwheel_northbound/text.h"

#include <errno.h>
#include <fcntl.h>
#include <ini.h>
#include <stdarg.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>

/// inih reads lines into a buffer of 200 bytes with line end and terminator, and would truncate longer ones.
#define LINE_MAX_LENGTH 197U

typedef struct {
    const settings_form_t *form;
    settings_report_t *report;
    const char *text;
    size_t size;
    size_t at;
    const char *pending; ///< Line that must become a value; NULL once it has.
    size_t pending_length;
    unsigned line;
    bool section_bad; ///< The name of the section was refused, so its keys are not judged.
    unsigned lines[SETTINGS_KEYS_MAX];
    void *values;
} loader_t;

void settings_complain(settings_report_t *report, unsigned line, const char *format, ...) {
    char text[SETTINGS_MESSAGE_SIZE + 64U];
    char plain[SETTINGS_MESSAGE_SIZE + 64U];
    va_list list;
    report->errors++;
    if (report->errors > SETTINGS_ERRORS_SHOWN) {
        return;
    }
    (void)fputs(report->name, report->err);
    if (line > 0) {
        (void)fprintf(report->err, ":%u", line);
    }
    (void)fputs(": ", report->err);
    va_start(list, format);
    (void)vsnprintf(text, sizeof text, format, list);
    va_end(list);
    iwn_plain_copy(text, plain, sizeof plain); // The message quotes the file.
    (void)fprintf(report->err, "%s\n", plain);
}

static int finish(const settings_report_t *report) {
    if (report->errors > SETTINGS_ERRORS_SHOWN) {
        (void)fprintf(report->err, "%s: %u more errors are not shown; fix these first\n", report->name,
                      report->errors - SETTINGS_ERRORS_SHOWN);
    }
    return (report->errors == 0U) ? 0 : SETTINGS_ERROR;
}

const settings_key_t *settings_find(const settings_form_t *form, const char *section, const char *key) {
    for (size_t i = 0; i < form->count; i++) {
        const settings_key_t *row = &form->keys[i];
        if (strcmp(row->key, key) == 0 && (section == NULL || strcmp(row->section, section) == 0)) {
            return row;
        }
    }
    return NULL;
}

/// Returns the row of this section with the most similar key, or NULL if none is similar.
static const settings_key_t *find_similar(const settings_form_t *form, const char *section, const char *key) {
    const settings_key_t *best = NULL;
    size_t best_distance = SETTINGS_WORD_STRANGE;
    for (size_t i = 0; i < form->count; i++) {
        const settings_key_t *row = &form->keys[i];
        const size_t far =
            (strcmp(row->section, section) == 0) ? settings_word_distance(key, row->key) : SETTINGS_WORD_STRANGE;
        if (far < best_distance) {
            best = row;
            best_distance = far;
        }
    }
    return best;
}

/// Writes the names of the sections (`section` NULL) or of a section's keys, separated by commas. Returns false if
/// there are none.
static bool list_names(const settings_form_t *form, const char *section, char *out, size_t size) {
    const char *last = "";
    size_t used = 0;
    for (size_t i = 0; i < form->count && used < size; i++) {
        const settings_key_t *row = &form->keys[i];
        const char *name = (section != NULL) ? row->key : row->section;
        if ((section == NULL || strcmp(row->section, section) == 0) && strcmp(name, last) != 0) {
            const int n = snprintf(out + used, size - used, "%s%s", (used > 0) ? ", " : "", name);
            used += (n > 0) ? (size_t)n : size;
            last = name;
        }
    }
    return used > 0;
}

static bool is_section(const settings_form_t *form, const char *name) {
    char keys[2];
    return list_names(form, name, keys, sizeof keys);
}

/// Reports a line that should have become a value, but inih has not passed one.
static void settle_pending(loader_t *loader) {
    if (loader->pending != NULL) {
        const int length = (loader->pending_length > 40U) ? 40 : (int)loader->pending_length;
        settings_complain(loader->report, loader->line,
                          "\"%.*s\" is not KEY = VALUE; add the '=' or begin the line with ;", length, loader->pending);
        loader->pending = NULL;
    }
}

static bool is_blank(char c) {
    return c == ' ' || c == '\t' || c == '\r';
}

static bool fit_line(loader_t *loader, const char *line, size_t length) {
    for (size_t i = 0; i < length; i++) {
        const unsigned char c = (unsigned char)line[i];
        if (c < 0x20U && !is_blank((char)c)) {
            settings_complain(loader->report, loader->line,
                              "holds the control character 0x%02X; is this a text file? Delete the character", c);
            return false;
        }
    }
    if (length > LINE_MAX_LENGTH) {
        settings_complain(loader->report, loader->line, "has %zu characters; shorten it to %u", length,
                          LINE_MAX_LENGTH);
        return false;
    }
    return true;
}

/// Checks `[name]`, followed by nothing or a comment. Any other line is refused, and its keys have no section.
static void check_section(loader_t *loader, const char *line, size_t length) {
    char name[LINE_MAX_LENGTH + 1U];
    char known[SETTINGS_MESSAGE_SIZE];
    const char *end = memchr(line, ']', length);
    const char *after = end;
    loader->section_bad = true;
    if (end == NULL) {
        settings_complain(loader->report, loader->line, "the section's name has no ']'; write for example [bus]");
        return;
    }
    do {
        after++;
    } while (after < line + length && is_blank(*after));
    if (after < line + length && *after != ';' && *after != '#') {
        settings_complain(loader->report, loader->line, "something follows the ']'; begin a new line for it");
        return;
    }
    memcpy(name, line + 1, (size_t)(end - line) - 1U);
    name[(size_t)(end - line) - 1U] = '\0';
    loader->section_bad = !is_section(loader->form, name);
    if (loader->section_bad) {
        (void)list_names(loader->form, NULL, known, sizeof known);
        settings_complain(loader->report, loader->line, "unknown section [%s]; known are: %s", name, known);
    }
}

/// Returns the next line of the text without blanks around it, and advances.
static const char *cut_line(loader_t *loader, size_t *out_length) {
    const char *line = loader->text + loader->at;
    const char *newline = memchr(line, '\n', loader->size - loader->at);
    size_t length = (newline != NULL) ? (size_t)(newline - line) : loader->size - loader->at;
    loader->at += length + 1U;
    loader->line++;
    if (loader->line == 1U && length >= 3U && memcmp(line, "\xEF\xBB\xBF", 3) == 0) {
        line += 3;
        length -= 3U;
    }
    while (length > 0 && is_blank(line[0])) {
        line++;
        length--;
    }
    while (length > 0 && is_blank(line[length - 1U])) {
        length--;
    }
    *out_length = length;
    return line;
}

/// Replaces fgets for inih: returns the next line without leading blanks, because inih would append an indented line to
/// the last value. A refused line becomes an empty one.
static char *next_line(char *out, int size, void *context) {
    loader_t *loader = context;
    size_t length = 0;
    settle_pending(loader);
    if (loader->at >= loader->size) {
        return NULL;
    }
    const char *line = cut_line(loader, &length);
    if (!fit_line(loader, line, length) || length + 2U > (size_t)size) {
        length = 0;
    }
    if (length > 0 && line[0] == '[') {
        check_section(loader, line, length);
        if (loader->section_bad) {
            length = 0;
        }
    } else if (length > 0 && line[0] != ';' && line[0] != '#') {
        loader->pending = line;
        loader->pending_length = length;
    }
    memcpy(out, line, length);
    out[length] = '\n';
    out[length + 1U] = '\0';
    return out;
}

static void unknown_key(loader_t *loader, const char *section, const char *key) {
    char known[SETTINGS_MESSAGE_SIZE];
    const settings_key_t *similar = find_similar(loader->form, section, key);
    const char *hint = (loader->form->hint != NULL) ? loader->form->hint(key) : NULL;
    const settings_key_t *elsewhere = settings_find(loader->form, NULL, key);
    if (key[0] == '\0') {
        settings_complain(loader->report, loader->line, "there is no key before the '='; write KEY = VALUE");
    } else if (section[0] == '\0') {
        settings_complain(loader->report, loader->line, "%s is before any section; put it under [%s]", key,
                          (elsewhere != NULL) ? elsewhere->section : "its section");
    } else if (elsewhere != NULL) {
        settings_complain(loader->report, loader->line, "%s is not a key of [%s]; move it to [%s]", key, section,
                          elsewhere->section);
    } else if (hint != NULL) {
        settings_complain(loader->report, loader->line, "unknown key %s in [%s]; %s", key, section, hint);
    } else if (similar != NULL) {
        settings_complain(loader->report, loader->line, "unknown key %s in [%s]; did you mean %s?", key, section,
                          similar->key);
    } else {
        (void)list_names(loader->form, section, known, sizeof known);
        settings_complain(loader->report, loader->line, "unknown key %s in [%s]; known are: %s", key, section, known);
    }
}

/// Handler of inih. It always returns 1: this file counts the errors, so that one does not hide the next.
static int take_value(void *context, const char *section, const char *key, const char *value) {
    loader_t *loader = context;
    char why[SETTINGS_MESSAGE_SIZE];
    loader->pending = NULL;
    if (loader->section_bad) {
        return 1;
    }
    const settings_key_t *row = settings_find(loader->form, section, key);
    if (row == NULL) {
        unknown_key(loader, section, key);
        return 1;
    }
    unsigned *line = &loader->lines[row - loader->form->keys];
    if (*line != 0) {
        settings_complain(loader->report, loader->line, "%s is set a second time (first on line %u); delete one", key,
                          *line);
        return 1;
    }
    *line = loader->line;
    if (!settings_value_parse(loader->form, row, value, loader->values, why)) {
        settings_complain(loader->report, loader->line, "%s", why);
    }
    return 1;
}

int settings_parse(const settings_form_t *form, settings_report_t *report, const char *text, size_t size,
                   void *values) {
    loader_t loader = {.form = form, .report = report, .text = text, .size = size, .values = values};
    const int result = ini_parse_stream(next_line, &loader, take_value, &loader);
    if (result != 0 && report->errors == 0) {
        settings_complain(report, (result > 0) ? (unsigned)result : 0U, "cannot be read; write KEY = VALUE lines");
    }
    if (report->errors == 0 && form->complete != NULL) {
        form->complete(values, loader.lines);
    }
    if (report->errors == 0 && form->relate != NULL) {
        form->relate(report, values, loader.lines);
    }
    return finish(report);
}

/// Reads the file into `out`, of SETTINGS_FILE_MAX bytes. Returns false and reports the error if it cannot.
static bool read_file(settings_report_t *report, const char *program, int file, char *out, size_t *out_size) {
    struct stat status;
    if (fstat(file, &status) != 0 || !S_ISREG(status.st_mode)) {
        settings_complain(report, 0, "is not a regular file; name the configuration file with -c FILE");
        return false;
    }
    *out_size = 0;
    while (*out_size < SETTINGS_FILE_MAX) {
        const ssize_t got = read(file, out + *out_size, SETTINGS_FILE_MAX - *out_size);
        if (got < 0) {
            settings_complain(report, 0, "cannot be read (%s); check the disk", strerror(errno));
            return false;
        }
        if (got == 0) {
            return true;
        }
        *out_size += (size_t)got;
    }
    settings_complain(report, 0, "is larger than %u bytes; this is not a configuration of %s; use another",
                      SETTINGS_FILE_MAX - 1U, program);
    return false;
}

int settings_load(const settings_form_t *form, const char *path, void *values, FILE *err) {
    static char text[SETTINGS_FILE_MAX]; // Too large for a stack.
    size_t size = 0;
    settings_report_t report = {.name = path, .err = err};
    const int file = open(path, O_RDONLY | O_CLOEXEC | O_NONBLOCK | O_NOCTTY);
    if (file < 0) {
        const int error = errno;
        if (error == EACCES) {
            settings_complain(&report, 0, "cannot be opened (%s); allow %s's user to read it", strerror(error),
                              form->program);
        } else {
            settings_complain(&report, 0, "cannot be opened (%s); %s", strerror(error), form->missing);
        }
        return SETTINGS_ERROR;
    }
    const bool good = read_file(&report, form->program, file, text, &size);
    (void)close(file);
    return good ? settings_parse(form, &report, text, size, values) : SETTINGS_ERROR;
}

int settings_override(const settings_form_t *form, settings_report_t *report, const char *name, const char *value,
                      void *values) {
    static const unsigned no_lines[SETTINGS_KEYS_MAX];
    char why[SETTINGS_MESSAGE_SIZE];
    const char *key = strchr(name, '.');
    char section[32];
    (void)snprintf(section, sizeof section, "%.*s", (key != NULL) ? (int)(key - name) : 0, name);
    const settings_key_t *row = (key != NULL) ? settings_find(form, section, key + 1) : NULL;
    if (row == NULL) {
        settings_complain(report, 0, "%s is not a key of the configuration; write SECTION.KEY", name);
    } else if (!settings_value_parse(form, row, value, values, why)) {
        settings_complain(report, 0, "%s", why);
    } else if (form->relate != NULL) {
        form->relate(report, values, no_lines);
    }
    return finish(report);
}
