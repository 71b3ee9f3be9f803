// SPDX-License-Identifier: MIT
#include "program.h"

#include "begin/begin.h"

#include <getopt.h>
#include <sysexits.h>
#include <unistd.h>

/// Values of getopt for options without a letter: an action, or the index of a key in the table of the bridge.
enum { TO_DO = 256, TO_CHANGE = 512, PRINT = 1024 };

#define COMMON 5U

/// Contents of the command line.
typedef struct {
    const char *path; ///< NULL: not named.
    const char *value[BRIDGE_OPTIONS_MAX];
    int action;
    bool print;
} wanted_t;

static int misuse(const bridge_program_t *self, const char *word, const char *what) {
    (void)fprintf(stderr, "%s: %.100s %s; see %s --help\n", self->form->program, word, what, self->form->program);
    return EX_USAGE;
}

static void fill(const bridge_program_t *self, struct option options[COMMON + BRIDGE_OPTIONS_MAX + 1U]) {
    const struct option common[COMMON] = {
        {"config", required_argument, NULL, 'c'},   {"check", no_argument, NULL, TO_DO + BRIDGE_CHECK},
        {"print-config", no_argument, NULL, PRINT}, {"version", no_argument, NULL, 'V'},
        {"help", no_argument, NULL, 'h'},
    };
    size_t count = 0;
    for (; count < COMMON; count++) {
        options[count] = common[count];
    }
    for (int i = 0; i < (int)BRIDGE_OPTIONS_MAX && self->own[i].name != NULL; i++) {
        const bool changes = self->own[i].key != NULL;
        options[count++] = (struct option){self->own[i].name, changes ? required_argument : no_argument, NULL,
                                           changes ? TO_CHANGE + i : TO_DO + BRIDGE_OWN + i};
    }
    options[count] = (struct option){NULL, 0, NULL, 0};
}

/// Returns BRIDGE_GO, or an exit code.
static int parse(const bridge_program_t *self, int count, char **arguments, wanted_t *out_wanted) {
    struct option options[COMMON + BRIDGE_OPTIONS_MAX + 1U];
    int option = 0;
    fill(self, options);
    opterr = 0;
    while ((option = getopt_long(count, arguments, ":c:hV", options, NULL)) != -1) {
        if (option == 'h') {
            (void)fputs(self->help, stdout);
            return 0;
        }
        if (option == 'V') {
            (void)printf("%s " IWHEEL_VERSION "\n", self->form->program);
            return 0;
        }
        if (option == '?' || option == ':') {
            return misuse(self, arguments[optind - 1],
                          (option == ':') ? "needs a value" : "is not an option of this program");
        }
        if (!begin_is_value(self->form->program, optarg)) {
            return EX_USAGE;
        }
        if (option == 'c') {
            out_wanted->path = optarg;
        } else if (option == PRINT) {
            out_wanted->print = true;
        } else if (option >= TO_CHANGE) {
            out_wanted->value[option - TO_CHANGE] = optarg;
        } else {
            out_wanted->action = option - TO_DO;
        }
    }
    return (optind < count) ? misuse(self, arguments[optind], "is not valid: this program has options only")
                            : BRIDGE_GO;
}

/// Returns 0, or the error of reading.
static int configure(const bridge_program_t *self, const wanted_t *wanted) {
    const char *path = (wanted->path != NULL) ? wanted->path : self->path;
    int error = 0;
    if (wanted->path != NULL || access(path, F_OK) == 0) {
        error = settings_load(self->form, path, self->settings, stderr);
    }
    for (size_t i = 0; i < BRIDGE_OPTIONS_MAX && error == 0; i++) {
        if (wanted->value[i] != NULL) {
            char name[64];
            (void)snprintf(name, sizeof name, "--%s", self->own[i].name);
            settings_report_t report = {.name = name, .err = stderr};
            error = settings_override(self->form, &report, self->own[i].key, wanted->value[i], self->settings);
        }
    }
    return error;
}

int bridge_program_begin(const bridge_program_t *self, int count, char **arguments, int *out_action) {
    wanted_t wanted = {.action = BRIDGE_RUN};
    int code = begin_program(self->form->program, count, arguments);
    if (code == 0) {
        code = parse(self, count, arguments, &wanted);
    }
    if (code != BRIDGE_GO) {
        return code;
    }
    code = configure(self, &wanted);
    if (code == 0 && wanted.print) {
        settings_print(self->form, self->settings, self->standard, NULL, stdout);
        return 0;
    }
    *out_action = wanted.action;
    return (code == 0) ? BRIDGE_GO : code;
}
