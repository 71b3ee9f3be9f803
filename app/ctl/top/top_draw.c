// SPDX-License-Identifier: MIT
// Layout of the screen.
#include "status/advice.h"
#include "text/ctl_text.h"
#include "top.h"

#include <ctype.h>
#include <curses.h>
#include <stdio.h>
#include <string.h>

#define BIG_ROWS   5
#define BIG_COLUMN 6
/// From these sizes on: big letters, and both wheels with all their lines.
#define ROWS_BIG   20
#define ROWS_FULL  24
#define ROWS_LEAST 4
/// In a narrower terminal, big letters would use the rows that sentences need.
#define COLUMNS_BIG 55

static const json_t *get(const json_t *object, const char *field) {
    return json_object_get(object, field);
}

static bool rolls(const top_model_t *model) {
    return json_is_true(get(model->state, "rolling"));
}

static top_tone_t tone_of(const top_model_t *model, const char *state) {
    if (!model->connected || model->stale || rolls(model) || strcmp(state, "latched") == 0) {
        return TOP_BAD;
    }
    return (strcmp(state, "listening") == 0) ? TOP_GOOD : TOP_CARE;
}

/// Writes the most important word, in capitals.
static void state_word(const top_model_t *model, char out_word[16]) {
    const char *state = text_word(model->state, "state");
    const char *word = !model->connected                           ? "NO GATEWAY"
                       : (model->stale || model->state == NULL)    ? "NO ANSWER"
                       : rolls(model)                              ? "ROLLING"
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
    const char *where = json_string_value(get(estop, "pressed_at"));
    const bool at_one = where != NULL && strncmp(where, "line", 4) == 0;
    (void)snprintf(right, sizeof right, "e-stop %.16s%s%.8s%s ", (strcmp(button, "none") == 0) ? "NONE" : button,
                   at_one ? " at " : "", at_one ? where : "",
                   json_is_true(get(estop, "simulated")) ? " (SIMULATED)" : "");
    const int column = COLS - (int)strlen(right);
    const int columns = column - 10;
    top_put(model, 0, 0, TOP_TITLE, " iWheel  %.*s",
            (columns > 40)  ? 40
            : (columns > 5) ? columns
                            : 0,
            text_word(get(model->state, "bus"), "name"));
    top_put(model, 0, (column > 0) ? column : 0, released ? TOP_GOOD : TOP_BAD, "%s", right);
}

/// Writes a name of the protocol as words.
static void spell(const char *name, char *out_words, size_t size) {
    text_clean(name, out_words, size);
    for (char *c = strchr(out_words, '_'); c != NULL; c = strchr(c, '_')) {
        *c = ' ';
    }
}

/// Draws the lease holder, or the reason why there is none and the next action. Returns the number of rows.
static int draw_reason(const top_model_t *model, int row, int rows, const advice_t *advice) {
    char left[TEXT_CELL];
    char words[64];
    char text[TOP_TEXT_SIZE];
    const json_t *lease = get(model->state, "lease");
    const char *cause = json_string_value(get(model->state, "cause"));
    top_tone_t tone = TOP_TITLE;
    if (json_is_integer(get(lease, "holder"))) {
        text_integer(get(lease, "remaining_ms"), "ms", left);
        (void)snprintf(text, sizeof text, "%.30s drives (pid %lld); its command is valid for %s",
                       text_word(lease, "name"), json_integer_value(get(lease, "pid")), left);
    } else if (rolls(model)) {
        tone = TOP_BAD;
        (void)snprintf(text, sizeof text, "%s", advice->line[0]);
    } else if (cause != NULL) {
        tone = tone_of(model, text_word(model->state, "state"));
        spell(cause, words, sizeof words);
        (void)snprintf(text, sizeof text, "%s: %s", words, advice->line[0]);
    } else {
        (void)snprintf(text, sizeof text, "%s", advice->line[0]);
    }
    return top_put_wrapped(model, row, rows, tone, text);
}

/// Draws the cause as a sentence, and the last stop. Returns the number of rows.
static int draw_cause(const top_model_t *model, int row, int rows) {
    advice_t advice;
    if (!model->connected || model->state == NULL) {
        return top_put_wrapped(model, row, rows, TOP_TITLE, model->notice);
    }
    advice_collect(model->state, &advice);
    const int first = (rows >= 4) ? rows - 2 : (rows >= 3 && COLS < TOP_COLUMNS_WHOLE) ? 2 : 1;
    const int used = draw_reason(model, row, first, &advice);
    return used + top_put_wrapped(model, row + used, rows - used, TOP_FAINT, model->last_stop);
}

static void draw_keys(const top_model_t *model) {
    if (model->notice[0] != '\0' && model->connected) {
        top_put(model, LINES - 2, 1, TOP_CARE, "%s", model->notice);
    }
    top_put(model, LINES - 1, 0, TOP_TITLE,
            (COLS >= TOP_COLUMNS_WHOLE) ? " SPACE stop   E e-stop   R reset   Q quit"
            : (COLS >= 38)              ? " SPACE stop  E e-stop  R reset  Q quit"
                                        : " SPACE stop  Q quit");
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
    const bool big = LINES >= ROWS_BIG && COLS >= COLUMNS_BIG && COLS >= (int)strlen(word) * BIG_COLUMN + 1;
    if (big) {
        top_put_big(model, row, tone_of(model, state), word);
        row += BIG_ROWS;
    } else {
        top_put(model, row++, 1, tone_of(model, state), " %s ", word);
    }
    // Where lines are short, the rows without big letters are used for whole sentences.
    const int reasons = (LINES >= ROWS_FULL) ? (big ? 3 : 5) : (LINES >= ROWS_BIG) ? (big ? 2 : 4) : big ? 1 : 2;
    const int used = draw_cause(model, row, reasons);
    row += big ? reasons : used; // Below big letters no line moves when a sentence is longer.
    if (model->state != NULL && model->connected) {
        row += top_draw_wheels(model, row, LINES < ROWS_FULL);
        row += top_draw_rest(model, row, LINES - 2 - row);
        top_draw_plots(model, row + 1, LINES - 2 - row - 1);
    }
    draw_keys(model);
}
