// SPDX-License-Identifier: MIT
#include "text.h"

#include <stdlib.h>
#include <string.h>
#include <unistd.h>

static bool is_control(const unsigned char *c) {
    return *c < 0x20U || *c == 0x7FU || (c[0] == 0xC2U && c[1] >= 0x80U && c[1] <= 0x9FU);
}

void text_safe(const char *text, FILE *out) {
    for (const unsigned char *c = (const unsigned char *)text; *c != '\0'; c++) {
        if (!is_control(c)) {
            (void)fputc(*c, out);
            continue;
        }
        (void)fputc('?', out);
        c += *c == 0xC2U ? 1 : 0;
    }
}

void text_clean(const char *text, char *out, size_t size) {
    size_t used = 0;
    for (const unsigned char *c = (const unsigned char *)text; *c != '\0' && used + 1U < size; c++) {
        out[used++] = is_control(c) ? '?' : (char)*c;
        c += is_control(c) && *c == 0xC2U ? 1 : 0;
    }
    out[used] = '\0';
}

bool text_wants_colour(FILE *out) {
    const char *no_color = getenv("NO_COLOR");
    const char *term = getenv("TERM");
    return isatty(fileno(out)) == 1 && (no_color == NULL || no_color[0] == '\0') && term != NULL &&
           strcmp(term, "dumb") != 0;
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
    const unsigned long long size = number < 0 ? 0ULL - (unsigned long long)number : (unsigned long long)number;
    const char *sign = number < 0 ? "-" : "";
    const char *gap = unit[0] != '\0' ? " " : "";
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
    return word != NULL ? word : "--";
}
