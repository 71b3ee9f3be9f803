// SPDX-License-Identifier: MIT
/// Private to the DDS side: entities, and the strings that its samples point to.
#ifndef ROS2_ROS_PARTS_H
#define ROS2_ROS_PARTS_H

#include "raw.h"
#include "ros.h"

#include <dds/dds.h>

/// The longest name of a DDS topic with its terminator.
#define ROS_NAME_SIZE 200U
/// A namespace and a node.
#define ROS_ROBOT_SIZE 132U
/// The prefix of a frame and the name of a handle.
#define ROS_FRAME_SIZE 80U

/// By its hash a newer ROS knows whether both sides mean the same type (REP-2011).
typedef struct {
    const char *name; ///< With a leading / outside of the namespace.
    const dds_topic_descriptor_t *type;
    const char *hash;
    bool retained; ///< Late readers get the last one: transient local.
} ros_topic_t;

typedef enum {
    WRITES_ODOM = 0,
    WRITES_JOINTS,
    WRITES_TF,
    WRITES_LEFT_WRENCH,
    WRITES_RIGHT_WRENCH,
    WRITES_LEFT_BATTERY,
    WRITES_RIGHT_BATTERY,
    WRITES_DIAGNOSTICS,
    WRITES_STATE,
    WRITES_ANSWER,
    WRITES_ESTOP,
    WRITERS
} writer_t;

/// Replies that wait at a time; of more, the oldest leaves at once.
#define ROS_WAITING 8U

/// A reply whose caller is not known as a reader yet: DDS would send it to nobody.
typedef struct {
    bool used;
    ros_verb_t verb;
    uint64_t source;   ///< The writer of the request.
    uint64_t until_us; ///< By bridge_now_us; then it leaves all the same.
    ros_raw_t raw;
} ros_reply_t;

struct ros {
    ros_settings_t settings;
    dds_entity_t domain; ///< 0: not ours.
    dds_entity_t participant;
    dds_entity_t writers[WRITERS];              ///< 0: not offered.
    dds_entity_t commands[ROS_COMMAND_READERS]; ///< 0: not driving, or not this type.
    dds_entity_t asks;
    dds_entity_t requests[ROS_VERBS];
    dds_entity_t replies[ROS_VERBS];
    ros_reply_t waiting[ROS_WAITING]; ///< The oldest first.
    dds_entity_t graph;
    int fd; ///< An eventfd: DDS has something for us.
    ros_came_t came;
    void *context;                   ///< Of `came`.
    char robot[ROS_ROBOT_SIZE];      ///< Namespace and node, by which /diagnostics tells two machines apart.
    char handles[2][ROS_FRAME_SIZE]; ///< Frames of the forces, left and right.
    char text[2048];
};

/// `rt/odom`, in a namespace `rt/w1/odom`.
void ros_name(const ros_t *self, const char *name, const char *prefix, const char *suffix, char out[ROS_NAME_SIZE]);

/// The caller, or who makes the entity with it, deletes it.
dds_qos_t *ros_qos(const char *user_data, int32_t depth, bool reliable, bool retained);
dds_entity_t ros_reader(ros_t *self, dds_entity_t topic, dds_qos_t *qos, dds_on_data_available_fn react);
dds_entity_t ros_writer(ros_t *self, dds_entity_t topic, dds_qos_t *qos);

/// Bounds what CycloneDDS writes to stderr.
void ros_limit_log(void);

/// Makes `ros_fd` readable; for a reader that has something.
void ros_wake(dds_entity_t reader, void *context);

/// The service of a verb, in the form of every vendor. False: DDS refuses it.
bool ros_open_service(ros_t *self, ros_verb_t verb);

/// Writes the replies that waited for their callers, or waited long enough.
void ros_send_replies(ros_t *self);

/// Nothing is a reply any more that leaves from here on.
void ros_close_services(ros_t *self);

#endif
