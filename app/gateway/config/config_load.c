// SPDX-License-Identifier: MIT
#include "config_relations.h"

#include <errno.h>
#include <fcntl.h>
#include <ini.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>

/// inih reads lines into a buffer of 200 bytes with line end and terminator; longer ones it would cut.
#define LINE_MAX_LENGTH 197U

typedef struct {
    config_report_t report;
    const char *text;
    size_t size;
    size_t at;
    const char *pending; ///< A line that must become a value; null once it has.
    size_t pending_length;
    unsigned line;
    bool section_bad; ///< The section's name was refused: its keys are not judged.
    unsigned seen[CONFIG_KEYS_MAX];
    gateway_config_t config;
} loader_t;

void gateway_config_default(gateway_config_t *out_config) {
    static const gateway_config_t standard = {
        .bus = {"can0", 1000000U, 625U, GATEWAY_MISMATCH_REFUSE},
        .track_mm = 540U,
        .estop = {"ESTOP", true, 5U},
        .northbound = {"/run/iwheel/gateway.sock", 0660U, "iwheel", 16U},
        .record = {30U, "/var/lib/iwheel"},
    };
    *out_config = standard;
    iw_config_default(&out_config->core);
}

/// The line promised to become a value, but inih made none of it.
static void settle_pending(loader_t *loader) {
    if (loader->pending != NULL) {
        const int length = (loader->pending_length > 40U) ? 40 : (int)loader->pending_length;
        config_complain(&loader->report, loader->line,
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
            config_complain(&loader->report, loader->line,
                            "holds the control character 0x%02X; is this a text file? Delete the character", c);
            return false;
        }
    }
    if (length > LINE_MAX_LENGTH) {
        config_complain(&loader->report, loader->line, "has %zu characters; shorten it to %u", length, LINE_MAX_LENGTH);
        return false;
    }
    return true;
}

/// `[name]`, then nothing or a comment. Anything else leaves no section to speak of.
static void check_section(loader_t *loader, const char *line, size_t length) {
    char name[LINE_MAX_LENGTH + 1U];
    char known[CONFIG_MESSAGE_SIZE];
    const char *end = memchr(line, ']', length);
    const char *after = end;
    loader->section_bad = true;
    if (end == NULL) {
        config_complain(&loader->report, loader->line, "the section's name has no ']'; write for example [bus]");
        return;
    }
    do {
        after++;
    } while (after < line + length && is_blank(*after));
    if (after < line + length && *after != ';' && *after != '#') {
        config_complain(&loader->report, loader->line, "something follows the ']'; begin a new line for it");
        return;
    }
    memcpy(name, line + 1, (size_t)(end - line) - 1U);
    name[(size_t)(end - line) - 1U] = '\0';
    loader->section_bad = !config_section_known(name);
    if (loader->section_bad) {
        config_keys_list(NULL, known, sizeof known);
        config_complain(&loader->report, loader->line, "unknown section [%s]; known are: %s", name, known);
    }
}

/// The next line of the text without what surrounds it; moves on.
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

/// fgets for inih: the next line without leading blanks, since inih would take an indented line for the last value's
/// continuation. A line that was refused here is handed on as an empty one.
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
        length = loader->section_bad ? 0 : length;
    } else if (length > 0 && line[0] != ';' && line[0] != '#') {
        loader->pending = line;
        loader->pending_length = length;
    }
    memcpy(out, line, length);
    out[length] = '\n';
    out[length + 1U] = '\0';
    return out;
}

static bool speaks_of_ids(const char *key) {
    const char *id = strstr(key, "id");
    return id != NULL && (id == key || id[-1] == '_') && strchr("s_", id[2]) != NULL;
}

static void unknown_key(loader_t *loader, const char *section, const char *key) {
    char known[CONFIG_MESSAGE_SIZE];
    const config_key_t *similar = config_key_similar(section, key);
    const config_key_t *elsewhere = config_key_elsewhere(key);
    if (key[0] == '\0') {
        config_complain(&loader->report, loader->line, "no key stands before the '='; write KEY = VALUE");
    } else if (section[0] == '\0') {
        config_complain(&loader->report, loader->line, "%s stands before any section; put it under [%s]", key,
                        (elsewhere != NULL) ? elsewhere->section : "its section");
    } else if (elsewhere != NULL) {
        config_complain(&loader->report, loader->line, "%s is no key of [%s]; move it to [%s]", key, section,
                        elsewhere->section);
    } else if (speaks_of_ids(key)) {
        config_complain(
            &loader->report, loader->line,
            "unknown key %s in [%s]; the ids are fixed by the wheels (setpoints: left 266 = 0x10A, right 298 = "
            "0x12A), delete the line; for exchanged wheels exchange their cables",
            key, section);
    } else if (similar != NULL) {
        config_complain(&loader->report, loader->line, "unknown key %s in [%s]; did you mean %s?", key, section,
                        similar->key);
    } else {
        config_keys_list(section, known, sizeof known);
        config_complain(&loader->report, loader->line, "unknown key %s in [%s]; known are: %s", key, section, known);
    }
}

/// inih's handler. Always 1: errors are counted by us, so that one does not hide the next.
static int take_value(void *context, const char *section, const char *key, const char *value) {
    loader_t *loader = context;
    char why[CONFIG_MESSAGE_SIZE];
    loader->pending = NULL;
    if (loader->section_bad) {
        return 1;
    }
    const config_key_t *row = config_key_find(section, key);
    if (row == NULL) {
        unknown_key(loader, section, key);
        return 1;
    }
    unsigned *seen = &loader->seen[row - config_keys];
    if (*seen != 0) {
        config_complain(&loader->report, loader->line, "%s is here a second time (first on line %u); keep one", key,
                        *seen);
        return 1;
    }
    *seen = loader->line;
    if (!config_value_parse(row, value, &loader->config, why)) {
        config_complain(&loader->report, loader->line, "%s", why);
    }
    return 1;
}

int gateway_config_parse(const char *name, const char *text, size_t size, gateway_config_t *out_config, FILE *err) {
    loader_t loader = {.report = {.name = name, .err = err}, .text = text, .size = size};
    gateway_config_default(&loader.config);
    const int result = ini_parse_stream(next_line, &loader, take_value, &loader);
    if (result != 0 && loader.report.errors == 0) {
        config_complain(&loader.report, (result > 0) ? (unsigned)result : 0U,
                        "cannot be read; write KEY = VALUE lines");
    }
    if (loader.report.errors == 0) {
        config_relations_check(&loader.report, &loader.config, loader.seen);
    }
    if (loader.report.errors > 0) {
        config_complain_end(&loader.report);
        return GATEWAY_CONFIG_ERROR;
    }
    *out_config = loader.config;
    return 0;
}

/// The file's bytes in `out`, of GATEWAY_CONFIG_FILE_MAX bytes; false after a complaint.
static bool read_file(config_report_t *report, int file, char *out, size_t *out_size) {
    struct stat status;
    if (fstat(file, &status) != 0 || !S_ISREG(status.st_mode)) {
        config_complain(report, 0, "is not a regular file; give the configuration file with -c FILE");
        return false;
    }
    *out_size = 0;
    while (*out_size < GATEWAY_CONFIG_FILE_MAX) {
        const ssize_t got = read(file, out + *out_size, GATEWAY_CONFIG_FILE_MAX - *out_size);
        if (got < 0) {
            config_complain(report, 0, "cannot be read (%s); check the disk", strerror(errno));
            return false;
        }
        if (got == 0) {
            return true;
        }
        *out_size += (size_t)got;
    }
    config_complain(report, 0, "is larger than %u bytes; this is no configuration of the gateway, give another",
                    GATEWAY_CONFIG_FILE_MAX - 1U);
    return false;
}

int gateway_config_load(const char *path, gateway_config_t *out_config, FILE *err) {
    static char text[GATEWAY_CONFIG_FILE_MAX]; // Too large for a stack.
    size_t size = 0;
    config_report_t report = {.name = path, .err = err};
    const int file = open(path, O_RDONLY | O_CLOEXEC | O_NONBLOCK | O_NOCTTY);
    if (file < 0) {
        config_complain(&report, 0, "cannot be opened (%s); %s", strerror(errno),
                        (errno == EACCES) ? "give the gateway's user the right to read it"
                                          : "create it from share/gateway.conf, or give another with -c FILE");
        return GATEWAY_CONFIG_ERROR;
    }
    const bool good = read_file(&report, file, text, &size);
    (void)close(file);
    return good ? gateway_config_parse(path, text, size, out_config, err) : GATEWAY_CONFIG_ERROR;
}

int gateway_config_override(gateway_config_t *config, const char *name, const char *value, const char *origin,
                            FILE *err) {
    static const unsigned no_lines[CONFIG_KEYS_MAX];
    config_report_t report = {.name = origin, .err = err};
    gateway_config_t changed = *config;
    char why[CONFIG_MESSAGE_SIZE];
    for (size_t i = 0; i < config_key_count; i++) {
        const config_key_t *row = &config_keys[i];
        const size_t length = strlen(row->section);
        if (strncmp(name, row->section, length) != 0 || name[length] != '.' ||
            strcmp(name + length + 1U, row->key) != 0) {
            continue;
        }
        if (!config_value_parse(row, value, &changed, why)) {
            config_complain(&report, 0, "%s", why);
            return GATEWAY_CONFIG_ERROR;
        }
        config_relations_check(&report, &changed, no_lines);
        if (report.errors == 0) {
            *config = changed;
        }
        return (report.errors == 0) ? 0 : GATEWAY_CONFIG_ERROR;
    }
    config_complain(&report, 0, "%s is no key of the configuration; write SECTION.KEY", name);
    return GATEWAY_CONFIG_ERROR;
}
