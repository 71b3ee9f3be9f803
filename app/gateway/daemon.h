// SPDX-License-Identifier: MIT
/// The parts of the gateway, composed: allocated once at start, known here, to main.c and to loop.c and to nobody else. A module takes
/// the part that it is about.
///
/// One cycle of the loop (loop.c) has one of two orders:
///
///     usual:   wait -> signals -> step of the core (bus, e-stop) -> what changed -> lines of clients
///              -> step again if they asked for something -> new clients -> flush -> what is kept (ledger/) -> watchdog
///     driving: wait -> signals -> lines of the lease's holder -> step of the core -> what changed -> lines of the others -> as above
///
/// so that the wheels come before everybody who talks about them. The second order is taken while the wheels are driven, the holder has
/// said something, and neither a step nor an edge of the e-stop is due: its command is judged by the look at bus and e-stop that follows
/// and leaves after one look instead of two. That saves two system calls before the command is on the bus (2.16 instead of 2.23 per frame
/// of docs/developer/speed.md, with 20 commands/s). Work per cycle is bounded in each of these places.
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

/// Whether the gateway goes on: SERVES --SIGTERM, SIGINT, SIGHUP--> ENDS, or SERVES --a gateway that goes before it--> GIVES_WAY. In both
/// the wheels are stopped, and the loop returns when nothing is sent to them any more.
typedef enum { GW_LOOP_SERVES, GW_LOOP_ENDS, GW_LOOP_GIVES_WAY } gw_loop_phase_t;

/// How closely the loop follows the bus. Each step of the core decides it:
///
///     RESTING --setpoints are sent--> ALERT --armed--> DRIVING --stop--> ALERT --no more setpoints--> RESTING
///
/// RESTING, DRIVING: frames may wait and are read together. ALERT (a stop, or arming): each frame wakes the loop.
typedef enum { GW_PACE_RESTING, GW_PACE_ALERT, GW_PACE_DRIVING } gw_pace_t;

/// Of loop.c alone; main.c sets `suspended_us` and reads `phase`.
typedef struct {
    gw_loop_phase_t phase;
    gw_pace_t pace;
    bool frames_wait; ///< The bus wakes nobody. Independent: watchers and a silent bus forbid what the pace permits.
    int signal_fd;
    iw_client_t holder;        ///< Of the lease, as of the last step: served first.
    iw_time_us_t suspended_us; ///< Of the machine, as last read.
    iw_time_us_t clocks_us;    ///< When both clocks are read next, though nothing is late.
    iw_time_us_t awaited_us;   ///< Until when the last wait was to last at the most.
    iw_time_us_t look_us;      ///< When bus and e-stop are read though nothing wakes the loop.
    iw_time_us_t frames_us;    ///< When frames were read last.
    iw_time_us_t box_look_us;  ///< When the black box's writer is polled next.
    iw_time_us_t mark_us;      ///< When a change of the crash marker that failed is tried again; 0: none did.
    uint32_t silent_pairs;     ///< Setpoint pairs sent until the last silence.
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

/// Tells the parts of each other and of the configuration, which is set. They are opened after that.
void gw_daemon_compose(gw_daemon_t *self);

/// Opens epoll and signal descriptors and watches everything the daemon has open. SIGTERM, SIGINT and SIGHUP
/// are then read by the loop and nowhere else. 0 or an errno.
int gw_loop_open(gw_daemon_t *daemon);
void gw_loop_close(gw_daemon_t *daemon);

/// Runs until a signal has asked for the end and the wheels have been brought to a stop. 0, or an errno if waiting
/// itself failed.
int gw_loop_run(gw_daemon_t *daemon);

#endif
