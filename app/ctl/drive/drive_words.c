// SPDX-License-Identifier: MIT
#include "drive_words.h"

#include <stdio.h>
#include <string.h>

/// A whole decimal number, possibly negative, of which |number| <= limit.
static bool parse_integer(const char *text, int limit, int *out_number) {
    const bool negative = text[0] == '-';
    const char *digits = text + (negative || text[0] == '+' ? 1 : 0);
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

/// "2s", "1.5s", "300ms".
static bool parse_time(const char *text, int *out_ms) {
    const size_t whole = strspn(text, "0123456789");
    const char *rest = text + whole;
    int number = 0;
    int thousandths = 0;
    if (whole == 0 || whole > 6U) {
        return false;
    }
    for (size_t i = 0; i < whole; i++) {
        number = number * 10 + (text[i] - '0');
    }
    if (*rest == '.') {
        const size_t digits = strspn(rest + 1, "0123456789");
        int weight = 100;
        if (digits == 0 || digits > 3U || rest[1U + digits] != 's') {
            return false;
        }
        for (size_t i = 1; i <= digits; i++, weight /= 10) {
            thousandths += (rest[i] - '0') * weight;
        }
        rest += 1U + digits;
    }
    if (strcmp(rest, "s") == 0) {
        *out_ms = number * 1000 + thousandths;
        return true;
    }
    *out_ms = number;
    return strcmp(rest, "ms") == 0;
}

static bool parse_for(const char *text, drive_words_t *drive, char *out_why) {
    if (text == NULL || !parse_time(text, &drive->time_ms)) {
        (void)snprintf(out_why, DRIVE_WHY_SIZE, "--for wants a time with its unit, such as 2s or 500ms, not \"%s\"",
                       text != NULL ? text : "");
        return false;
    }
    if (drive->time_ms < DRIVE_TIME_MIN_MS || drive->time_ms > DRIVE_TIME_MAX_MS) {
        (void)snprintf(out_why, DRIVE_WHY_SIZE, "--for %s is out of range; write %dms to %ds", text, DRIVE_TIME_MIN_MS,
                       DRIVE_TIME_MAX_MS / 1000);
        return false;
    }
    return true;
}

static bool parse_pair(char **words, int limit, int *out_pair) {
    return parse_integer(words[0], limit, &out_pair[0]) && parse_integer(words[1], limit, &out_pair[1]);
}

static bool is_number(const char *word) {
    return strspn(word, "+-0123456789") > 0 && strncmp(word, "--", 2) != 0;
}

/// The option at `words[at]`; moves `*at` to its last word.
static bool parse_option(int count, char **words, int *at, drive_words_t *drive, char *out_why) {
    const char *word = words[*at];
    const int left = count - *at - 1;
    if (strcmp(word, "--takeover") == 0) {
        drive->takeover = true;
        return true;
    }
    if (strcmp(word, "--for") == 0) {
        *at += 1;
        return parse_for(left > 0 ? words[*at] : NULL, drive, out_why);
    }
    if (strcmp(word, "--current") == 0) {
        drive->has_current = left >= 2 && parse_pair(&words[*at + 1], DRIVE_CURRENT_MAX_mA, drive->current_mA);
        *at += 2;
        if (!drive->has_current) {
            (void)snprintf(out_why, DRIVE_WHY_SIZE,
                           "--current wants two currents in mA, left and right, within -%d..%d", DRIVE_CURRENT_MAX_mA,
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
                (void)snprintf(why, sizeof(why), "\"%.40s\" is no speed; write whole mm/s within -32768..32767",
                               words[i]);
            }
            speeds++;
        } else {
            (void)parse_option(count, words, &i, &drive, why);
        }
    }
    if (why[0] == '\0' && speeds < 2) {
        (void)snprintf(why, sizeof(why),
                       "drive wants two speeds in mm/s, left and right, such as: iwheelctl drive 200 200");
    }
    (void)snprintf(out_why, DRIVE_WHY_SIZE, "%s", why);
    if (why[0] == '\0') {
        *out_drive = drive;
    }
    return why[0] == '\0';
}
