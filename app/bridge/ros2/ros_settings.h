// SPDX-License-Identifier: MIT
/// The bridge's configuration file. config/settings.h reads it and reports every error with file, line and fix.
#ifndef ROS2_ROS_SETTINGS_H
#define ROS2_ROS_SETTINGS_H

#include "config/settings.h"

/// The bridge reads this file if the command line has no `-c FILE`. It may be absent.
#define ROS_SETTINGS_PATH "/etc/iwheel/ros2.conf"

/// Types of cmd_vel. Controllers of Jazzy send TwistStamped, most other programs send Twist.
typedef enum { ROS_COMMAND_TWIST = 1, ROS_COMMAND_STAMPED = 2, ROS_COMMAND_BOTH = 3 } ros_command_types_t;

typedef struct {
    struct {
        char socket[108];
    } gateway;
    struct {
        uint32_t domain;   ///< 0..232.
        bool loopback;     ///< True: this machine only, without multicast. False: as CYCLONEDDS_URI configures it.
        bool synchronised; ///< NTP or PTP synchronises the clocks of the other machines with this one.
        bool humble;       ///< ros_discovery_info has ids of 24 bytes, as before ROS Iron.
        char ns[65];       ///< Namespace, or `none`.
        char node[65];
    } ros;
    struct {
        bool enabled;
        uint8_t command; ///< Bits of the types that cmd_vel accepts: `ros_command_types_t`.
        uint32_t timeout_ms;
        bool auto_arm;
        bool allow_reset;
    } drive;
    struct {
        uint32_t rate_hz;
        char odom_frame[65];
        char base_frame[65];
        bool tf;
    } odometry;
} ros_settings_t;

/// The defaults.
extern const ros_settings_t ros_settings_standard;

extern const settings_form_t ros_settings_form;

/// Returns the namespace; empty: none.
const char *ros_settings_space(const ros_settings_t *settings);

#endif
