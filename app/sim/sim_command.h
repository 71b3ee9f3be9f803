// SPDX-License-Identifier: MIT
/// How a command of the panel is made. Private to panel*.c.
#ifndef SIM_COMMAND_H
#define SIM_COMMAND_H

#include "panel.h"

#define SIM_ARGUMENTS 3U

/// What may stand at a place behind the name.
typedef struct {
    enum {
        SIM_NOTHING = 0, ///< The end.
        SIM_SIDES,       ///< Which wheels; stands first. Without it a command means both.
        SIM_CHOICE,      ///< `word` (1) or `other` (0).
        SIM_WHOLE,       ///< A decimal integer.
        SIM_MILLI,       ///< A decimal number, in thousandths.
        SIM_WORD,        ///< Anything: the command reads it.
        SIM_REST,        ///< Anything, as many words as there are, but one.
    } kind;
    sim_range_t range;
    const char *word;
    const char *other;
    const char *also; ///< A word that stands for `value`; NULL: none.
    int64_t value;    ///< Also if nothing stands there.
    bool optional;
} sim_argument_t;

typedef struct {
    sim_panel_t *panel;
    sim_world_t *world;
    iw_time_us_t now_us;
    const sim_words_t *words;
    unsigned sides;               ///< Bit n is side n.
    int64_t value[SIM_ARGUMENTS]; ///< Of the arguments, the sides left out.
} sim_call_t;

typedef struct {
    const char *name; ///< Its line in commands_wheel.txt or commands_bus.txt begins with it.
    sim_argument_t argument[SIM_ARGUMENTS];
    /// NULL: done. SIM_USAGE: the arguments are not right. Else the reason why not. Nothing may have changed unless
    /// NULL. May be missing.
    const char *(*run)(const sim_call_t *call);
    /// Then for each wheel. May be missing.
    void (*each)(const sim_call_t *call, sim_wheel_t *wheel);
    bool asks; ///< It changes nothing.
} sim_command_t;

extern const char SIM_USAGE[];

/// Both end with a row without a name.
extern const sim_command_t sim_wheel_commands[];
extern const sim_command_t sim_bus_commands[];

// What a row of `argument` says.
#define WHOLE(min_, max_)     .kind = SIM_WHOLE, .range = {(min_), (max_)}
#define MILLI(min_, max_)     .kind = SIM_MILLI, .range = {(min_), (max_)}
#define CHOICE(word_, other_) .kind = SIM_CHOICE, .word = (word_), .other = (other_)
#define ON_OFF                CHOICE("on", "off")

// A row of the tables: a command for each wheel, and one for the whole.
#define EACH(name_, each_, ...) .name = (name_), .each = (each_), .argument = {__VA_ARGS__}
#define ONCE(name_, run_, ...)  .name = (name_), .run = (run_), .argument = {__VA_ARGS__}

#endif
