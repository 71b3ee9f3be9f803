// SPDX-License-Identifier: MIT
/// Telling what is wrong, and the one rule that several keys share: the stop budget.
///
/// Private to the configuration reader.
#ifndef CONFIG_RELATIONS_H
#define CONFIG_RELATIONS_H

#include "config_value.h"

/// The first of these are written, the others counted.
#define CONFIG_ERRORS_SHOWN 20U

typedef struct {
    const char *name; ///< The file, or where else the value came from.
    FILE *err;
    unsigned errors;
} config_report_t;

/// Writes `NAME:LINE: message`, or `NAME: message` with line 0, and counts it.
__attribute__((format(printf, 3, 4))) void config_complain(config_report_t *report, unsigned line, const char *format,
                                                           ...);

/// Tells how many errors were not shown, if any.
void config_complain_end(config_report_t *report);

/// Complains if the values do not fit together, at the line of the last key involved. `seen` has the line of every
/// key, 0 if it was not given.
void config_relations_check(config_report_t *report, const gateway_config_t *config, const unsigned *seen);

#endif
