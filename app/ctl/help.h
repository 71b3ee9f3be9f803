// SPDX-License-Identifier: MIT
/// The verbs of iwheelctl and what their --help says.
#ifndef HELP_H
#define HELP_H

#include "talk/ctl.h"

#include <stdio.h>

typedef struct {
    const char *name;
    ctl_verb_t run;
    const char
        *page; ///< What its --help prints: "Usage: " with the verb's words, an empty line, "NAME: SUMMARY", the rest.
    const char *no_json; ///< Why it refuses --json, and what to do instead; null: it answers in JSON.
    /// The words that may follow, by their number from 0 on, null behind the last; a null pointer: others, or none.
    const char *(*choice)(unsigned number);
} verb_t;

/// The verb of that name, or a null pointer.
const verb_t *help_find(const char *name);

/// The page of the program.
void help_print(FILE *out);

/// Tells that there is no such verb and which one may be meant; with "" that there is none at all. Returns CTL_USAGE.
int help_unknown(const char *name);

#endif
