// SPDX-License-Identifier: MIT
/// What the bridge knows of the machine and of itself: all that its topics, its diagnostics and its decisions rest on.
#ifndef ROS2_FACTS_H
#define ROS2_FACTS_H

#include "odometry.h"

#include "iwheel_client/client.h"

#define ROS_SENTENCE_SIZE 600U
/// Keys of the configuration that odometry and driving depend on.
#define ROS_CONFIGURED 4U

///     GONE --snapshot--> UP --none for 0.15 s--> SILENT --snapshot--> UP; UP, SILENT --connection lost--> GONE
typedef enum {
    ROS_LINK_GONE = 0, ///< No connection to the gateway.
    ROS_LINK_SILENT,   ///< Connected, but no snapshot came for too long.
    ROS_LINK_UP
} ros_link_t;

#define ROS_TYPE_SIZE  96U
#define ROS_TOPIC_SIZE 160U

/// Publishers that send to cmd_vel and are not received, as DDS announces them. All texts are of the characters that ROS allows in names.
typedef struct {
    unsigned count;
    char topic[ROS_TOPIC_SIZE]; ///< The whole name of cmd_vel.
    char type[ROS_TYPE_SIZE];   ///< Of one of them, as ROS writes it.
    const char *policy;         ///< Its QoS policy that does not match; empty: its type does not.
    const char *wanted;         ///< The types that are received.
    /// Another topic whose name ends with cmd_vel and that has a publisher of Twist or TwistStamped; empty: none.
    char elsewhere[ROS_TOPIC_SIZE];
} ros_unmatched_t;

/// Commands since the start.
typedef struct {
    unsigned publishers;             ///< Of cmd_vel, now.
    uint64_t passed;                 ///< Handed to the gateway, each once.
    uint64_t late;                   ///< Too old, from the future, or overtaken.
    uint64_t unknown;                ///< Of a writer whose clock is not known yet, and not zero.
    uint64_t others;                 ///< Of another publisher than the one that has the wheels, and not zero.
    uint64_t bad;                    ///< No numbers, or out of any range.
    uint64_t unsent;                 ///< The gateway was gone or did not read.
    uint64_t refused;                ///< By the gateway.
    char refusal[ROS_SENTENCE_SIZE]; ///< Why the last one was refused, and the cure; empty since one was accepted.
    bool coming;                     ///< One came within the last second.
    bool unusable;                   ///< The last one was no usable numbers.
    ros_unmatched_t unmatched;
} ros_commands_t;

/// Of a snapshot; and of the last stop the sentence.
typedef struct {
    iwc_state_t now;
    int64_t wall_us;
    char estop[16];
    char pressed_at[16];  ///< Of two contacts: neither, line, line2, both; empty: it has one.
    bool estop_tried;     ///< Its button was seen to work on this wiring.
    bool estop_simulated; ///< It is the button of a simulator.
    bool holding;         ///< Zeros are held until release or arm.
    bool rolling;         ///< A wheel turns although nothing is sent to it.
    char bus[16];
    char timing[16];
    char holder[65]; ///< Name of who has the lease.
    int64_t lease_ms;
    /// What a gateway without a file has in its configuration, by ros_facts_read_config: a board's ledger has no values.
    char configured[ROS_CONFIGURED][24];
    int64_t radius_mm;
    int64_t track_mm; ///< 0: not configured, so no turn is known.
    ros_measures_t measures;
    bool setpoint_current;                ///< A twist has no current, but the configuration wants one.
    char contradicted[ROS_SENTENCE_SIZE]; ///< Of the assumption ledger, with the cure; empty: nothing.
    unsigned assumed;                     ///< Entries that nothing has verified yet.
    char stop[ROS_SENTENCE_SIZE];
    iwc_value_t stop_number; ///< As the gateway counts; not known: there was none.
} ros_machine_t;

typedef struct {
    ros_link_t link;
    char trouble[256]; ///< Why there is no connection.
    bool drive;        ///< Configured to drive.
    ros_machine_t machine;
    ros_commands_t commands;
    unsigned odometry_restarts;
} ros_facts_t;

/// The e-stop as iwheel/emergency_stop publishes it. A line that cannot be read, or whose gateway is gone, counts as pressed.
typedef enum {
    ROS_ESTOP_NO_LINE = 0, ///< None is configured, or the gateway was never connected.
    ROS_ESTOP_RELEASED,
    ROS_ESTOP_PRESSED
} ros_estop_t;

ros_estop_t ros_facts_estop(const ros_facts_t *facts);

/// `geometry_msgs/msg/Twist` of `geometry_msgs::msg::dds_::Twist_`, cut to `size`; a character that ROS does not allow becomes `?`.
void ros_facts_type_name(const char *dds, char *out, size_t size);

/// Takes in a snapshot (event `state`, reply to `status`). False, with `*out_machine` untouched, if it is none.
bool ros_facts_read(const iwc_t *gateway, const iwc_message_t *message, ros_machine_t *out_machine);

/// Takes in the reply to `config`, if it is one. Whether the ledger lacks values, so that it has to be asked for: `ros_facts_lack_values`.
void ros_facts_read_config(const iwc_message_t *reply, ros_machine_t *machine);
bool ros_facts_lack_values(const iwc_message_t *snapshot);

/// Takes in what the ledger of a snapshot says: measures, contradictions. Dearer, and seldom new.
void ros_facts_read_assumptions(const iwc_message_t *message, ros_machine_t *machine);

#endif
