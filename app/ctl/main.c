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
} arguments_t;

/// Reads an option that is allowed anywhere. Returns the number of arguments that it used; 0: it is another argument;
/// -1 after it has reported a mistake.
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
        (void)ctl_fail(CTL_USAGE, "--socket needs a path, such as --socket /run/iwheel/gateway.sock");
        return -1;
    } else {
        return 0;
    }
    return 1;
}

/// Reads the arguments. Returns false after it has reported a mistake.
static bool take_arguments(arguments_t *self, int count, char **arguments) {
    for (int i = 1; i < count;) {
        const int used = take_option(self, count - i, &arguments[i]);
        if (used < 0) {
            return false;
        }
        if (used == 0 && self->verb == NULL && arguments[i][0] == '-') {
            (void)ctl_fail(CTL_USAGE, "unknown option %s; see: iwheelctl --help", arguments[i]);
            return false;
        }
        if (used == 0 && self->verb == NULL) {
            self->verb = arguments[i];
        } else if (used == 0) {
            self->words[self->count] = arguments[i];
            self->count++;
        }
        i += (used == 0) ? 1 : used;
    }
    if (self->ctl->socket != NULL && self->ctl->socket[0] == '\0') {
        (void)ctl_fail(CTL_USAGE, "--socket needs a path, such as --socket /run/iwheel/gateway.sock");
        return false;
    }
    return true;
}

static int dispatch(const arguments_t *arguments) {
    const verb_t *verb = (arguments->verb != NULL) ? help_find(arguments->verb) : NULL;
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
    int code = begin_program("iwheelctl", count, arguments);
    if (code != 0) {
        return code;
    }
    self.words = (char **)calloc((size_t)count + 1U, sizeof *self.words);
    if (!client_init(&ctl.client) || self.words == NULL) {
        code = ctl_fail(CTL_INTERNAL, "out of memory");
    } else {
        code = take_arguments(&self, count, arguments) ? dispatch(&self) : CTL_USAGE;
    }
    client_free(&ctl.client);
    free((void *)self.words);
    return ctl_finish(code);
}
