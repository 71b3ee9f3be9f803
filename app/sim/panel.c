// SPDX-License-Identifier: MIT
#include "command.h"

#include <stdio.h>
#include <string.h>

const char SIM_USAGE[] = "usage";

static size_t describe(char *out, size_t size, const sim_command_t *table, unsigned count) {
    size_t used = 0U;
    for (unsigned i = 0U; i < count && used < size; i++) {
        char call[64];
        (void)snprintf(call, sizeof call, "%s %s", table[i].name, table[i].arguments);
        int const length = snprintf(&out[used], size - used, "%-42s %s\n", call, table[i].help);
        used += (size_t)length;
    }
    return used;
}

static sim_outcome_t help(sim_panel_t *self) {
    size_t used = describe(self->answer, sizeof self->answer, sim_wheel_commands, sim_wheel_command_count);
    used += describe(&self->answer[used], sizeof self->answer - used, sim_bus_commands, sim_bus_command_count);
    (void)snprintf(&self->answer[used], sizeof self->answer - used, "%-42s %s\n.\n", "help", "this list");
    return SIM_ASKED;
}

static const sim_command_t *find_in(const sim_command_t *table, unsigned count, const char *name) {
    for (unsigned i = 0U; i < count; i++) {
        if (strcmp(table[i].name, name) == 0) {
            return &table[i];
        }
    }
    return NULL;
}

static sim_outcome_t refuse(sim_panel_t *self, const char *what, const char *detail) {
    (void)snprintf(self->answer, sizeof self->answer, "error %s%.*s\n", what, (int)SIM_LINE_BYTES, detail);
    return SIM_REFUSED;
}

static sim_outcome_t run(sim_panel_t *self, const sim_command_t *command, const sim_call_t *call) {
    const char *reason = SIM_USAGE;
    if (call->words->count >= command->words_min && call->words->count <= command->words_max) {
        (void)snprintf(self->answer, sizeof self->answer, "ok\n");
        reason = command->run(call);
    }
    if (reason == SIM_USAGE) {
        char usage[128];
        (void)snprintf(usage, sizeof usage, "%s %s", command->name, command->arguments);
        return refuse(self, "that is not right; usage: ", usage);
    }
    return (reason == NULL) ? command->outcome : refuse(self, reason, "");
}

sim_outcome_t sim_panel_execute(sim_panel_t *self, iw_time_us_t now_us, const char *line) {
    sim_words_t words;
    if (!sim_words_split(&words, line)) {
        return refuse(self, "a command is a line of at most 255 printable ASCII characters; help lists the commands",
                      "");
    }
    if (words.count == 0U) {
        return refuse(self, "empty line; help lists the commands", "");
    }
    if (strcmp(words.word[0], "help") == 0) {
        return help(self);
    }
    const sim_command_t *command = find_in(sim_wheel_commands, sim_wheel_command_count, words.word[0]);
    if (command == NULL) {
        command = find_in(sim_bus_commands, sim_bus_command_count, words.word[0]);
    }
    if (command == NULL) {
        return refuse(self, "unknown command; help lists the commands; this is none: ", words.word[0]);
    }
    sim_call_t const call = {self, self->world, now_us, &words};
    return run(self, command, &call);
}
