// SPDX-License-Identifier: MIT
/// /diagnostics and iwheel/state: what is wrong, in a sentence with its cure. Pure.
#ifndef ROS2_DIAGNOSIS_H
#define ROS2_DIAGNOSIS_H

#include "facts.h"

/// As diagnostic_msgs/DiagnosticStatus has them.
typedef enum { ROS_OK = 0, ROS_WARN, ROS_ERROR, ROS_STALE } ros_level_t;

typedef enum {
    ROS_TELLS_GATEWAY = 0,
    ROS_TELLS_ESTOP,
    ROS_TELLS_BUS,
    ROS_TELLS_TIMING,
    ROS_TELLS_LEFT,
    ROS_TELLS_RIGHT,
    ROS_REPORTS_ASSUMPTIONS,
    ROS_TELLS_COMMANDS,
    ROS_TELLS
} ros_tells_t;

#define ROS_VALUES_MAX 12U

typedef struct {
    const char *key; ///< With its unit.
    char text[24];   ///< Empty: not known.
} ros_value_t;

typedef struct {
    ros_level_t level;
    unsigned value_count;
    const char *name; ///< Of the part; the name of the node comes before it.
    ros_value_t values[ROS_VALUES_MAX];
    char message[ROS_SENTENCE_SIZE + 100U];
} ros_status_t;

void ros_diagnose(const ros_facts_t *facts, ros_tells_t which, ros_status_t *out_status);

/// What changes without words: two equal texts need not be told twice. One JSON object, for the topic iwheel/state.
void ros_state_json(const ros_facts_t *facts, char *out, size_t size);

#endif
