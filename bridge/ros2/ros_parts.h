// SPDX-License-Identifier: MIT
/// Private to the DDS side: entities, and the strings that its samples point to.
#ifndef ROS2_ROS_PARTS_H
#define ROS2_ROS_PARTS_H

#include "ros.h"

#include <dds/dds.h>

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
    WRITERS
} writer_t;

struct ros {
    ros_settings_t settings;
    dds_entity_t domain; ///< 0: not ours.
    dds_entity_t participant;
    dds_entity_t writers[WRITERS]; ///< 0: not offered.
    dds_entity_t commands;         ///< 0: not driving.
    dds_entity_t asks;
    dds_entity_t requests[ROS_VERBS];
    dds_entity_t replies[ROS_VERBS];
    dds_entity_t graph;
    int fd; ///< An eventfd: DDS has something for us.
    ros_came_t came;
    void *context; ///< Of `came`.
    char text[2048];
};

#endif
