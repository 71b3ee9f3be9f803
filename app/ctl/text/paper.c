// SPDX-License-Identifier: MIT
#include "paper.h"

#include "text.h"

#include <stdarg.h>
#include <string.h>

#define TEXT_MAX 1024U

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

void paper_say(const paper_t *self, tone_t tone, const char *format, ...) {
    char text[TEXT_MAX];
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
    const size_t room = PAPER_WIDTH - PAPER_LABEL;
    do {
        size_t cut = strlen(text);
        if (cut > room) {
            for (cut = room; cut > 0 && text[cut] != ' '; cut--) {
            }
            cut = (cut == 0) ? room : cut;
        }
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
