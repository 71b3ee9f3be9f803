// SPDX-License-Identifier: MIT
/// A DDS type whose samples are the serialised bytes as received. DDS decodes nothing, so it cannot drop a sample that
/// it cannot decode. The bridge uses it for service topics, whose payload differs between vendors.
#ifndef ROS2_RAW_H
#define ROS2_RAW_H

#include "services.h"

#include <dds/dds.h>

/// Longer samples are cut. Samples of a service are shorter.
#define ROS_RAW_MAX 1024U

typedef struct {
    size_t size; ///< Size as received; `bytes` holds ROS_RAW_MAX at most.
    uint8_t bytes[ROS_RAW_MAX];
    ros_caller_t caller; ///< Sample identity of a sample from the network; otherwise zeros.
} ros_raw_t;

/// Creates a topic of this name and type. Returns it, or a negative error of dds_create_topic.
dds_entity_t ros_raw_topic(dds_entity_t participant, const char *name, const char *type);

#endif
