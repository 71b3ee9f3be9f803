// SPDX-License-Identifier: MIT
#include "world.h"

#include <stdlib.h>
#include <string.h>

#define US_PER_HOUR 3600000000.0
#define TRACE_US    800000U
#define EXIT_USAGE  64
#define REPLAY_EACH 25U ///< Every so manieth seed is played twice.
#define TOLERATED   3U  ///< Seeds that may fail before a campaign ends.

static void usage(FILE *out) {
    (void)fputs(
        "usage: test_daemon [--seed N [--trace] [--events]] | [--first N] [--hours H] | --kills N [--first N]\n"
        "Plays seeds through the gateway itself, main and loop and port, on a kernel in virtual time, and judges what "
        "it "
        "does from outside.\n"
        "A seed that fails is made small and told as a timeline. --seed N plays one. --kills N kills one gateway after "
        "another, N in all,\n"
        "in every phase of a drive, before or after the effect of a system call, and tells when zeros were on the "
        "bus.\n"
        "--quick ends at the first seed that fails, which is not made small. The last line is `N passed, N failed, "
        "N skipped`.\n",
        out);
}

/// Leaves out events, in ever smaller pieces, as long as the same rule stays broken.
static void shrink(scenario_t *scenario, uint32_t rule) {
    static scenario_t trial;
    static result_t result;
    size_t piece = scenario->count;
    while (piece > 0U) {
        bool shorter = false;
        for (size_t from = 0; from < scenario->count;) {
            const size_t taken = (from + piece <= scenario->count) ? piece : scenario->count - from;
            trial = *scenario;
            memmove(&trial.event[from], &trial.event[from + taken],
                    (trial.count - from - taken) * sizeof trial.event[0]);
            trial.count -= taken;
            world_play(&trial, IW_NEVER, &result);
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

static void tell_broken(const scenario_t *scenario, const result_t *failed) {
    printf("FAILED seed %llu at %.6f s, rule %u: %s\n", (unsigned long long)scenario->seed,
           (double)failed->broken_us / 1e6, (unsigned)failed->rule, failed->text);
}

static void tell_failure(scenario_t *scenario, const result_t *failed) {
    static result_t result;
    const size_t drawn = scenario->count;
    tell_broken(scenario, failed);
    shrink(scenario, failed->rule);
    world_play(scenario, IW_NEVER, &result);
    printf("made small: %zu of %zu events; rule %u at %.6f s: %s\n", scenario->count, drawn, (unsigned)result.rule,
           (double)result.broken_us / 1e6, result.text);
    scenario_print(scenario, stdout);
    printf("what happened right before:\n");
    world_play(scenario, (result.broken_us > TRACE_US) ? result.broken_us - TRACE_US : 0U, &result);
    (void)fflush(stdout);
}

static int play_one(uint64_t seed, bool trace, bool events) {
    static scenario_t scenario;
    static result_t result;
    scenario_draw(&scenario, seed);
    if (events) {
        scenario_print(&scenario, stdout);
    }
    world_play(&scenario, trace ? 0U : IW_NEVER, &result);
    if (result.rule != 0U) {
        tell_failure(&scenario, &result);
    }
    printf("seed %llu hash %016llx, %.1f s, %llu calls of which %llu failed, %u lives\n", (unsigned long long)seed,
           (unsigned long long)result.hash, (double)result.simulated_us / 1e6, (unsigned long long)result.calls,
           (unsigned long long)result.failed, (unsigned)result.lives);
    printf("%d passed, %d failed, 0 skipped\n", result.rule == 0U, result.rule != 0U);
    return (result.rule == 0U) ? EXIT_SUCCESS : EXIT_FAILURE;
}

static void add(result_t *sum, const result_t *one) {
    sum->simulated_us += one->simulated_us;
    sum->calls += one->calls;
    sum->failed += one->failed;
    sum->frames += one->frames;
    sum->nonzero += one->nonzero;
    sum->lives += one->lives;
    for (unsigned kind = 0; kind < EV_KINDS; kind++) {
        sum->events[kind] += one->events[kind];
    }
}

static void tell_sum(const result_t *sum) {
    printf("events:");
    for (unsigned kind = 0; kind < EV_KINDS; kind++) {
        printf("%s %s %u", (kind > 0U) ? "," : "", scenario_kind_name(kind), (unsigned)sum->events[kind]);
    }
    printf("\n%.2f simulated hours, %u lives of the process, %llu system calls of which %llu were made to fail, %llu "
           "setpoints of which "
           "%llu nonzero\n",
           (double)sum->simulated_us / US_PER_HOUR, (unsigned)sum->lives, (unsigned long long)sum->calls,
           (unsigned long long)sum->failed, (unsigned long long)sum->frames, (unsigned long long)sum->nonzero);
}

/// The same seed must do the same again.
static bool replays(const scenario_t *scenario, const result_t *result) {
    static result_t again;
    world_play(scenario, IW_NEVER, &again);
    if (again.hash != result->hash || again.calls != result->calls) {
        printf("FAILED seed %llu: played again it does something else\n", (unsigned long long)scenario->seed);
        return false;
    }
    return true;
}

static int play_many(uint64_t first, double hours, bool quick) {
    static scenario_t scenario;
    static result_t result;
    static result_t sum;
    unsigned passed = 0;
    unsigned failed = 0;
    for (uint64_t seed = first; (double)sum.simulated_us / US_PER_HOUR < hours && failed < (quick ? 1U : TOLERATED);
         seed++) {
        scenario_draw(&scenario, seed);
        world_play(&scenario, IW_NEVER, &result);
        add(&sum, &result);
        bool good = result.rule == 0U;
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
    tell_sum(&sum);
    printf("%u passed, %u failed, 0 skipped\n", passed, failed);
    return (failed == 0U && passed > 0U) ? EXIT_SUCCESS : EXIT_FAILURE;
}

static void tell_kills(const result_t *result) {
    printf("| killed at | kills | nonzero in force | zeros after the start, worst | after the kill, worst "
           "|\n|---|---:|---:|---:|---:|\n");
    for (unsigned phase = 0; phase < AT_PHASES; phase++) {
        const phase_stats_t *stats = &result->phase[phase];
        printf("| %s | %u | %u |", world_phase_name(phase), (unsigned)stats->kills, (unsigned)stats->moving);
        if (stats->moving == 0U) {
            printf(" -- | -- |\n");
        } else {
            printf(" %.1f ms | %.1f ms |\n", (double)stats->worst_us / 1e3, (double)stats->between_us / 1e3);
        }
    }
}

/// The table of docs/simulated-hours.md.
static int kill_many(uint64_t seed, uint32_t lives) {
    static scenario_t scenario;
    static result_t result;
    scenario_kills(&scenario, seed, lives);
    world_play(&scenario, IW_NEVER, &result);
    tell_kills(&result);
    const bool good = result.rule == 0U;
    if (!good) {
        const iw_time_us_t from_us = (result.broken_us > TRACE_US) ? result.broken_us - TRACE_US : 0U;
        tell_broken(&scenario, &result);
        world_play(&scenario, from_us, &result);
    }
    printf("%u passed, %d failed, 0 skipped\n", good ? (unsigned)lives : 0U, !good);
    return good ? EXIT_SUCCESS : EXIT_FAILURE;
}

typedef struct {
    uint64_t seed;
    uint64_t first;
    uint64_t kills;
    double hours;
    bool one;
    bool trace;
    bool events;
    bool quick;
} options_t;

/// How many words were understood; 0: none.
static int take(options_t *options, const char *word, const char *value) {
    const struct {
        const char *name;
        bool *value;
    } switches[] = {{"--trace", &options->trace}, {"--events", &options->events}, {"--quick", &options->quick}};
    for (size_t i = 0; i < sizeof switches / sizeof switches[0]; i++) {
        if (strcmp(word, switches[i].name) == 0) {
            *switches[i].value = true;
            return 1;
        }
    }
    if (value == NULL) {
        return 0;
    }
    if (strcmp(word, "--hours") == 0) {
        options->hours = strtod(value, NULL);
    } else if (strcmp(word, "--seed") == 0) {
        options->one = true;
        options->seed = strtoull(value, NULL, 10);
    } else if (strcmp(word, "--first") == 0) {
        options->first = strtoull(value, NULL, 10);
    } else if (strcmp(word, "--kills") == 0) {
        options->kills = strtoull(value, NULL, 10);
    } else {
        return 0;
    }
    return 2;
}

int main(int argc, char **argv) {
    options_t options = {.first = 1, .hours = 1.0};
    (void)setenv("NOTIFY_SOCKET", "/run/notify", 1);
    (void)setenv("WATCHDOG_USEC", "1000000", 1);
    (void)unsetenv("WATCHDOG_PID");
    FILE *nowhere = fopen("/dev/null", "w");
    stderr = (nowhere != NULL) ? nowhere : stderr; // Why a start failed is the gateway's to say, hundreds of times.
    for (int i = 1; i < argc;) {
        if (strcmp(argv[i], "--help") == 0) {
            usage(stdout);
            return EXIT_SUCCESS;
        }
        const int taken = take(&options, argv[i], (i + 1 < argc) ? argv[i + 1] : NULL);
        if (taken == 0) {
            usage(stdout);
            return EXIT_USAGE;
        }
        i += taken;
    }
    if (options.one) {
        return play_one(options.seed, options.trace, options.events);
    }
    const int result =
        (options.kills == 0U || options.quick) ? play_many(options.first, options.hours, options.quick) : EXIT_SUCCESS;
    return (result == EXIT_SUCCESS && options.kills > 0U) ? kill_many(options.first, (uint32_t)options.kills) : result;
}
