// SPDX-License-Identifier: MIT
#include "drive_words.h"

#include <stdio.h>
#include <string.h>

/// Reads a whole decimal number with an optional sign. Returns false if it is not valid or its absolute value is over
/// the limit.
static bool parse_integer(const char *text, int limit, int *out_number) {
    const bool negative = text[0] == '-';
    const char *digits = text + ((negative || text[0] == '+') ? 1 : 0);
    const size_t length = strlen(digits);
    int number = 0;
    if (length == 0 || length > 9U || strspn(digits, "0123456789") != length) {
        return false;
    }
    for (size_t i = 0; i < length; i++) {
        number = number * 10 + (digits[i] - '0');
    }
    *out_number = negative ? -number : number;
    return number <= limit;
}

static bool parse_for(const char *text, drive_words_t *drive, char *out_why) {
    static const duration_range_t range = {DRIVE_TIME_MIN_MS * INT64_C(1000), DRIVE_TIME_MAX_MS * INT64_C(1000)};
    int64_t us = 0;
    const bool good = duration_option("--for", text, range, &us, out_why);
    if (good) {
        drive->time_ms = (int)(us / 1000);
    }
    return good;
}

static bool parse_pair(char **words, int limit, int *out_pair) {
    return parse_integer(words[0], limit, &out_pair[0]) && parse_integer(words[1], limit, &out_pair[1]);
}

static bool is_number(const char *word) {
    return strspn(word, "+-0123456789") > 0 && strncmp(word, "--", 2) != 0;
}

/// Reads the option at `words[*at]` and moves `*at` to its last word.
static bool parse_option(int count, char **words, int *at, drive_words_t *drive, char *out_why) {
    const char *word = words[*at];
    const int left = count - *at - 1;
    if (strcmp(word, "--takeover") == 0) {
        drive->takeover = true;
        return true;
    }
    if (strcmp(word, "--for") == 0) {
        *at += 1;
        return parse_for((left > 0) ? words[*at] : NULL, drive, out_why);
    }
    if (strcmp(word, "--current") == 0) {
        drive->has_current = left >= 2 && parse_pair(&words[*at + 1], DRIVE_CURRENT_MAX_mA, drive->current_mA);
        *at += 2;
        if (!drive->has_current) {
            (void)snprintf(out_why, DRIVE_WHY_SIZE,
                           "--current needs two currents in mA, left and right, within -%d..%d", DRIVE_CURRENT_MAX_mA,
                           DRIVE_CURRENT_MAX_mA);
        }
        return drive->has_current;
    }
    (void)snprintf(out_why, DRIVE_WHY_SIZE, "drive does not understand \"%.60s\"; see: iwheelctl drive --help", word);
    return false;
}

bool drive_words_parse(int count, char **words, drive_words_t *out_drive, char *out_why) {
    char why[DRIVE_WHY_SIZE] = "";
    int speeds = 0;
    drive_words_t drive = {.time_ms = DRIVE_TIME_DEFAULT_MS};
    for (int i = 0; i < count && why[0] == '\0'; i++) {
        if (speeds < 2 && is_number(words[i])) {
            if (!parse_integer(words[i], 32768, &drive.speed_mm_s[speeds]) || drive.speed_mm_s[speeds] == 32768) {
                (void)snprintf(why, sizeof why, "\"%.40s\" is not a speed; write whole mm/s within -32768..32767",
                               words[i]);
            }
            speeds++;
        } else {
            (void)parse_option(count, words, &i, &drive, why);
        }
    }
    if (why[0] == '\0' && speeds < 2) {
        (void)snprintf(why, sizeof why,
                       "drive needs two speeds in mm/s, left and right, such as: iwheelctl drive 200 200");
    }
    (void)snprintf(out_why, DRIVE_WHY_SIZE, "%s", why);
    if (why[0] == '\0') {
        *out_drive = drive;
    }
    return why[0] == '\0';
}
