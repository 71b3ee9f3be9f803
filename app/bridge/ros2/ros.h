// SPDX-License-Identifier: MIT
/// The DDS side: a node with its topics and services, as ROS 2 sees them. Everything that knows DDS is behind this header.
///
/// DDS receives in threads of its own; they wake us, or have a command carried out where it came. All else is taken and written by the
/// caller's thread, and nothing here waits: writers keep the last ten, a reader that does not keep up loses.
#ifndef ROS2_ROS_H
#define ROS2_ROS_H

#include "diagnosis.h"
#include "ros_settings.h"
#include "services.h"

typedef struct ros ros_t;

typedef enum { ROS_ARM = 0, ROS_STOP, ROS_ESTOP, ROS_RESET, ROS_VERBS } ros_verb_t;

/// Called in a thread of DDS when a command came, from before `ros_open` returns until `ros_close` does. True: it was taken; false: wake us.
typedef bool (*ros_came_t)(void *context);

/// Joins the domain. `came` may be NULL. NULL after a complaint on `err`.
ros_t *ros_open(const ros_settings_t *settings, ros_came_t came, void *context, FILE *err);
void ros_close(ros_t *self);

/// Readable when something came. `ros_woken` is called before taking it, and once a second at least: it also writes the replies that waited.
int ros_fd(const ros_t *self);
void ros_woken(ros_t *self);

typedef struct {
    double linear[3];
    double angular[3];
    uint64_t source;  ///< Of its publisher, never 0.
    int64_t sent_us;  ///< By the publisher's clock, from DDS.
    int64_t stamp_us; ///< Of its header; 0: it has none.
} ros_command_t;

/// The types of cmd_vel: Twist and TwistStamped, one reader each.
#define ROS_COMMAND_READERS 2U

/// The newest command of one reader since the last call; false: none.
bool ros_take_command(ros_t *self, unsigned reader, ros_command_t *out_command);

/// How many publishers of cmd_vel are received.
unsigned ros_publishers(const ros_t *self);

/// Finds the publishers of cmd_vel that are not received. The cost grows with the number of writers in the domain.
void ros_find_unmatched(ros_t *self, ros_unmatched_t *out);

typedef struct {
    ros_verb_t verb;
    bool by_topic;       ///< Else a service, and `caller` knows the answer by what it sent.
    ros_caller_t caller; ///< ROS_FORM_UNREADABLE: nobody can tell what was wanted, but on which topic.
    uint64_t source;     ///< As of a command.
    int64_t sent_us;
} ros_request_t;

/// A request, from a service or the topic iwheel/ask; false: none. Every sample with data on the topic of a service is one; that a client
/// comes, goes or disposes of something is none.
bool ros_take_request(ros_t *self, ros_request_t *out_request);
void ros_answer(ros_t *self, const ros_request_t *request, bool success, const char *text);

/// odom, joint_states, and with [odometry] tf the transform. What the machine does not know is left out.
void ros_publish_motion(ros_t *self, const ros_machine_t *machine, const ros_odometry_t *odometry);
void ros_publish_wrench(ros_t *self, const ros_machine_t *machine);
void ros_publish_battery(ros_t *self, const ros_machine_t *machine);

/// `statuses` has ROS_TELLS entries, whose names get the name of the node before them; `wall_us` is now.
void ros_publish_diagnostics(ros_t *self, const ros_status_t *statuses, int64_t wall_us);
void ros_publish_state(ros_t *self, const char *json);

/// iwheel/emergency_stop: true if pressed.
void ros_publish_estop(ros_t *self, bool pressed);

#endif
