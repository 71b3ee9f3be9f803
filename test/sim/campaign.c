// SPDX-License-Identifier: MIT
#include "campaign.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#define REPLAY_EACH 25U ///< One seed of this many is played twice.
#define TOLERATED   3U  ///< Seeds that may fail before a campaign ends.

/// Removes these events. Returns true if the rule stays broken without them, otherwise restores them.
static bool can_do_without(const campaign_t *self, size_t from, size_t removed, uint32_t rule) {
    static event_t before[CAMPAIGN_EVENTS_MAX];
    const size_t count = *self->count;
    memcpy(before, self->event, count * sizeof before[0]);
    memmove(&self->event[from], &self->event[from + removed], (count - from - removed) * sizeof before[0]);
    *self->count = count - removed;
    if (self->play(IW_NEVER).rule == rule) {
        return true;
    }
    memcpy(self->event, before, count * sizeof before[0]);
    *self->count = count;
    return false;
}

/// Removes events in ever smaller pieces as long as the same rule stays broken.
static void shrink(const campaign_t *self, uint32_t rule) {
    size_t piece = *self->count;
    while (piece > 0U) {
        bool shorter = false;
        for (size_t from = 0; from < *self->count;) {
            const size_t removed = (from + piece <= *self->count) ? piece : *self->count - from;
            const bool spare = can_do_without(self, from, removed, rule);
            shorter = shorter || spare;
            from += spare ? 0U : removed;
        }
        piece = (shorter && piece == 1U) ? 1U : piece / 2U;
    }
}

void campaign_print_broken(uint64_t seed, const verdict_t *failed) {
    printf("FAILED seed %llu at %.6f s, rule %u: %s\n", (unsigned long long)seed, (double)failed->broken_us / 1e6,
           (unsigned)failed->rule, failed->text);
}

void campaign_print_failure(const campaign_t *self, uint64_t seed, const verdict_t *failed) {
    const size_t drawn = *self->count;
    campaign_print_broken(seed, failed);
    shrink(self, failed->rule);
    const verdict_t small = self->play(IW_NEVER);
    printf("made small: %zu of %zu events; rule %u at %.6f s: %s\n", *self->count, drawn, (unsigned)small.rule,
           (double)small.broken_us / 1e6, small.text);
    self->print();
    printf("the events and setpoints before the end:\n");
    (void)self->play((small.broken_us > self->trace_us) ? small.broken_us - self->trace_us : 0U);
    (void)fflush(stdout);
}

/// Returns true if the same seed leads to the same result again.
static bool replays(const campaign_t *self, uint64_t seed, uint64_t hash) {
    const bool same = self->play(IW_NEVER).hash == hash;
    if (!same) {
        printf("FAILED seed %llu: a second run differs\n", (unsigned long long)seed);
    }
    return same;
}

static bool passes(const campaign_t *self, uint64_t seed, bool quick) {
    self->draw(seed);
    const verdict_t verdict = self->play(IW_NEVER);
    self->add();
    if (verdict.rule == 0U) {
        return seed % REPLAY_EACH != 0U || replays(self, seed, verdict.hash);
    }
    if (quick) {
        campaign_print_broken(seed, &verdict);
    } else {
        campaign_print_failure(self, seed, &verdict);
    }
    return false;
}

int campaign_run(const campaign_t *self, uint64_t first, bool quick) {
    unsigned passed = 0;
    unsigned failed = 0;
    for (uint64_t seed = first; !self->enough() && failed < (quick ? 1U : TOLERATED); seed++) {
        if (passes(self, seed, quick)) {
            passed++;
        } else {
            failed++;
        }
    }
    self->print_sum();
    printf("%u passed, %u failed, 0 skipped\n", passed, failed);
    return (failed == 0U && passed > 0U) ? EXIT_SUCCESS : EXIT_FAILURE;
}
