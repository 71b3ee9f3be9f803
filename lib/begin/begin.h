// SPDX-License-Identifier: MIT
/// What every program does before anything else: its streams are safe to write to, and its arguments mean something.
///
/// Link `iwheel_begin` and include "begin/begin.h". To be called once, in main, before the first line of output and before another
/// descriptor is opened.
#ifndef IWHEEL_BEGIN_H
#define IWHEEL_BEGIN_H

#include <stdbool.h>

/// Ignores SIGPIPE: the exit code of a program whose log has no reader any more is still its own, and a service goes on. Opens what is
/// closed of descriptors 0 to 2 with /dev/null, so that no socket takes the place of one and is written to.
///
/// Refuses an empty argument and a bare `--`. 0, or EX_USAGE of sysexits after a line on stderr.
int begin_program(const char *program, int count, char **arguments);

/// Whether an option's value is one: it does not begin with `-`, as the next option does where the value was forgotten; `-` alone is one. False after a line on
/// stderr. NULL: the option has none; true.
bool begin_is_value(const char *program, const char *value);

#endif
