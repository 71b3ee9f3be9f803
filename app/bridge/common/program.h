// SPDX-License-Identifier: MIT
/// Command line of all bridges: `-c FILE`, `--check`, `--print-config`, `--version`, `--help`, and options of each
/// bridge.
#ifndef BRIDGE_PROGRAM_H
#define BRIDGE_PROGRAM_H

#include "config/settings.h"

/// Result: an action follows. Smaller results are exit codes: the action is done, or refused with a message.
#define BRIDGE_GO 256

#define BRIDGE_OPTIONS_MAX 8U

/// Actions.
#define BRIDGE_RUN   0
#define BRIDGE_CHECK 1
/// First number of the actions of a bridge, by their index in its table.
#define BRIDGE_OWN 2

typedef struct {
    const char *name; ///< `--NAME`.
    const char *key;  ///< `SECTION.KEY` that its value overrides; NULL: an action without a value.
} bridge_option_t;

typedef struct {
    const settings_form_t *form;             ///< Contains the name of the program.
    const char *path;                        ///< Configuration that is read without `-c`; it may be absent.
    const char *help;                        ///< Text of `--help`.
    bridge_option_t own[BRIDGE_OPTIONS_MAX]; ///< Ends with a NULL name.
    void *settings;                          ///< Contains the defaults; the file and the options override them.
    const void *standard;                    ///< Defaults, for printing.
} bridge_program_t;

/// Parses the command line and reads the configuration. Returns BRIDGE_GO and sets `*out_action`, or returns an exit
/// code.
int bridge_program_begin(const bridge_program_t *self, int count, char **arguments, int *out_action);

#endif
