// SPDX-License-Identifier: MIT
/// Composition of the gateway from its parts. It is allocated once at the start. Only main.c and loop.c know all parts;
/// a module receives the part that it needs.
///
/// One cycle of the loop (loop.c) has one of two orders:
///
///     usual:   wait -> signals -> step of the core (bus, e-stop) -> report changes -> lines of clients
///              -> step again after a request -> new clients -> flush -> store assumptions -> watchdog
///     driving: wait -> signals -> lines of the lease holder -> step of the core -> report changes -> lines of the
///              others -> as above
///
/// so that the wheels precede all clients. The loop uses the second order while the wheels are driven, the holder has
/// sent something, and neither a step nor an edge of the e-stop is due. The reading of bus and e-stop that follows then
/// judges the command, and it is sent after one reading instead of two. That saves two system calls before the command
/// is on the bus (2.16 instead of 2.23 per frame of docs/developer/speed.md, with 20 commands/s). The work per cycle is
/// limited in each of these places.
///
/// A board has one order, because a request needs milliseconds there: step -> request -> step
/// (port/stm32_stub/main.c).
#ifndef GATEWAY_DAEMON_H
#define GATEWAY_DAEMON_H

#include "answers/answers.h"
#include "assumptions/assumptions.h"
#include "box/box.h"
#include "bus/bus_facts.h"
#include "config/gateway_config.h"
#include "lock/runtime.h"
#include "process/notify.h"
#include "sockets/log.h"
#include "sockets/sock_clients.h"
#include "sockets/wakeup.h"
#include "wheels/wheels.h"

/// Whether the gateway continues: SERVES --SIGTERM, SIGINT, SIGHUP--> ENDS, or SERVES --a gateway with precedence-->
/// GIVES_WAY. In both cases it stops the wheels, and the loop returns when nothing is sent any more.
typedef enum { GW_LOOP_SERVES, GW_LOOP_ENDS, GW_LOOP_GIVES_WAY } gw_loop_phase_t;

/// Pace at which the loop follows the bus. Each step of the core selects it:
///
///     RESTING --setpoints are sent--> ALERT --armed--> DRIVING --stop--> ALERT --no more setpoints--> RESTING
///
/// RESTING, DRIVING: frames may wait and are read together. ALERT (a stop, or arming): each frame wakes the loop.
typedef enum { GW_PACE_RESTING, GW_PACE_ALERT, GW_PACE_DRIVING } gw_pace_t;

/// State of loop.c. main.c sets `suspended_us` and reads `phase`.
typedef struct {
    gw_loop_phase_t phase;
    gw_pace_t pace;
    bool frames_wait; ///< The bus does not wake the loop. Watchers, and a bus without frames, prevent it at any pace.
    int signal_fd;
    iw_client_t holder;        ///< Lease holder after the last step; it is served first.
    iw_time_us_t suspended_us; ///< Suspended time of the machine, as last read.
    iw_time_us_t clocks_us;    ///< Next time to read both clocks without lateness.
    iw_time_us_t awaited_us;   ///< Latest end of the last wait.
    iw_time_us_t poll_us;      ///< Next time to read bus and e-stop without a wake-up.
    iw_time_us_t frames_us;    ///< Last time at which frames were read.
    iw_time_us_t box_poll_us;  ///< Next time to poll the writer of the black box.
    iw_time_us_t mark_us;      ///< Next attempt to change the crash marker after a failure; 0 if none failed.
    uint32_t silent_pairs;     ///< Setpoint pairs sent up to the last pause.
} gw_loop_t;

typedef struct gw_daemon {
    gateway_config_t config;
    sock_log_t log;
    gw_notify_t notify;
    gw_runtime_t runtime;
    sock_wakeup_t wakeup;
    gw_box_t box;
    gw_wheels_t wheels;
    gw_bus_facts_t facts;
    gw_assumptions_t assumptions;
    sock_clients_t clients;
    gw_answers_t answers;
    gw_loop_t loop;
} gw_daemon_t;

/// Connects the parts with each other and with the configuration, which is set. They are opened later.
void gw_daemon_compose(gw_daemon_t *self);

/// Opens epoll and signal descriptors and watches all descriptors of the daemon. From then on only the loop reads
/// SIGTERM, SIGINT and SIGHUP. Returns 0 or an errno.
int gw_loop_open(gw_daemon_t *daemon);
void gw_loop_close(gw_daemon_t *daemon);

/// Runs until a signal requests the end and the wheels have stopped. Returns 0, or an errno if waiting failed.
int gw_loop_run(gw_daemon_t *daemon);

#endif
