// SPDX-License-Identifier: MIT
/// Contents of /diagnostics and iwheel/state: each problem as one sentence with its fix. Pure.
#ifndef ROS2_DIAGNOSIS_H
#define ROS2_DIAGNOSIS_H

#include "facts.h"

/// Levels, with the values of diagnostic_msgs/DiagnosticStatus.
typedef enum { ROS_OK = 0, ROS_WARN, ROS_ERROR, ROS_STALE } ros_level_t;

typedef enum {
    ROS_REPORT_GATEWAY = 0,
    ROS_REPORT_ESTOP,
    ROS_REPORT_BUS,
    ROS_REPORT_TIMING,
    ROS_REPORT_LEFT,
    ROS_REPORT_RIGHT,
    ROS_REPORTS_ASSUMPTIONS,
    ROS_REPORT_COMMANDS,
    ROS_REPORTS
} ros_report_t;

#define ROS_VALUES_MAX 12U

typedef struct {
    const char *key; ///< Name with unit.
    char text[24];   ///< Value; empty: not known.
} ros_value_t;

typedef struct {
    ros_level_t level;
    unsigned value_count;
    const char *name; ///< Name of the part. `ros_publish_diagnostics` puts the name of the node before it.
    ros_value_t values[ROS_VALUES_MAX];
    char message[ROS_SENTENCE_SIZE + 100U];
} ros_status_t;

/// Writes level, sentence and values of one part to `*out_status`.
void ros_diagnose(const ros_facts_t *facts, ros_report_t which, ros_status_t *out_status);

/// Writes the JSON object of the topic iwheel/state. Equal texts mean that nothing has changed.
void ros_state_json(const ros_facts_t *facts, char *out, size_t size);

#endif
