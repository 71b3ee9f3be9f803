// SPDX-License-Identifier: MIT
// Commands that concern the bus, other nodes, the button and the simulator itself.
#include "command.h"

#include <stdio.h>
#include <string.h>

#define PULSE_MAX_milli_ms 60000000
#define STATUS_BYTES       4096U

typedef const char *result_t;

static const sim_choice_t on_off = {"on", "off"};

static bool switched(const sim_call_t *call, bool *out_on) {
    return sim_words_choice(call->words->word[1], on_off, out_on);
}

static void tell(const sim_call_t *call, sim_error_t error) {
    if (call->panel->hooks.hub != NULL) {
        iw_can_frame_t const frame = sim_hub_error_frame(error);
        sim_hub_tell(call->panel->hooks.hub, &frame);
    }
}

static result_t set_ack(const sim_call_t *call) {
    bool on = false;
    if (!switched(call, &on)) {
        return SIM_USAGE;
    }
    sim_world_ack(call->world, call->now_us, on);
    return NULL;
}

static result_t set_stall(const sim_call_t *call) {
    bool on = false;
    if (!switched(call, &on)) {
        return SIM_USAGE;
    }
    sim_bus_stall(&call->world->bus, call->now_us, on);
    return NULL;
}

static result_t set_busoff(const sim_call_t *call) {
    bool on = false;
    if (!switched(call, &on)) {
        return SIM_USAGE;
    }
    sim_world_bus_off(call->world, call->now_us, on);
    tell(call, on ? SIM_ERROR_BUS_OFF : SIM_ERROR_RESTARTED);
    return NULL;
}

static result_t set_passive(const sim_call_t *call) {
    bool on = false;
    if (!switched(call, &on)) {
        return SIM_USAGE;
    }
    tell(call, on ? SIM_ERROR_PASSIVE : SIM_ERROR_ACTIVE);
    return NULL;
}

static result_t set_bus(const sim_call_t *call) {
    bool down = false;
    if (!sim_words_choice(call->words->word[1], (sim_choice_t){"down", "up"}, &down)) {
        return SIM_USAGE;
    }
    if (call->panel->hooks.hub != NULL) {
        sim_hub_down(call->panel->hooks.hub, down);
    }
    return NULL;
}

static result_t set_queue(const sim_call_t *call) {
    int64_t depth = 0;
    if (!sim_words_integer(call->words->word[1], (sim_range_t){1, SIM_BUS_QUEUE_MAX}, &depth)) {
        return SIM_USAGE;
    }
    sim_world_queue(call->world, (uint8_t)depth);
    return NULL;
}

static result_t set_foreign(const sim_call_t *call) {
    const sim_words_t *const words = call->words;
    bool on = false;
    bool const once = strcmp(words->word[1], "once") == 0;
    int64_t speed_mm_s = call->world->foreign.setpoint.speed_mm_s;
    if (!once && !switched(call, &on)) {
        return SIM_USAGE;
    }
    if (words->count == 3U &&
        !((on || once) && sim_words_integer(words->word[2], (sim_range_t){INT16_MIN, INT16_MAX}, &speed_mm_s))) {
        return SIM_USAGE;
    }
    call->world->foreign.setpoint.speed_mm_s = (int16_t)speed_mm_s;
    if (once) {
        sim_world_foreign_once(call->world, call->now_us);
    } else {
        call->world->foreign.due_us = on ? call->now_us : IW_NEVER;
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
    const sim_words_t *const words = call->words;
    char text[16];
    int64_t period_us = 0;
    bool on = false;
    iw_can_frame_t frame;
    (void)snprintf(text, sizeof text, "%.10s#", words->word[1]);
    if (!sim_words_frame(text, &frame) ||
        !sim_words_integer(words->word[2], (sim_range_t){100, 10000000}, &period_us) ||
        !sim_words_choice(words->word[3], on_off, &on)) {
        return SIM_USAGE;
    }
    frame.dlc = IW_CAN_DATA_MAX;
    call->world->babble = (sim_babble_t){on ? call->now_us : IW_NEVER, (uint32_t)period_us, frame};
    return NULL;
}

static result_t press(const sim_call_t *call) {
    const char *const action = call->words->word[1];
    sim_button_t *const button = call->panel->hooks.button;
    bool pressed = false;
    if (call->words->count != 2U || !sim_words_choice(action, (sim_choice_t){"press", "release"}, &pressed)) {
        return SIM_USAGE;
    }
    if (button != NULL) {
        sim_button_press(button, pressed);
    }
    return NULL;
}

static result_t set_estop(const sim_call_t *call) {
    const char *const action = call->words->word[1];
    sim_button_t *const button = call->panel->hooks.button;
    int64_t milli_ms = 0;
    bool unplug = false;
    if (sim_words_choice(action, (sim_choice_t){"unplug", "plug"}, &unplug) && call->words->count == 2U) {
        if (button != NULL) {
            sim_button_unplug(button, unplug);
        }
        return NULL;
    }
    if (strcmp(action, "pulse") != 0) {
        return press(call);
    }
    if (call->words->count != 3U ||
        !sim_words_milli(call->words->word[2], (sim_range_t){100, PULSE_MAX_milli_ms}, &milli_ms)) {
        return SIM_USAGE;
    }
    if (button != NULL && button->pressed) {
        return "the button is pressed already; first: estop release";
    }
    if (button != NULL) {
        sim_button_pulse(button, call->now_us + (iw_time_us_t)milli_ms);
    }
    return NULL;
}

static result_t log_mark(const sim_call_t *call) {
    char text[SIM_LINE_BYTES] = "";
    size_t used = 0U;
    if (strcmp(call->words->word[1], "mark") != 0) {
        return SIM_USAGE;
    }
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
    sim_button_t *const button = call->panel->hooks.button;
    bool const was_off = call->world->bus_off;
    sim_world_heal(call->world, call->now_us);
    tell(call, was_off ? SIM_ERROR_RESTARTED : SIM_ERROR_ACTIVE);
    if (hub != NULL) {
        sim_hub_down(hub, false);
    }
    if (button != NULL) {
        sim_button_unplug(button, false);
        sim_button_press(button, false);
    }
    return NULL;
}

static result_t quit(const sim_call_t *call) {
    if (call->panel->hooks.quit != NULL) {
        call->panel->hooks.quit(call->panel->hooks.context);
    }
    return NULL;
}

const sim_command_t sim_bus_commands[] = {
    {"ack", "on|off", "off: frames of clients are not acknowledged, telemetry goes on", set_ack, 2U, 2U, SIM_CHANGED},
    {"stall", "on|off", "on: the bus takes no frame from anybody", set_stall, 2U, 2U, SIM_CHANGED},
    {"busoff", "on|off", "clients' controllers are bus-off; off: restarted", set_busoff, 2U, 2U, SIM_CHANGED},
    {"passive", "on|off", "tells clients error passive or active, nothing else", set_passive, 2U, 2U, SIM_CHANGED},
    {"bus", "down|up", "down: closes all connections and takes none", set_bus, 2U, 2U, SIM_CHANGED},
    {"queue", "N", "frames a client's adapter holds, 1..64 (4)", set_queue, 2U, 2U, SIM_CHANGED},
    {"foreign", "on|off|once [MM_S]", "another node sends setpoints (300 mm/s)", set_foreign, 2U, 3U, SIM_CHANGED},
    {"frame", "ID#DATA|ID#R", "another node sends a frame; ID 3 or 8 hex digits", inject, 2U, 2U, SIM_CHANGED},
    {"babble", "ID PERIOD_US on|off", "another node floods; PERIOD_US from 100", set_babble, 4U, 4U, SIM_CHANGED},
    {"estop", "press|release|pulse MS|unplug|plug", "the button, or its wire", set_estop, 2U, 3U, SIM_CHANGED},
    {"log", "mark TEXT", "writes TEXT into the log as a comment", log_mark, 3U, SIM_WORDS_MAX, SIM_ASKED},
    {"status", "", "what is true now, as one line of JSON", status, 1U, 1U, SIM_ASKED},
    {"normal", "", "undoes every fault, releases the button", heal, 1U, 1U, SIM_CHANGED},
    {"quit", "", "ends the simulator", quit, 1U, 1U, SIM_CHANGED},
};
const unsigned sim_bus_command_count = sizeof sim_bus_commands / sizeof sim_bus_commands[0];
