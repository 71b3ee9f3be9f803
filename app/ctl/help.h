// SPDX-License-Identifier: MIT
/// The verbs of iwheelctl and their --help pages.
#ifndef HELP_H
#define HELP_H

#include "talk/ctl.h"

#include <stdio.h>

typedef struct {
    const char *name;
    ctl_verb_t run;
    const char *page;    ///< --help page: "Usage: ...", an empty line, "NAME: SUMMARY", the rest.
    const char *no_json; ///< Why it refuses --json, and what to use instead; NULL: it answers in JSON.
    /// Returns a word that may follow, by its number from 0 on; NULL after the last. A null pointer: other words, or
    /// none.
    const char *(*choice)(unsigned number);
} verb_t;

/// Returns the verb of that name, or NULL.
const verb_t *help_find(const char *name);

/// Prints the page of the program.
void help_print(FILE *out);

/// Reports an unknown verb and the one that may be meant; with "", that the verb is missing. Returns CTL_USAGE.
int help_unknown(const char *name);

#endif
