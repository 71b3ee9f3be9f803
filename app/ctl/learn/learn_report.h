// SPDX-License-Identifier: MIT
/// The parts of learn's report that weigh evidence. Private to learn.
#ifndef LEARN_REPORT_H
#define LEARN_REPORT_H

#include "learn.h"

#define LEARN_TEXT 160U

/// A line of the report behind its mark.
__attribute__((format(printf, 2, 3))) void learn_say(char mark, const char *format, ...);

void learn_say_type(const learn_t *self);
void learn_say_role(const learn_t *self);
void learn_say_signs(const learn_t *self);
void learn_say_scale(const learn_t *self);
void learn_say_force(const learn_t *self);
void learn_say_pose(const learn_t *self);

/// Lines for the configuration file, for what the recording speaks for clearly.
void learn_suggest(const learn_t *self);

#endif
