// SPDX-License-Identifier: MIT
/// The bridge's configuration file, read as the gateway's (config/settings.h): every error with file, line and cure.
#ifndef ROS2_ROS_SETTINGS_H
#define ROS2_ROS_SETTINGS_H

#include "config/settings.h"

/// Read when no `-c FILE` is given. Its absence is no error then.
#define ROS_SETTINGS_PATH "/etc/iwheel/ros2.conf"

/// Types of cmd_vel. ROS 2 programs send one or the other: Jazzy's controllers TwistStamped, most others Twist.
typedef enum { ROS_COMMAND_TWIST = 1, ROS_COMMAND_STAMPED = 2, ROS_COMMAND_BOTH = 3 } ros_command_types_t;

typedef struct {
    struct {
        char socket[108];
    } gateway;
    struct {
        uint32_t domain;   ///< 0..232.
        bool loopback;     ///< This machine only, without multicast; else as CYCLONEDDS_URI says.
        bool synchronised; ///< Other machines have this one's clock.
        bool humble;       ///< Ids of 24 bytes in ros_discovery_info, as before Iron.
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

/// The namespace before a relative name; empty: there is none.
const char *ros_settings_space(const ros_settings_t *settings);

#endif
