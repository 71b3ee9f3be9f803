// SPDX-License-Identifier: MIT
// Assumptions about the wheels, their state, and their confirmation by the operator.
#include "config/similar.h"
#include "inspect/assumption.h"
#include "talk/ctl.h"
#include "talk/ctl_words.h"
#include "text/ctl_text.h"

#include "iwheel_northbound/words.h"

#include <ctype.h>
#include <stdlib.h>
#include <string.h>

#define LINE 512U

/// Adds the sentences of the daemon to the figures of a board, which has no memory for sentences.
static void explain(const char *name, json_t *entry) {
    char text[INSPECT_SOURCE_SIZE];
    iw_assumption_item_t item;
    iw_assumption_entry_t known = {.figure = (int32_t)json_integer_value(json_object_get(entry, "figure"))};
    if (!iwn_assumption_item_of(name, &item) || json_is_string(json_object_get(entry, "reason"))) {
        return;
    }
    for (int state = 0; state <= (int)IW_CONTRADICTED; state++) {
        if (strcmp(text_word(entry, "state"), iwn_assumption_state_name((iw_assumption_state_t)state)) == 0) {
            known.state = (iw_assumption_state_t)state;
        }
    }
    for (int source = 0; source <= (int)IW_SOURCE_OPERATOR; source++) {
        if (strcmp(text_word(entry, "evidence"), iwn_source_name((iw_source_t)source)) == 0) {
            known.source = (iw_source_t)source;
        }
    }
    inspect_assumption_source(item, &known, &(inspect_word_t){"", ""}, text);
    if (known.source == IW_SOURCE_BUS && !json_is_integer(json_object_get(entry, "figure"))) {
        (void)snprintf(text, sizeof text, "measured on the bus");
    }
    (void)json_object_set_new(entry, "reason", json_string(text));
    if (known.state == IW_CONTRADICTED) {
        (void)json_object_set_new(entry, "disabled", json_string(inspect_assumption_cost(item)));
    }
}

void ctl_explain_assumptions(json_t *assumptions) {
    const char *name = NULL;
    json_t *entry = NULL;
    json_object_foreach(assumptions, name, entry) {
        explain(name, entry);
    }
}

/// Prints "force_unit_left = cN: ..." with the reason, and the effect of a contradiction.
static void print_item(const paper_t *paper, const char *label, tone_t tone, const char *name, const json_t *entry) {
    char line[LINE];
    const char *disabled = json_string_value(json_object_get(entry, "disabled"));
    const bool known = json_object_get(entry, "value") != NULL; // The snapshot of a board does not have all values.
    (void)snprintf(line, sizeof line, "%.64s%s%.64s: %.256s", name, known ? " = " : "",
                   known ? text_word(entry, "value") : "", text_word(entry, "reason"));
    paper_wrap(paper, label, tone, line);
    if (disabled != NULL) {
        (void)snprintf(line, sizeof line, "disabled: %.256s", disabled);
        paper_wrap(paper, "", TONE_CARE, line);
    }
}

static void print_state(const paper_t *paper, json_t *assumptions, const char *state, tone_t tone) {
    char label[PAPER_LABEL + 1U];
    const char *name = NULL;
    json_t *entry = NULL;
    size_t length = 0;
    for (; state[length] != '\0' && length < sizeof label - 1U; length++) {
        label[length] = (char)toupper((unsigned char)state[length]);
    }
    label[length] = '\0';
    json_object_foreach(assumptions, name, entry) {
        if (strcmp(text_word(entry, "state"), state) == 0) {
            print_item(paper, label, tone, name, entry);
            label[0] = '\0';
        }
    }
}

int verb_ledger(ctl_t *self, int count, char **words) {
    json_t *status = NULL;
    if (!words_at_most("ledger", count, 0, words)) {
        return CTL_USAGE;
    }
    const int code = ctl_ask(self, json_pack("{s:s}", "cmd", "status"), &status);
    if (code == CTL_OK && !self->json) {
        const paper_t paper = {.out = stdout, .colour = text_wants_colour(stdout)};
        json_t *assumptions = json_object_get(status, "ledger");
        ctl_explain_assumptions(assumptions);
        print_state(&paper, assumptions, "contradicted", TONE_BAD);
        print_state(&paper, assumptions, "confirmed", TONE_GOOD);
        print_state(&paper, assumptions, "assumed", TONE_PLAIN);
    }
    json_decref(status);
    return code;
}

/// Reads ITEM [VALUE] [--how TEXT], in any order. Returns NULL after it has reported what is wrong with the words.
static json_t *compose(int count, char **words, const char **out_item) {
    char *plain[3] = {NULL, NULL, NULL};
    const char *how = NULL;
    int plains = 0;
    for (int i = 0; i < count; i++) {
        if (strcmp(words[i], "--how") == 0) {
            if (i + 1 == count) {
                (void)ctl_fail(CTL_USAGE, "--how needs a text; see: iwheelctl confirm --help");
                return NULL;
            }
            how = words[++i];
        } else if (plains < 3) {
            plain[plains++] = words[i];
        }
    }
    if (!words_at_most("confirm", plains, 2, plain)) {
        return NULL;
    }
    if (plains == 0) {
        (void)ctl_fail(CTL_USAGE, "confirm needs the name of an item; to list them: iwheelctl ledger");
        return NULL;
    }
    json_t *request =
        json_pack("{s:s,s:s,s:s*,s:s*}", "cmd", "confirm", "item", plain[0], "value", plain[1], "how", how);
    if (request == NULL) {
        (void)ctl_fail(CTL_USAGE, "confirm: item, value and how must be readable text (UTF-8)");
    }
    *out_item = plain[0];
    return request;
}

/// Suggests an item with a similar name after the gateway refused an unknown one.
static void suggest(const char *item) {
    const char *best = NULL;
    size_t best_distance = SETTINGS_WORD_STRANGE;
    for (unsigned i = 0; i < (unsigned)IW_ASSUMPTION_ITEMS; i++) {
        const char *name = iwn_assumption_item_name((iw_assumption_item_t)i);
        const size_t far = settings_word_distance(item, name);
        if (far < best_distance) {
            best = name;
            best_distance = far;
        }
    }
    if (best != NULL && strcmp(item, best) != 0) {
        (void)ctl_fail(CTL_NO, "did you mean %s?", best);
    }
}

int verb_confirm(ctl_t *self, int count, char **words) {
    json_t *reply = NULL;
    const char *item = NULL;
    json_t *request = compose(count, words, &item);
    if (request == NULL) {
        return CTL_USAGE;
    }
    const int code = ctl_ask(self, request, &reply);
    if (code == CTL_OK && !self->json) {
        const paper_t paper = {.out = stdout, .colour = text_wants_colour(stdout)};
        const bool good = strcmp(text_word(reply, "state"), "confirmed") == 0;
        explain(text_word(reply, "item"), reply);
        print_item(&paper, good ? "CONFIRMED" : "CONTRADICTED", good ? TONE_GOOD : TONE_BAD, text_word(reply, "item"),
                   reply);
    }
    if (code == CTL_NO && !self->json) {
        suggest(item);
    }
    json_decref(reply);
    return code;
}
