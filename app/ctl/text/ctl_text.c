// SPDX-License-Identifier: MIT
#include "ctl_text.h"

#include "iwheel_northbound/text.h"

#include <stdlib.h>
#include <string.h>
#include <sys/ioctl.h>
#include <time.h>
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

void text_vline(FILE *out, const char *format, va_list list) {
    char text[2048];
    (void)vsnprintf(text, sizeof text, format, list);
    text_safe(text, out);
    (void)fputc('\n', out);
}

void text_line(FILE *out, const char *format, ...) {
    va_list list;
    va_start(list, format);
    text_vline(out, format, list);
    va_end(list);
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
    if (json_is_integer(value)) {
        text_number(json_integer_value(value), digits, unit, out);
    } else {
        (void)snprintf(out, TEXT_CELL, "--");
    }
}

void text_add_number(long long number, unsigned digits, const char *unit, iwn_text_t *text) {
    char decimals[1U + TEXT_DECIMALS_MAX] = ".";
    unsigned long long rest = (number < 0) ? 0U - (unsigned long long)number : (unsigned long long)number;
    for (unsigned i = digits; i > 0U; i--) {
        decimals[i] = (char)('0' + rest % 10U);
        rest /= 10U;
    }
    if (number < 0 && rest == 0U) {
        iwn_text_span(text, "-", 1U);
    }
    iwn_text_int(text, (int64_t)((number < 0) ? 0U - rest : rest));
    if (digits > 0U) {
        iwn_text_span(text, decimals, 1U + digits);
    }
    if (unit[0] != '\0') {
        iwn_text_span(text, " ", 1U);
        iwn_text_add(text, unit);
    }
}

void text_number(long long number, unsigned digits, const char *unit, char out[TEXT_CELL]) {
    iwn_text_t text = iwn_text_begin(out, TEXT_CELL);
    text_add_number(number, digits, unit, &text);
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

const char *text_side(unsigned side) {
    return (side == IW_LEFT) ? "left" : "right";
}

size_t text_cut(const char *text, size_t columns) {
    const size_t length = strlen(text);
    size_t cut = columns;
    while (cut > 0 && length > columns && text[cut] != ' ') {
        cut--;
    }
    return (length <= columns) ? length : (cut == 0) ? columns : cut;
}

void text_when(json_int_t wall_us, char out[TEXT_CELL]) {
    struct tm local;
    const time_t seconds = (time_t)(wall_us / 1000000);
    if (localtime_r(&seconds, &local) == NULL || strftime(out, TEXT_CELL, "%Y-%m-%d %H:%M:%S", &local) == 0U) {
        (void)snprintf(out, TEXT_CELL, "--");
    }
}

void paper_text(const paper_t *self, tone_t tone, unsigned width, const char *text) {
    static const char *const codes[] = {
        [TONE_PLAIN] = "",        [TONE_TITLE] = "\033[1m",  [TONE_GOOD] = "\033[32m",
        [TONE_CARE] = "\033[33m", [TONE_BAD] = "\033[1;31m", [TONE_FAINT] = "\033[2m",
    };
    const bool coloured = self->colour && tone != TONE_PLAIN;
    (void)fputs(coloured ? codes[tone] : "", self->out);
    text_safe(text, self->out);
    (void)fputs(coloured ? "\033[0m" : "", self->out);
    for (size_t used = strlen(text); used < width; used++) {
        (void)fputc(' ', self->out);
    }
}

void paper_print(const paper_t *self, tone_t tone, const char *format, ...) {
    char text[1024];
    va_list list;
    va_start(list, format);
    (void)vsnprintf(text, sizeof text, format, list);
    va_end(list);
    paper_text(self, tone, 0, text);
}

void paper_label(const paper_t *self, const char *label) {
    paper_text(self, TONE_FAINT, PAPER_LABEL, label);
}

void paper_wrap(const paper_t *self, const char *label, tone_t tone, const char *text) {
    char piece[PAPER_WIDTH];
    const size_t columns = PAPER_WIDTH - PAPER_LABEL;
    do {
        const size_t cut = text_cut(text, columns);
        memcpy(piece, text, cut);
        piece[cut] = '\0';
        paper_label(self, label);
        paper_text(self, tone, 0, piece);
        paper_end(self);
        label = "";
        text += cut;
        text += strspn(text, " ");
    } while (*text != '\0');
}

void paper_end(const paper_t *self) {
    (void)fputc('\n', self->out);
}
