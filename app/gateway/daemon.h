// SPDX-License-Identifier: MIT
/// The parts of the gateway, composed: allocated once at start, known here, to main.c and to loop.c and to nobody else. A module takes
/// the part that it is about.
///
/// One cycle of the loop (loop.c), always in this order:
///
///     wait -> signals -> who drives, if nothing else is due -> bus and e-stop (core step) -> what changed (answers/)
///          -> clients (answers/)
///          -> step again if they asked for something -> new clients -> flush -> what is kept (ledger/) -> watchdog
///
/// so that the wheels come before everybody who talks about them. Work per cycle is bounded in each of these places.
#ifndef GATEWAY_DAEMON_H
#define GATEWAY_DAEMON_H

#include "answers/answers.h"
#include "box/box.h"
#include "bus/bus_facts.h"
#include "config/gateway_config.h"
#include "ledger/knowledge.h"
#include "lock/runtime.h"
#include "process/notify.h"
#include "sockets/clients.h"
#include "sockets/log.h"
#include "sockets/wakeup.h"
#include "wheels/wheels.h"

typedef struct gw_daemon {
    gateway_config_t config;
    gw_log_t log;
    gw_notify_t notify;
    gw_runtime_t runtime;
    gw_wakeup_t wakeup;
    gw_box_t box;
    gw_wheels_t wheels;
    gw_bus_facts_t facts;
    gw_knowledge_t knowledge;
    gw_clients_t clients;
    gw_answers_t answers;
    iw_time_us_t suspended_us; ///< Of the machine, as last looked at.
    iw_time_us_t clocks_us;    ///< When both clocks are read next, though nothing is late.
    iw_time_us_t awaited_us;   ///< Until when the last wait was to last at the most.
    iw_time_us_t box_look_us;  ///< When the black box's writer is listened to next.
    iw_client_t holder;        ///< Of the lease, as of the last step: served first.
    int signal_fd;
    bool gave_way;          ///< It shuts down because somebody else's gateway goes before it.
    iw_time_us_t frames_us; ///< When frames were taken last.
    iw_time_us_t mark_us;   ///< When a change of the crash marker that failed is tried again; 0: none did.
    uint32_t silent_pairs;  ///< Setpoint pairs handed over until the last silence.
    iw_time_us_t look_us;   ///< When bus and e-stop are looked at though nothing has woken us.
    bool driving;           ///< The wheels are armed, and follow the holder of the lease.
    bool frames_may_wait;   ///< As far as the wheels are concerned.
    bool frames_wait;       ///< The bus wakes nobody for now: its frames are taken together.
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
