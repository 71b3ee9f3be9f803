// SPDX-License-Identifier: MIT
/// Scenarios drawn from seeds, played one after another. A scenario that breaks a rule is made small and printed as a timeline.
#ifndef SIM_TEST_CAMPAIGN_H
#define SIM_TEST_CAMPAIGN_H

#include "iwheel/types.h"

/// An event drawn from a seed. Each simulation defines its own kinds and the meaning of `a` and `b`.
typedef struct {
    iw_time_us_t at_us;
    uint32_t span_us;
    int32_t a;
    int32_t b;
    uint8_t kind;
    uint8_t who;
    uint8_t style;
} event_t;

#define CAMPAIGN_EVENTS_MAX 512U

/// The result of one run.
typedef struct {
    uint32_t rule; ///< The broken rule; 0: none.
    iw_time_us_t broken_us;
    const char *text;
    uint64_t hash; ///< Hash of all that was sent.
} verdict_t;

/// A simulation: it has one scenario at a time.
typedef struct {
    size_t *count; ///< Events of the scenario, at most CAMPAIGN_EVENTS_MAX.
    event_t *event;
    void (*draw)(uint64_t seed);
    verdict_t (*play)(iw_time_us_t trace_from_us); ///< Prints a timeline from that time on; IW_NEVER: none.
    void (*print)(void);                           ///< Prints the scenario, a line for each event.
    void (*add)(void);                             ///< Adds the result of the last run to the sum of all.
    bool (*enough)(void);                          ///< True if enough has been played.
    void (*print_sum)(void);
    iw_time_us_t trace_us; ///< Length of the timeline of a small scenario, before its end.
} campaign_t;

/// Prints the rule that the scenario breaks, makes the scenario small, and prints it with the timeline before its end.
void campaign_print_failure(const campaign_t *self, uint64_t seed, const verdict_t *failed);

/// Prints the broken rule in one line.
void campaign_print_broken(uint64_t seed, const verdict_t *failed);

/// Plays seeds from `first` on until it is enough or three have failed; each 25th is played twice and must have the same result. `quick`:
/// ends at the first seed that fails and does not make it small. Returns an exit status; the last line is "N passed, N failed, 0 skipped".
int campaign_run(const campaign_t *self, uint64_t first, bool quick);

#endif
