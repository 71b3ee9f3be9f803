// SPDX-License-Identifier: MIT
// How close does an ordinary machine come to pair_mm? Drives for hours within the ranges of an ordinary machine; nothing may stop it.
#include "faults.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#define EXIT_USAGE   64
#define US_PER_HOUR  3600000000.0
#define DRIVES       40U
#define PERMILLE_TOP 1000

typedef struct {
    double hours;
    uint64_t first;
    uint16_t pair_mm;
    bool faults;
} options_t;

static machine_t machine;

/// The results of all machines.
static struct {
    double hours;
    uint64_t machines;
    uint64_t drives;
    uint64_t kerbs;
    uint64_t stops;
    int32_t largest_um;
    uint64_t largest_seed;
} sum;

static int32_t any_speed(sim_random_t *random) {
    static const int32_t favourites[] = {0, 1000, -1000, 500, -500, 99};
    const uint32_t kind = sim_random_below(random, 12U);
    return (kind < 6U) ? favourites[kind] : (int32_t)sim_random_below(random, 2001U) - 1000;
}

/// Straight, in a curve, on the spot, or to a stop.
static void any_command(sim_random_t *random) {
    const int32_t left_mm_s = any_speed(random);
    const uint32_t kind = sim_random_below(random, 5U);
    if (kind == 0U) {
        machine_command(&machine, left_mm_s, left_mm_s);
    } else if (kind == 1U) {
        machine_command(&machine, left_mm_s, -left_mm_s);
    } else if (kind == 2U) {
        machine_command(&machine, 0, 0);
    } else {
        machine_command(&machine, left_mm_s, any_speed(random));
    }
}

static void print_stop(uint64_t seed) {
    const iw_stop_t *const stop = &machine.gateway.permit.stop;
    printf("FAILED seed %llu: a false stop, cause %u, sides %u, %u, at %d %d mm/s\n", (unsigned long long)seed,
           stop->cause, stop->sides, stop->detail, stop->applied.wheel[IW_LEFT].speed_mm_s,
           stop->applied.wheel[IW_RIGHT].speed_mm_s);
    sum.stops++;
}

static void note_largest(uint64_t seed) {
    const int32_t largest_um = machine.gateway.diverge.largest_um;
    if (largest_um > sum.largest_um) {
        sum.largest_um = largest_um;
        sum.largest_seed = seed;
    }
}

/// Removes the slope: nothing holds an undriven wheel on it, so the wheel would roll away before it can be armed.
static void level(void) {
    for (size_t side = 0; side < IW_SIDES; side++) {
        sim_motion_advance(&machine.pair.wheel[side].motion, machine.now_us);
        machine.pair.wheel[side].motion.slope_mm_s2 = 0;
    }
}

static void maybe_kerb(sim_random_t *random) {
    const bool apart = machine.now_us - machine.even_us >= SIM_RANGE_KERB_APART_US;
    if (machine.kerb_us == IW_NEVER && apart && sim_random_below(random, 3U) != 0U) {
        machine.kerb_us = sim_ranges_kerb(&machine.pair, machine.now_us, random);
        sum.kerbs++;
    }
}

/// One drive: some commands for a while each, with kerbs in between; then the client loses its lease. Returns false if something stopped it.
static bool drive_once(uint64_t seed, sim_random_t *random) {
    const uint32_t commands = 3U + sim_random_below(random, 10U);
    level();
    if (!machine_arm(&machine)) {
        printf("FAILED seed %llu: it cannot be armed\n", (unsigned long long)seed);
        return false;
    }
    sim_ranges_road(&machine.pair, machine.now_us, random);
    for (uint32_t i = 0; i < commands; i++) {
        any_command(random);
        machine_run(&machine, 100U + sim_random_below(random, 3000U));
        maybe_kerb(random);
        machine_run(&machine, 500U);
        note_largest(seed);
        if (iw_gateway_state(&machine.gateway) != IW_STATE_ARMED) {
            print_stop(seed);
            return false;
        }
    }
    machine.drive_us = IW_NEVER; // The client has gone and its lease ends: the pair rule must not stop the ramp either.
    machine_run(&machine, 1500U);
    note_largest(seed);
    sum.drives++;
    return true;
}

static bool drive_machine(uint64_t seed, uint16_t pair_mm) {
    sim_pair_config_t pair;
    iw_config_t config;
    sim_random_t random;
    sim_random_init(&random, seed);
    sim_pair_default(&pair);
    sim_ranges_machine(&pair, &random);
    machine_config(&config, pair_mm);
    machine_init(&machine, &pair, &config, seed);
    const iw_time_us_t from_us = machine.now_us;
    bool good = true;
    for (uint32_t i = 0; i < DRIVES && good; i++) {
        good = drive_once(seed, &random);
    }
    sum.hours += (double)(machine.now_us - from_us) / US_PER_HOUR;
    sum.machines++;
    return good;
}

static int drive_ranges(const options_t *options) {
    uint64_t failed = 0;
    for (uint64_t seed = options->first; sum.hours < options->hours && failed < 3U; seed++) {
        failed += drive_machine(seed, options->pair_mm) ? 0U : 1U;
    }
    iw_config_t config;
    machine_config(&config, options->pair_mm);
    printf("%.1f simulated hours, %llu machines, %llu drives, %llu kerbs, %llu false stops; largest deviation %.1f of "
           "%u mm (seed %llu)\n",
           sum.hours, (unsigned long long)sum.machines, (unsigned long long)sum.drives, (unsigned long long)sum.kerbs,
           (unsigned long long)sum.stops, (double)sum.largest_um / 1000.0, config.pair_mm,
           (unsigned long long)sum.largest_seed);
    printf("%u passed, %u failed, 0 skipped\n", failed == 0U, failed != 0U);
    return (failed == 0U) ? EXIT_SUCCESS : EXIT_FAILURE;
}

static void usage(FILE *out) {
    fputs("usage: test_pair [--hours H] [--first SEED] [--pair-mm N] | --faults [--pair-mm N]\n"
          "Drives different machines within the ranges of an ordinary machine (test/support/sim_ranges.h) for H\n"
          "simulated hours (1); nothing may stop them. Prints the largest deviation. --faults: prints the angle of\n"
          "each fault of one wheel as a table, and checks its limit.\n"
          "The last line is `N passed, N failed, N skipped`.\n",
          out);
}

int main(int argc, char **argv) {
    options_t options = {.hours = 1.0, .first = 1};
    for (int i = 1; i < argc; i++) {
        const char *const value = (i + 1 < argc) ? argv[i + 1] : NULL;
        if (strcmp(argv[i], "--faults") == 0) {
            options.faults = true;
        } else if (strcmp(argv[i], "--help") == 0) {
            usage(stdout);
            return EXIT_SUCCESS;
        } else if (value != NULL && strcmp(argv[i], "--hours") == 0) {
            options.hours = strtod(argv[++i], NULL);
        } else if (value != NULL && strcmp(argv[i], "--first") == 0) {
            options.first = strtoull(argv[++i], NULL, 10);
        } else if (value != NULL && strcmp(argv[i], "--pair-mm") == 0) {
            options.pair_mm = (uint16_t)strtoul(argv[++i], NULL, 10);
        } else {
            usage(stderr);
            return EXIT_USAGE;
        }
    }
    return options.faults ? faults_play(options.pair_mm) : drive_ranges(&options);
}
