// SPDX-License-Identifier: MIT
/// Everything outside the gateway's process: bus and wheels (the simulator's model), button, clients, service manager, and their
/// faults. One scenario at a time, drawn from a seed; the same seed leads to the same run, to the microsecond.
///
/// Chaos comes first; then all faults end, a well-behaved client must be able to drive, and the wheels are at standstill after it has disconnected.
#ifndef DAEMON_WORLD_H
#define DAEMON_WORLD_H

#include "../sim/campaign.h"

#include "iwheel/can_frame.h"
#include "iwheel/config.h"

#include <linux/can.h>
#include <stdio.h>

#define WORLD_EVENTS   128U
#define WORLD_START_US UINT64_C(1000000000)

typedef enum {
    EV_FAIL = 0,  ///< Calls fail, `a` permille of them, for `span`.
    EV_STOP,      ///< The process does not run for `span` (SIGSTOP, starved).
    EV_LATE,      ///< Each wake-up is late by up to `a` us.
    EV_NO_FD,     ///< No descriptor is left.
    EV_KILL,      ///< kill -9, during any call.
    EV_TERM,      ///< SIGTERM.
    EV_WALL,      ///< The wall clock leaps by `a` s.
    EV_SUSPEND,   ///< The machine sleeps for `span`, which the monotonic clock does not count.
    EV_PRESS,     ///< The e-stop is pressed for `span`.
    EV_NO_BUTTON, ///< The chip of the button is gone for `span`.
    EV_DOWN,      ///< The interface is down,
    EV_GONE,      ///< or deleted and created again.
    EV_BUS_OFF,
    EV_NO_ACK,
    EV_STALL,   ///< The bus accepts no frame.
    EV_POWER,   ///< Wheels without power.
    EV_FOREIGN, ///< Another master sends.
    EV_MUTE,    ///< Wheel `who` sends no telemetry.
    EV_REBOOT,  ///< Wheel `who` restarts.
    EV_BABBLE,  ///< A node sends id `a` continuously.
    EV_DRIVER,  ///< A client drives `a`, `b` mm/s for `span`, then ends according to `style`.
    EV_BLIND,   ///< A client streams a nonzero command, whatever the replies.
    EV_NOISE,   ///< A client sends random requests, in pieces.
    EV_WATCHER, ///< A client watches, and reads or not.
    EV_KINDS,
} event_kind_t;

typedef struct {
    uint64_t seed;
    iw_config_t config;
    iw_time_us_t chaos_us;
    uint32_t restart_us; ///< Restart delay of the service manager.
    bool watchdog;       ///< The service manager kills a process that does not report for a second that it is alive.
    bool may_restart;    ///< The gateway has the right to set the link down.
    bool kills;          ///< Only kills happen, one in a call of each life: see world_kill_phases.
    uint32_t kill_lives; ///< Number of these lives.
    size_t count;
    event_t event[WORLD_EVENTS];
} scenario_t;

/// The phase of a life in which it was killed.
typedef enum {
    AT_START,
    AT_SILENCE,
    AT_ARMING,
    AT_RAMP_UP,
    AT_STEADY,
    AT_RAMP_DOWN,
    AT_HOLD,
    AT_RESTART,
    AT_PHASES
} phase_t;

typedef struct {
    uint32_t kills;
    uint32_t moving; ///< Kills with a nonzero setpoint possibly in effect.
    iw_time_us_t
        worst_us; ///< For these, the longest time from the next start until zeros of both wheels were on the bus.
    iw_time_us_t between_us; ///< The same from the kill.
} phase_stats_t;

typedef struct {
    uint32_t rule; ///< The broken rule; 0: none.
    iw_time_us_t broken_us;
    char text[240];
    uint64_t hash; ///< Hash of all that was sent.
    uint64_t simulated_us;
    uint64_t calls;
    uint64_t failed;
    uint64_t frames;
    uint64_t nonzero;
    uint32_t lives;
    uint32_t drives; ///< Times a client was allowed to drive.
    uint32_t events[EV_KINDS];
    phase_stats_t phase[AT_PHASES];
} result_t;

void scenario_draw(scenario_t *self, uint64_t seed);
/// One kill in each of `lives` lives, and no other event.
void scenario_kills(scenario_t *self, uint64_t seed, uint32_t lives);
const char *scenario_kind_name(unsigned kind);
void scenario_print(const scenario_t *self, FILE *out);
const char *world_phase_name(unsigned phase);

/// `trace_from_us`: prints events and setpoints on stdout from then on; IW_NEVER: nothing.
void world_play(const scenario_t *scenario, iw_time_us_t trace_from_us, result_t *out_result);

// For the kernel ------------------------------------------------------------------------------------------------------

iw_time_us_t world_next_us(void);
/// Does all that is due by now.
void world_run(void);
/// The gateway sends a frame. Returns 0 or the errno of the call.
void world_call(const iw_can_frame_t *first, unsigned count); ///< This many frames come in one call.
int world_send(const iw_can_frame_t *frame);
/// The gateway has tried to send it.
void world_sent(const iw_can_frame_t *frame, bool accepted);
/// The gateway reads a frame from the kernel.
void world_received(const struct can_frame *raw, bool echo);
/// The gateway has read from this connection.
void world_taken(int stream);
/// The gateway reports to the service manager.
void world_notified(const char *words, size_t size);
void world_link_changed(bool up);

#endif
