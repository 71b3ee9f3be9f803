// SPDX-License-Identifier: MIT
// The events of a scenario, drawn from its seed.
#include "daemon_world.h"

#include "iwheel_sim/random.h"

#include <string.h>

#define MS 1000U
#define S  1000000U

/// How an event of a kind is drawn. Spans are drawn so that short ones are as likely as long ones.
typedef struct {
    const char *name;
    uint32_t weight;
    uint32_t span_min_us;
    uint32_t span_max_us;
    int32_t a_min;
    int32_t a_max;
} draw_t;

static const draw_t draws[EV_KINDS] = {
    [EV_FAIL] = {"calls fail", 4, 5 * MS, 5 * S, 1, 300},
    [EV_STOP] = {"process does not run", 3, 1 * MS, 3 * S, 0, 0},
    [EV_LATE] = {"wake-ups are late", 2, 100 * MS, 5 * S, 100, 15000},
    [EV_NO_FD] = {"no descriptor is left", 1, 10 * MS, 3 * S, 0, 0},
    [EV_KILL] = {"killed", 3, 0, 0, 0, 0},
    [EV_TERM] = {"SIGTERM", 1, 0, 0, 0, 0},
    [EV_WALL] = {"wall clock leaps", 1, 0, 0, -4000, 4000},
    [EV_SUSPEND] = {"machine sleeps", 1, 50 * MS, 5 * S, 0, 0},
    [EV_PRESS] = {"e-stop pressed", 4, 100, 3 * S, 0, 0},
    [EV_NO_BUTTON] = {"e-stop's chip gone", 1, 1 * MS, 2 * S, 0, 0},
    [EV_DOWN] = {"interface down", 2, 500, 2 * S, 0, 0},
    [EV_GONE] = {"interface deleted", 1, 1 * MS, 2 * S, 0, 0},
    [EV_BUS_OFF] = {"bus-off", 2, 1 * MS, 2 * S, 0, 0},
    [EV_NO_ACK] = {"no acknowledgement", 1, 1 * MS, 2 * S, 0, 0},
    [EV_STALL] = {"bus accepts no frame", 2, 1 * MS, 1 * S, 0, 0},
    [EV_POWER] = {"wheels without power", 1, 20 * MS, 3 * S, 0, 0},
    [EV_FOREIGN] = {"second master", 1, 1 * MS, 1 * S, 0, 0},
    [EV_MUTE] = {"wheel offline", 2, 5 * MS, 2 * S, 0, 0},
    [EV_REBOOT] = {"wheel reboots", 1, 0, 0, 0, 0},
    [EV_BABBLE] = {"node babbles", 1, 10 * MS, 1 * S, 0, 2047},
    [EV_DRIVER] = {"client drives", 14, 1 * S, 12 * S, -1000, 1000},
    [EV_BLIND] = {"client streams blindly", 2, 50 * MS, 3 * S, -1000, 1000},
    [EV_NOISE] = {"client talks nonsense", 3, 100 * MS, 5 * S, 0, 0},
    [EV_WATCHER] = {"client watches", 3, 1 * S, 10 * S, 0, 0},
};

const char *scenario_kind_name(unsigned kind) {
    return draws[kind].name;
}

static uint32_t between(sim_random_t *random, uint32_t low, uint32_t high) {
    return low + sim_random_below(random, high - low + 1U);
}

static uint32_t draw_span(sim_random_t *random, uint32_t low, uint32_t high) {
    uint32_t top = high;
    while (top / 2U > low && sim_random_below(random, 2U) == 0U) {
        top /= 2U;
    }
    return between(random, low, top);
}

static uint8_t draw_kind(sim_random_t *random) {
    uint32_t sum = 0;
    for (unsigned kind = 0; kind < EV_KINDS; kind++) {
        sum += draws[kind].weight;
    }
    uint32_t rest = sim_random_below(random, sum);
    unsigned kind = 0;
    while (rest >= draws[kind].weight) {
        rest -= draws[kind++].weight;
    }
    return (uint8_t)kind;
}

static void draw_event(event_t *event, sim_random_t *random) {
    event->kind = draw_kind(random);
    const draw_t *draw = &draws[event->kind];
    const uint32_t width = (uint32_t)(draw->a_max - draw->a_min);
    event->span_us = draw_span(random, draw->span_min_us, draw->span_max_us);
    event->a = draw->a_min + (int32_t)between(random, 0, width);
    event->b = draw->a_min + (int32_t)between(random, 0, width);
    event->who = (uint8_t)sim_random_below(random, 2);
    event->style = (uint8_t)sim_random_below(random, 12);
}

static void draw_config(iw_config_t *config, sim_random_t *random) {
    iw_config_default(config);
    config->setpoint_type = 1;
    config->setpoint_type_set = true;
    config->current_role = IW_ROLE_LIMIT;
    config->track_mm = 540;
    if (sim_random_below(random, 2) == 0U) {
        config->period_ms = (uint16_t)between(random, 8, 40);
        config->lease_ms = (uint16_t)between(random, 120, 300);
        config->accel_mm_s2 = (uint16_t)between(random, 400, 4000);
        config->decel_mm_s2 = (uint16_t)between(random, 2000, 8000);
        config->max_speed_mm_s = (uint16_t)between(random, 300, 1200);
    }
}

void scenario_draw(scenario_t *self, uint64_t seed) {
    sim_random_t random;
    memset(self, 0, sizeof *self);
    sim_random_init(&random, seed);
    self->seed = seed;
    draw_config(&self->config, &random);
    self->restart_us = 100U * MS;
    self->watchdog = sim_random_below(&random, 2) == 0U;
    self->may_restart = sim_random_below(&random, 4) != 0U;
    iw_time_us_t at_us = WORLD_START_US + 1500U * MS;
    const size_t count = between(&random, 20, WORLD_EVENTS - 2U);
    const uint32_t apart_us = between(&random, 300, 2500) * MS;
    for (size_t i = 0; i < count; i++) {
        draw_event(&self->event[i], &random);
        self->event[i].at_us = at_us;
        at_us += sim_random_below(&random, 2U * apart_us);
    }
    self->count = count;
    self->chaos_us = at_us + 1U * S;
}

/// Draws drives of all kinds one after the other; the process is killed in calls that daemon_world.c selects.
void scenario_kills(scenario_t *self, uint64_t seed, uint32_t lives) {
    sim_random_t random;
    memset(self, 0, sizeof *self);
    sim_random_init(&random, seed);
    self->seed = seed;
    iw_config_default(&self->config);
    self->config.setpoint_type = 1;
    self->config.setpoint_type_set = true;
    self->config.current_role = IW_ROLE_LIMIT;
    self->config.track_mm = 540;
    self->restart_us = 100U * MS;
    self->watchdog = self->may_restart = self->kills = true;
    self->kill_lives = lives;
    self->chaos_us = IW_NEVER;
}

void scenario_print(const scenario_t *self, FILE *out) {
    const iw_config_t *config = &self->config;
    (void)fprintf(out, "period %u ms, lease %u ms, %u and %u mm/s2, %u mm/s; %s watchdog, %s purge\n",
                  config->period_ms, config->lease_ms, config->accel_mm_s2, config->decel_mm_s2, config->max_speed_mm_s,
                  self->watchdog ? "a" : "no", self->may_restart ? "may" : "may not");
    for (size_t i = 0; i < self->count; i++) {
        const event_t *event = &self->event[i];
        (void)fprintf(out, "  %11.6f s  %s", (double)event->at_us / 1e6, draws[event->kind].name);
        if (event->span_us > 0U) {
            (void)fprintf(out, " for %.3f ms", (double)event->span_us / 1e3);
        }
        (void)fprintf(out, "; %d %d %u %u\n", event->a, event->b, event->who, event->style);
    }
}
