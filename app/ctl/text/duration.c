// SPDX-License-Identifier: MIT
#include "duration.h"

#include <inttypes.h>
#include <stdio.h>
#include <string.h>

#define DIGITS_MAX   6U
#define DECIMALS_MAX 3U

/// Units, the largest first. A whole number of days is written in hours.
static const struct {
    const char *name;
    int64_t us;
} units[] = {{"h", 3600000000}, {"min", 60000000}, {"s", 1000000}, {"ms", 1000}};
#define UNITS (sizeof units / sizeof units[0])

/// Appends the digits at `*at` to `*number`. Returns false if there are none, or more than `most`.
static bool take_digits(const char **at, size_t most, int64_t *number) {
    const size_t digits = strspn(*at, "0123456789");
    for (size_t i = 0; i < digits && i < most; i++) {
        *number = *number * 10 + ((*at)[i] - '0');
    }
    *at += digits;
    return digits > 0 && digits <= most;
}

bool duration_parse(const char *text, int64_t *out_us) {
    int64_t number = 0;
    int64_t scale = 1;
    const char *at = text;
    bool good = take_digits(&at, DIGITS_MAX, &number);
    if (good && *at == '.') {
        const char *const decimals = ++at;
        good = take_digits(&at, DECIMALS_MAX, &number);
        for (const char *c = decimals; c < at; c++) {
            scale *= 10;
        }
    }
    for (size_t i = 0; good && i < UNITS; i++) {
        if (strcmp(at, units[i].name) == 0) {
            *out_us = number * units[i].us / scale;
            return true;
        }
    }
    return false;
}

/// Writes a time in the largest unit in which it is a whole number.
static void duration_write(int64_t us, char *out_text, size_t size) {
    size_t i = 0;
    while (i < UNITS - 1U && us % units[i].us != 0) {
        i++;
    }
    (void)snprintf(out_text, size, "%" PRId64 "%s", us / units[i].us, units[i].name);
}

/// Guesses the meant time: a number without its unit is in seconds, with `m` in minutes. Returns false if there is no
/// guess, or if it is not in range.
static bool guess(const char *text, duration_range_t range, char *out_text, size_t size) {
    int64_t us = 0;
    const size_t digits = strspn(text, "0123456789.");
    const bool minutes = strcmp(text + digits, "m") == 0;
    (void)snprintf(out_text, size, "%.*s%s", (int)digits, text, minutes ? "min" : "s");
    return (minutes || text[digits] == '\0') && duration_parse(out_text, &us) && us >= range.min_us &&
           us <= range.max_us;
}

bool duration_option(const char *option, const char *text, duration_range_t range, int64_t *out_us,
                     char out_why[DURATION_WHY_SIZE]) {
    char least[24];
    char most[24];
    char meant[48];
    int64_t us = 0;
    if (text == NULL || !duration_parse(text, &us)) {
        const bool guessed = text != NULL && guess(text, range, meant, sizeof meant);
        (void)snprintf(out_why, DURATION_WHY_SIZE,
                       "%s needs a time with its unit, such as " DURATION_FORM ", not \"%.40s\"%s%s%s%s", option,
                       (text != NULL) ? text : "", guessed ? "; write: " : "", guessed ? option : "",
                       guessed ? " " : "", guessed ? meant : "");
        return false;
    }
    if (us < range.min_us || us > range.max_us) {
        duration_write(range.min_us, least, sizeof least);
        duration_write(range.max_us, most, sizeof most);
        (void)snprintf(out_why, DURATION_WHY_SIZE, "%s %.40s is out of range; write %s to %s", option, text, least,
                       most);
        return false;
    }
    *out_us = us;
    return true;
}
