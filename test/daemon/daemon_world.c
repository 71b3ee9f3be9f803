// SPDX-License-Identifier: MIT
#include "daemon_world.h"

#include "daemon_clients.h"
#include "daemon_judge.h"
#include "kernel.h"

#include "iwheel_sim/world.h"

#include <errno.h>
#include <linux/can/error.h>
#include <signal.h>
#include <stdlib.h>
#include <string.h>

#define MS           1000U
#define S            1000000U
#define UPTIME_US    UINT64_C(600000000)
#define PROVE_US     (25U * S) ///< Time within which a client must be able to drive after all faults have ended.
#define DRIVEN_US    (1U * S)
#define REST_US      (14U * S) ///< Time within which all must then come to standstill.
#define WATCHDOG_US  S
#define AIM_CALLS    400U
#define START_CALLS  180U
#define ARM_CALLS    40U
#define AIM_US       (20U * S) ///< Limit for a phase that does not come.
#define LATE_DEFAULT 60U

typedef enum { PART_CHAOS, PART_PROVE, PART_REST } part_t;

static struct {
    const scenario_t *scenario;
    result_t *result;
    sim_world_t sim;
    uint8_t port;
    size_t next;
    event_t fault[EV_KINDS];
    iw_time_us_t until_us[EV_KINDS]; ///< 0: not active.
    iw_time_us_t trace_us;
    iw_time_us_t fed_us; ///< Last message to the service manager; IW_NEVER: the process is not ready.
    iw_time_us_t fed_stolen_us;
    iw_time_us_t part_us;
    part_t part;
    bool proven;
    bool troubled; ///< The bus had a fault at the last check.
    iw_time_us_t life_us;
    phase_t aim; ///< Phase of the next kill.
    uint32_t kills;
    bool aimed;
} world;

const char *world_phase_name(unsigned phase) {
    static const char *const names[AT_PHASES] = {"start",  "silence",   "arming", "ramp up",
                                                 "steady", "ramp down", "hold",   "zeros of a restart"};
    return names[phase];
}

static bool traces(void) {
    return vk.now_us >= world.trace_us;
}

static void print_event(const char *what, const char *more) {
    if (traces()) {
        printf("  %11.6f s  %s%s\n", (double)vk.now_us / 1e6, what, more);
    }
}

// ---- faults ------------------------------------------------------------------------------------------------------

static void disturb_bus(unsigned kind, bool on) {
    judge_bus_fault();
    switch (kind) {
    case EV_DOWN:
        vk_link_up(!on);
        break;
    case EV_GONE:
        vk_link_exist(!on);
        vk_link_up(!on);
        break;
    case EV_BUS_OFF:
        sim_world_bus_off(&world.sim, vk.now_us, on);
        vk.link.off = on;
        vk_set_carrier();
        vk_deliver_error(on ? CAN_ERR_BUSOFF : CAN_ERR_RESTARTED, 0);
        judge_bus_lost();
        break;
    case EV_NO_ACK:
        sim_world_ack(&world.sim, vk.now_us, !on);
        break;
    case EV_STALL:
        sim_bus_stall(&world.sim.bus, vk.now_us, on);
        break;
    case EV_POWER:
        sim_world_power(&world.sim, vk.now_us, !on);
        break;
    case EV_FOREIGN:
        world.sim.foreign.due_us = on ? vk.now_us : IW_NEVER;
        break;
    case EV_BABBLE:
        world.sim.babble.period_us = 100U + (uint32_t)abs(world.fault[kind].b);
        world.sim.babble.frame = (iw_can_frame_t){.id = (uint32_t)world.fault[kind].a & 0x7FFU, .dlc = 8U};
        world.sim.babble.due_us = on ? vk.now_us : IW_NEVER;
        break;
    default:
        world.sim.pair.wheel[world.fault[kind].who].muted = on;
        break;
    }
}

/// Begins or ends a fault that lasts.
static void switch_fault(unsigned kind, bool on) {
    const event_t *event = &world.fault[kind];
    switch (kind) {
    case EV_FAIL:
        vk.fail_permille = on ? (uint32_t)event->a : 0U;
        break;
    case EV_LATE:
        vk.late_us = on ? (uint32_t)event->a : LATE_DEFAULT;
        break;
    case EV_NO_FD:
        vk.no_descriptors = on;
        vk_note_failure();
        break;
    case EV_PRESS:
        vk_press(on);
        judge_end("e-stop", JUDGE_REACTION_US);
        break;
    case EV_NO_BUTTON:
        vk.button.there = !on;
        vk.button.number += on ? 1 : 0;
        judge_end("e-stop unreadable", JUDGE_REACTION_US);
        break;
    default:
        disturb_bus(kind, on);
        break;
    }
}

static void end_fault(unsigned kind) {
    world.until_us[kind] = 0;
    print_event("end of: ", scenario_kind_name(kind));
    switch_fault(kind, false);
}

static void happen_once(const event_t *event) {
    switch (event->kind) {
    case EV_STOP:
        vk.stop_us = vk.now_us + event->span_us;
        break;
    case EV_KILL:
        vk.doomed = true;
        break;
    case EV_TERM:
        vk.signal = SIGTERM;
        judge_end("SIGTERM", (iw_time_us_t)S);
        break;
    case EV_WALL:
        vk.wall_off_us += (int64_t)event->a * (int64_t)S;
        break;
    case EV_SUSPEND:
        vk.suspended_us += event->span_us;
        break;
    case EV_REBOOT:
        judge_bus_fault();
        sim_world_reboot(&world.sim, vk.now_us, (iw_side_t)event->who);
        break;
    default:
        clients_start(event);
        break;
    }
}

static bool lasts(unsigned kind) {
    return kind == EV_FAIL || kind == EV_LATE || kind == EV_NO_FD || (kind >= EV_PRESS && kind <= EV_MUTE) ||
           kind == EV_BABBLE;
}

static void begin_event(const event_t *event) {
    world.result->events[event->kind]++;
    print_event(scenario_kind_name(event->kind), "");
    if (!lasts(event->kind)) {
        happen_once(event);
        return;
    }
    if (world.until_us[event->kind] != 0U) {
        end_fault(event->kind); // Only one of a kind is active.
    }
    world.fault[event->kind] = *event;
    world.until_us[event->kind] = vk.now_us + event->span_us;
    switch_fault(event->kind, true);
}

static void heal(void) {
    for (unsigned kind = 0; kind < EV_KINDS; kind++) {
        if (world.until_us[kind] != 0U) {
            end_fault(kind);
        }
    }
    vk.stop_us = 0;
    sim_world_heal(&world.sim, vk.now_us);
    clients_all_gone();
    vk_link_up(false); // Swallowed frames are dropped.
    vk.link.up_at_us = vk.now_us + 20U * MS;
}

// ---- the gateway's frames ------------------------------------------------------------------------------------------

void world_link_changed(bool up) {
    print_event(up ? "link up" : "link down", "");
    judge_bus_lost();
    if (up) {
        sim_world_bus_off(&world.sim, vk.now_us, false); // After a new setup the controller takes part again.
        world.port = sim_world_connect(&world.sim);
    } else {
        judge_end("interface down", JUDGE_REACTION_US);
        sim_world_disconnect(&world.sim, vk.now_us, world.port);
    }
}

static void aim(void);

void world_sent(const iw_can_frame_t *frame, bool accepted) {
    if (traces()) {
        printf("  %11.6f s    sends %u: %d mm/s%s\n", (double)vk.now_us / 1e6, (unsigned)frame->id,
               (int16_t)(frame->data[1] << 8 | frame->data[2]), accepted ? "" : ", not accepted");
    }
    judge_frame(frame, accepted);
    aim();
}

void world_call(const iw_can_frame_t *first, unsigned count) {
    judge_call(first, count);
}

int world_send(const iw_can_frame_t *frame) {
    const sim_port_t *port = &world.sim.bus.port[world.port];
    const int error = !vk.link.exists ? ENXIO : !vk.link.up ? ENETDOWN : (port->count >= port->depth) ? ENOBUFS : 0;
    world_sent(frame, error == 0);
    if (error == 0) {
        sim_world_submit(&world.sim, vk.now_us, world.port, frame);
    } else {
        judge_bus_fault();
    }
    return error;
}

static bool is_setpoint(uint32_t id) {
    return id == 266U || id == 298U;
}

void world_received(const struct can_frame *raw, bool echo) {
    if ((raw->can_id & CAN_ERR_FLAG) != 0U) {
        judge_bus_lost();
        judge_end("bus-off", JUDGE_REACTION_US);
    } else if (is_setpoint(raw->can_id) && echo) {
        judge_echo((raw->can_id == 266U) ? IW_LEFT : IW_RIGHT);
    } else if (is_setpoint(raw->can_id)) {
        judge_end("second master", JUDGE_REACTION_US);
    }
}

void world_taken(int stream) {
    clients_taken(stream);
    aim();
}

void world_notified(const char *words, size_t size) {
    const bool ready = size == strlen("READY=1") && memcmp(words, "READY=1", size) == 0;
    const bool alive = size == strlen("WATCHDOG=1") && memcmp(words, "WATCHDOG=1", size) == 0;
    world.fed_stolen_us = vk.stolen_us;
    world.fed_us = (ready || (alive && world.fed_us != IW_NEVER)) ? vk.now_us : world.fed_us;
}

// ---- kills, one in each life ---------------------------------------------------------------------------------------

/// Kills in a call soon after the phase has begun; while arming, after it has had time to find the wheels at standstill.
static void aim(void) {
    const iw_time_us_t since_us = vk.now_us - world.life_us;
    const bool there = judge_phase() == world.aim && (world.aim != AT_ARMING || since_us > S / 2U);
    if (!world.scenario->kills || world.aimed || (!there && since_us < AIM_US)) {
        return;
    }
    const uint32_t among = (world.aim == AT_START) ? START_CALLS : (world.aim == AT_ARMING) ? ARM_CALLS : AIM_CALLS;
    vk.kill_at = vk.calls + 1U + sim_random_below(&vk.random, among);
    vk.kill_after = sim_random_below(&vk.random, 2U) == 0U;
    world.aimed = true;
}

/// There is always a client that wants to drive.
static void keep_driving(void) {
    if (world.scenario->kills && clients_next_us() == IW_NEVER) {
        const uint8_t styles[] = {0, 1, 2, 4, 5};
        const event_t drives = {.span_us = 2U * S + sim_random_below(&vk.random, 3U * S),
                                .a = (int32_t)sim_random_below(&vk.random, 1900U) - 950,
                                .b = 300,
                                .kind = EV_DRIVER,
                                .style = styles[sim_random_below(&vk.random, sizeof styles)]};
        clients_start(&drives);
    }
}

// ---- time --------------------------------------------------------------------------------------------------------

static iw_time_us_t sooner(iw_time_us_t a, iw_time_us_t b) {
    return (a < b) ? a : b;
}

iw_time_us_t world_next_us(void) {
    iw_time_us_t next_us = sooner(sim_world_wake_us(&world.sim), clients_next_us());
    if (world.next < world.scenario->count) {
        next_us = sooner(next_us, world.scenario->event[world.next].at_us);
    }
    for (unsigned kind = 0; kind < EV_KINDS; kind++) {
        next_us = (world.until_us[kind] != 0U) ? sooner(next_us, world.until_us[kind]) : next_us;
    }
    return sooner(next_us, world.part_us);
}

static void run_bus(void) {
    sim_delivery_t delivery;
    while (sim_world_step(&world.sim, vk.now_us, &delivery)) {
        const bool ours = delivery.port == world.port && vk.link.up;
        if (is_setpoint(delivery.frame.id) && ours) {
            judge_on_bus(&delivery.frame);
        } else if (is_setpoint(delivery.frame.id)) {
            judge_foreign_on_bus();
        }
        if (!vk.link.off) {
            vk_deliver(&delivery.frame, ours);
        }
    }
}

static void note_driving(void) {
    const iw_time_us_t since_us = clients_driving_us();
    const sim_wheel_t *wheel = world.sim.pair.wheel;
    const bool turning = wheel[IW_LEFT].motion.speed_um_s != 0 && wheel[IW_RIGHT].motion.speed_um_s != 0;
    if (world.part == PART_PROVE && turning && since_us != IW_NEVER && vk.now_us - since_us >= DRIVEN_US) {
        world.proven = true;
        world.part_us = vk.now_us;
    }
}

static void next_part(void) {
    const event_t drives = {.span_us = PROVE_US, .a = 200, .b = 180, .kind = EV_DRIVER};
    switch (world.part++) {
    case PART_CHAOS:
        print_event("all faults have ended", "");
        heal();
        clients_start(&drives);
        world.part_us = vk.now_us + PROVE_US;
        break;
    case PART_PROVE:
        if (!world.proven) {
            judge_break(9, "all faults have ended, but the machine cannot be driven");
        }
        clients_all_gone();
        world.part_us = vk.now_us + REST_US;
        break;
    default:
        if (!judge_is_silent(S) || world.sim.pair.wheel[IW_LEFT].motion.speed_um_s != 0) {
            judge_break(9, "no client drives, but standstill does not follow");
        }
        vk.end_us = vk.now_us;
        world.part_us = IW_NEVER;
        break;
    }
}

static void run_faults(void) {
    for (unsigned kind = 0; kind < EV_KINDS; kind++) {
        if (world.until_us[kind] != 0U && world.until_us[kind] <= vk.now_us) {
            end_fault(kind);
        }
    }
    while (world.next < world.scenario->count && world.scenario->event[world.next].at_us <= vk.now_us) {
        begin_event(&world.scenario->event[world.next++]);
    }
}

/// The service manager kills a process that does not report for a second that it is alive.
static void watch_over(void) {
    if (!world.scenario->watchdog || world.fed_us == IW_NEVER || vk.now_us - world.fed_us <= WATCHDOG_US) {
        return;
    }
    print_event("the watchdog of the service kills it", "");
    if (vk.failed_us < world.fed_us && vk.stolen_us - world.fed_stolen_us < WATCHDOG_US / 4U) {
        judge_break(13, "the process runs, and has not reported to the service manager for a second");
    }
    world.fed_us = IW_NEVER;
    vk.doomed = true;
}

void world_run(void) {
    vk.trace = traces();
    run_bus();
    run_faults();
    clients_run();
    keep_driving();
    note_driving();
    const bool troubled = vk.link.off || !vk.link.up || !sim_pair_acknowledges(&world.sim.pair) || world.sim.ack_off ||
                          world.sim.bus.stalled || world.until_us[EV_BABBLE] != 0U;
    if (troubled || world.troubled) {
        judge_bus_fault(); // The fault lasted at least until now.
    }
    world.troubled = troubled;
    judge_tick();
    aim();
    watch_over();
    if (vk.now_us >= world.part_us) {
        next_part();
    }
}

// ---- a scenario --------------------------------------------------------------------------------------------------

static const char *config_text(const iw_config_t *config) {
    static char text[1024];
    (void)snprintf(text, sizeof text,
                   "[bus]\ninterface = " VK_INTERFACE "\n[wheels]\nsetpoint_type = %u\ncurrent_role = limit\n"
                   "track_mm = %u\n[drive]\n"
                   "period_ms = %u\nlease_ms = %u\naccel_mm_s2 = %u\ndecel_mm_s2 = %u\nmax_speed_mm_s = %u\n"
                   "[estop]\nline = " VK_LINE "\n[northbound]\nsocket = " VK_GATEWAY "\ngroup = none\n"
                   "watch_socket = " VK_WATCHERS "\nwatch_group = none\n[record]\nblackbox_s = 1\n",
                   config->setpoint_type, config->track_mm, config->period_ms, config->lease_ms, config->accel_mm_s2,
                   config->decel_mm_s2, config->max_speed_mm_s);
    return text;
}

static void begin(const scenario_t *scenario, iw_time_us_t trace_from_us, result_t *result) {
    sim_pair_config_t pair;
    memset(result, 0, sizeof *result);
    memset(&world, 0, sizeof world);
    world.scenario = scenario;
    world.result = result;
    world.trace_us = trace_from_us;
    world.part_us = scenario->chaos_us;
    world.fed_us = IW_NEVER;
    sim_pair_default(&pair);
    pair.age_us = UPTIME_US;
    sim_world_init(&world.sim, &pair, WORLD_START_US, scenario->seed);
    world.port = sim_world_connect(&world.sim);
    vk_begin(scenario->seed ^ UINT64_C(0x4E57), WORLD_START_US, config_text(&scenario->config));
    vk.link.may_restart = scenario->may_restart;
    vk.late_us = LATE_DEFAULT;
    judge_begin(scenario, result);
    clients_begin(scenario->seed);
}

/// Judges the end of a life. The process may end for lack of a resource before it has begun to wait, or on request.
static void judge_ended(vk_end_t end, bool waited, bool asked) {
    const bool wanting = vk.no_descriptors || vk.failed_us >= world.life_us;
    judge_death(end == VK_EXITED && vk.exit_code == 0);
    print_event("process ended", (end == VK_EXITED) ? " on its own" : "");
    if (end == VK_EXITED && !asked && (waited || !wanting)) {
        judge_break(12, "the process ended on its own with status %d", vk.exit_code);
    }
}

static void prepare_life(void) {
    world.life_us = vk.now_us;
    world.fed_us = IW_NEVER;
    world.aimed = false;
    world.aim = (phase_t)(world.kills % AT_PHASES);
    print_event("process starts", "");
    judge_life();
    aim();
}

void world_play(const scenario_t *scenario, iw_time_us_t trace_from_us, result_t *out_result) {
    begin(scenario, trace_from_us, out_result);
    vk_end_t end;
    do {
        const uint64_t waits = vk.waits;
        const uint32_t terms = out_result->events[EV_TERM];
        prepare_life();
        end = vk_live();
        if (end != VK_OVER) {
            judge_ended(end, vk.waits > waits + 1U, out_result->events[EV_TERM] != terms);
            world.kills += (end == VK_KILLED) ? 1U : 0U;
            world.fed_us = IW_NEVER;
            vk_idle(scenario->restart_us);
        }
        if (scenario->kills && world.kills >= scenario->kill_lives) {
            vk.end_us = vk.now_us;
        }
    } while (end != VK_OVER && vk.now_us < vk.end_us);
    out_result->drives = world.proven;
    out_result->simulated_us = vk.now_us - WORLD_START_US;
    out_result->calls = vk.calls;
    out_result->failed = vk.failed;
}
