// SPDX-License-Identifier: MIT
#include "text.h"

#include "iwheel_northbound/text.h"

#include <stdarg.h>
#include <stdlib.h>
#include <string.h>
#include <sys/ioctl.h>
#include <unistd.h>

void text_safe(const char *text, FILE *out) {
    size_t bytes;
    for (; *text != '\0'; text += bytes) {
        const bool plain = iwn_plain_is(iwn_plain_read(text, &bytes));
        (void)fwrite(plain ? text : "?", 1, plain ? bytes : 1U, out);
    }
}

void text_json(const char *line, FILE *out) {
    char piece[256];
    size_t length;
    while (*line != '\0') {
        line = iwn_plain_json(line, piece, sizeof piece, &length);
        (void)fwrite(piece, 1, length, out);
    }
    (void)fputc('\n', out);
}

void text_line(FILE *out, const char *format, ...) {
    char text[2048];
    va_list list;
    va_start(list, format);
    (void)vsnprintf(text, sizeof text, format, list);
    va_end(list);
    text_safe(text, out);
    (void)fputc('\n', out);
}

void text_clean(const char *text, char *out, size_t size) {
    iwn_plain_copy(text, out, size);
}

bool text_json_value(const json_t *value, FILE *out) {
    char *line = json_dumps(value, JSON_COMPACT);
    if (line == NULL) {
        return false;
    }
    text_json(line, out);
    free(line);
    return true;
}

static bool obeys(FILE *out) {
    const char *term = getenv("TERM");
    return isatty(fileno(out)) == 1 && term != NULL && term[0] != '\0' && strcmp(term, "dumb") != 0;
}

bool text_wants_colour(FILE *out) {
    const char *no_color = getenv("NO_COLOR");
    return obeys(out) && (no_color == NULL || no_color[0] == '\0');
}

unsigned text_live_columns(FILE *out) {
    struct winsize size = {0};
    if (!obeys(out)) {
        return 0;
    }
    (void)ioctl(fileno(out), TIOCGWINSZ, &size);
    return (size.ws_col > 1U) ? size.ws_col - 1U : 79U;
}

void text_integer(const json_t *value, const char *unit, char out[TEXT_CELL]) {
    text_decimal(value, 0, unit, out);
}

void text_decimal(const json_t *value, unsigned digits, const char *unit, char out[TEXT_CELL]) {
    if (!json_is_integer(value)) {
        (void)snprintf(out, TEXT_CELL, "--");
        return;
    }
    const long long number = json_integer_value(value);
    unsigned long long scale = 1;
    for (unsigned i = 0; i < digits; i++) {
        scale *= 10U;
    }
    const unsigned long long size = (number < 0) ? 0ULL - (unsigned long long)number : (unsigned long long)number;
    const char *sign = (number < 0) ? "-" : "";
    const char *gap = (unit[0] != '\0') ? " " : "";
    if (digits == 0) {
        (void)snprintf(out, TEXT_CELL, "%s%llu%s%s", sign, size, gap, unit);
    } else {
        (void)snprintf(out, TEXT_CELL, "%s%llu.%0*llu%s%s", sign, size / scale, (int)digits, size % scale, gap, unit);
    }
}

void text_age(const json_t *age_ms, char out[TEXT_CELL]) {
    const long long ms = json_integer_value(age_ms);
    if (!json_is_integer(age_ms) || ms < 0) {
        (void)snprintf(out, TEXT_CELL, "--");
    } else if (ms < 1000) {
        (void)snprintf(out, TEXT_CELL, "%lld ms", ms);
    } else if (ms < 120000) {
        (void)snprintf(out, TEXT_CELL, "%lld.%lld s", ms / 1000, ms % 1000 / 100);
    } else if (ms < 7200000) {
        (void)snprintf(out, TEXT_CELL, "%lld min", ms / 60000);
    } else if (ms < 172800000) {
        (void)snprintf(out, TEXT_CELL, "%lld h", ms / 3600000);
    } else {
        (void)snprintf(out, TEXT_CELL, "%lld days", ms / 86400000);
    }
}

const char *text_word(const json_t *object, const char *field) {
    const char *word = json_string_value(json_object_get(object, field));
    return (word != NULL) ? word : "--";
}
