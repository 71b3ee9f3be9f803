// SPDX-License-Identifier: MIT
#include "panel.h"

#include <inttypes.h>
#include <stdarg.h>
#include <stdio.h>

typedef struct {
    char *out;
    size_t size;
    size_t used;
} text_t;

__attribute__((format(printf, 2, 3))) static void add(text_t *text, const char *format, ...) {
    va_list arguments;
    va_start(arguments, format);
    int const length = vsnprintf(&text->out[text->used], text->size - text->used, format, arguments);
    va_end(arguments);
    text->used += (size_t)length;
    if (text->used >= text->size) {
        text->used = text->size - 1U;
    }
}

static const char *truth(bool value) {
    return value ? "true" : "false";
}

static void add_setpoint(text_t *text, const sim_motion_t *motion, iw_time_us_t now_us) {
    if (motion->received_us == IW_NEVER) {
        add(text, "\"setpoint\":null,\"setpoint_age_ms\":null,");
        return;
    }
    add(text, "\"setpoint\":{\"type\":%u,\"speed_mm_s\":%d,\"current_mA\":%d},\"setpoint_age_ms\":%" PRIu64 ",",
        (unsigned)motion->setpoint.type, motion->setpoint.speed_mm_s, motion->setpoint.current_mA,
        (now_us - motion->received_us) / IW_US_PER_MS);
}

static void add_wheel(text_t *text, const sim_wheel_t *wheel, iw_time_us_t now_us) {
    static const char *const state[] = {"off", "booting", "running"};
    sim_motion_t motion = wheel->motion;
    sim_motion_advance(&motion, now_us);
    add(text, "{\"state\":\"%s\",\"boots\":%" PRIu32 ",\"speed_mm_s\":%" PRId32 ",\"position_mm\":%" PRId64 ",",
        state[wheel->state], wheel->boots, sim_motion_true_mm_s(&motion), sim_motion_true_mm(&motion));
    add_setpoint(text, &motion, now_us);
    add(text,
        "\"driven\":%s,\"setpoints\":%" PRIu32 ",\"ticks\":%" PRId32 ",\"load_mN\":%" PRId32 ",\"lost\":%" PRIu32
        ",\"muted\":%s,\"blocked\":%s,",
        truth(motion.driven), motion.setpoints, (int32_t)motion.ticks, wheel->force.load_mN, wheel->lost,
        truth(wheel->muted), truth(wheel->motion.blocked));
    add(text,
        "\"frames\":{\"speed\":%" PRIu32 ",\"status\":%" PRIu32 ",\"pose\":%" PRIu32 ",\"force\":%" PRIu32
        ",\"offset\":%" PRIu32 "}}",
        wheel->sent[SIM_TELEMETRY_SPEED], wheel->sent[SIM_TELEMETRY_STATUS], wheel->sent[SIM_TELEMETRY_POSE],
        wheel->sent[SIM_TELEMETRY_FORCE], wheel->sent[SIM_TELEMETRY_OFFSET]);
}

static void add_bus(text_t *text, const sim_world_t *world) {
    add(text, "{\"ack\":%s,\"stalled\":%s,\"off\":%s,\"queue\":%u,\"dropped\":%" PRIu32 ",\"busy_us\":%" PRIu64 ",",
        truth(world->bus.acknowledged), truth(world->bus.stalled), truth(world->bus_off), (unsigned)world->queue_depth,
        world->dropped, world->bus.busy_us);
    add(text, "\"foreign\":%s,\"babble\":%s", truth(world->foreign.due_us != IW_NEVER),
        truth(world->babble.due_us != IW_NEVER));
}

static const char *button_word(const sim_button_t *button) {
    return button->unplugged ? "unplugged" : button->pressed ? "pressed" : "released";
}

size_t sim_panel_status(const sim_panel_t *self, iw_time_us_t now_us, char *out, size_t size) {
    text_t text = {out, size, 0U};
    const sim_world_t *const world = self->world;
    const sim_hub_t *const hub = self->hooks.hub;
    const sim_button_t *const button = self->hooks.button;
    add(&text, "{\"t_us\":%" PRIu64 ",\"power\":%s,\"battery_dV\":%u,\"left\":", now_us, truth(world->pair.power),
        (unsigned)sim_pair_battery_dV(&world->pair));
    add_wheel(&text, &world->pair.wheel[IW_LEFT], now_us);
    add(&text, ",\"right\":");
    add_wheel(&text, &world->pair.wheel[IW_RIGHT], now_us);
    add(&text, ",\"bus\":");
    add_bus(&text, world);
    if (hub != NULL) {
        add(&text, ",\"down\":%s,\"clients\":%" PRIu32 ",\"lost_by_readers\":%" PRIu32 ",\"malformed\":%" PRIu32,
            truth(hub->down), hub->clients, hub->lost, hub->malformed);
    }
    add(&text, "}");
    if (button != NULL) {
        add(&text, ",\"estop\":\"%s\"", button_word(button));
    }
    if (self->hooks.second != NULL) {
        add(&text, ",\"estop2\":\"%s\"", button_word(self->hooks.second));
    }
    add(&text, "}");
    return text.used;
}
