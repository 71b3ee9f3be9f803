// SPDX-License-Identifier: MIT
/// The command line of a bridge, alike for all: `-c FILE`, `--check`, `--print-config`, `--version`, `--help`, and what it has of its own.
#ifndef BRIDGE_PROGRAM_H
#define BRIDGE_PROGRAM_H

#include "config/settings.h"

/// There is something to do; smaller results are exit codes of what has been done, or refused with a message.
#define BRIDGE_GO 256

#define BRIDGE_OPTIONS_MAX 8U

/// What is to be done.
#define BRIDGE_RUN   0
#define BRIDGE_CHECK 1
/// And from here on the bridge's own, by their place in its table.
#define BRIDGE_OWN 2

typedef struct {
    const char *name; ///< `--NAME`.
    const char
        *key; ///< "SECTION.KEY", which its value goes before the file's; null: without a value, something else to do.
} bridge_option_t;

typedef struct {
    const settings_form_t *form; ///< Has the program's name.
    const char *path; ///< Of the configuration that is read where `-c` names none; its absence is no error then.
    const char *help; ///< What `--help` prints.
    bridge_option_t own[BRIDGE_OPTIONS_MAX]; ///< Up to a null name.
    void *settings;                          ///< Holds the defaults; the file and options go over it.
    const void *standard;                    ///< The defaults, for printing.
} bridge_program_t;

/// Reads command line and configuration. BRIDGE_GO with what to do in `out_action`, or an exit code.
int bridge_program_begin(const bridge_program_t *self, int count, char **arguments, int *out_action);

#endif
