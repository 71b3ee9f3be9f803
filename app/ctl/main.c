// SPDX-License-Identifier: MIT
#include "help.h"

#include "begin/begin.h"

#include <stdlib.h>
#include <string.h>

typedef struct {
    ctl_t *ctl;
    const char *verb;
    char **words; ///< Arguments of the verb.
    int count;
    bool help;
    bool version;
    bool wrong; ///< A mistake was reported.
} arguments_t;

static void report_no_path(arguments_t *self) {
    if (!self->wrong) {
        (void)ctl_fail(CTL_USAGE, "--socket needs a path, such as --socket /run/iwheel/gateway.sock");
    }
    self->wrong = true;
}

/// Reads an option that is allowed anywhere. Returns the number of arguments that it used; 0: it is another argument.
static int take_option(arguments_t *self, int left, char **argument) {
    static const char socket[] = "--socket";
    const size_t length = sizeof socket - 1U;
    if (strcmp(argument[0], "--json") == 0) {
        self->ctl->json = true;
    } else if (strcmp(argument[0], "--help") == 0 || strcmp(argument[0], "-h") == 0) {
        self->help = true;
    } else if (strcmp(argument[0], "--version") == 0) {
        self->version = true;
    } else if (strncmp(argument[0], socket, length) == 0 && argument[0][length] == '=') {
        self->ctl->socket = argument[0] + length + 1U;
    } else if (strcmp(argument[0], socket) == 0 && left > 1 && argument[1][0] != '-') {
        self->ctl->socket = argument[1];
        return 2;
    } else if (strcmp(argument[0], socket) == 0) {
        report_no_path(self);
    } else {
        return 0;
    }
    return 1;
}

/// Reads the arguments, all of them also after a mistake, which it reports.
static void take_arguments(arguments_t *self, int count, char **arguments) {
    for (int i = 1; i < count;) {
        const int used = take_option(self, count - i, &arguments[i]);
        if (used == 0 && self->verb == NULL && (arguments[i][0] == '-' || arguments[i][0] == '\0')) {
            if (!self->wrong) {
                (void)ctl_fail(CTL_USAGE, "unknown option %s; see: iwheelctl --help", arguments[i]);
            }
            self->wrong = true;
        } else if (used == 0 && self->verb == NULL) {
            self->verb = arguments[i];
        } else if (used == 0) {
            self->words[self->count] = arguments[i];
            self->count++;
        }
        i += (used == 0) ? 1 : used;
    }
    if (self->ctl->socket != NULL && self->ctl->socket[0] == '\0') {
        report_no_path(self);
        self->ctl->socket = NULL;
    }
}

/// Stops in spite of a mistake in the arguments if the verb is a stop. Returns an exit code.
static int stop_anyway(const arguments_t *arguments) {
    const verb_t *verb = (arguments->verb != NULL) ? help_find(arguments->verb) : NULL;
    if (verb == NULL || arguments->help || arguments->version) {
        return CTL_USAGE;
    }
    int code = CTL_USAGE;
    if (verb->run == verb_stop || verb->run == verb_disarm) {
        code = verb->run(arguments->ctl, 0, arguments->words); // Without the words: the first mistake was reported.
    } else if (verb->run == verb_estop) {
        code = verb_estop(arguments->ctl, arguments->count, arguments->words);
    }
    return (code != CTL_OK) ? code : CTL_USAGE;
}

static int dispatch(const arguments_t *arguments) {
    const verb_t *verb = (arguments->verb != NULL) ? help_find(arguments->verb) : NULL;
    if (arguments->wrong) {
        return stop_anyway(arguments);
    }
    if (arguments->version) {
        (void)puts("iwheelctl " IWHEEL_VERSION);
        return CTL_OK;
    }
    if (arguments->help && arguments->verb == NULL) {
        help_print(stdout);
        return CTL_OK;
    }
    if (verb == NULL) {
        return help_unknown((arguments->verb != NULL) ? arguments->verb : "");
    }
    if (arguments->help) {
        (void)fputs(verb->page, stdout);
        return CTL_OK;
    }
    if (arguments->ctl->json && verb->no_json != NULL) {
        return ctl_fail(CTL_USAGE, "%s", verb->no_json);
    }
    return verb->run(arguments->ctl, arguments->count, arguments->words);
}

int main(int count, char **arguments) {
    static ctl_t ctl;
    arguments_t self = {.ctl = &ctl};
    int code = CTL_OK;
    self.wrong = begin_program("iwheelctl", count, arguments) != 0;
    self.words = (char **)calloc((size_t)count + 1U, sizeof *self.words);
    if (!client_init(&ctl.client) || self.words == NULL) {
        code = ctl_fail(CTL_INTERNAL, "out of memory");
    } else {
        take_arguments(&self, count, arguments);
        code = dispatch(&self);
    }
    client_free(&ctl.client);
    free((void *)self.words);
    return ctl_finish(code);
}
