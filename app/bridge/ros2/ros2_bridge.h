// SPDX-License-Identifier: MIT
/// The bridge: a client of the gateway on one side, a node of ROS on the other. One loop, fixed memory.
///
/// One thread does all work except for a drive command: the DDS thread that received it forwards it, if the loop is
/// waiting, because waking another thread would take longer than everything else. Each thread holds `lock` while it
/// uses `bridge_t`. The DDS thread only tries to lock; if the lock is held, it wakes the loop instead. So DDS never
/// waits for the bridge.
///
/// The lease belongs to the first publisher that drives after the grant. The bridge drops commands of other publishers
/// until the wheels were stopped.
///
/// The bridge forwards each command at most once and repeats nothing, so the gateway's lease stops the wheels however
/// the bridge ends. If the source falls silent while the bridge holds the lease, the bridge requests one stop. It
/// always forwards a person's stop. After any stop a person must arm again, unless `ros_auto_command` permits more.
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
    ros_ages_t ages;       ///< Ages of commands and requests by the time stamps of DDS.
    ros_ages_t stamp_ages; ///< Ages of commands by the time stamps in their headers.
    ros_auto_t auto_arm;
    int64_t leased_us;    ///< Time of the grant of the lease to this bridge; 0: no lease.
    uint64_t driver;      ///< The first publisher that drove since the grant; 0: none has driven.
    bool assumptions_due; ///< Read the assumptions from the next snapshot, in every state of the link.
    bool silenced;        ///< The bridge requested a stop because the source fell silent; the event is outstanding.
    bool gone_reported;   ///< The log has the warning. A gateway that accepts and fails again is one absence.
    int64_t received_us;  ///< Reception of the last snapshot.
    int64_t commanded_us; ///< Time at which the last command was forwarded; 0: none since arming.
    int64_t coming_us;    ///< Reception of the last command, forwarded or not; 0: none.
    int64_t moved_us;     ///< Reception of the last command that was not zero; 0: none.
    ros_estop_t estop;    ///< State that iwheel/emergency_stop shows.
    iwc_value_t shown;    ///< Number of the stop that iwheel/state shows.
    int64_t shown_us;     ///< Time since which iwheel/state shows it.
    unsigned rate_hz;     ///< Requested rate of the snapshots; 0: refused.
    int64_t rate_id;      ///< Id of the request for another rate; 0: none.
    int64_t used_us;      ///< Time at which DDS last had a node matched with the bridge, or of the connection.
    int64_t used_next_us; ///< Time of the next such check.
    int64_t retry_us;     ///< Time of the next attempt to connect.
    int64_t backoff_us;   ///< Interval to the attempt after that.
    int64_t second_us;    ///< Time at which the reports once per second are due.
    char state[2048];     ///< The last iwheel/state.
} bridge_t;

/// Joins the domain and tries once to connect to the gateway, which may also start later. Returns 0, or an exit code of
/// sysexits after an error line on stderr: 69 no DDS, 77 the gateway refuses this user.
int bridge_open(bridge_t *self, const ros_settings_t *settings);

/// Does all work that is due. Waits at most 400 ms, for a gateway that hangs.
void bridge_step(bridge_t *self);

/// Returns the time until `bridge_step` has work that no descriptor announces, in ms. Writes the gateway's descriptor
/// to `*out_fd` (-1: none).
int bridge_wait_ms(bridge_t *self, int *out_fd);

/// Stops the wheels if this bridge holds the lease, and leaves the domain.
void bridge_close(bridge_t *self);

#endif
