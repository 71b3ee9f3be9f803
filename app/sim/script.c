// SPDX-License-Identifier: MIT
#include "script.h"

#include <errno.h>
#include <stdio.h>
#include <string.h>

#define LATEST_ms INT64_C(86400000)
#define US_PER_MS 1000U

static bool fail(sim_script_fault_t *out_fault, unsigned line, const char *reason) {
    out_fault->line = line;
    (void)snprintf(out_fault->reason, sizeof out_fault->reason, "%s", reason);
    return false;
}

/// Returns the text after the first `words` words.
static const char *after(const char *line, unsigned words) {
    const char *at = line + strspn(line, " \t");
    for (unsigned i = 0U; i < words; i++) {
        at += strcspn(at, " \t");
        at += strspn(at, " \t");
    }
    return at;
}

/// Reads `at` and `wait`: advances `*time_us` and sets `*out_command` to the rest of the line. Returns false if the
/// number is not valid or the time goes back.
static bool read_time(const char *line, iw_time_us_t *time_us, const char **out_command) {
    sim_words_t words;
    bool is_at = false;
    int64_t milli = 0;
    *out_command = after(line, 0U);
    if (!sim_words_split(&words, line) || words.count == 0U ||
        !sim_words_choice(words.word[0], (sim_choice_t){"at", "wait"}, &is_at)) {
        return true;
    }
    if (words.count < 2U || !sim_words_milli(words.word[1], (sim_range_t){0, LATEST_ms}, &milli)) {
        return false;
    }
    iw_time_us_t const given_us = (iw_time_us_t)milli * US_PER_MS;
    iw_time_us_t const then_us = is_at ? given_us : *time_us + given_us;
    if (then_us < *time_us) {
        return false;
    }
    *time_us = then_us;
    *out_command = after(line, 2U);
    return true;
}

typedef struct {
    const char *(*check)(void *context, const char *command);
    void *context;
    iw_time_us_t time_us;
    unsigned line;
} reader_t;

static bool read_line(sim_script_t *self, reader_t *reader, const char *line, sim_script_fault_t *out_fault) {
    const char *command = NULL;
    if (line[strspn(line, " \t")] == '#') {
        return true;
    }
    if (!read_time(line, &reader->time_us, &command)) {
        return fail(out_fault, reader->line,
                    "write: at SECONDS COMMAND, or: wait SECONDS [COMMAND]; time must not go back");
    }
    if (command[0] == '\0') {
        return true;
    }
    const char *const reason = reader->check(reader->context, command);
    if (reason != NULL) {
        return fail(out_fault, reader->line, reason);
    }
    if (self->count == SIM_SCRIPT_STEPS) {
        return fail(out_fault, reader->line, "more than 512 commands; make the script shorter");
    }
    sim_script_step_t *const step = &self->step[self->count++];
    step->at_us = reader->time_us;
    (void)snprintf(step->command, sizeof step->command, "%s", command);
    return true;
}

bool sim_script_load(sim_script_t *self, const char *path, const char *(*check)(void *context, const char *command),
                     void *context, sim_script_fault_t *out_fault) {
    char line[SIM_LINE_BYTES];
    reader_t reader = {check, context, 0U, 0U};
    bool good = true;
    self->count = 0U;
    self->next = 0U;
    FILE *const file = fopen(path, "re");
    if (file == NULL) {
        return fail(out_fault, 0U, strerror(errno));
    }
    while (good && fgets(line, sizeof line, file) != NULL) {
        reader.line += 1U;
        if (strlen(line) == sizeof line - 1U && line[sizeof line - 2U] != '\n') {
            good = fail(out_fault, reader.line, "the line is longer than 254 characters");
        } else {
            line[strcspn(line, "\r\n")] = '\0';
            good = read_line(self, &reader, line, out_fault);
        }
    }
    if (good && ferror(file) != 0) {
        good = fail(out_fault, 0U, strerror(errno));
    }
    (void)fclose(file);
    return good;
}

iw_time_us_t sim_script_next_us(const sim_script_t *self) {
    return (self->next < self->count) ? self->step[self->next].at_us : IW_NEVER;
}

const char *sim_script_take(sim_script_t *self, iw_time_us_t elapsed_us) {
    if (sim_script_next_us(self) > elapsed_us) {
        return NULL;
    }
    return self->step[self->next++].command;
}
