// SPDX-License-Identifier: MIT
/// The verbs of iwheelctl and what their --help says.
#ifndef HELP_H
#define HELP_H

#include "talk/ctl.h"

#include <stdio.h>

typedef struct {
    const char *name;
    ctl_verb_t run;
    const char *words;   ///< What follows the name.
    const char *summary; ///< One line.
    const char *details; ///< More, for the verb's own help; lines end with '\n'.
} verb_t;

/// The verb of that name, or a null pointer.
const verb_t *help_find(const char *name);

/// The page of the program.
void help_print(FILE *out);

/// The page of a verb.
void help_print_verb(const verb_t *verb, FILE *out);

/// The names of all verbs, separated by blanks.
void help_names(char *out, size_t size);

#endif
