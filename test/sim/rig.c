// SPDX-License-Identifier: MIT
#include "rig_parts.h"

#include <string.h>

#define MS            1000U
#define S             1000000U
#define RULE_NOTHING  902U ///< Nothing happened in the run.
#define RULE_UNUSABLE 903U ///< All faults have ended and the machine cannot be driven.
#define RULE_RESTLESS 904U ///< No client drives, and standstill and silence do not follow.
#define RULE_INTERNAL 905U ///< The gate had to stop the scheduler, or the encoder had to clamp.
#define QUIET_US      (1500U * MS)
#define USABLE_US     (20U * S)
#define DRIVEN_US     (1U * S)
#define SETTLE_US     (14U * S)
#define HELD_US       (30U * S)
#define RULE_HELD     818U ///< The oracle's rule of the same number.
#define ODD_IDS       11U

bool rig_traces(const rig_t *rig) {
    return rig->now_us >= rig->trace_from_us && rig->oracle.rule == ORACLE_NO_RULE;
}

void rig_hash(rig_t *rig, uint64_t value) {
    for (unsigned byte = 0; byte < 8U; byte++) {
        rig->result->hash = (rig->result->hash ^ ((value >> (8U * byte)) & 0xFFU)) * UINT64_C(1099511628211);
    }
}

bool rig_active(const rig_t *rig, unsigned kind) {
    return rig->fault_until_us[kind] > rig->now_us;
}

/// Requests a step of the gateway at that time; its delay is drawn.
void rig_wake(rig_t *rig, iw_time_us_t at_us) {
    uint32_t latency_us = rig->scenario->wake_latency_us;
    if (rig_active(rig, EV_LOOP_SLOW)) {
        latency_us += (uint32_t)rig->fault[EV_LOOP_SLOW].a;
    }
    if (at_us < rig->wake_us) {
        const iw_time_us_t late_us = at_us + sim_random_below(&rig->random, latency_us + 1U);
        rig->wake_us = (late_us < rig->wake_us) ? late_us : rig->wake_us;
    }
}

// ---- faults ------------------------------------------------------------------------------------------------------

static void set_one(rig_t *rig, const event_t *event, iw_side_t side, bool on) {
    sim_wheel_t *const wheel = &rig->world.pair.wheel[side];
    sim_motion_advance(&wheel->motion, rig->now_us);
    switch (event->kind) {
    case EV_MUTE:
        wheel->muted = on;
        break;
    case EV_LOSS:
        wheel->loss_permille = on ? (uint16_t)event->a : 0U;
        break;
    case EV_SWAP:
        wheel->motion.swapped = on;
        break;
    case EV_BLOCK:
        wheel->motion.blocked = on;
        break;
    case EV_RUNAWAY:
        wheel->motion.runaway_mm_s = on ? (int16_t)event->a : 0;
        break;
    case EV_FREE:
        wheel->motion.freewheels = on;
        break;
    case EV_DROOP:
        wheel->motion.droop_permille = on ? (uint16_t)event->a : 0U;
        break;
    case EV_LATE:
        wheel->late_us = on ? (uint32_t)event->a : 0U;
        break;
    default:
        wheel->force.forced_raw = (on && event->b >= 0) ? event->a : SIM_FORCE_AUTO;
        wheel->force.unit = (on == (side == IW_LEFT)) ? IW_FORCE_DN : IW_FORCE_CN;
        break;
    }
}

/// Applies to one wheel, or to both: then they go straight, and each is judged alone.
static void set_wheel(rig_t *rig, const event_t *event, bool on) {
    for (unsigned side = 0; side < IW_SIDES; side++) {
        if (event->who == side || event->who == IW_SIDES) {
            set_one(rig, event, (iw_side_t)side, on);
        }
    }
}

static void crash(rig_t *rig) {
    rig->state_seen = iw_gateway_is_sending(&rig->gateway) ? IW_STATE_ARMED : IW_STATE_LISTENING;
    rig->alive = false;
    rig->queued = 0;
    for (size_t i = 0; i < SCENARIO_CLIENTS; i++) {
        rig->client[i].id = ++rig->next_client;
    }
}

static void start_gateway(rig_t *rig, bool restarted) {
    const iw_hal_t hal = port_hal(rig);
    (void)iw_gateway_init(&rig->gateway, &rig->scenario->config, &hal, rig->now_us, restarted);
    oracle_start(&rig->oracle, &rig->gateway, rig->now_us, restarted);
    iw_estop_pair_init(&rig->pair, ORACLE_CONTACTS_US);
    rig->alive = true;
    rig->result->stats.stops[IW_CAUSE_RESTART] += restarted ? 1U : 0U;
    rig->stops_seen = rig->gateway.permit.stop.number;
    rig->promised_us = rig->now_us;
    rig->wake_us = rig->now_us;
    rig->state_seen = iw_gateway_state(&rig->gateway);
}

static void contradict(rig_t *rig, bool contradicted) {
    const iw_bus_facts_t facts = {contradicted, !rig->scenario->echo_early};
    iw_gateway_bus_facts(&rig->gateway, &facts);
}

/// Begins or ends a fault that lasts.
static void switch_fault(rig_t *rig, const event_t *event, bool on) {
    switch (event->kind) {
    case EV_ESTOP:
    case EV_ESTOP_GONE:
        rig->edge = true;
        oracle_edge(&rig->oracle, rig->now_us);
        rig_wake(rig, rig->now_us);
        break;
    case EV_BUS_DOWN:
        port_lose_bus(rig);
        break;
    case EV_BUS_OFF:
        port_lose_bus(rig);
        sim_world_bus_off(&rig->world, rig->now_us, on);
        break;
    case EV_NO_ACK:
        sim_world_ack(&rig->world, rig->now_us, !on);
        break;
    case EV_BUS_STALL:
        sim_bus_stall(&rig->world.bus, rig->now_us, on);
        break;
    case EV_FOREIGN:
        rig->world.foreign.due_us = on ? rig->now_us : IW_NEVER;
        break;
    case EV_BABBLE:
        rig->world.babble.period_us = (uint32_t)event->b;
        rig->world.babble.frame = (iw_can_frame_t){.id = (uint32_t)event->a, .dlc = 8U};
        rig->world.babble.due_us = on ? rig->now_us : IW_NEVER;
        break;
    case EV_POWER:
        sim_world_power(&rig->world, rig->now_us, !on);
        break;
    case EV_CRASH:
        if (on) {
            crash(rig);
        } else {
            port_restart(rig);
            start_gateway(rig, rig->state_seen != IW_STATE_LISTENING);
        }
        break;
    case EV_TIMING:
        contradict(rig, on);
        break;
    case EV_MUTE:
    case EV_LOSS:
    case EV_SWAP:
    case EV_BLOCK:
    case EV_RUNAWAY:
    case EV_FREE:
    case EV_DROOP:
    case EV_LATE:
    case EV_FORCE:
        set_wheel(rig, event, on);
        break;
    default:
        break;
    }
}

static void send_odd(rig_t *rig, const event_t *event) {
    static const uint32_t ids[ODD_IDS] = {256, 288, 257, 289, 290, 512, 544, 513, 545, 600, 100};
    static const uint32_t formats[4] = {IW_CAN_EXTENDED, IW_CAN_REMOTE, IW_CAN_FD, 0U};
    for (int32_t i = 0; i < event->a; i++) {
        iw_can_frame_t frame = {0};
        const uint32_t format = formats[sim_random_below(&rig->random, 4U)];
        frame.id = ids[sim_random_below(&rig->random, ODD_IDS)] | format;
        frame.dlc = (uint8_t)sim_random_below(&rig->random, (format == 0U) ? 2U : 9U);
        sim_world_inject(&rig->world, rig->now_us, &frame);
    }
}

static bool lasts(unsigned kind) {
    return kind < EV_GOOD_CLIENT;
}

static void find_fault_end(rig_t *rig) {
    rig->fault_end_us = IW_NEVER;
    for (unsigned kind = 0; kind < EV_KINDS; kind++) {
        const iw_time_us_t until_us = rig->fault_until_us[kind];
        if (until_us != 0U && until_us < rig->fault_end_us) {
            rig->fault_end_us = until_us;
        }
    }
}

static void end_fault(rig_t *rig, unsigned kind) {
    rig->fault_until_us[kind] = 0;
    switch_fault(rig, &rig->fault[kind], false);
    if (rig_traces(rig)) {
        printf("  %11.6f s  end of: %s\n", (double)rig->now_us / 1e6, scenario_kind_name(kind));
    }
}

static void end_faults(rig_t *rig) {
    for (unsigned kind = 0; kind < EV_KINDS; kind++) {
        if (rig->fault_until_us[kind] != 0U && rig->fault_until_us[kind] <= rig->now_us) {
            end_fault(rig, kind);
        }
    }
    find_fault_end(rig);
}

static void begin_instant(rig_t *rig, const event_t *event) {
    switch (event->kind) {
    case EV_TX_LOST:
        rig->tx_lost = (uint32_t)event->a;
        break;
    case EV_ECHO_LOST:
        rig->echo_lost = (uint32_t)event->a;
        break;
    case EV_FOREIGN:
        sim_world_foreign_once(&rig->world, rig->now_us);
        break;
    case EV_ODD_FRAMES:
        send_odd(rig, event);
        break;
    default:
        rig->world.pair.wheel[event->who].boot_us = (uint32_t)event->a;
        sim_world_reboot(&rig->world, rig->now_us, (iw_side_t)event->who);
        break;
    }
}

/// Only one of a kind is active: the next ends the previous one.
static void begin_event(rig_t *rig, const event_t *event) {
    rig->result->stats.events[event->kind]++;
    if (rig_traces(rig)) {
        printf("  %11.6f s  %s\n", (double)rig->now_us / 1e6, scenario_kind_name(event->kind));
    }
    if (!lasts(event->kind)) {
        clients_start(rig, event);
    } else if (event->span_us == 0U) {
        begin_instant(rig, event);
    } else {
        if (rig->fault_until_us[event->kind] != 0U) {
            end_fault(rig, event->kind);
        }
        rig->fault[event->kind] = *event;
        rig->fault_until_us[event->kind] = rig->now_us + event->span_us;
        switch_fault(rig, event, true);
        find_fault_end(rig);
    }
}

// ---- the gateway's turn ------------------------------------------------------------------------------------------

static void note_stop(rig_t *rig) {
    const iw_stop_t *const stop = &rig->gateway.permit.stop;
    const iw_state_t state = iw_gateway_state(&rig->gateway);
    if (stop->number != rig->stops_seen) {
        rig->stops_seen = stop->number;
        rig->result->stats.stops[stop->cause]++;
    }
    if (state == rig->state_seen) {
        return;
    }
    rig->result->stats.armed += (state == IW_STATE_ARMED) ? 1U : 0U;
    rig->state_seen = state;
    if (rig_traces(rig)) {
        static const char *const names[] = {"LISTENING", "ARMED", "STOPPING", "LATCHED"};
        printf("  %11.6f s    state %s, last cause %s\n", (double)rig->now_us / 1e6, names[state],
               rig_cause_name(stop->cause));
    }
}

static void step_once(rig_t *rig) {
    oracle_step_begin(&rig->oracle, rig->now_us, rig->promised_us);
    rig->promised_us = iw_gateway_step(&rig->gateway, rig->now_us);
    oracle_step_end(&rig->oracle, rig->now_us);
    rig->result->stats.steps++;
    note_stop(rig);
    rig->wake_us = IW_NEVER;
    rig_wake(rig, rig->promised_us);
    if (rig->rx_count > 0U) {
        rig_wake(rig, rig->rx[rig->rx_first].at_us);
    }
}

static void run_gateway(rig_t *rig) {
    if (rig->queued > 0U && rig->scenario->requests_first) {
        clients_run_queue(rig);
    }
    step_once(rig);
    if (rig->queued > 0U) {
        clients_run_queue(rig);
        step_once(rig);
    }
}

// ---- time --------------------------------------------------------------------------------------------------------

static iw_time_us_t sooner(iw_time_us_t a, iw_time_us_t b) {
    return (a < b) ? a : b;
}

static iw_time_us_t gateway_us(const rig_t *rig) {
    const iw_time_us_t stalled_us = rig->fault_until_us[EV_LOOP_STALL];
    if (!rig->alive) {
        return IW_NEVER;
    }
    return (rig->wake_us < stalled_us) ? stalled_us : rig->wake_us;
}

static iw_time_us_t next_us(const rig_t *rig) {
    const iw_time_us_t world_us = sooner(sim_world_next_us(&rig->world), port_next_us(rig));
    return sooner(sooner(world_us, rig->fault_end_us), sooner(clients_next_us(rig), gateway_us(rig)));
}

/// Does all that is due by `until_us`, in order; the caller handles the events of the scenario.
static void run_until(rig_t *rig, iw_time_us_t until_us) {
    sim_delivery_t delivery;
    while (rig->oracle.rule == ORACLE_NO_RULE) {
        const iw_time_us_t at_us = next_us(rig);
        if (at_us > until_us) {
            break;
        }
        rig->now_us = (at_us > rig->now_us) ? at_us : rig->now_us;
        while (sim_world_step(&rig->world, rig->now_us, &delivery)) {
            port_deliver(rig, &delivery);
        }
        port_release(rig);
        if (rig->fault_end_us <= rig->now_us) {
            end_faults(rig);
        }
        clients_step(rig);
        if (gateway_us(rig) <= rig->now_us) {
            run_gateway(rig);
        }
    }
    rig->now_us = (until_us > rig->now_us) ? until_us : rig->now_us;
}

// ---- the end: all faults have ended ----------------------------------------------------------------------------

static void heal(rig_t *rig) {
    for (unsigned kind = 0; kind < EV_KINDS; kind++) {
        if (rig->fault_until_us[kind] != 0U) {
            end_fault(rig, kind);
        }
    }
    find_fault_end(rig);
    rig->tx_lost = rig->echo_lost = 0;
    sim_world_heal(&rig->world, rig->now_us);
    for (size_t side = 0; side < IW_SIDES; side++) {
        sim_wheel_slow(&rig->world.pair.wheel[side], rig->scenario->slow_permille);
    }
    clients_all_gone(rig);
    port_lose_bus(rig); // The interface goes down and up: the lost frames are dropped.
}

static bool turning(const rig_t *rig) {
    const sim_wheel_t *const wheel = rig->world.pair.wheel;
    const bool left = wheel[IW_LEFT].motion.speed_um_s != 0;
    const bool right = wheel[IW_RIGHT].motion.speed_um_s != 0;
    return left && right;
}

static bool standing(const rig_t *rig) {
    const sim_wheel_t *const wheel = rig->world.pair.wheel;
    return wheel[IW_LEFT].motion.speed_um_s == 0 && wheel[IW_RIGHT].motion.speed_um_s == 0;
}

/// Without a track every arm is refused, whichever client sends it and however often.
static bool may_move(const rig_t *rig) {
    return rig->scenario->config.track_mm != 0U;
}

/// Returns true if a client drives for DRIVEN_US without a break before that time. A late detection of a reboot may stop it once more.
static bool gets_driven(rig_t *rig, iw_time_us_t limit_us) {
    iw_time_us_t since_us = rig->now_us;
    while (rig->now_us < limit_us && rig->oracle.rule == ORACLE_NO_RULE) {
        run_until(rig, rig->now_us + 50U * MS);
        if (!turning(rig) || iw_gateway_state(&rig->gateway) != IW_STATE_ARMED) {
            since_us = rig->now_us;
        } else if (rig->now_us - since_us >= DRIVEN_US) {
            return true;
        }
    }
    return false;
}

/// Returns true if, before that time, the wheels are at standstill and nothing is sent for a second.
static bool comes_to_rest(rig_t *rig, iw_time_us_t limit_us) {
    while (rig->now_us < limit_us && rig->oracle.rule == ORACLE_NO_RULE) {
        const uint64_t frames = rig->result->stats.frames;
        run_until(rig, rig->now_us + S);
        if (standing(rig) && rig->result->stats.frames == frames) {
            return true;
        }
    }
    return false;
}

/// The zeros of a hold have no other end.
static void release_at_rest(rig_t *rig) {
    const event_t release = {.kind = EV_ONE_RELEASE};
    if (rig->scenario->config.hold && may_move(rig)) { // Otherwise no motion ever began that could end in a hold.
        run_until(rig, rig->now_us + HELD_US);
        if (iw_gateway_state(&rig->gateway) == IW_STATE_LISTENING) {
            oracle_fail(&rig->oracle, rig->now_us, RULE_HELD, "no client has released the hold, and nothing is sent");
        }
        clients_start(rig, &release);
    }
}

/// A well-behaved client must be able to drive now; after it has gone, the wheels are at standstill and the bus is silent.
static void prove_usable(rig_t *rig) {
    const event_t drives = {.span_us = 60U * S, .a = 200, .b = 180, .kind = EV_GOOD_CLIENT, .style = 3U};
    clients_start(rig, &drives);
    if (!gets_driven(rig, rig->now_us + USABLE_US) && may_move(rig)) {
        oracle_fail(&rig->oracle, rig->now_us, RULE_UNUSABLE,
                    "all faults have ended, but the machine cannot be driven");
    }
    clients_all_gone(rig);
    release_at_rest(rig);
    if (!comes_to_rest(rig, rig->now_us + SETTLE_US)) {
        oracle_fail(&rig->oracle, rig->now_us, RULE_RESTLESS, "no client drives, but standstill does not follow");
    }
}

static void judge_whole(rig_t *rig) {
    const rig_stats_t *const stats = &rig->result->stats;
    uint64_t stops = 0;
    for (unsigned cause = 0; cause < IW_CAUSES; cause++) {
        stops += stats->stops[cause];
    }
    const bool moved = stats->frames >= 40U && stats->nonzero >= 10U && stats->armed > 0U && stops > 0U;
    if (may_move(rig) ? !moved : stats->refused[IW_REFUSE_TRACK_NOT_SET] == 0U) {
        oracle_fail(&rig->oracle, rig->now_us, RULE_NOTHING, "nothing happened in this run");
    }
}

static void judge_internal(rig_t *rig) {
    if (rig->gateway.sender.envelope.stopped != 0U || rig->gateway.sender.sent.clamped != 0U) {
        oracle_fail(&rig->oracle, rig->now_us, RULE_INTERNAL, "the gate had to stop a frame of the scheduler");
    }
}

static void begin(rig_t *rig, const scenario_t *scenario) {
    sim_pair_config_t pair;
    const bool setpoint = scenario->config.current_role == IW_ROLE_SETPOINT;
    sim_pair_default(&pair);
    pair.age_us = scenario->age_us;
    for (size_t side = 0; side < IW_SIDES; side++) {
        pair.wheel[side].motion.current_is_setpoint = setpoint;
        pair.wheel[side].offset_us = scenario->offset_us;
    }
    rig->now_us = SCENARIO_START_US;
    rig->fault_end_us = IW_NEVER;
    sim_random_init(&rig->random, scenario->seed ^ UINT64_C(0x5EED));
    sim_world_init(&rig->world, &pair, rig->now_us, scenario->seed);
    for (size_t side = 0; side < IW_SIDES; side++) {
        sim_wheel_slow(&rig->world.pair.wheel[side], scenario->slow_permille);
    }
    rig->port = sim_world_connect(&rig->world);
    rig->oracle.proven = !scenario->echo_early;
    rig->oracle.purges = scenario->can_purge;
    clients_init(rig);
    start_gateway(rig, false);
    contradict(rig, false);
}

void rig_play(const scenario_t *scenario, iw_time_us_t trace_from_us, rig_result_t *out_result) {
    static rig_t rig;
    memset(&rig, 0, sizeof rig);
    memset(out_result, 0, sizeof *out_result);
    rig.scenario = scenario;
    rig.result = out_result;
    rig.trace_from_us = trace_from_us;
    out_result->hash = UINT64_C(14695981039346656037);
    begin(&rig, scenario);
    for (size_t i = 0; i < scenario->count && rig.oracle.rule == ORACLE_NO_RULE; i++) {
        run_until(&rig, SCENARIO_START_US + scenario->event[i].at_us);
        judge_internal(&rig);
        begin_event(&rig, &scenario->event[i]);
    }
    run_until(&rig, SCENARIO_START_US + scenario->chaos_us);
    judge_internal(&rig);
    heal(&rig);
    run_until(&rig, rig.now_us + QUIET_US);
    prove_usable(&rig);
    judge_internal(&rig);
    judge_whole(&rig);
    out_result->rule = rig.oracle.rule;
    out_result->broken_us = rig.oracle.broken_us;
    memcpy(out_result->text, rig.oracle.text, sizeof out_result->text);
    out_result->stats.simulated_us = rig.now_us - SCENARIO_START_US;
}

void rig_stats_add(rig_stats_t *sum, const rig_stats_t *stats) {
    uint64_t *const to = (uint64_t *)sum;
    const uint64_t *const from = (const uint64_t *)stats;
    for (size_t i = 0; i < sizeof *sum / sizeof *to; i++) {
        to[i] += from[i];
    }
}

const char *rig_cause_name(unsigned cause) {
    static const char *const names[IW_CAUSES] = {
        "none",         "e-stop line",    "e-stop disagrees", "software e-stop", "bus down",   "second master",
        "send stalled", "wheel rebooted", "wheel lost",       "feedback sign",   "overspeed",  "loop hung",
        "internal",     "loop late",      "wheel blocked",    "pair diverges",   "lease lost", "client gone",
        "client stop",  "shutdown",       "restart",
    };
    return names[cause];
}

const char *rig_refusal_name(unsigned refusal) {
    static const char *const names[RIG_REFUSALS] = {
        "ok",
        "out of range",
        "missing field",
        "not holder",
        "busy",
        "not armed",
        "latched",
        "e-stop pressed",
        "bus down",
        "timing mismatch",
        "wheel lost",
        "wheel blocked",
        "pair diverges",
        "not at rest",
        "send stalled",
        "second master",
        "cause present",
        "type not set",
        "track not set",
        "stale command",
        "listen only",
        "contradicted",
    };
    return names[refusal];
}
