// SPDX-License-Identifier: MIT
#include "daemon_world.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#define US_PER_HOUR 3600000000.0
#define TRACE_US    800000U
#define EXIT_USAGE  64

static void usage(FILE *out) {
    (void)fputs(
        "usage: test_daemon [--seed N [--trace] [--events]] | [--first N] [--hours H] | --kills N [--first N]\n"
        "Plays seeds through the gateway itself, main and loop and port, on a kernel in virtual time, and judges it "
        "from "
        "outside.\n"
        "A seed that fails is made small and printed as a timeline. --seed N plays one. --kills N kills one gateway "
        "after "
        "another, N in all,\n"
        "in every phase of a drive, before or after the effect of a system call, and prints when zeros were on the "
        "bus.\n"
        "--quick ends at the first seed that fails, which is not made small. The last line is `N passed, N failed, "
        "N skipped`.\n",
        out);
}

static scenario_t scenario;
static result_t result;
static result_t sum;
static double wanted_hours;

static void draw(uint64_t seed) {
    scenario_draw(&scenario, seed);
}

static verdict_t play(iw_time_us_t trace_from_us) {
    world_play(&scenario, trace_from_us, &result);
    return (verdict_t){result.rule, result.broken_us, result.text, result.hash ^ result.calls << 32};
}

static void print(void) {
    scenario_print(&scenario, stdout);
}

static void add(void) {
    sum.simulated_us += result.simulated_us;
    sum.calls += result.calls;
    sum.failed += result.failed;
    sum.frames += result.frames;
    sum.nonzero += result.nonzero;
    sum.lives += result.lives;
    for (unsigned kind = 0; kind < EV_KINDS; kind++) {
        sum.events[kind] += result.events[kind];
    }
}

static bool enough(void) {
    return (double)sum.simulated_us / US_PER_HOUR >= wanted_hours;
}

static void print_sum(void) {
    printf("events:");
    for (unsigned kind = 0; kind < EV_KINDS; kind++) {
        printf("%s %s %u", (kind > 0U) ? "," : "", scenario_kind_name(kind), (unsigned)sum.events[kind]);
    }
    printf("\n%.2f simulated hours, %u lives of the process, %llu system calls of which %llu were made to fail, %llu "
           "setpoints of which "
           "%llu nonzero\n",
           (double)sum.simulated_us / US_PER_HOUR, (unsigned)sum.lives, (unsigned long long)sum.calls,
           (unsigned long long)sum.failed, (unsigned long long)sum.frames, (unsigned long long)sum.nonzero);
}

static const campaign_t campaign = {&scenario.count, scenario.event, draw,    play, print, add,
                                    enough,          print_sum,      TRACE_US};

static int play_one(uint64_t seed, bool trace, bool events) {
    draw(seed);
    if (events) {
        print();
    }
    const verdict_t verdict = play(trace ? 0U : IW_NEVER);
    const bool good = verdict.rule == 0U;
    if (!good) {
        campaign_print_failure(&campaign, seed, &verdict);
    }
    printf("seed %llu hash %016llx, %.1f s, %llu calls of which %llu failed, %u lives\n", (unsigned long long)seed,
           (unsigned long long)result.hash, (double)result.simulated_us / 1e6, (unsigned long long)result.calls,
           (unsigned long long)result.failed, (unsigned)result.lives);
    printf("%d passed, %d failed, 0 skipped\n", good, !good);
    return good ? EXIT_SUCCESS : EXIT_FAILURE;
}

static void print_kills(void) {
    printf("| killed at | kills | nonzero in force | zeros after the start, worst | after the kill, worst "
           "|\n|---|---:|---:|---:|---:|\n");
    for (unsigned phase = 0; phase < AT_PHASES; phase++) {
        const phase_stats_t *stats = &result.phase[phase];
        printf("| %s | %u | %u |", world_phase_name(phase), (unsigned)stats->kills, (unsigned)stats->moving);
        if (stats->moving == 0U) {
            printf(" -- | -- |\n");
        } else {
            printf(" %.1f ms | %.1f ms |\n", (double)stats->worst_us / 1e3, (double)stats->between_us / 1e3);
        }
    }
}

/// Prints the figures of docs/developer/verification.md.
static int kill_many(uint64_t seed, uint32_t lives) {
    scenario_kills(&scenario, seed, lives);
    const verdict_t verdict = play(IW_NEVER);
    print_kills();
    const bool good = verdict.rule == 0U;
    if (!good) {
        campaign_print_broken(seed, &verdict);
        (void)play((verdict.broken_us > TRACE_US) ? verdict.broken_us - TRACE_US : 0U);
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

/// Returns the number of words that were understood; 0: none.
static int parse(options_t *options, const char *word, const char *value) {
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
    stderr = (nowhere != NULL) ? nowhere
                               : stderr; // Without this, the gateway would print hundreds of reasons for failed starts.
    for (int i = 1; i < argc;) {
        if (strcmp(argv[i], "--help") == 0) {
            usage(stdout);
            return EXIT_SUCCESS;
        }
        const int used = parse(&options, argv[i], (i + 1 < argc) ? argv[i + 1] : NULL);
        if (used == 0) {
            usage(stdout);
            return EXIT_USAGE;
        }
        i += used;
    }
    if (options.one) {
        return play_one(options.seed, options.trace, options.events);
    }
    wanted_hours = options.hours;
    const int status =
        (options.kills == 0U || options.quick) ? campaign_run(&campaign, options.first, options.quick) : EXIT_SUCCESS;
    return (status == EXIT_SUCCESS && options.kills > 0U) ? kill_many(options.first, (uint32_t)options.kills) : status;
}
