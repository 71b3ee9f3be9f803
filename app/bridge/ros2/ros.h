// SPDX-License-Identifier: MIT
/// The DDS side: a node of ROS 2 with its topics and services. All code that uses DDS is behind this header.
///
/// DDS receives in its own threads. Such a thread either wakes the caller's thread, or forwards a command itself. The
/// caller's thread reads and writes everything else. No function here waits: writers store the last ten samples, and a
/// reader that is too slow loses samples.
#ifndef ROS2_ROS_H
#define ROS2_ROS_H

#include "diagnosis.h"
#include "ros_settings.h"
#include "services.h"

typedef struct ros ros_t;

typedef enum { ROS_ARM = 0, ROS_STOP, ROS_ESTOP, ROS_RESET, ROS_VERBS } ros_verb_t;

/// DDS calls this function in one of its threads when a command came. The first call may come before `ros_open`
/// returns, the last one before `ros_close` returns. It returns true if it handled the command; otherwise `ros_fd`
/// becomes readable.
typedef bool (*ros_came_t)(void *context);

/// Joins the domain. `came` may be NULL. Returns NULL after an error line on `err`. The caller ends the result with
/// `ros_close`.
ros_t *ros_open(const ros_settings_t *settings, ros_came_t came, void *context, FILE *err);
void ros_close(ros_t *self);

/// Returns a descriptor that is readable when a sample came.
int ros_fd(const ros_t *self);

/// Resets `ros_fd` and writes the replies that waited. The caller calls it before it reads samples, and at least once a
/// second.
void ros_woken(ros_t *self);

typedef struct {
    double linear[3];
    double angular[3];
    uint64_t source;  ///< Identifies the publisher, never 0.
    int64_t sent_us;  ///< Time stamp of DDS, by the publisher's clock.
    int64_t stamp_us; ///< Time stamp in the header; 0: the type has no header.
} ros_command_t;

/// cmd_vel has two types, Twist and TwistStamped, with one reader each.
#define ROS_COMMAND_READERS 2U

/// Reads the newest command of one reader. Returns false if none came since the last call.
bool ros_take_command(ros_t *self, unsigned reader, ros_command_t *out_command);

/// Returns the number of publishers of cmd_vel from which the bridge receives.
unsigned ros_publishers(const ros_t *self);

/// Returns true if DDS has matched a node with a topic or a service of the bridge. Readers of the names of nodes do not
/// count.
bool ros_is_used(const ros_t *self);

/// Finds the publishers of cmd_vel from which the bridge does not receive. The cost grows with the number of writers in
/// the domain. `*out` has the result of the last call. It stays unchanged if it shows no such publisher, no program has
/// announced a writer in the last 2 s, and the last search was less than 10 s ago.
void ros_find_unmatched(ros_t *self, ros_unmatched_t *out);

typedef struct {
    ros_verb_t verb;
    bool by_topic;       ///< True: from iwheel/ask. False: from a service, and `caller` identifies the reply.
    ros_caller_t caller; ///< ROS_FORM_UNREADABLE: only the topic of the request is known.
    uint64_t source;     ///< Identifies the writer, as in a command.
    int64_t sent_us;     ///< Time stamp of DDS, by the writer's clock.
} ros_request_t;

/// Reads a request from a service or the topic iwheel/ask. Returns false if there is none. Every sample with data on
/// the topic of a service is a request; a sample without data, when a client joins, leaves or disposes of an instance,
/// is not.
bool ros_take_request(ros_t *self, ros_request_t *out_request);

/// Sends the reply to a request. If DDS does not know the caller's reader yet, the reply waits for it, at most a
/// second.
void ros_answer(ros_t *self, const ros_request_t *request, bool success, const char *text);

/// Publishes odom, joint_states, and with [odometry] tf the transform. Omits each message whose values are not known.
void ros_publish_motion(ros_t *self, const ros_machine_t *machine, const ros_odometry_t *odometry);
void ros_publish_wrench(ros_t *self, const ros_machine_t *machine);
void ros_publish_battery(ros_t *self, const ros_machine_t *machine);

/// Publishes `statuses`, which has ROS_REPORTS entries, with the name of the node before each name. `wall_us` is the
/// present time.
void ros_publish_diagnostics(ros_t *self, const ros_status_t *statuses, int64_t wall_us);
void ros_publish_state(ros_t *self, const char *json);

/// Publishes iwheel/emergency_stop.
void ros_publish_estop(ros_t *self, bool pressed);

#endif
