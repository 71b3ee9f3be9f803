// SPDX-License-Identifier: MIT
/// Definition of a command of the panel. Private to panel*.c.
#ifndef SIM_COMMAND_H
#define SIM_COMMAND_H

#include "panel.h"

#define SIM_ARGUMENTS 3U

/// Definition of one argument after the name.
typedef struct {
    enum {
        SIM_NOTHING = 0, ///< No further argument.
        SIM_SIDES,       ///< Wheels; always the first argument. A command without it applies to both.
        SIM_CHOICE,      ///< `word` (1) or `other` (0).
        SIM_WHOLE,       ///< A decimal integer.
        SIM_MILLI,       ///< A decimal number, in thousandths.
        SIM_WORD,        ///< Any word: the command reads it.
        SIM_REST,        ///< Any words, at least one.
    } kind;
    sim_range_t range;
    const char *word;
    const char *other;
    const char *also; ///< A word that means `value`; NULL: none.
    int64_t value;    ///< Also the value of an absent optional argument.
    bool optional;
} sim_argument_t;

typedef struct {
    sim_panel_t *panel;
    sim_world_t *world;
    iw_time_us_t now_us;
    const sim_words_t *words;
    unsigned sides;               ///< Bit n is side n.
    int64_t value[SIM_ARGUMENTS]; ///< Values of the arguments without the sides.
} sim_call_t;

typedef struct {
    const char *name; ///< First word of its line in commands_wheel.txt or commands_bus.txt.
    sim_argument_t argument[SIM_ARGUMENTS];
    /// Executes the command once. Returns NULL if done, SIM_USAGE if the arguments are not valid, otherwise the reason
    /// of the refusal. It must change nothing unless it returns NULL. May be NULL.
    const char *(*run)(const sim_call_t *call);
    /// Executes the command for one wheel, after `run`. May be NULL.
    void (*each)(const sim_call_t *call, sim_wheel_t *wheel);
    bool asks; ///< The command changes nothing.
} sim_command_t;

extern const char SIM_USAGE[];

/// Both tables end with a row without a name.
extern const sim_command_t sim_wheel_commands[];
extern const sim_command_t sim_bus_commands[];

// Forms of a row of `argument`.
#define WHOLE(min_, max_)     .kind = SIM_WHOLE, .range = {(min_), (max_)}
#define MILLI(min_, max_)     .kind = SIM_MILLI, .range = {(min_), (max_)}
#define CHOICE(word_, other_) .kind = SIM_CHOICE, .word = (word_), .other = (other_)
#define ON_OFF                CHOICE("on", "off")

// Rows of the tables: a command for each wheel, and a command for the whole.
#define EACH(name_, each_, ...) .name = (name_), .each = (each_), .argument = {__VA_ARGS__}
#define ONCE(name_, run_, ...)  .name = (name_), .run = (run_), .argument = {__VA_ARGS__}

#endif
