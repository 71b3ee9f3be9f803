// SPDX-License-Identifier: MIT
#include "top.h"

#include "text/ctl_text.h"

#include <curses.h>
#include <stdarg.h>
#include <stdio.h>
#include <string.h>

#define LETTER_ROWS    5
#define LETTER_COLUMNS 5

typedef struct {
    char letter;
    uint8_t row[LETTER_ROWS]; ///< Five bits each; the leftmost is the highest.
} letter_t;

static const letter_t letters[] = {
    {'A', {0x0E, 0x11, 0x1F, 0x11, 0x11}}, {'C', {0x0F, 0x10, 0x10, 0x10, 0x0F}}, {'D', {0x1E, 0x11, 0x11, 0x11, 0x1E}},
    {'E', {0x1F, 0x10, 0x1E, 0x10, 0x1F}}, {'G', {0x0F, 0x10, 0x13, 0x11, 0x0F}}, {'H', {0x11, 0x11, 0x1F, 0x11, 0x11}},
    {'I', {0x0E, 0x04, 0x04, 0x04, 0x0E}}, {'L', {0x10, 0x10, 0x10, 0x10, 0x1F}}, {'M', {0x11, 0x1B, 0x15, 0x11, 0x11}},
    {'N', {0x11, 0x19, 0x15, 0x13, 0x11}}, {'O', {0x0E, 0x11, 0x11, 0x11, 0x0E}}, {'P', {0x1E, 0x11, 0x1E, 0x10, 0x10}},
    {'R', {0x1E, 0x11, 0x1E, 0x12, 0x11}}, {'S', {0x0F, 0x10, 0x0E, 0x01, 0x1E}}, {'T', {0x1F, 0x04, 0x04, 0x04, 0x04}},
    {'W', {0x11, 0x11, 0x15, 0x1B, 0x11}}, {'Y', {0x11, 0x0A, 0x04, 0x04, 0x04}},
};

/// Returns the attributes of a tone. Without colours, other attributes distinguish the tones.
static attr_t attributes_of(const top_model_t *model, top_tone_t tone) {
    static const attr_t plain[TOP_TONES] = {
        [TOP_TITLE] = A_BOLD,           [TOP_GOOD] = A_NORMAL, [TOP_CARE] = A_BOLD,
        [TOP_BAD] = A_REVERSE | A_BOLD, [TOP_FAINT] = A_DIM,
    };
    if (!model->colour || tone == TOP_PLAIN || tone == TOP_TITLE || tone == TOP_FAINT) {
        return plain[tone];
    }
    return COLOR_PAIR((int)tone) | ((tone == TOP_GOOD) ? A_NORMAL : A_BOLD);
}

void top_put(const top_model_t *model, int row, int column, top_tone_t tone, const char *format, ...) {
    char text[2U * TOP_TEXT_SIZE];
    char clean[2U * TOP_TEXT_SIZE];
    va_list arguments;
    const int space = COLS - column;
    if (row < 0 || row >= LINES || space <= 0) {
        return;
    }
    va_start(arguments, format);
    (void)vsnprintf(text, sizeof text, format, arguments);
    va_end(arguments);
    text_clean(text, clean, sizeof clean);
    // Cut by characters, not by bytes: continuation bytes of UTF-8 use no column.
    size_t length = 0;
    int columns = 0;
    while (clean[length] != '\0') {
        columns += (((unsigned char)clean[length] & 0xC0U) != 0x80U) ? 1 : 0;
        if (columns > space) {
            break;
        }
        length++;
    }
    (void)attrset((int)attributes_of(model, tone));
    (void)mvaddnstr(row, column, clean, (int)length);
    (void)attrset(A_NORMAL);
}

int top_put_wrapped(const top_model_t *model, int row, int rows, top_tone_t tone, const char *text) {
    const size_t space = (COLS > 3) ? (size_t)COLS - 2U : 1U;
    int used = 0;
    for (; used < rows && *text != '\0'; used++) {
        const size_t cut = text_cut(text, (used < rows - 1) ? space : SIZE_MAX);
        top_put(model, row + used, 1, tone, "%.*s", (int)cut, text);
        text += cut;
        text += strspn(text, " ");
    }
    return used;
}

static const letter_t *find(char letter) {
    for (size_t i = 0; i < sizeof letters / sizeof letters[0]; i++) {
        if (letters[i].letter == letter) {
            return &letters[i];
        }
    }
    return NULL;
}

/// Spaces in reverse are blocks on every terminal.
void top_put_big(const top_model_t *model, int row, top_tone_t tone, const char *word) {
    int column = 1;
    (void)attrset((int)(attributes_of(model, (tone == TOP_BAD && !model->colour) ? TOP_CARE : tone) | A_REVERSE));
    for (const char *c = word; *c != '\0'; c++, column += LETTER_COLUMNS + 1) {
        const letter_t *letter = find(*c);
        for (int y = 0; letter != NULL && y < LETTER_ROWS; y++) {
            for (int x = 0; x < LETTER_COLUMNS; x++) {
                if (((unsigned)letter->row[y] >> (unsigned)(LETTER_COLUMNS - 1 - x) & 1U) != 0U && row + y < LINES) {
                    (void)mvaddch(row + y, column + x, ' ');
                }
            }
        }
    }
    (void)attrset(A_NORMAL);
}
