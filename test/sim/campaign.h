// SPDX-License-Identifier: MIT
/// Scenarios drawn from seeds, played one after another: one that breaks a rule is made small and told as a timeline.
#ifndef SIM_TEST_CAMPAIGN_H
#define SIM_TEST_CAMPAIGN_H

#include "iwheel/types.h"

/// Something that happens, as drawn from a seed; what kinds there are, and what `a` and `b` mean, is each simulation's own.
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

/// What came of a play.
typedef struct {
    uint32_t rule; ///< That was broken; 0: all were kept.
    iw_time_us_t broken_us;
    const char *text;
    uint64_t hash; ///< Of all that was sent.
} verdict_t;

/// A simulation: it has one scenario at a time.
typedef struct {
    size_t *count; ///< Events of the scenario, at most CAMPAIGN_EVENTS_MAX.
    event_t *event;
    void (*draw)(uint64_t seed);
    verdict_t (*play)(iw_time_us_t trace_from_us); ///< From then on it is told on stdout; IW_NEVER: not at all.
    void (*print)(void);                           ///< The scenario, a line for each event.
    void (*add)(void);                             ///< What came of the last play to the sum of all.
    bool (*enough)(void);                          ///< So much has been played.
    void (*tell_sum)(void);
    iw_time_us_t trace_us; ///< Told of a scenario that was made small: so long before its end.
} campaign_t;

/// Tells the rule that the scenario breaks, makes it small, prints what is left of it, and what happens right before.
void campaign_tell_failure(const campaign_t *self, uint64_t seed, const verdict_t *failed);

/// One line.
void campaign_tell_broken(uint64_t seed, const verdict_t *failed);

/// Plays seeds from `first` on until it is enough or three have failed; each 25th is played twice and must do the same again. `quick`:
/// ends with the first that fails, which is not made small. Returns an exit status; the last line is "N passed, N failed, 0 skipped".
int campaign_run(const campaign_t *self, uint64_t first, bool quick);

#endif
