// SPDX-License-Identifier: MIT
/// Commands that set and clear faults in the simulated world.
///
/// A line is one command. The answer is `ok`, `ok TEXT` or `error REASON`; the answer to `help` has several lines and a
/// single `.` in the last one. A refused command changes nothing. Everything outside the world (button, connections,
/// log) is reached through hooks, so a script can be checked in advance with a scratch world and empty hooks.
#ifndef SIM_PANEL_H
#define SIM_PANEL_H

#include "hub.h"
#include "iwheel_sim/world.h"
#include "sim_button.h"
#include "sim_words.h"

/// Size for the longest answer, that of `help`.
#define SIM_ANSWER_BYTES 8192U

/// Parts outside the world. Each of them may be NULL; then a command does nothing with it.
typedef struct {
    sim_hub_t *hub;
    sim_button_t *button;
    sim_button_t *second; ///< Second contact of the same button.
    void (*mark)(void *context, const char *text);
    void (*quit)(void *context);
    void *context;
} sim_hooks_t;

typedef struct {
    sim_world_t *world;
    sim_hooks_t hooks;
    char answer[SIM_ANSWER_BYTES]; ///< Answer to the last command; every line ends in a newline.
} sim_panel_t;

typedef enum {
    SIM_REFUSED, ///< Nothing changed; the answer has the reason.
    SIM_ASKED,   ///< The command was answered; nothing changed.
    SIM_CHANGED, ///< The command was executed; it must be logged.
} sim_outcome_t;

/// Executes one command. Before the call, all frames that are due before `now_us` must have been read from the world.
sim_outcome_t sim_panel_execute(sim_panel_t *self, iw_time_us_t now_us, const char *line);

/// Writes one line of JSON about both wheels, the bus and the button. Returns its length, at most `size` - 1.
size_t sim_panel_status(const sim_panel_t *self, iw_time_us_t now_us, char *out, size_t size);

#endif
