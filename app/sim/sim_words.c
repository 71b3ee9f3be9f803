// SPDX-License-Identifier: MIT
#include "sim_words.h"

#include "candump.h"

#include <stdio.h>
#include <string.h>

bool sim_words_split(sim_words_t *self, const char *line) {
    size_t const length = strlen(line);
    if (length >= sizeof self->text) {
        return false;
    }
    memcpy(self->text, line, length + 1U);
    self->count = 0U;
    bool inside = false;
    for (char *at = self->text; *at != '\0'; at++) {
        if (*at == ' ' || *at == '\t' || *at == '\r') {
            *at = '\0';
            inside = false;
        } else if (*at < ' ' || *at > '~') {
            return false;
        } else if (!inside) {
            if (self->count == SIM_WORDS_MAX) {
                return false;
            }
            self->word[self->count++] = at;
            inside = true;
        }
    }
    return true;
}

bool sim_words_choice(const char *word, sim_choice_t choice, bool *out_one) {
    bool const one = strcmp(word, choice.one) == 0;
    if (!one && strcmp(word, choice.other) != 0) {
        return false;
    }
    *out_one = one;
    return true;
}

bool sim_words_sides(const char *word, unsigned *out_mask) {
    bool left = false;
    if (strcmp(word, "both") == 0) {
        *out_mask = 3U;
        return true;
    }
    if (!sim_words_choice(word, (sim_choice_t){"left", "right"}, &left)) {
        return false;
    }
    *out_mask = left ? 1U << IW_LEFT : 1U << IW_RIGHT;
    return true;
}

static bool is_digit(char c) {
    return c >= '0' && c <= '9';
}

/// Appends the digits at `*at`, at most `most`, to `*value`. Returns their number.
static unsigned read_digits(const char **at, unsigned most, int64_t *value) {
    unsigned digits = 0U;
    for (; digits < most && is_digit(**at); ++*at) {
        *value = *value * 10 + (**at - '0');
        digits += 1U;
    }
    return digits;
}

/// Reads digits with a sign and a point, scaled by 10^`places`. At most 12 before the point, so that nothing overflows.
static bool read_scaled(const char *word, unsigned places, int64_t *out_value) {
    bool const negative = word[0] == '-';
    const char *at = negative ? word + 1 : word;
    int64_t value = 0;
    unsigned behind = 0U;
    if (read_digits(&at, 12U, &value) == 0U) {
        return false;
    }
    if (*at == '.' && places > 0U) {
        at++;
        behind = read_digits(&at, places, &value);
        if (behind == 0U) {
            return false;
        }
    }
    if (*at != '\0') {
        return false;
    }
    for (; behind < places; behind++) {
        value *= 10;
    }
    *out_value = negative ? -value : value;
    return true;
}

static bool within(sim_range_t range, int64_t value, int64_t *out_value) {
    if (value < range.min || value > range.max) {
        return false;
    }
    *out_value = value;
    return true;
}

bool sim_words_integer(const char *word, sim_range_t range, int64_t *out_value) {
    int64_t value = 0;
    return read_scaled(word, 0U, &value) && within(range, value, out_value);
}

bool sim_words_milli(const char *word, sim_range_t range, int64_t *out_milli) {
    int64_t value = 0;
    return read_scaled(word, 3U, &value) && within(range, value, out_milli);
}

bool sim_words_frame(const char *word, iw_can_frame_t *out_frame) {
    char line[SIM_LINE_BYTES];
    candump_t frame;
    const char *why = NULL;
    const int length = snprintf(line, sizeof line, "(0) sim %s", word);
    // The panel does not accept candump's marks, lengths of remote frames, and dots between bytes.
    if (strspn(word, "0123456789ABCDEFabcdefRr#") != strlen(word) || (size_t)length >= sizeof line ||
        candump_parse(line, (size_t)length, &frame, &why) != CANDUMP_FRAME) {
        return false;
    }
    if (frame.fd || frame.error || (frame.remote && strpbrk(word, "Rr")[1] != '\0')) {
        return false;
    }
    *out_frame = candump_to_core(&frame);
    return true;
}
