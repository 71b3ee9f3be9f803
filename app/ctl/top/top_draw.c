// SPDX-License-Identifier: MIT
// What stands where.
#include "status/advice.h"
#include "text/text.h"
#include "top.h"

#include <ctype.h>
#include <curses.h>
#include <stdio.h>
#include <string.h>

#define BIG_ROWS   5
#define BIG_COLUMN 6
/// From these sizes on there are big letters, and both wheels with all their lines.
#define ROWS_BIG   20
#define ROWS_FULL  24
#define ROWS_LEAST 4

static const json_t *get(const json_t *object, const char *field) {
    return json_object_get(object, field);
}

static top_tone_t tone_of(const top_model_t *model, const char *state) {
    if (!model->connected || model->stale || strcmp(state, "latched") == 0) {
        return TOP_BAD;
    }
    return strcmp(state, "listening") == 0 ? TOP_GOOD : TOP_CARE;
}

/// The one word that matters most, in capitals.
static void state_word(const top_model_t *model, char out_word[16]) {
    const char *state = text_word(model->state, "state");
    const char *word = !model->connected                           ? "NO GATEWAY"
                       : model->stale || model->state == NULL      ? "NO ANSWER"
                       : json_is_true(get(model->state, "arming")) ? "ARMING"
                                                                   : state;
    size_t i = 0;
    for (; word[i] != '\0' && i < 15U; i++) {
        out_word[i] = (char)toupper((unsigned char)word[i]);
    }
    out_word[i] = '\0';
}

static void draw_head(const top_model_t *model) {
    const json_t *estop = get(model->state, "estop");
    const char *button = text_word(estop, "state");
    const bool released = strcmp(button, "released") == 0;
    char right[96];
    top_put(model, 0, 0, TOP_TITLE, " iWheel  %.40s", text_word(get(model->state, "bus"), "name"));
    (void)snprintf(right, sizeof(right), "e-stop %.16s%s ", strcmp(button, "none") == 0 ? "NONE" : button,
                   json_is_true(get(estop, "simulated")) ? " (SIMULATED)" : "");
    const int column = COLS - (int)strlen(right);
    top_put(model, 0, column > 0 ? column : 0, released ? TOP_GOOD : TOP_BAD, "%s", right);
}

/// A name of the protocol as words.
static void spell(const char *name, char *out_words, size_t size) {
    text_clean(name, out_words, size);
    for (char *c = strchr(out_words, '_'); c != NULL; c = strchr(c, '_')) {
        *c = ' ';
    }
}

/// Who drives, or why nobody does and what to do next.
static void draw_reason(const top_model_t *model, int row, const advice_t *advice) {
    char left[TEXT_CELL];
    char words[64];
    const json_t *lease = get(model->state, "lease");
    const char *cause = json_string_value(get(model->state, "cause"));
    const top_tone_t tone = tone_of(model, text_word(model->state, "state"));
    if (json_is_integer(get(lease, "holder"))) {
        text_integer(get(lease, "remaining_ms"), "ms", left);
        top_put(model, row, 1, TOP_TITLE, "%.30s drives (pid %lld); its command holds for %s", text_word(lease, "name"),
                json_integer_value(get(lease, "pid")), left);
    } else if (cause != NULL) {
        spell(cause, words, sizeof(words));
        top_put(model, row, 1, tone, "%s: %s", words, advice->line[0]);
    } else {
        top_put(model, row, 1, TOP_TITLE, "%s", advice->line[0]);
    }
}

/// Why, in words, and what the last stop was.
static void draw_cause(const top_model_t *model, int row, int rows) {
    advice_t advice;
    if (!model->connected || model->state == NULL) {
        top_put(model, row, 1, TOP_TITLE, "%s", model->notice);
        return;
    }
    advice_collect(model->state, &advice);
    draw_reason(model, row, &advice);
    const char *rest = model->last_stop;
    for (int i = 1; i < rows && *rest != '\0'; i++) {
        const size_t room = COLS > 3 ? (size_t)COLS - 2U : 1U;
        size_t cut = strlen(rest);
        if (cut > room && i < rows - 1) {
            for (cut = room; cut > 0 && rest[cut] != ' '; cut--) {
            }
            cut = cut == 0 ? room : cut;
        }
        top_put(model, row + i, 1, TOP_FAINT, "%.*s", (int)cut, rest);
        rest += cut;
        rest += strspn(rest, " ");
    }
}

static void draw_keys(const top_model_t *model) {
    if (model->notice[0] != '\0' && model->connected) {
        top_put(model, LINES - 2, 1, TOP_CARE, "%s", model->notice);
    }
    top_put(model, LINES - 1, 0, TOP_TITLE,
            COLS >= 60 ? " SPACE stop   E e-stop   R reset   Q quit" : " SPACE stop  Q quit");
}

void top_draw(const top_model_t *model) {
    char word[16];
    const char *state = text_word(model->state, "state");
    int row = 1;
    (void)erase();
    state_word(model, word);
    if (LINES < ROWS_LEAST || COLS < 20) {
        top_put(model, 0, 0, tone_of(model, state), "%s", word);
        return;
    }
    draw_head(model);
    if (LINES >= ROWS_BIG && COLS >= (int)strlen(word) * BIG_COLUMN + 1) {
        top_put_big(model, row, tone_of(model, state), word);
        row += BIG_ROWS;
    } else {
        top_put(model, row++, 1, tone_of(model, state), " %s ", word);
    }
    const int reasons = LINES >= ROWS_FULL ? 3 : LINES >= ROWS_BIG ? 2 : 1;
    draw_cause(model, row, reasons);
    row += reasons;
    if (model->state != NULL && model->connected) {
        const bool brief = LINES < ROWS_FULL;
        top_draw_wheels(model, row, brief);
        row += brief ? 4 : 7;
        top_draw_rest(model, row, LINES - 2 - row);
    }
    draw_keys(model);
}
