// SPDX-License-Identifier: MIT
/// A DDS type whose samples are their serialised bytes, as they are on the wire: nothing is decoded, so nothing that cannot be decoded is lost.
/// For service topics, whose payload has a form for each vendor.
#ifndef ROS2_RAW_H
#define ROS2_RAW_H

#include "services.h"

#include <dds/dds.h>

/// Longer samples are cut; none of a service is.
#define ROS_RAW_MAX 1024U

typedef struct {
    size_t size; ///< As it was on the wire; `bytes` holds ROS_RAW_MAX at most.
    uint8_t bytes[ROS_RAW_MAX];
    ros_caller_t caller; ///< The sample identity, of a sample that came from the network; else zeros.
} ros_raw_t;

/// A topic of this name and type; negative: as of dds_create_topic.
dds_entity_t ros_raw_topic(dds_entity_t participant, const char *name, const char *type);

#endif
