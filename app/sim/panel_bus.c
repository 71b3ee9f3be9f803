// SPDX-License-Identifier: MIT
// Commands for the bus, other nodes, the button and the simulator itself.
#include "sim_command.h"

#include <stdio.h>
#include <string.h>

#define PULSE_MAX_milli_ms 60000000
#define STATUS_BYTES       4096U
/// Value of an absent argument.
#define OMITTED INT64_MIN
/// Value of `once`; on and off are 1 and 0.
#define BUT_ONCE 2

typedef const char *result_t;

static void report(const sim_call_t *call, sim_error_t error) {
    if (call->panel->hooks.hub != NULL) {
        iw_can_frame_t const frame = sim_hub_error_frame(error);
        sim_hub_report(call->panel->hooks.hub, &frame);
    }
}

static result_t set_ack(const sim_call_t *call) {
    sim_world_ack(call->world, call->now_us, call->value[0] != 0);
    return NULL;
}

static result_t set_stall(const sim_call_t *call) {
    sim_bus_stall(&call->world->bus, call->now_us, call->value[0] != 0);
    return NULL;
}

static result_t set_busoff(const sim_call_t *call) {
    const bool on = call->value[0] != 0;
    sim_world_bus_off(call->world, call->now_us, on);
    report(call, on ? SIM_ERROR_BUS_OFF : SIM_ERROR_RESTARTED);
    return NULL;
}

static result_t set_passive(const sim_call_t *call) {
    report(call, (call->value[0] != 0) ? SIM_ERROR_PASSIVE : SIM_ERROR_ACTIVE);
    return NULL;
}

static result_t set_bus(const sim_call_t *call) {
    if (call->panel->hooks.hub != NULL) {
        sim_hub_down(call->panel->hooks.hub, call->value[0] != 0);
    }
    return NULL;
}

static result_t set_queue(const sim_call_t *call) {
    sim_world_queue(call->world, (uint8_t)call->value[0]);
    return NULL;
}

static result_t set_foreign(const sim_call_t *call) {
    sim_foreign_t *const foreign = &call->world->foreign;
    const bool off = call->value[0] == 0;
    if (call->value[1] != OMITTED && off) {
        return SIM_USAGE;
    }
    if (call->value[1] != OMITTED) {
        foreign->setpoint.speed_mm_s = (int16_t)call->value[1];
    }
    if (call->value[0] == BUT_ONCE) {
        sim_world_foreign_once(call->world, call->now_us);
    } else {
        foreign->due_us = off ? IW_NEVER : call->now_us;
    }
    return NULL;
}

static result_t inject(const sim_call_t *call) {
    iw_can_frame_t frame;
    if (!sim_words_frame(call->words->word[1], &frame)) {
        return SIM_USAGE;
    }
    sim_world_inject(call->world, call->now_us, &frame);
    return NULL;
}

static result_t set_babble(const sim_call_t *call) {
    char text[16];
    iw_can_frame_t frame;
    (void)snprintf(text, sizeof text, "%.10s#", call->words->word[1]);
    if (!sim_words_frame(text, &frame)) {
        return SIM_USAGE;
    }
    frame.dlc = IW_CAN_DATA_MAX;
    call->world->babble =
        (sim_babble_t){(call->value[2] != 0) ? call->now_us : IW_NEVER, (uint32_t)call->value[1], frame};
    return NULL;
}

/// Action on a button: a pulse; or press and release (`on`); or, with `plug`, unplug and plug (`on`).
typedef struct {
    bool plug;
    bool pulses;
    bool on;
    iw_time_us_t until_us;
} action_t;

static result_t obey(const action_t *config, sim_button_t *button) {
    if (config->pulses && button->pressed) {
        return "the button is pressed already; first: estop release";
    }
    if (config->pulses) {
        sim_button_pulse(button, config->until_us);
    } else {
        (config->plug ? sim_button_unplug : sim_button_press)(button, config->on);
    }
    return NULL;
}

/// Applies the action to all contacts of the button.
static result_t obey_all(const action_t *config, const sim_hooks_t *hooks) {
    result_t result = (hooks->button != NULL) ? obey(config, hooks->button) : NULL;
    return (result == NULL && hooks->second != NULL) ? obey(config, hooks->second) : result;
}

/// Reads the action. Returns false if it does not exist. `span` is the duration of a pulse in us, or OMITTED.
static bool read_action(const sim_call_t *call, const char *action, int64_t span, action_t *out_config) {
    *out_config = (action_t){.pulses = strcmp(action, "pulse") == 0, .until_us = call->now_us + (iw_time_us_t)span};
    out_config->plug = sim_words_choice(action, (sim_choice_t){"unplug", "plug"}, &out_config->on);
    return out_config->pulses == (span != OMITTED) &&
           (out_config->pulses || out_config->plug ||
            sim_words_choice(action, (sim_choice_t){"press", "release"}, &out_config->on));
}

static result_t set_estop(const sim_call_t *call) {
    action_t config;
    return read_action(call, call->words->word[1], call->value[1], &config) ? obey_all(&config, &call->panel->hooks)
                                                                            : SIM_USAGE;
}

static result_t set_contact(const sim_call_t *call) {
    const sim_hooks_t *const hooks = &call->panel->hooks;
    sim_button_t *const button = (call->value[0] == 1) ? hooks->button : hooks->second;
    action_t config;
    if (!read_action(call, call->words->word[2], call->value[2], &config)) {
        return SIM_USAGE;
    }
    if (hooks->button != NULL && hooks->second == NULL) {
        return "the button has one contact; start the simulator with --estop2 PATH for another";
    }
    return (button != NULL) ? obey(&config, button) : NULL;
}

static result_t log_mark(const sim_call_t *call) {
    char text[SIM_LINE_BYTES] = "";
    size_t used = 0U;
    for (unsigned i = 2U; i < call->words->count; i++) {
        int const length = snprintf(&text[used], sizeof text - used, "%s%s", (i > 2U) ? " " : "", call->words->word[i]);
        used += (size_t)length;
    }
    if (call->panel->hooks.mark != NULL) {
        call->panel->hooks.mark(call->panel->hooks.context, text);
    }
    return NULL;
}

static result_t status(const sim_call_t *call) {
    char json[STATUS_BYTES];
    (void)sim_panel_status(call->panel, call->now_us, json, sizeof json);
    (void)snprintf(call->panel->answer, sizeof call->panel->answer, "ok %s\n", json);
    return NULL;
}

static result_t heal(const sim_call_t *call) {
    sim_hub_t *const hub = call->panel->hooks.hub;
    static const action_t repaired[] = {{.plug = true}, {.plug = false}};
    bool const was_off = call->world->bus_off;
    sim_world_heal(call->world, call->now_us);
    report(call, was_off ? SIM_ERROR_RESTARTED : SIM_ERROR_ACTIVE);
    if (hub != NULL) {
        sim_hub_down(hub, false);
    }
    (void)obey_all(&repaired[0], &call->panel->hooks);
    return obey_all(&repaired[1], &call->panel->hooks);
}

static result_t quit(const sim_call_t *call) {
    if (call->panel->hooks.quit != NULL) {
        call->panel->hooks.quit(call->panel->hooks.context);
    }
    return NULL;
}

#define WORD   .kind = SIM_WORD
#define SWITCH .kind = SIM_CHOICE, .word = "on", .other = "off", .also = "once", .value = BUT_ONCE
#define SPEED  .kind = SIM_WHOLE, .range = {INT16_MIN, INT16_MAX}, .optional = true, .value = OMITTED
#define PULSE  .kind = SIM_MILLI, .range = {100, PULSE_MAX_milli_ms}, .optional = true, .value = OMITTED

const sim_command_t sim_bus_commands[] = {
    {ONCE("ack", set_ack, {ON_OFF})},
    {ONCE("stall", set_stall, {ON_OFF})},
    {ONCE("busoff", set_busoff, {ON_OFF})},
    {ONCE("passive", set_passive, {ON_OFF})},
    {ONCE("bus", set_bus, {CHOICE("down", "up")})},
    {ONCE("queue", set_queue, {WHOLE(1, SIM_BUS_QUEUE_MAX)})},
    {ONCE("foreign", set_foreign, {SWITCH}, {SPEED})},
    {ONCE("frame", inject, {WORD})},
    {ONCE("babble", set_babble, {WORD}, {WHOLE(100, 10000000)}, {ON_OFF})},
    {ONCE("estop", set_estop, {WORD}, {PULSE})},
    {ONCE("contact", set_contact, {WHOLE(1, 2)}, {WORD}, {PULSE})},
    {ONCE("log", log_mark, {CHOICE("mark", "mark")}, {.kind = SIM_REST}), .asks = true},
    {ONCE("status", status, {0}), .asks = true},
    {ONCE("normal", heal, {0})},
    {ONCE("quit", quit, {0})},
    {.name = NULL},
};
