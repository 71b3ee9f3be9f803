// SPDX-License-Identifier: MIT
#include "orders_world.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#define MS         1000U
#define LENGTH     6U
#define EXIT_USAGE 64
/// Time for which the consequences of the last letter are judged.
#define TAIL_US (250U * MS)
/// Time between two letters: one of `uniform`, or by number a mix of spacings that differs in every sequence.
#define UNIFORM 6U
static const uint32_t uniform_us[UNIFORM] = {0, 300, 3 * MS, 60 * MS, 260 * MS, 900 * MS};
static const uint32_t mixed_us[] = {0,        90,       1 * MS,   9 * MS,    47 * MS,  130 * MS,
                                    210 * MS, 520 * MS, 730 * MS, 1010 * MS, 1700 * MS};
#define MIXED (sizeof mixed_us / sizeof mixed_us[0])

typedef enum { START_REST = 0, START_DRIVING, STARTS } start_t;
#define COMBINATIONS ((unsigned)STARTS * (unsigned)MODES)

/// One complete enumeration.
typedef struct {
    start_t start;
    world_mode_t mode;
    unsigned
        spacing; ///< Below UNIFORM: that spacing. From UNIFORM on: mixed; in every third of these, drives come late.
    unsigned length;
} combination_t;

static bool is_late(const combination_t *combination) {
    return combination->spacing >= UNIFORM && (combination->spacing - UNIFORM) % 3U == 2U;
}

static const char *const start_names[STARTS] = {"rest", "driving"};
static const char *const mode_names[MODES] = {"once", "stream", "blind"};

static void usage(FILE *out) {
    fputs(
        "usage: test_orders [--full] [--length N] [--part I/N]\n"
        "       test_orders --sequence rest|driving once|stream|blind SPACING LETTER,LETTER,...\n"
        "Plays every sequence of press, release, reset, arm, command, kill, restart and bus (down or up), with "
        "several\n"
        "spacings, from wheels at standstill and from driving wheels, with after_stop = hold and without, with drives "
        "that come "
        "immediately or have waited, and judges\n"
        "each by the rules of motion permission.\n"
        "--length: of the sequences, default 6; --part 0/2 and 1/2 are the halves; --full: more spacings.\n"
        "--sequence plays one and prints its events; SPACING is the number printed with a failure. A failing sequence "
        "is\n"
        "made small first. The last line is `N passed, N failed, N skipped`.\n",
        out);
}

static uint32_t hash(uint32_t value) {
    value = (value ^ (value >> 16)) * 0x45D9F3BU;
    value = (value ^ (value >> 16)) * 0x45D9F3BU;
    return value ^ (value >> 16);
}

/// Returns the time from this letter to the next one.
static uint32_t spacing_us(const combination_t *combination, const uint8_t *letters, unsigned count) {
    uint32_t seed = combination->spacing;
    if (combination->spacing < UNIFORM) {
        return uniform_us[combination->spacing];
    }
    for (unsigned i = 0; i < count; i++) {
        seed = hash(seed * STEP_KINDS + letters[i] + 1U);
    }
    return mixed_us[seed % MIXED];
}

/// Begins with wheels known to be at standstill, or with wheels driven by a client that continues according to its mode.
static void begin(world_t *world, const combination_t *combination, world_stats_t *stats) {
    world_init(world, combination->mode, combination->spacing % 2U == 1U, stats);
    world_run(world, 350U * MS);
    if (combination->start == START_DRIVING) {
        world->mode = (combination->mode == MODE_ONCE) ? MODE_STREAM : combination->mode;
        world_do(world, STEP_ARM);
        world_run(world, 20U * MS);
        world_do(world, STEP_COMMAND);
        world_run(world, 700U * MS);
        world->mode = combination->mode;
        world->drive_us = (combination->mode == MODE_ONCE) ? IW_NEVER : world->drive_us;
    }
    world->late = is_late(combination);
}

typedef struct {
    const combination_t *combination;
    world_t *world;
    uint8_t letters[LENGTH];
    uint64_t sequences;
} play_t;

/// Plays every continuation. Returns false at the first that breaks a rule; it is then in `letters`, with length `*count`.
static bool play_all(play_t *play, unsigned *count) {
    static world_t saved[LENGTH];
    const unsigned depth = *count;
    if (depth == play->combination->length) {
        play->sequences++;
        world_run(play->world, TAIL_US);
        return !world_broken(play->world);
    }
    saved[depth] = *play->world;
    for (uint8_t letter = 0; letter < STEP_KINDS; letter++) {
        *play->world = saved[depth];
        play->letters[depth] = letter;
        world_do(play->world, (world_step_t)letter);
        world_run(play->world, spacing_us(play->combination, play->letters, depth + 1U));
        *count = depth + 1U;
        if (world_broken(play->world) || !play_all(play, count)) {
            return false;
        }
        *count = depth;
    }
    return true;
}

static bool breaks(world_t *world, const combination_t *combination, const uint8_t *letters, unsigned count) {
    static world_stats_t unused;
    const bool traces = world->traces;
    begin(world, combination, &unused);
    world->traces = traces;
    for (unsigned i = 0; i < count && !world_broken(world); i++) {
        world_do(world, (world_step_t)letters[i]);
        world_run(world, spacing_us(combination, letters, i + 1U));
    }
    if (!world_broken(world)) {
        world_run(world, 2000U * MS);
    }
    return world_broken(world);
}

/// Removes letters as long as a rule stays broken.
static unsigned shrink(world_t *world, const combination_t *combination, uint8_t *letters, unsigned count) {
    for (unsigned i = 0; i < count;) {
        uint8_t fewer[LENGTH];
        memcpy(fewer, letters, sizeof fewer);
        memmove(&fewer[i], &fewer[i + 1U], count - i - 1U);
        if (breaks(world, combination, fewer, count - 1U)) {
            memcpy(letters, fewer, sizeof fewer);
            count--;
            i = 0;
        } else {
            i++;
        }
    }
    return count;
}

static void print_failure(play_t *play, unsigned count) {
    const combination_t *const combination = play->combination;
    world_t *const world = play->world;
    printf("FAILED rule %u: %s\n", world->oracle.rule, world->oracle.text);
    count = shrink(world, combination, play->letters, count);
    printf("made small: --sequence %s %s %u ", start_names[combination->start], mode_names[combination->mode],
           combination->spacing);
    for (unsigned i = 0; i < count; i++) {
        printf("%s%s", (i > 0U) ? "," : "", world_step_name(play->letters[i]));
    }
    printf("\n");
    world->traces = true;
    (void)breaks(world, combination, play->letters, count);
    printf("rule %u at %.3f ms: %s\n", world->oracle.rule, (double)world->oracle.broken_us / 1e3, world->oracle.text);
}

/// Returns true if everything happened that must happen in a complete enumeration; otherwise it proves nothing.
static bool happened(const world_stats_t *stats, const combination_t *combination) {
    const bool drove = combination->start == START_DRIVING ||
                       (stats->armed > 0U && stats->drives > 0U && stats->nonzero > 0U) ||
                       combination->spacing < 2U; // Arming takes longer than these spacings.
    const bool enough = combination->length > 3U; // Long enough to arm and to be late in both ways.
    const bool waited = !is_late(combination) || !enough || (stats->aged > 0U && stats->stale > 0U);
    return drove && waited && stats->restarts > 0U && stats->latched > 0U;
}

static bool play_combination(const combination_t *combination, uint64_t *out_sequences) {
    static world_t world;
    world_stats_t stats = {0};
    play_t play = {combination, &world, {0}, 0};
    unsigned count = 0;
    begin(&world, combination, &stats);
    const bool good = !world_broken(&world) && play_all(&play, &count);
    if (!good) {
        print_failure(&play, count);
    }
    const bool seen = happened(&stats, combination);
    printf("%-6s from %s, %s, spacing %u: %llu sequences, %llu frames of which %llu nonzero, %llu times armed, "
           "%llu drives (%llu that had waited; %llu refused as older than the arm), %llu resets, %llu latches\n",
           (good && seen) ? "ok" : "FAILED", start_names[combination->start], mode_names[combination->mode],
           combination->spacing, (unsigned long long)play.sequences, (unsigned long long)stats.frames,
           (unsigned long long)stats.nonzero, (unsigned long long)stats.armed, (unsigned long long)stats.drives,
           (unsigned long long)stats.aged, (unsigned long long)stats.stale, (unsigned long long)stats.resets,
           (unsigned long long)stats.latched);
    fflush(stdout);
    *out_sequences += play.sequences;
    return good && seen;
}

static int play_everything(unsigned length, bool full, unsigned part, unsigned parts) {
    const unsigned spacings = UNIFORM + (full ? 12U : 3U);
    unsigned index = 0;
    unsigned passed = 0;
    unsigned failed = 0;
    uint64_t sequences = 0;
    for (unsigned spacing = spacings; spacing-- > 0U;) {
        for (unsigned which = 0; which < COMBINATIONS; which++, index++) {
            const combination_t combination = {(start_t)(which % STARTS), (world_mode_t)(which / STARTS), spacing,
                                               length};
            if ((index + spacing) % parts != part) {
                continue;
            }
            const bool good = play_combination(&combination, &sequences);
            passed += good ? 1U : 0U;
            failed += good ? 0U : 1U;
        }
    }
    printf("summary sequences %llu\n", (unsigned long long)sequences);
    printf("%u passed, %u failed, 0 skipped\n", passed, failed);
    return (failed == 0U && passed > 0U) ? EXIT_SUCCESS : EXIT_FAILURE;
}

static int find_name(const char *const *names, int count, const char *name) {
    for (int i = 0; i < count; i++) {
        if (strcmp(names[i], name) == 0) {
            return i;
        }
    }
    return -1;
}

static int read_letter(const char *word) {
    for (int letter = 0; letter < STEP_KINDS; letter++) {
        if (strcmp(world_step_name((unsigned)letter), word) == 0) {
            return letter;
        }
    }
    return -1;
}

static int play_sequence(char **words) {
    static world_t world;
    const int start = find_name(start_names, STARTS, words[0]);
    const int mode = find_name(mode_names, MODES, words[1]);
    uint8_t letters[LENGTH];
    unsigned count = 0;
    for (char *word = strtok(words[3], ","); word != NULL && count < LENGTH; word = strtok(NULL, ",")) {
        const int letter = read_letter(word);
        if (letter < 0) {
            fprintf(stderr, "test_orders: no such letter: %s\n", word);
            return EXIT_USAGE;
        }
        letters[count++] = (uint8_t)letter;
    }
    if (start < 0 || mode < 0) {
        usage(stderr);
        return EXIT_USAGE;
    }
    const combination_t combination = {(start_t)start, (world_mode_t)mode, (unsigned)strtoul(words[2], NULL, 10),
                                       LENGTH};
    world.traces = true;
    const bool broken = breaks(&world, &combination, letters, count);
    if (broken) {
        printf("FAILED rule %u at %.3f ms: %s\n", world.oracle.rule, (double)world.oracle.broken_us / 1e3,
               world.oracle.text);
    }
    printf("%d passed, %d failed, 0 skipped\n", !broken, broken);
    return broken ? EXIT_FAILURE : EXIT_SUCCESS;
}

int main(int argc, char **argv) {
    unsigned length = LENGTH;
    unsigned part = 0;
    unsigned parts = 1;
    bool full = false;
    for (int i = 1; i < argc; i++) {
        if (strcmp(argv[i], "--help") == 0) {
            usage(stdout);
            return EXIT_SUCCESS;
        }
        if (strcmp(argv[i], "--sequence") == 0 && i + 4 < argc) {
            return play_sequence(&argv[i + 1]);
        }
        if (strcmp(argv[i], "--full") == 0) {
            full = true;
        } else if (strcmp(argv[i], "--length") == 0 && i + 1 < argc) {
            length = (unsigned)strtoul(argv[++i], NULL, 10);
        } else if (strcmp(argv[i], "--part") == 0 && i + 1 < argc) {
            char *slash = NULL;
            part = (unsigned)strtoul(argv[++i], &slash, 10);
            parts = (*slash == '/') ? (unsigned)strtoul(slash + 1, NULL, 10) : 0U;
        } else {
            usage(stderr);
            return EXIT_USAGE;
        }
    }
    if (length < 1U || length > LENGTH || parts < 1U || part >= parts) {
        usage(stderr);
        return EXIT_USAGE;
    }
    return play_everything(length, full, part, parts);
}
