// SPDX-License-Identifier: MIT
/// Private to the DDS side: entities, and the strings that its samples point to.
#ifndef ROS2_ROS_PARTS_H
#define ROS2_ROS_PARTS_H

#include "raw.h"
#include "ros.h"

#include <dds/dds.h>

/// Size of the longest name of a DDS topic, with its terminator.
#define ROS_NAME_SIZE 200U
/// Size of a namespace and the name of a node.
#define ROS_ROBOT_SIZE 132U
/// Size of the prefix of a frame and the name of a handle.
#define ROS_FRAME_SIZE 80U

typedef struct {
    const char *name; ///< A leading / places the topic outside of the namespace.
    const dds_topic_descriptor_t *type;
    const char
        *hash;     ///< Newer releases of ROS compare it to find out whether both sides have the same type (REP-2011).
    bool retained; ///< Transient local: a late reader receives the last sample.
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

/// Replies that can wait at the same time. If there are more, the oldest is sent immediately.
#define ROS_WAITING ROS_MARKS

/// A reply whose caller DDS does not know as a reader yet. DDS would send it to no reader.
typedef struct {
    bool used;
    ros_verb_t verb;
    uint64_t source;   ///< The writer of the request.
    uint64_t until_us; ///< Time, by bridge_now_us, at which the reply is sent in any case.
    ros_raw_t raw;
} ros_reply_t;

struct ros {
    ros_settings_t settings;
    dds_entity_t domain; ///< 0: CycloneDDS created the domain with its own configuration.
    dds_entity_t participant;
    dds_entity_t writers[WRITERS];              ///< 0: the topic is not offered.
    dds_entity_t commands[ROS_COMMAND_READERS]; ///< 0: driving or this type is disabled.
    dds_entity_t asks;
    dds_entity_t requests[ROS_VERBS];
    dds_entity_t replies[ROS_VERBS];
    ros_reply_t waiting[ROS_WAITING]; ///< The oldest first.
    dds_entity_t graph;
    int64_t searched_us; ///< Time of the last search for publishers that do not match; 0: none yet.
    int fd;              ///< An eventfd, readable when DDS has a sample.
    ros_came_t came;
    void *context;                   ///< Argument of `came`.
    char robot[ROS_ROBOT_SIZE];      ///< Namespace and node, which distinguish two machines in /diagnostics.
    char handles[2][ROS_FRAME_SIZE]; ///< Frames of the forces, left and right.
    char text[2048];                 ///< Text of the last sample on iwheel/answer.
};

/// Writes the DDS name of a topic: `rt/odom`, in a namespace `rt/w1/odom`.
void ros_name(const ros_t *self, const char *name, const char *prefix, const char *suffix, char out[ROS_NAME_SIZE]);

/// Creates QoS settings. The caller deletes them, or passes them to `ros_reader` or `ros_writer`, which delete them.
dds_qos_t *ros_qos(const char *user_data, int32_t depth, bool reliable, bool retained);
dds_entity_t ros_reader(ros_t *self, dds_entity_t topic, dds_qos_t *qos, dds_on_data_available_fn react);
dds_entity_t ros_writer(ros_t *self, dds_entity_t topic, dds_qos_t *qos);

/// Limits the lines that CycloneDDS writes to stderr.
void ros_limit_log(void);

/// Makes `ros_fd` readable. DDS calls it when a reader has a sample.
void ros_wake(dds_entity_t reader, void *context);

/// Opens the service of a verb, in the form of every vendor. Returns false if DDS refuses it.
bool ros_open_service(ros_t *self, ros_verb_t verb);

/// Writes each waiting reply whose caller can read it now, or whose time is over.
void ros_send_replies(ros_t *self);

/// Returns the time, by bridge_now_us, when a program last announced a writer or the end of one; 0: never. DDS may not
/// have processed the announcement yet.
int64_t ros_announced_us(void);

/// Stops marking messages that leave the process as replies.
void ros_close_services(ros_t *self);

#endif
