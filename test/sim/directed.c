// SPDX-License-Identifier: MIT
#include "directed.h"

#include "rig.h"

#include <stdlib.h>
#include <string.h>

#define MS 1000U
#define S  1000000U
/// Interval of frames that leaves no gap: a frame of 8 bytes lasts 120 us.
#define BABBLE_US 100

typedef struct {
    int32_t id;
    iw_cause_t stop; ///< The only cause that may stop the wheels.
} babble_t;

/// Setpoints are 266 and 298. A wheel whose force frame (512, 544) never gets onto the bus sends no later frame either.
static const babble_t babbles[] = {
    {0, IW_CAUSE_SEND_STALLED},   {100, IW_CAUSE_SEND_STALLED}, {255, IW_CAUSE_SEND_STALLED},
    {265, IW_CAUSE_SEND_STALLED}, {267, IW_CAUSE_SEND_STALLED}, {297, IW_CAUSE_SEND_STALLED},
    {299, IW_CAUSE_WHEEL_LOST},   {511, IW_CAUSE_WHEEL_LOST},   {546, IW_CAUSE_NONE},
    {600, IW_CAUSE_NONE},         {2047, IW_CAUSE_NONE},
};

typedef struct {
    const char *name;
    uint8_t kind; ///< An event_kind_t.
    uint8_t who;  ///< A wheel, or 2: both.
    int32_t a;
    iw_cause_t stop; ///< The cause that must stop the wheels.
} follow_t;

/// Wheels that do not follow, while one step in each 100 ms is late.
static const follow_t follows[] = {
    {"left wheel blocked", EV_BLOCK, IW_LEFT, 0, IW_CAUSE_PAIR_DIVERGES},
    {"right wheel slow", EV_DROOP, IW_RIGHT, 500, IW_CAUSE_PAIR_DIVERGES},
    {"both wheels blocked", EV_BLOCK, 2, 0, IW_CAUSE_WHEEL_BLOCKED},
    {"both wheels too fast", EV_RUNAWAY, 2, 500, IW_CAUSE_OVERSPEED},
    {"both wheels backwards", EV_SWAP, 2, 0, IW_CAUSE_FEEDBACK_SIGN},
    {"both wheels as commanded", EV_DROOP, 2, 0, IW_CAUSE_NONE},
};

/// A client drives for six seconds. Later events are added.
static void write_scenario(scenario_t *scenario) {
    memset(scenario, 0, sizeof *scenario);
    scenario->seed = 1;
    scenario->chaos_us = 8U * S;
    scenario->age_us = 100U * S;
    scenario->slow_permille = 1000;
    scenario->offset_us = 60U * S;
    scenario->rx_depth = 2000;
    iw_config_default(&scenario->config);
    scenario->config.setpoint_type = 1;
    scenario->config.setpoint_type_set = true;
    scenario->config.current_role = IW_ROLE_LIMIT;
    scenario->config.track_mm = 540;
    scenario->event[0] =
        (event_t){.at_us = 500U * MS, .span_us = 6U * S, .a = 400, .b = 300, .kind = EV_GOOD_CLIENT, .style = 3U};
    scenario->count = 1;
}

/// Meanwhile a node babbles for two seconds.
static bool play_babble(const babble_t *babble) {
    static scenario_t scenario;
    static rig_result_t result;
    write_scenario(&scenario);
    scenario.config.wheel_silent_ms = 200; // A missing echo is detected before missing telemetry.
    scenario.event[scenario.count++] =
        (event_t){.at_us = 3U * S, .span_us = 2U * S, .a = babble->id, .b = BABBLE_US, .kind = EV_BABBLE};
    rig_play(&scenario, IW_NEVER, &result);
    const uint64_t stalls = result.stats.stops[IW_CAUSE_SEND_STALLED];
    const uint64_t lost = result.stats.stops[IW_CAUSE_WHEEL_LOST];
    const bool good = result.rule == ORACLE_NO_RULE && stalls == (babble->stop == IW_CAUSE_SEND_STALLED) &&
                      lost == (babble->stop == IW_CAUSE_WHEEL_LOST);
    printf("%-6s id %4d babbles: %llu times send stalled, %llu times a wheel lost, rule %u %s\n",
           good ? "ok" : "FAILED", babble->id, (unsigned long long)stalls, (unsigned long long)lost, result.rule,
           result.text);
    return good;
}

/// Meanwhile the wheels do not follow for two seconds.
static bool play_follow(const follow_t *follow) {
    static scenario_t scenario;
    static rig_result_t result;
    write_scenario(&scenario);
    scenario.event[0].style = 11U; // Straight on.
    scenario.event[scenario.count++] =
        (event_t){.at_us = 3U * S, .span_us = 2U * S, .a = follow->a, .b = 0, .kind = follow->kind, .who = follow->who};
    for (iw_time_us_t at_us = 2950U * MS; at_us < 5U * S; at_us += 100U * MS) {
        scenario.event[scenario.count++] = (event_t){.at_us = at_us, .span_us = 45U * MS, .kind = EV_LOOP_STALL};
    }
    rig_play(&scenario, IW_NEVER, &result);
    const uint64_t *const stops = result.stats.stops;
    const uint64_t all = stops[IW_CAUSE_PAIR_DIVERGES] + stops[IW_CAUSE_WHEEL_BLOCKED] + stops[IW_CAUSE_OVERSPEED] +
                         stops[IW_CAUSE_FEEDBACK_SIGN];
    const bool good =
        result.rule == ORACLE_NO_RULE && ((follow->stop == IW_CAUSE_NONE) ? all == 0U : stops[follow->stop] > 0U);
    printf("%-6s often late, %s: %llu stops, rule %u %s\n", good ? "ok" : "FAILED", follow->name,
           (unsigned long long)all, result.rule, result.text);
    return good;
}

int directed_play(void) {
    unsigned passed = 0;
    unsigned failed = 0;
    for (size_t i = 0; i < sizeof babbles / sizeof babbles[0]; i++) {
        const bool good = play_babble(&babbles[i]);
        passed += good ? 1U : 0U;
        failed += good ? 0U : 1U;
    }
    for (size_t i = 0; i < sizeof follows / sizeof follows[0]; i++) {
        const bool good = play_follow(&follows[i]);
        passed += good ? 1U : 0U;
        failed += good ? 0U : 1U;
    }
    printf("%u passed, %u failed, 0 skipped\n", passed, failed);
    return (failed == 0U) ? EXIT_SUCCESS : EXIT_FAILURE;
}
