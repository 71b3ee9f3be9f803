// SPDX-License-Identifier: MIT
/// State of the machine and of the bridge: the input of its topics, its diagnostics and its decisions.
#ifndef ROS2_FACTS_H
#define ROS2_FACTS_H

#include "odometry.h"

#include "iwheel_client/client.h"

#define ROS_SENTENCE_SIZE 600U
/// Keys of the configuration that odometry and driving depend on.
#define ROS_CONFIGURED 4U
/// The assumptions of a gateway have about 4 kB. Longer ones are read each time.
#define ROS_ASSUMPTIONS_SIZE 8192U

///     GONE --snapshot--> UP --none for 0.15 s--> SILENT --snapshot--> UP; UP, SILENT --connection lost--> GONE
typedef enum {
    ROS_LINK_GONE = 0, ///< No connection to the gateway.
    ROS_LINK_SILENT,   ///< Connected, but no snapshot came for too long.
    ROS_LINK_UP
} ros_link_t;

#define ROS_TYPE_SIZE  96U
#define ROS_TOPIC_SIZE 160U

/// Publishers of cmd_vel that the bridge does not receive, as DDS announces them. All texts consist of the characters
/// that ROS allows in names.
typedef struct {
    unsigned count;
    char topic[ROS_TOPIC_SIZE]; ///< Full name of cmd_vel.
    char type[ROS_TYPE_SIZE];   ///< Type of one of these publishers, as ROS writes it.
    const char *policy;         ///< QoS policy of this publisher that does not match; empty: the type does not match.
    const char *wanted;         ///< Types that the bridge receives.
    /// Another topic whose name ends with cmd_vel and that has a publisher of Twist or TwistStamped; empty: none.
    char elsewhere[ROS_TOPIC_SIZE];
} ros_unmatched_t;

/// Commands since the start.
typedef struct {
    unsigned publishers;             ///< Present number of publishers of cmd_vel.
    uint64_t passed;                 ///< Forwarded to the gateway, each once.
    uint64_t late;                   ///< Dropped: too old, from the future, or overtaken.
    uint64_t unknown;                ///< Dropped: not zero, from a writer whose clock is not known yet.
    uint64_t others;                 ///< Dropped: not zero, from another publisher than the driver.
    uint64_t bad;                    ///< Dropped: not a number, or out of range.
    uint64_t unsent;                 ///< Not sent: the gateway was gone or did not read.
    uint64_t refused;                ///< Refused by the gateway.
    char refusal[ROS_SENTENCE_SIZE]; ///< Reason and fix of the last refusal; empty since a command was accepted.
    bool coming;                     ///< A command came within the last second.
    bool unusable;                   ///< The last command had no usable numbers.
    ros_unmatched_t unmatched;
} ros_commands_t;

/// Contents of the newest snapshot, and the sentence of the last stop.
typedef struct {
    iwc_state_t now;
    int64_t wall_us;
    char estop[16];
    char pressed_at[16];  ///< With two contacts: neither, line, line2 or both; empty: one contact.
    bool estop_tried;     ///< The gateway has seen the button work on this wiring.
    bool estop_simulated; ///< The button belongs to a simulator.
    bool holding;         ///< The gateway sends zeros until release or arm.
    bool rolling;         ///< A wheel turns although the gateway sends nothing to it.
    char bus[16];
    char timing[16];
    char holder[65]; ///< Name of the client that holds the lease.
    int64_t lease_ms;
    /// Values from the reply to `config`, see `ros_facts_read_config`: the assumption store of a board has no values.
    char configured[ROS_CONFIGURED][24];
    int64_t radius_mm;
    int64_t track_mm; ///< 0: not configured, so the bridge cannot compute turns.
    ros_measures_t measures;
    bool setpoint_current;                  ///< The configuration requires a current, which a twist does not have.
    char contradicted[ROS_SENTENCE_SIZE];   ///< Contradicted assumptions, with the fix; empty: none.
    unsigned assumed;                       ///< Assumptions that nothing has verified yet.
    size_t assumptions_length;              ///< 0: the next assumptions are read in any case.
    char assumptions[ROS_ASSUMPTIONS_SIZE]; ///< Text of the assumptions that were read last.
    char stop[ROS_SENTENCE_SIZE];           ///< Sentence of the last stop.
    iwc_value_t stop_number;                ///< Number of the last stop, as the gateway counts; not known: no stop yet.
} ros_machine_t;

typedef struct {
    ros_link_t link;
    char trouble[256]; ///< Why there is no connection.
    bool drive;        ///< The configuration permits driving.
    ros_machine_t machine;
    ros_commands_t commands;
    unsigned odometry_restarts;
} ros_facts_t;

/// The e-stop as iwheel/emergency_stop publishes it. A line that cannot be read, or whose gateway is gone, counts as
/// pressed.
typedef enum {
    ROS_ESTOP_NO_LINE = 0, ///< None is configured, or the gateway was never connected.
    ROS_ESTOP_RELEASED,
    ROS_ESTOP_PRESSED
} ros_estop_t;

ros_estop_t ros_facts_estop(const ros_facts_t *facts);

/// Converts a DDS type name (`geometry_msgs::msg::dds_::Twist_`) to that of ROS (`geometry_msgs/msg/Twist`), cut to
/// `size`. A character that ROS does not allow becomes `?`.
void ros_facts_type_name(const char *dds, char *out, size_t size);

/// Reads a snapshot (event `state`, reply to `status`). Returns false for any other message, with `*out_machine`
/// unchanged.
bool ros_facts_read(const iwc_t *gateway, const iwc_message_t *message, ros_machine_t *out_machine);

/// Reads the values in the reply to `config`; ignores other messages.
void ros_facts_read_config(const iwc_message_t *reply, ros_machine_t *machine);

/// Returns true if the assumptions of this snapshot have no values, so that the caller must request `config`.
bool ros_facts_lack_values(const iwc_message_t *snapshot);

/// Reads measures and contradictions from the assumptions of a snapshot. This is slower than `ros_facts_read`, so the
/// function compares the text first: if it and the configured values are those of the last call, nothing changes.
void ros_facts_read_assumptions(const iwc_message_t *message, ros_machine_t *machine);

#endif
