// SPDX-License-Identifier: MIT
/// The bridge: a client of the gateway on one side, a node on the other. One loop, fixed memory.
///
/// One thread does everything, but for the plain command that drives: that is passed on by the thread of DDS that received it, if the loop is
/// waiting, because to wake another thread would take longer than all the rest. Whoever touches what is below holds `lock`; the thread of
/// DDS only tries it, and wakes the loop if it is held: so DDS never waits for us.
///
/// The lease belongs to the first publisher that drives after it was granted; what others publish is dropped until the wheels were stopped.
///
/// It passes a command on at most once and repeats nothing, so the wheels stop by the gateway's lease however it ends. Silence of its source
/// makes it stop once, if it holds the lease; a person's stop is passed on always. After any stop somebody arms again.
#ifndef ROS2_BRIDGE_H
#define ROS2_BRIDGE_H

#include "ages.h"
#include "commands.h"
#include "ros.h"

#include <pthread.h>

typedef struct {
    pthread_mutex_t lock;
    ros_settings_t settings;
    iwc_t *gateway;
    ros_t *ros;
    ros_facts_t facts;
    ros_odometry_t odometry;
    ros_ages_t ages;       ///< By the time at which DDS says that a command or request was sent,
    ros_ages_t stamp_ages; ///< and by the one in a command's header.
    ros_auto_t auto_arm;
    int64_t leased_us;    ///< When this bridge was granted the lease; 0: it has none.
    uint64_t driver;      ///< The publisher that has the wheels: the first that drove since then; 0: none has driven.
    bool assumptions_due; ///< Read it out of the next snapshot, in every state of the link.
    bool silenced;        ///< The stop that comes is ours: the source was silent. The lease has ended already.
    bool told_gone;       ///< In the log; in every state: a gateway that accepts and fails again is one absence.
    int64_t received_us;  ///< When the last snapshot came.
    int64_t commanded_us; ///< When the last command was passed on; 0: none since armed.
    int64_t coming_us;    ///< When the last command came, passed or not,
    int64_t moved_us;     ///< and the last one that was not zero; 0: none.
    ros_estop_t estop;    ///< As iwheel/emergency_stop shows it.
    iwc_value_t shown;    ///< Number of the stop that iwheel/state shows,
    int64_t shown_us;     ///< since then.
    int64_t retry_us;     ///< When to connect again,
    int64_t backoff_us;   ///< and how long to wait after that.
    int64_t second_us;    ///< When what is told once a second is due.
    char state[2048];     ///< The last iwheel/state.
} bridge_t;

/// Joins the domain and calls the gateway once; that may be there later too. 0, or an exit code of sysexits after a complaint on stderr:
/// 69 no DDS, 77 the gateway's socket is not for us.
int bridge_open(bridge_t *self, const ros_settings_t *settings);

/// Does all that is due. Waits nowhere longer than a gateway that hangs needs to be seen: 400 ms.
void bridge_step(bridge_t *self);

/// When `bridge_step` has something to do without anything coming, in ms from now, and the gateway's descriptor (-1: there is none).
int bridge_wait_ms(bridge_t *self, int *out_fd);

/// Stops the wheels if they are ours, and leaves.
void bridge_close(bridge_t *self);

#endif
