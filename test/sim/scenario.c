// SPDX-License-Identifier: MIT
#include "scenario.h"

#include "iwheel_sim/random.h"

#include <stdlib.h>
#include <string.h>

#define S  1000000U
#define MS 1000U

/// How an event of a kind is drawn. Spans are drawn log-uniformly, so that short ones are as likely as long ones.
typedef struct {
    const char *name;
    uint32_t span_min_us;
    uint32_t span_max_us;
    int32_t a_min;
    int32_t a_max;
    uint8_t who; ///< Number of choices.
} draw_t;

static const draw_t draws[EV_KINDS] = {
    [EV_ESTOP] = {"e-stop pressed", 1 * MS, 3 * S, 0, 0, 1},
    [EV_ESTOP_GONE] = {"e-stop line unreadable", 1 * MS, 1 * S, 0, 0, 1},
    [EV_BUS_DOWN] = {"bus down", 1 * MS, 2 * S, 0, 0, 1},
    [EV_BUS_OFF] = {"bus-off", 1 * MS, 2 * S, 0, 0, 1},
    [EV_PASSIVE] = {"error passive", 1 * MS, 2 * S, 0, 0, 1},
    [EV_NO_ACK] = {"no acknowledgement", 1 * MS, 14 * S, 0, 0, 1},
    [EV_BUS_STALL] = {"bus accepts no frame", 1 * MS, 1 * S, 0, 0, 1},
    [EV_TX_FULL] = {"port accepts no frame", 1 * MS, 1 * S, 0, 0, 1},
    [EV_TX_RIGHT] = {"port accepts no frame for the right", 1 * MS, 1 * S, 0, 0, 1},
    [EV_TX_HOLD] = {"adapter delays sent frames", 50 * MS, 3 * S, 200, 120 * MS, 1},
    [EV_TX_LOST] = {"adapter swallows frames", 0, 0, 1, 4, 1},
    [EV_RX_HOLD] = {"adapter delivers late", 50 * MS, 3 * S, 200, 60 * MS, 1},
    [EV_ECHO_LOST] = {"echoes lost", 0, 0, 1, 3, 1},
    [EV_FOREIGN] = {"second master", 1, 1 * S, 0, 0, 1},
    [EV_BABBLE] = {"babbling node", 10 * MS, 1 * S, 0, 2047, 1},
    [EV_ODD_FRAMES] = {"odd frames", 0, 0, 1, 20, 1},
    [EV_MUTE] = {"wheel offline", 5 * MS, 2 * S, 0, 0, 2},
    [EV_REBOOT] = {"wheel reboots", 0, 0, 3 * MS, 800 * MS, 2},
    [EV_POWER] = {"wheels without power", 20 * MS, 14 * S, 0, 0, 1},
    [EV_LOSS] = {"wheel loses frames", 100 * MS, 5 * S, 10, 950, 2},
    [EV_SWAP] = {"wheel reports the wrong sign", 100 * MS, 5 * S, 0, 0, 3},
    [EV_BLOCK] = {"wheel blocked", 100 * MS, 5 * S, 0, 0, 3},
    [EV_RUNAWAY] = {"wheel too fast", 100 * MS, 14 * S, 100, 2500, 3},
    [EV_FREE] = {"wheel coasts", 100 * MS, 5 * S, 0, 0, 3},
    [EV_DROOP] = {"wheel slow", 100 * MS, 5 * S, 100, 900, 3},
    [EV_LATE] = {"wheel late", 100 * MS, 5 * S, 20 * MS, 400 * MS, 3},
    [EV_FORCE] = {"force absurd", 100 * MS, 5 * S, -32768, 32767, 2},
    [EV_LOOP_STALL] = {"loop stalls", 10 * MS, 3 * S, 0, 0, 1},
    [EV_LOOP_SLOW] = {"loop slow", 50 * MS, 2 * S, 500, 150 * MS, 1},
    [EV_CRASH] = {"gateway crashes", 5 * MS, 1 * S, 0, 0, 1},
    [EV_TIMING] = {"bus timing contradicted", 10 * MS, 1 * S, 0, 0, 1},
    [EV_GOOD_CLIENT] = {"client drives", 200 * MS, 15 * S, -1200, 1200, SCENARIO_CLIENTS},
    [EV_BLIND] = {"client streams blindly", 50 * MS, 5 * S, -1200, 1200, SCENARIO_CLIENTS},
    [EV_FIGHT] = {"client wants takeover", 50 * MS, 3 * S, 0, 0, SCENARIO_CLIENTS},
    [EV_RESETS] = {"client resets again and again", 50 * MS, 3 * S, 0, 0, SCENARIO_CLIENTS},
    [EV_ONE_DRIVE] = {"one drive", 0, 0, -1500, 1500, SCENARIO_CLIENTS},
    [EV_ONE_ARM] = {"one arm", 0, 0, 0, 1, SCENARIO_CLIENTS},
    [EV_ONE_RESET] = {"one reset", 0, 0, 0, 0, SCENARIO_CLIENTS},
    [EV_ONE_STOP] = {"one stop", 0, 0, 0, 1, SCENARIO_CLIENTS},
    [EV_ONE_ESTOP] = {"software e-stop", 0, 0, 0, 0, SCENARIO_CLIENTS},
    [EV_DISCONNECT] = {"client disconnects", 0, 0, 0, 0, SCENARIO_CLIENTS},
    [EV_TARE] = {"tare", 0, 0, 0, 0, 2},
    [EV_ONE_RELEASE] = {"one release", 0, 0, 0, 0, SCENARIO_CLIENTS},
};

const char *scenario_kind_name(unsigned kind) {
    return draws[kind].name;
}

static uint32_t between(sim_random_t *random, uint32_t low, uint32_t high) {
    return low + sim_random_below(random, high - low + 1U);
}

static bool chance(sim_random_t *random, uint32_t percent) {
    return sim_random_below(random, 100U) < percent;
}

static uint32_t log_span(sim_random_t *random, uint32_t low, uint32_t high) {
    uint32_t doublings = 0;
    if (high <= low) {
        return low;
    }
    while (doublings < 31U && (low << (doublings + 1U)) <= high && (low << (doublings + 1U)) > low) {
        doublings++;
    }
    const uint32_t base = low << sim_random_below(random, doublings + 1U);
    return (base < high / 2U) ? between(random, base, 2U * base) : between(random, base, high);
}

/// Depends on the seed: the default configuration, or limits that all, one or hardly any commands reach.
static const struct {
    uint16_t max_mrad_s;
    uint16_t accel_mrad_s2;
    uint16_t track_mm;
} yaws[] = {{1000, 2000, 540}, {300, 500, 400}, {1500, 8000, 700}, {5000, 10000, 1500}};

static void draw_config(scenario_t *self, sim_random_t *random) {
    iw_config_t *const config = &self->config;
    iw_config_default(config);
    config->setpoint_type = (uint8_t)sim_random_next(random);
    config->setpoint_type_set = true;
    config->current_role = chance(random, 60) ? IW_ROLE_LIMIT : IW_ROLE_SETPOINT;
    if (chance(random, 70)) {
        config->period_ms = (uint16_t)between(random, 5, 50);
        config->lease_ms = (uint16_t)between(random, 100, 400);
        config->accel_mm_s2 = (uint16_t)between(random, 400, 4000);
        config->decel_mm_s2 = (uint16_t)between(random, 1500, 8000);
        config->max_speed_mm_s = (uint16_t)between(random, 300, 1500);
        config->max_current_mA = (uint16_t)between(random, 300, 2000);
        config->zero_hold_ms = (uint16_t)between(random, 1100, 2000);
        config->echo_ms = (uint16_t)between(random, 20, 90);
        config->setpoint_dlc = (uint16_t)between(random, 5, 8);
    }
    // A slower wheel needs limits that match.
    config->wheel_lag_ms = (uint16_t)(60U + self->slow_permille * 2U / 1000U);
    config->pair_mm = (uint16_t)(60U + self->seed % 4U * 30U);
    config->min_current_mA = (uint16_t)(300U + self->seed % 5U * 200U);
    if (config->min_current_mA > config->max_current_mA) {
        config->min_current_mA = config->max_current_mA;
    }
    config->hold_max_s = (uint16_t)(10U + self->seed % 3U * 8U);
    config->asymmetric_current = self->seed % 7U == 3U;
    config->hold = self->seed % 5U == 2U;
    config->max_yaw_mrad_s = yaws[self->seed / 4U % 4U].max_mrad_s;
    config->yaw_accel_mrad_s2 = yaws[self->seed / 4U % 4U].accel_mrad_s2;
    config->track_mm = (self->seed % 41U == 17U) ? 0U : yaws[self->seed / 4U % 4U].track_mm;
    if (self->slow_permille > 1000U) {
        config->wheel_silent_ms = (uint16_t)between(random, self->slow_permille * 4U / 1000U * 3U, 200);
    } else if (chance(random, 50)) {
        config->wheel_silent_ms = (uint16_t)between(random, 20, 150);
    }
    config->invert[IW_LEFT] = chance(random, 30);
    config->invert[IW_RIGHT] = chance(random, 50);
    if (iw_config_check(config) != IW_CONFIG_OK) {
        config->lease_ms = 200;
        config->decel_mm_s2 = 4000;
        config->max_speed_mm_s = 1000;
    }
}

static void draw_event(event_t *event, unsigned kind, sim_random_t *random) {
    const draw_t *const draw = &draws[kind];
    const uint32_t reach = (uint32_t)(draw->a_max - draw->a_min);
    event->kind = (uint8_t)kind;
    event->who = (uint8_t)sim_random_below(random, draw->who);
    event->span_us = log_span(random, draw->span_min_us, draw->span_max_us);
    event->a = draw->a_min + (int32_t)sim_random_below(random, reach + 1U);
    event->b = draw->a_min + (int32_t)sim_random_below(random, reach + 1U);
    event->style = (uint8_t)sim_random_next(random);
    if (kind == EV_FOREIGN && chance(random, 50)) {
        event->span_us = 0;
    } else if (kind == EV_BABBLE) {
        event->a = chance(random, 50) ? (int32_t)sim_random_below(random, 250) : 600 + event->a % 1400;
        event->b = (int32_t)(chance(random, 40) ? between(random, 80, 119) : between(random, 120, 2000));
    } else if (kind == EV_ONE_DRIVE && chance(random, 20)) {
        event->b *= 40000;
    }
}

/// Draws events of one kind, spread over the run.
static void draw_kind(scenario_t *self, unsigned kind, uint32_t number, sim_random_t *random) {
    for (uint32_t i = 0; i < number && self->count < SCENARIO_EVENTS; i++) {
        event_t *const event = &self->event[self->count++];
        // One draw per statement: C leaves the order of evaluation inside an expression open.
        event->at_us = sim_random_below(random, (uint32_t)(self->chaos_us / MS)) * (iw_time_us_t)MS;
        event->at_us += sim_random_below(random, MS);
        draw_event(event, kind, random);
    }
}

/// A total order, so that every library sorts in the same way.
static int by_time(const void *a, const void *b) {
    const event_t *const one = a;
    const event_t *const other = b;
    const int64_t order[] = {
        (one->at_us == other->at_us) ? 0 : ((one->at_us < other->at_us) ? -1 : 1),
        (int64_t)one->kind - other->kind,
        (int64_t)one->who - other->who,
        (int64_t)one->span_us - other->span_us,
        (int64_t)one->a - other->a,
        (int64_t)one->b - other->b,
        (int64_t)one->style - other->style,
    };
    for (size_t i = 0; i < sizeof order / sizeof order[0]; i++) {
        if (order[i] != 0) {
            return (order[i] < 0) ? -1 : 1;
        }
    }
    return 0;
}

/// Depends on the seed: well within the allowed range, barely within, beyond it, and almost shorted.
static const iw_time_us_t contact_lags_ms[] = {0, 90, 180, 300, 10000};

void scenario_draw(scenario_t *self, uint64_t seed) {
    sim_random_t random;
    memset(self, 0, sizeof *self);
    sim_random_init(&random, seed);
    self->seed = seed;
    self->two_contacts = seed % 9U == 4U;
    self->contact_lag_us = contact_lags_ms[seed / 9U % 5U] * MS;
    self->chaos_us = (iw_time_us_t)between(&random, 30, 150) * S;
    self->slow_permille = (seed % 10U == 0U) ? 1000U : between(&random, 4, 12) * 1000U;
    self->age_us = chance(&random, 50) ? (uint64_t)between(&random, 1, 200) * S : 0U;
    self->wake_latency_us = chance(&random, 50) ? between(&random, 0, 2000) : 0U;
    self->rx_depth = chance(&random, 80) ? 278U : 2000U;
    self->can_purge = chance(&random, 50);
    self->echo_early = chance(&random, 10);
    self->requests_first = chance(&random, 50);
    self->offset_us = 60U * (iw_time_us_t)S;
    if (chance(&random, 40)) {
        self->offset_us = chance(&random, 50) ? IW_NEVER : between(&random, 50, 120) * (iw_time_us_t)S;
    }
    draw_config(self, &random);
    const uint32_t minutes4 = (uint32_t)(self->chaos_us / (15U * S)) + 1U;
    const uint32_t rate = between(&random, 1, 3);
    for (unsigned kind = 0; kind < EV_KINDS; kind++) {
        if ((kind < EV_GOOD_CLIENT) ? chance(&random, 25) : chance(&random, 40)) {
            draw_kind(self, kind, between(&random, 1, minutes4 * rate), &random);
        }
    }
    draw_kind(self, EV_GOOD_CLIENT, minutes4 * between(&random, 1, 4), &random);
    qsort(self->event, self->count, sizeof self->event[0], by_time);
}

void scenario_print(const scenario_t *self, FILE *out) {
    const iw_config_t *const c = &self->config;
    fprintf(
        out,
        "seed %llu: period %u ms, lease %u ms, accel %u mm/s2, decel %u mm/s2, max %u mm/s %u mA, hold %u ms, "
        "silent %u ms, echo %u ms, current %s, invert %d %d, telemetry x%u, offset frames for %d s, wake-up within %u "
        "us%s%s%s%s\n",
        (unsigned long long)self->seed, c->period_ms, c->lease_ms, c->accel_mm_s2, c->decel_mm_s2, c->max_speed_mm_s,
        c->max_current_mA, c->zero_hold_ms, c->wheel_silent_ms, c->echo_ms,
        (c->current_role == IW_ROLE_LIMIT) ? "limit" : "setpoint", c->invert[0], c->invert[1],
        self->slow_permille / 1000U, (self->offset_us == IW_NEVER) ? -1 : (int)(self->offset_us / S),
        self->wake_latency_us, self->can_purge ? ", purges" : "", self->echo_early ? ", echo unproven" : "",
        self->requests_first ? ", requests before step" : "", self->two_contacts ? ", two contacts" : "");
    for (size_t i = 0; i < self->count; i++) {
        const event_t *const e = &self->event[i];
        fprintf(out, "  %11.6f s  %-34s", (double)(SCENARIO_START_US + e->at_us) / 1e6, draws[e->kind].name);
        if (draws[e->kind].who > 1U) {
            fprintf(out, " #%u", e->who);
        }
        if (e->span_us > 0U) {
            fprintf(out, " for %.3f ms", (double)e->span_us / 1e3);
        }
        if (draws[e->kind].a_max != 0) {
            fprintf(out, " (%d, %d)", e->a, e->b);
        }
        fprintf(out, "\n");
    }
}
