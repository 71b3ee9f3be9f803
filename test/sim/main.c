// SPDX-License-Identifier: MIT
#include "directed.h"
#include "rig.h"

#include <stdlib.h>
#include <string.h>

#define US_PER_HOUR 3600000000.0
#define TRACE_US    400000U
#define EXIT_USAGE  64

static void usage(FILE *out) {
    fputs("usage: test_sim [--seed N [--trace] [--events]] | [--first N] [--count N | --hours H | --hashes] | "
          "--directed\n"
          "Simulates seeds with the real core in virtual time and judges each by the rules of motion permission.\n"
          "A seed that fails is reduced to its shortest form and printed as a timeline.\n"
          "--seed N simulates one seed and prints the hash of everything that was sent; --trace prints its timeline, "
          "--events its events.\n"
          "--hashes simulates --count seeds and prints only their hashes, to compare machines.\n"
          "--directed simulates a node that babbles with lower and with higher ids.\n"
          "--quick ends at the first seed that fails, without reducing it.\n"
          "The line `summary ...` sums up the run; the last line is `N passed, N failed, N skipped`.\n",
          out);
}

static scenario_t scenario;
static rig_result_t result;
static rig_stats_t sum;
static double wanted_hours; ///< 0: no limit but the number of seeds.
static uint64_t seeds_left;

static void draw(uint64_t seed) {
    scenario_draw(&scenario, seed);
}

static verdict_t play(iw_time_us_t trace_from_us) {
    rig_play(&scenario, trace_from_us, &result);
    return (verdict_t){result.rule, result.broken_us, result.text, result.hash};
}

static void print(void) {
    scenario_print(&scenario, stdout);
}

static void add(void) {
    rig_stats_add(&sum, &result.stats);
    seeds_left--;
}

static bool enough(void) {
    return seeds_left == 0U || (wanted_hours > 0.0 && (double)sum.simulated_us / US_PER_HOUR >= wanted_hours);
}

static void print_sum(void) {
    printf("summary hours %.2f steps %llu frames %llu nonzero %llu requests %llu armed %llu drives %llu\n",
           (double)sum.simulated_us / US_PER_HOUR, (unsigned long long)sum.steps, (unsigned long long)sum.frames,
           (unsigned long long)sum.nonzero, (unsigned long long)sum.requests, (unsigned long long)sum.armed,
           (unsigned long long)sum.drives);
    for (unsigned kind = 0; kind < EV_KINDS; kind++) {
        printf("event %llu %s\n", (unsigned long long)sum.events[kind], scenario_kind_name(kind));
    }
    for (unsigned cause = 1; cause < IW_CAUSES; cause++) {
        printf("stop %llu %s\n", (unsigned long long)sum.stops[cause], rig_cause_name(cause));
    }
    for (unsigned refusal = 1; refusal < RIG_REFUSALS; refusal++) {
        printf("refused %llu %s\n", (unsigned long long)sum.refused[refusal], rig_refusal_name(refusal));
    }
}

static const campaign_t campaign = {&scenario.count, scenario.event, draw,    play, print, add,
                                    enough,          print_sum,      TRACE_US};

static int play_one(uint64_t seed, bool trace, bool events) {
    draw(seed);
    if (events) {
        print();
    }
    const verdict_t verdict = play(trace ? 0U : IW_NEVER);
    const bool good = verdict.rule == ORACLE_NO_RULE;
    if (!good) {
        campaign_print_failure(&campaign, seed, &verdict);
    }
    printf("seed %llu hash %016llx\n", (unsigned long long)seed, (unsigned long long)verdict.hash);
    printf("%d passed, %d failed, 0 skipped\n", good, !good);
    return good ? EXIT_SUCCESS : EXIT_FAILURE;
}

static int print_hashes(uint64_t first, uint64_t count) {
    for (uint64_t seed = first; seed < first + count; seed++) {
        draw(seed);
        printf("seed %llu hash %016llx\n", (unsigned long long)seed, (unsigned long long)play(IW_NEVER).hash);
    }
    return EXIT_SUCCESS;
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

/// Returns true if the word is a switch without a value.
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

static int carry_out(const options_t *options) {
    if (options->directed) {
        return directed_play();
    }
    if (options->one) {
        return play_one(options->seed, options->trace, options->events);
    }
    if (options->hashes) {
        return print_hashes(options->first, (options->count == MANY) ? 10U : options->count);
    }
    const bool bounded = options->hours > 0.0 || options->count != MANY;
    wanted_hours = bounded ? options->hours : 1.0;
    seeds_left = options->count;
    return campaign_run(&campaign, options->first, options->quick);
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
    return carry_out(&options);
}
