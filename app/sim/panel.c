// SPDX-License-Identifier: MIT
#include "sim_command.h"

#include "sim_texts.h"

#include <stdio.h>
#include <string.h>

#define SIM_USAGE_COLUMNS 42U
#define SIM_BOTH          ((1U << IW_LEFT) | (1U << IW_RIGHT))

const char SIM_USAGE[] = "usage";

static const sim_command_t *const tables[] = {sim_wheel_commands, sim_bus_commands};
#define TABLES (sizeof tables / sizeof tables[0])

static const char *const lists[TABLES] = {sim_commands_wheel, sim_commands_bus};

static sim_outcome_t help(sim_panel_t *self) {
    (void)snprintf(self->answer, sizeof self->answer, "%s%s.\n", lists[0], lists[1]);
    return SIM_ASKED;
}

/// Finds the usage in the command's line of its list: name and arguments, up to their explanation. Returns its length;
/// 0 if no list has the command.
static int usage_of(const char *name, const char **out_usage) {
    size_t const length = strlen(name);
    for (size_t i = 0U; i < TABLES; i++) {
        for (const char *line = lists[i]; *line != '\0'; line = strchr(line, '\n') + 1U) {
            if (strncmp(line, name, length) == 0 && line[length] == ' ') {
                size_t used = SIM_USAGE_COLUMNS + strcspn(line + SIM_USAGE_COLUMNS, " "); // Some usages are longer.
                for (; line[used - 1U] == ' '; used--) {
                }
                *out_usage = line;
                return (int)used;
            }
        }
    }
    return 0;
}

static const sim_command_t *find(const char *name) {
    for (size_t i = 0U; i < TABLES; i++) {
        for (const sim_command_t *each = tables[i]; each->name != NULL; each++) {
            if (strcmp(each->name, name) == 0) {
                return each;
            }
        }
    }
    return NULL;
}

static sim_outcome_t refuse(sim_panel_t *self, const char *what, const char *detail) {
    (void)snprintf(self->answer, sizeof self->answer, "error %s%.*s\n", what, (int)SIM_LINE_BYTES, detail);
    return SIM_REFUSED;
}

static bool read_argument(const sim_argument_t *argument, const char *word, int64_t *out_value) {
    unsigned sides = 0U;
    bool first = false;
    bool good = true;
    if (argument->also != NULL && strcmp(word, argument->also) == 0) {
        *out_value = argument->value;
        return true;
    }
    switch (argument->kind) {
    case SIM_SIDES:
        good = sim_words_sides(word, &sides);
        *out_value = sides;
        return good;
    case SIM_CHOICE:
        good = sim_words_choice(word, (sim_choice_t){argument->word, argument->other}, &first);
        *out_value = first ? 1 : 0;
        return good;
    case SIM_WHOLE:
        return sim_words_integer(word, argument->range, out_value);
    case SIM_MILLI:
        return sim_words_milli(word, argument->range, out_value);
    default:
        return true;
    }
}

/// Reads the arguments. Returns false if the words are not those that the command accepts.
static bool read_arguments(const sim_command_t *command, sim_call_t *call) {
    const unsigned arguments = call->words->count - 1U;
    unsigned values = 0U;
    unsigned i = 0U;
    for (; i < SIM_ARGUMENTS && command->argument[i].kind != SIM_NOTHING; i++) {
        const sim_argument_t *const argument = &command->argument[i];
        int64_t value = argument->value;
        const bool good =
            (i < arguments) ? read_argument(argument, call->words->word[i + 1U], &value) : argument->optional;
        if (!good) {
            return false;
        }
        if (argument->kind == SIM_REST) {
            return true;
        }
        if (argument->kind == SIM_SIDES) {
            call->sides = (unsigned)value;
        } else {
            call->value[values++] = value;
        }
    }
    return arguments <= i;
}

static sim_outcome_t run(sim_panel_t *self, const sim_command_t *command, sim_call_t *call) {
    const char *reason = SIM_USAGE;
    if (read_arguments(command, call)) {
        (void)snprintf(self->answer, sizeof self->answer, "ok\n");
        reason = (command->run != NULL) ? command->run(call) : NULL;
    }
    if (reason == SIM_USAGE) {
        const char *usage = "";
        const int length = usage_of(command->name, &usage);
        (void)snprintf(self->answer, sizeof self->answer, "error wrong arguments; usage: %.*s\n", length, usage);
        return SIM_REFUSED;
    }
    if (reason != NULL) {
        return refuse(self, reason, "");
    }
    for (unsigned side = 0U; side < IW_SIDES && command->each != NULL; side++) {
        if (((call->sides >> side) & 1U) != 0U) {
            command->each(call, &call->world->pair.wheel[side]);
        }
    }
    return command->asks ? SIM_ASKED : SIM_CHANGED;
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
    const sim_command_t *const command = find(words.word[0]);
    if (command == NULL) {
        return refuse(self, "unknown command (help lists the commands): ", words.word[0]);
    }
    sim_call_t call = {self, self->world, now_us, &words, SIM_BOTH, {0}};
    return run(self, command, &call);
}
