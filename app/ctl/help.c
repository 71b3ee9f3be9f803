// SPDX-License-Identifier: MIT
#include "help.h"

#include "config/similar.h"
#include "talk/ctl_words.h"

#include "iwheel_northbound/text.h"
#include "iwheel_northbound/words.h"

#include "help_texts.h"

#include <string.h>

static const char *topic_choice(unsigned number) {
    return (number < (unsigned)IWN_TOPICS) ? iwn_topic_name((iwn_topic_t)number) : NULL;
}

static const char *side_choice(unsigned number) {
    static const char *const sides[] = {"left", "right"};
    return (number < 2U) ? sides[number] : NULL;
}

static const char *config_choice(unsigned number) {
    static const char *const words[] = {"show", "set", "commit", "discard"};
    return (number < sizeof words / sizeof words[0]) ? words[number] : NULL;
}

static const char *fleet_choice(unsigned number) {
    static const char *const verbs[] = {"history", "recordings", "recording"};
    return (number < 3U) ? verbs[number] : NULL;
}

static const char *item_choice(unsigned number) {
    return (number < (unsigned)IW_ASSUMPTION_ITEMS) ? iwn_assumption_item_name((iw_assumption_item_t)number) : NULL;
}

static const char *verb_choice(unsigned number);

/// The page of a verb is the file with its name in help/.
#define ROW(name_, run_, no_json_, choice_)                                                                            \
    {.name = #name_, .run = (run_), .page = help_##name_, .no_json = (no_json_), .choice = (choice_)},

static const verb_t verbs[] = {CTL_VERBS(ROW)};
#define VERBS (sizeof verbs / sizeof verbs[0])

static const char *verb_choice(unsigned number) {
    return (number < VERBS) ? verbs[number].name : NULL;
}

const verb_t *help_find(const char *name) {
    for (size_t i = 0; i < VERBS; i++) {
        if (strcmp(verbs[i].name, name) == 0) {
            return &verbs[i];
        }
    }
    return NULL;
}

int help_unknown(const char *name) {
    char known[256];
    iwn_text_t list = iwn_text_begin(known, sizeof known);
    const char *best = NULL;
    size_t best_distance = SETTINGS_WORD_STRANGE;
    for (size_t i = 0; i < VERBS; i++) {
        const size_t far = settings_word_distance(name, verbs[i].name);
        if (far < best_distance) {
            best = verbs[i].name;
            best_distance = far;
        }
        IWN_TEXT_JOIN(&list, (i > 0) ? " " : "", verbs[i].name);
    }
    if (name[0] == '\0') {
        return ctl_fail(CTL_USAGE, "the verb is missing; known verbs: %s", known);
    }
    return (best != NULL) ? ctl_fail(CTL_USAGE, "unknown verb \"%s\"; did you mean %s? All: iwheelctl help", name, best)
                          : ctl_fail(CTL_USAGE, "unknown verb \"%s\"; known verbs: %s", name, known);
}

/// Returns the part of the usage line that follows the verb's name, and its length.
static size_t words_of(const verb_t *verb, const char **out_words) {
    *out_words = verb->page + strlen("Usage: iwheelctl [--socket PATH]") +
                 strlen((verb->no_json == NULL) ? " [--json] " : " ") + strlen(verb->name);
    return (size_t)(strstr(*out_words, "\n\n") - *out_words);
}

/// Returns the line after the usage, without the name, and its length.
static int summary_of(const verb_t *verb, const char **out_summary) {
    *out_summary = strstr(verb->page, "\n\n") + 2U + strlen(verb->name) + 2U;
    return (int)strcspn(*out_summary, "\n");
}

void help_print(FILE *out) {
    static const char mark[] = "\nVERBS\n"; // Place of the verbs in the file.
    const char *const at = strstr(help_iwheelctl, mark) + 1U;
    (void)fprintf(out, "%.*s", (int)(at - help_iwheelctl), help_iwheelctl);
    for (size_t i = 0; i < VERBS; i++) {
        const char *summary = NULL;
        const int length = summary_of(&verbs[i], &summary);
        (void)fprintf(out, "  %-9s%.*s\n", verbs[i].name, length, summary);
    }
    (void)fputs(at + strlen(mark) - 1U, out);
}

/// Prints the options in the verb's usage, and FILE and BUS if it accepts them.
static void list_words(const verb_t *verb, FILE *out) {
    char words[256];
    const char *begin = NULL;
    const size_t size = words_of(verb, &begin);
    (void)snprintf(words, sizeof words, "%.*s", (int)size, begin);
    const char *at = words;
    for (at = strstr(at, "--"); at != NULL; at = strstr(at, "--")) {
        const size_t length = 2U + strspn(at + 2, "abcdefghijklmnopqrstuvwxyz-");
        (void)fprintf(out, "%.*s\n", (int)length, at);
        at += length;
    }
    for (unsigned i = 0; verb->choice != NULL && verb->choice(i) != NULL; i++) {
        (void)fprintf(out, "%s\n", verb->choice(i));
    }
    if (strncmp(words, " FILE", 5U) == 0 || strncmp(words, " [FILE", 6U) == 0 || strstr(words, "|FILE") != NULL) {
        (void)fputs("FILE\n", out);
    }
    if (strncmp(words, " [IFACE", 7U) == 0) {
        (void)fputs("BUS\n", out);
    }
    (void)fputs((verb->no_json == NULL) ? "--json\n--socket\n--help\n" : "--socket\n--help\n", out);
}

int verb_help(ctl_t *self, int count, char **words) {
    const bool list = count > 0 && strcmp(words[count - 1], "--list") == 0;
    (void)self;
    count -= list ? 1 : 0;
    if (!words_at_most("help", count, 1, words)) {
        return CTL_USAGE;
    }
    const verb_t *verb = (count > 0) ? help_find(words[0]) : NULL;
    if (count > 0 && verb == NULL) {
        return help_unknown(words[0]);
    }
    if (!list && verb != NULL) {
        (void)fputs(verb->page, stdout);
    } else if (!list) {
        help_print(stdout);
    } else if (verb != NULL) {
        list_words(verb, stdout);
    } else {
        for (size_t i = 0; i < VERBS; i++) {
            const char *summary = NULL;
            const int length = summary_of(&verbs[i], &summary);
            (void)printf("%s\t%.*s\n", verbs[i].name, length, summary);
        }
    }
    return CTL_OK;
}
