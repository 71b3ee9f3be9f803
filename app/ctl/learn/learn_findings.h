// SPDX-License-Identifier: MIT
/// Findings about a recording, sentence by sentence. Private to learn.
///
/// A sentence is for (+) or against (-) a fact only if everything that it claims was observed, often enough and on each
/// wheel that it names. Otherwise its mark is ? and it names the missing observation. `item` and `side` are its subject,
/// `value` is its conclusion in the form of the configuration.
#ifndef LEARN_FINDINGS_H
#define LEARN_FINDINGS_H

#include "learn.h"

#define LEARN_TEXT         256U
#define LEARN_VALUE        16U
#define LEARN_FINDINGS_MAX 48U
/// Minimum number of frames of one kind for a finding: at 50 Hz, a fifth of a second.
#define LEARN_FRAMES_MIN 10U
/// Minimum time for which a wheel must show a behaviour.
#define LEARN_SHOWN_MIN_US 500000

#define LEARN_BOTH IW_SIDES

typedef struct {
    char mark; ///< + for, - against, ? not known.
    const char *item;
    unsigned side;           ///< An iw_side_t, or LEARN_BOTH.
    char value[LEARN_VALUE]; ///< Empty: no conclusion.
    char text[LEARN_TEXT];
} learn_finding_t;

typedef struct {
    learn_finding_t at[LEARN_FINDINGS_MAX];
    unsigned count;
} learn_findings_t;

/// Replaces the findings by all those about `self`.
void learn_weigh(const learn_t *self, learn_findings_t *out_findings);

/// Adds a finding. Returns it, so that the caller can set its value.
__attribute__((format(printf, 5, 6))) learn_finding_t *learn_print(learn_findings_t *self, char mark, const char *item,
                                                                   unsigned side, const char *format, ...);

/// Returns the first finding about the item and side, or NULL.
const learn_finding_t *learn_find(const learn_findings_t *self, const char *item, unsigned side);

bool learn_is_empty(const learn_range_t *range);

/// Returns true if the wheel turned while a steady speed was commanded, for long enough and nearly always.
bool learn_turned(const learn_wheel_t *wheel);

/// Returns true if a steady speed was commanded for long enough and the wheel hardly ever turned.
bool learn_stayed(const learn_wheel_t *wheel);

/// Sets `*out_section` and `*out_key` and returns true if the value of the finding is a suggestion for the
/// configuration. Returns false otherwise.
bool learn_suggests(const learn_findings_t *self, const learn_finding_t *finding, const char **out_section,
                    const char **out_key);

// --- parts of learn_weigh -----------------------------------------------------------------------------------------

void learn_weigh_setpoints(const learn_t *self, learn_findings_t *out_findings); ///< learn_setpoints.c
void learn_weigh_wheels(const learn_t *self, learn_findings_t *out_findings);    ///< learn_wheels.c

#endif
