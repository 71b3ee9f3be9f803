// SPDX-License-Identifier: MIT
/// The commands that plant faults into the simulated world and take them out again.
///
/// One command a line; the answer is `ok`, `ok TEXT` or `error REASON`, and for `help` several lines with a single `.`
/// behind them. A command that is refused changes nothing. Everything outside the world (button, connections, log) is
/// reached through hooks, so a script can be checked beforehand against a scratch world with empty hooks.
#ifndef SIM_PANEL_H
#define SIM_PANEL_H

#include "hub.h"
#include "iwheel_sim/world.h"
#include "sim_button.h"
#include "sim_words.h"

/// Long enough for the longest answer, `help`.
#define SIM_ANSWER_BYTES 8192U

/// What lies outside the world. Any of them may be NULL: nothing is done then.
typedef struct {
    sim_hub_t *hub;
    sim_button_t *button;
    sim_button_t *second; ///< Contact of the same button.
    void (*mark)(void *context, const char *text);
    void (*quit)(void *context);
    void *context;
} sim_hooks_t;

typedef struct {
    sim_world_t *world;
    sim_hooks_t hooks;
    char answer[SIM_ANSWER_BYTES]; ///< To the last command, every line ending in a newline.
} sim_panel_t;

typedef enum {
    SIM_REFUSED, ///< Nothing changed; the answer tells why.
    SIM_ASKED,   ///< Answered; nothing changed.
    SIM_CHANGED, ///< Done, and worth telling.
} sim_outcome_t;

/// All that is due before `now_us` must have been taken from the world.
sim_outcome_t sim_panel_execute(sim_panel_t *self, iw_time_us_t now_us, const char *line);

/// One line of JSON on both wheels, the bus and the button. The length, not more than `size` - 1.
size_t sim_panel_status(const sim_panel_t *self, iw_time_us_t now_us, char *out, size_t size);

#endif
