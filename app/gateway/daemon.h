// SPDX-License-Identifier: MIT
/// Everything the gateway is made of, in one place, allocated once at start.
///
/// One cycle of the loop (loop.c), always in this order:
///
///     wait -> signals -> bus and e-stop (core step) -> what changed (status/) -> clients (answers/)
///          -> step again if they asked for something -> new clients -> flush -> what is kept (ledger/) -> watchdog
///
/// so that the wheels come before everybody who talks about them. Work per cycle is bounded in each of these places.
#ifndef GATEWAY_DAEMON_H
#define GATEWAY_DAEMON_H

#include "box/box.h"
#include "box/tape.h"
#include "bus/gaps.h"
#include "clients/client.h"
#include "clients/listener.h"
#include "gateway_config.h"
#include "ledger/knowledge.h"
#include "process/log.h"
#include "process/notify.h"
#include "process/runtime.h"
#include "process/wakeup.h"

#include "iwheel/evidence.h"
#include "iwheel/gateway.h"
#include "iwheel_linux/linux_hal.h"
#include "iwheel_northbound/why.h"

/// Slots of those who may drive, and behind them of those who may only watch: neither takes the others'.
#define GW_DRIVERS_MAX  64U
#define GW_WATCHERS_MAX 64U
#define GW_CLIENTS_MAX  (GW_DRIVERS_MAX + GW_WATCHERS_MAX)
#define GW_WARNINGS     8U
#define GW_WARNING_SIZE 400U

/// What was last told to the log and to watchers, so that only changes are told.
typedef struct {
    iw_state_t state;
    iw_bus_state_t bus;
    iw_client_t holder;
    uint32_t present; ///< Latching causes, as a bit each.
    uint32_t stop_number;
    uint32_t still_moving;
    bool left_behind;
    int estop;
    bool started; ///< The first observation only takes notes.
    char holder_name[IWN_NAME_MAX + 1U];
    char holder_text[GW_CLIENT_TEXT_SIZE];
} gw_observed_t;

/// Who asked for a stop, or an e-stop, last. `at_us` 0: nobody yet.
typedef struct {
    iw_time_us_t at_us;
    int pid;
    uid_t uid;
} gw_stopper_t;

typedef struct gw_daemon {
    gateway_config_t config;
    gw_log_t log;
    gw_notify_t notify;
    gw_runtime_t runtime;
    gw_wakeup_t wakeup;
    gw_listener_t listener[GW_RIGHTS];
    gw_box_t box;
    gw_tape_t tape;
    iw_linux_hal_t hal;
    iw_gateway_t gateway;
    gw_observed_t observed;
    gw_gaps_t gaps;
    gw_knowledge_t knowledge;
    iw_motion_evidence_t evidence;
    iwn_stop_note_t last_stop;
    iw_time_us_t now_us;       ///< Of the present cycle.
    iw_time_us_t woken_us;     ///< When the wait ended: what a client sends later than this was not waiting then.
    iw_time_us_t suspended_us; ///< Of the machine, as last looked at.
    iw_time_us_t step_next_us; ///< As the last step wished.
    iw_time_us_t box_look_us;  ///< When the black box's writer is listened to next.
    iw_client_t last_client;
    uint32_t clients; ///< Watchers among them.
    uint32_t watchers;
    uint32_t next_served[GW_RIGHTS];  ///< Slot where the next round begins.
    uint32_t next_flushed[GW_RIGHTS]; ///< The same of sending.
    int epoll_fd;
    int signal_fd;
    bool shutting_down;
    bool gave_way;         ///< It shuts down because somebody else's gateway goes before it.
    bool clients_waiting;  ///< The last round did not reach everybody.
    bool lines_waiting;    ///< The same of sending.
    bool requested;        ///< A request has changed something since the last step.
    bool frames_wait;      ///< The bus wakes nobody for now: its frames are taken together.
    uint32_t link_changes; ///< What of the link was last passed on.
    iw_link_purge_t purge_told;
    bool link_known;
    bool left_told; ///< That a setpoint was left in the controller.
    uint32_t warnings;
    char warning[GW_WARNINGS][GW_WARNING_SIZE];
    char estop_reason[IWN_REASON_MAX + 1U]; ///< Of the last software e-stop.
    gw_stopper_t stopped_by;
    gw_stopper_t estopped_by;
    char line[GW_REPLY_MAX]; ///< Where replies and events are written.
    iwn_work_t work;         ///< For reading requests.
    gw_client_t client[GW_CLIENTS_MAX];
} gw_daemon_t;

/// The open connection with this number; NULL if it is gone.
gw_client_t *gw_daemon_client(gw_daemon_t *self, iw_client_t id);

/// What is known of the wheels now: after a step or a request, look again.
iw_snapshot_t gw_daemon_look(const gw_daemon_t *self);

/// True while setpoints are sent, or about to be.
bool gw_daemon_is_sending(const gw_daemon_t *self);

#endif
