// SPDX-License-Identifier: MIT
/// How a command of the panel is made. Private to panel*.c.
#ifndef SIM_COMMAND_H
#define SIM_COMMAND_H

#include "panel.h"

typedef struct {
    sim_panel_t *panel;
    sim_world_t *world;
    iw_time_us_t now_us;
    const sim_words_t *words;
} sim_call_t;

typedef struct {
    const char *name;
    const char *arguments; ///< For the usage line.
    const char *help;
    /// NULL: done. SIM_USAGE: the arguments are not right. Else the reason why not. Nothing may have changed unless
    /// NULL.
    const char *(*run)(const sim_call_t *call);
    unsigned words_min; ///< With the command's name.
    unsigned words_max;
    sim_outcome_t outcome; ///< If done.
} sim_command_t;

extern const char SIM_USAGE[];

extern const sim_command_t sim_wheel_commands[];
extern const unsigned sim_wheel_command_count;
extern const sim_command_t sim_bus_commands[];
extern const unsigned sim_bus_command_count;

#endif
