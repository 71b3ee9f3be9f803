// SPDX-License-Identifier: MIT
/// What a recording tells, sentence by sentence. Private to learn.
///
/// A sentence is for (+) or against (-) something only if all that it claims was seen, on each wheel that it speaks of
/// and often enough; otherwise its mark is ? and it names what is missing. `item` and `side` say what it is about,
/// `value` what it concludes, as the configuration writes it.
#ifndef LEARN_FINDINGS_H
#define LEARN_FINDINGS_H

#include "learn.h"

#define LEARN_TEXT         256U
#define LEARN_VALUE        16U
#define LEARN_FINDINGS_MAX 48U
/// Frames of one kind without which they are no habit: at 50 Hz, a fifth of a second.
#define LEARN_FRAMES_MIN 10U
/// A wheel showed nothing that it did not show for this long.
#define LEARN_SHOWN_MIN_US 500000

#define LEARN_BOTH IW_SIDES

typedef struct {
    char mark; ///< + for, - against, ? nothing about.
    const char *item;
    unsigned side;           ///< An iw_side_t, or LEARN_BOTH.
    char value[LEARN_VALUE]; ///< Empty: it concludes none.
    char text[LEARN_TEXT];
} learn_finding_t;

typedef struct {
    learn_finding_t at[LEARN_FINDINGS_MAX];
    unsigned count;
} learn_findings_t;

/// All of them.
void learn_weigh(const learn_t *self, learn_findings_t *out_findings);

/// Adds one. The result is the finding, for its value.
__attribute__((format(printf, 5, 6))) learn_finding_t *learn_say(learn_findings_t *self, char mark, const char *item,
                                                                 unsigned side, const char *format, ...);

/// The first finding about it, or NULL.
const learn_finding_t *learn_find(const learn_findings_t *self, const char *item, unsigned side);

bool learn_is_empty(const learn_range_t *range);

/// The wheel turned while it was told a steady speed, long enough and nearly always.
bool learn_turned(const learn_wheel_t *wheel);

/// It was told a steady speed for long enough and hardly ever turned.
bool learn_stayed(const learn_wheel_t *wheel);

/// For the configuration: `*out_section` and `*out_key` of a finding whose value is worth a line there. False otherwise.
bool learn_suggests(const learn_findings_t *self, const learn_finding_t *finding, const char **out_section,
                    const char **out_key);

// --- what they weigh ---------------------------------------------------------------------------------------------

void learn_weigh_setpoints(const learn_t *self, learn_findings_t *out_findings); ///< learn_setpoints.c
void learn_weigh_wheels(const learn_t *self, learn_findings_t *out_findings);    ///< learn_wheels.c

#endif
