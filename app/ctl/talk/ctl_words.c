// SPDX-License-Identifier: MIT
#include "ctl_words.h"

#include "ctl.h"

#include <string.h>

int option_text(const option_t *option, const char *verb, const char *value) {
    if (value == NULL && option->wants != NULL) {
        return ctl_fail(CTL_USAGE, "%s needs %s", option->name, option->wants);
    }
    if (value == NULL) {
        return ctl_fail(CTL_USAGE, "%s needs a value; see: iwheelctl %s --help", option->name, verb);
    }
    *(const char **)option->out = value;
    return CTL_OK;
}

int option_time(const option_t *option, const char *verb, const char *value) {
    char why[DURATION_WHY_SIZE];
    (void)verb;
    return duration_option(option->name, value, option->range, option->out, why) ? CTL_OK
                                                                                 : ctl_fail(CTL_USAGE, "%s", why);
}

bool words_is_name(const char *word) {
    return word[0] != '-';
}

bool words_is_file(const char *word) {
    return word[0] != '-' || word[1] == '\0';
}

bool words_at_most(const char *verb, int count, int most, char **words) {
    if (count > most) {
        (void)ctl_fail(CTL_USAGE, "%s does not understand \"%s\"; see: iwheelctl %s --help", verb, words[most], verb);
        return false;
    }
    return true;
}

static const option_t *find(const option_t *option, const char *name) {
    while (option->name != NULL && strcmp(option->name, name) != 0) {
        option++;
    }
    return (option->name != NULL) ? option : NULL;
}

int words_read(const words_syntax_t *self, int count, char **words) {
    bool named = false;
    int code = CTL_OK;
    for (int i = 0; i < count && code == CTL_OK; i++) {
        const option_t *const option = find(self->options, words[i]);
        if (option == NULL && (named || !self->is_word(words[i]))) {
            (void)words_at_most(self->verb, count, i, words);
            code = CTL_USAGE;
        } else if (option == NULL) {
            *self->word = words[i];
            named = true;
        } else if (option->read == NULL) {
            *(bool *)option->out = true;
        } else {
            i++;
            code = option->read(option, self->verb, (i < count) ? words[i] : NULL);
        }
    }
    return code;
}
