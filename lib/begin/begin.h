// SPDX-License-Identifier: MIT
/// Start of every program: makes its standard streams safe and checks its arguments.
///
/// Link `iwheel_begin` and include "begin/begin.h". Call it once in main, before the first output and before another
/// descriptor is opened.
#ifndef IWHEEL_BEGIN_H
#define IWHEEL_BEGIN_H

#include <stdbool.h>

/// Ignores SIGPIPE, so that a program whose log has no reader ends with its own exit code, and a service continues.
/// Opens /dev/null for those of the descriptors 0 to 2 that are closed, so that no socket gets such a number and
/// receives output.
///
/// Refuses an empty argument and a bare `--`. Returns 0, or EX_USAGE of sysexits after a message on stderr.
int begin_program(const char *program, int count, char **arguments);

/// Checks the value of an option. Refuses a value that begins with `-`, because it is the next option after a forgotten
/// value; accepts `-` alone. Returns false after a message on stderr. NULL: the option has no value; returns true.
bool begin_is_value(const char *program, const char *value);

#endif
