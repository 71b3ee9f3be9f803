// SPDX-License-Identifier: MIT
#include "directed.h"
#include "rig.h"

#include <stdlib.h>
#include <string.h>
#include <time.h>

#define US_PER_HOUR 3600000000.0
#define TRACE_US    400000U
#define EXIT_USAGE  64
#define REPLAY_EACH 25U ///< Every so manieth seed is played twice.

static void usage(FILE *out) {
    fputs("usage: test_sim [--seed N [--trace] [--events]] | [--first N] [--count N | --hours H | --hashes] | "
          "--directed\n"
          "Plays seeds through the real core in virtual time and judges each by the rules of motion permission.\n"
          "A seed that fails is made small and told as a timeline. --seed N plays one, and tells the hash of all that "
          "was sent.\n"
          "--hashes plays --count seeds and tells only their hashes, for comparison between machines. --directed plays "
          "a\n"
          "node that babbles with lower and with higher ids. --quick ends at the first seed that fails, which is not "
          "made small.\n"
          "The line `summary ...` adds up what happened; the last line is `N passed, N failed, N skipped`.\n",
          out);
}

/// Leaves out events, in ever smaller pieces, as long as the same rule stays broken.
static void shrink(scenario_t *scenario, uint32_t rule) {
    static scenario_t trial;
    static rig_result_t result;
    size_t piece = scenario->count;
    while (piece > 0U) {
        bool shorter = false;
        for (size_t from = 0; from < scenario->count;) {
            const size_t taken = (from + piece <= scenario->count) ? piece : scenario->count - from;
            trial = *scenario;
            memmove(&trial.event[from], &trial.event[from + taken],
                    (trial.count - from - taken) * sizeof trial.event[0]);
            trial.count -= taken;
            rig_play(&trial, IW_NEVER, &result);
            if (result.rule == rule) {
                *scenario = trial;
                shorter = true;
            } else {
                from += taken;
            }
        }
        piece = (shorter && piece == 1U) ? 1U : piece / 2U;
    }
}

static void tell_broken(const scenario_t *scenario, const rig_result_t *failed) {
    printf("FAILED seed %llu at %.6f s, rule %u: %s\n", (unsigned long long)scenario->seed,
           (double)failed->broken_us / 1e6, failed->rule, failed->text);
}

static void tell_failure(scenario_t *scenario, const rig_result_t *failed) {
    static rig_result_t result;
    const size_t drawn = scenario->count;
    tell_broken(scenario, failed);
    shrink(scenario, failed->rule);
    rig_play(scenario, IW_NEVER, &result);
    printf("made small: %zu of %zu events; rule %u at %.6f s: %s\n", scenario->count, drawn, result.rule,
           (double)result.broken_us / 1e6, result.text);
    scenario_print(scenario, stdout);
    printf("what happened right before:\n");
    rig_play(scenario, (result.broken_us > TRACE_US) ? result.broken_us - TRACE_US : 0U, &result);
    fflush(stdout);
}

static void tell_stats(const rig_stats_t *sum) {
    printf("summary hours %.2f steps %llu frames %llu nonzero %llu requests %llu armed %llu drives %llu\n",
           (double)sum->simulated_us / US_PER_HOUR, (unsigned long long)sum->steps, (unsigned long long)sum->frames,
           (unsigned long long)sum->nonzero, (unsigned long long)sum->requests, (unsigned long long)sum->armed,
           (unsigned long long)sum->drives);
    for (unsigned kind = 0; kind < EV_KINDS; kind++) {
        printf("event %llu %s\n", (unsigned long long)sum->events[kind], scenario_kind_name(kind));
    }
    for (unsigned cause = 1; cause < IW_CAUSES; cause++) {
        printf("stop %llu %s\n", (unsigned long long)sum->stops[cause], rig_cause_name(cause));
    }
    for (unsigned refusal = 1; refusal < RIG_REFUSALS; refusal++) {
        printf("refused %llu %s\n", (unsigned long long)sum->refused[refusal], rig_refusal_name(refusal));
    }
}

static int play_one(uint64_t seed, bool trace, bool events) {
    static scenario_t scenario;
    static rig_result_t result;
    scenario_draw(&scenario, seed);
    if (events) {
        scenario_print(&scenario, stdout);
    }
    rig_play(&scenario, trace ? 0U : IW_NEVER, &result);
    if (result.rule != ORACLE_NO_RULE) {
        tell_failure(&scenario, &result);
    }
    printf("seed %llu hash %016llx\n", (unsigned long long)seed, (unsigned long long)result.hash);
    printf("%d passed, %d failed, 0 skipped\n", result.rule == ORACLE_NO_RULE, result.rule != ORACLE_NO_RULE);
    return (result.rule == ORACLE_NO_RULE) ? EXIT_SUCCESS : EXIT_FAILURE;
}

static int tell_hashes(uint64_t first, uint64_t count) {
    static scenario_t scenario;
    static rig_result_t result;
    for (uint64_t seed = first; seed < first + count; seed++) {
        scenario_draw(&scenario, seed);
        rig_play(&scenario, IW_NEVER, &result);
        printf("seed %llu hash %016llx\n", (unsigned long long)seed, (unsigned long long)result.hash);
    }
    return EXIT_SUCCESS;
}

/// The same seed must give the same bytes again.
static bool replays(const scenario_t *scenario, const rig_result_t *result) {
    static rig_result_t again;
    rig_play(scenario, IW_NEVER, &again);
    if (again.hash != result->hash) {
        printf("FAILED seed %llu: played again it sends other bytes\n", (unsigned long long)scenario->seed);
    }
    return again.hash == result->hash;
}

/// Until the hours or the count are full, or some seeds have failed; `quick`: until the first, which is not made small.
static int play_many(uint64_t first, uint64_t count, double hours, bool quick) {
    const unsigned tolerate = quick ? 1U : 3U;
    static scenario_t scenario;
    static rig_result_t result;
    static rig_stats_t sum;
    unsigned passed = 0;
    unsigned failed = 0;
    for (uint64_t seed = first; seed < first + count && failed < tolerate; seed++) {
        if (hours > 0.0 && (double)sum.simulated_us / US_PER_HOUR >= hours) {
            break;
        }
        scenario_draw(&scenario, seed);
        rig_play(&scenario, IW_NEVER, &result);
        rig_stats_add(&sum, &result.stats);
        bool good = result.rule == ORACLE_NO_RULE;
        if (!good && quick) {
            tell_broken(&scenario, &result);
        } else if (!good) {
            tell_failure(&scenario, &result);
        } else if (seed % REPLAY_EACH == 0U) {
            good = replays(&scenario, &result);
        }
        passed += good ? 1U : 0U;
        failed += good ? 0U : 1U;
    }
    tell_stats(&sum);
    printf("%u passed, %u failed, 0 skipped\n", passed, failed);
    return (failed == 0U && passed > 0U) ? EXIT_SUCCESS : EXIT_FAILURE;
}

#define MANY (UINT64_MAX / 2U)

typedef struct {
    uint64_t seed;
    uint64_t first;
    uint64_t count;
    double hours;
    bool one;
    bool trace;
    bool events;
    bool hashes;
    bool directed;
    bool quick;
} options_t;

/// True if the word is a switch without a value.
static bool take_switch(options_t *options, const char *word) {
    const struct {
        const char *name;
        bool *value;
    } switches[] = {{"--trace", &options->trace},
                    {"--events", &options->events},
                    {"--hashes", &options->hashes},
                    {"--directed", &options->directed},
                    {"--quick", &options->quick}};
    for (size_t i = 0; i < sizeof switches / sizeof switches[0]; i++) {
        if (strcmp(word, switches[i].name) == 0) {
            *switches[i].value = true;
            return true;
        }
    }
    return false;
}

static int play(const options_t *options) {
    if (options->directed) {
        return directed_play();
    }
    if (options->one) {
        return play_one(options->seed, options->trace, options->events);
    }
    if (options->hashes) {
        return tell_hashes(options->first, (options->count == MANY) ? 10U : options->count);
    }
    const bool bounded = options->hours > 0.0 || options->count != MANY;
    return play_many(options->first, options->count, bounded ? options->hours : 1.0, options->quick);
}

int main(int argc, char **argv) {
    options_t options = {.first = 1, .count = MANY};
    for (int i = 1; i < argc; i++) {
        const char *const value = (i + 1 < argc) ? argv[i + 1] : NULL;
        if (take_switch(&options, argv[i])) {
            continue;
        }
        if (strcmp(argv[i], "--help") == 0) {
            usage(stdout);
            return EXIT_SUCCESS;
        } else if (value == NULL) {
            usage(stderr);
            return EXIT_USAGE;
        } else if (strcmp(argv[i], "--seed") == 0) {
            options.one = true;
            options.seed = strtoull(argv[++i], NULL, 10);
        } else if (strcmp(argv[i], "--first") == 0) {
            options.first = strtoull(argv[++i], NULL, 10);
        } else if (strcmp(argv[i], "--count") == 0) {
            options.count = strtoull(argv[++i], NULL, 10);
        } else if (strcmp(argv[i], "--hours") == 0) {
            options.hours = strtod(argv[++i], NULL);
        } else {
            usage(stderr);
            return EXIT_USAGE;
        }
    }
    return play(&options);
}
