// SPDX-License-Identifier: MIT
/// The bridge's configuration file: `settings_load` of config/settings.h with `ros_settings_form` reads it into a
/// ros_settings_t, checks the ranges below, and reports every error with file, line and fix. The caller owns the
/// struct. It contains no pointers, and may be copied. Nothing here has a state or can fail.
#ifndef ROS2_ROS_SETTINGS_H
#define ROS2_ROS_SETTINGS_H

#include "config/settings.h"

/// The bridge reads this file if the command line has no `-c FILE`. It may be absent.
#define ROS_SETTINGS_PATH "/etc/iwheel/ros2.conf"

/// Types of cmd_vel. Controllers of Jazzy send TwistStamped, most other programs send Twist.
typedef enum { ROS_COMMAND_TWIST = 1, ROS_COMMAND_STAMPED = 2, ROS_COMMAND_BOTH = 3 } ros_command_types_t;

typedef struct {
    struct {
        char socket[108]; ///< Path of the gateway's socket, with its terminator.
    } gateway;
    struct {
        uint32_t domain;   ///< 0..232.
        bool loopback;     ///< True: this machine only, without multicast. False: as CYCLONEDDS_URI configures it.
        bool synchronised; ///< NTP or PTP synchronises the clocks of the other machines with this one.
        bool humble;       ///< ros_discovery_info has ids of 24 bytes, as before ROS Iron.
        char ns[65];       ///< Namespace, or `none`.
        char node[65];     ///< Name of the node; names of ROS have at most 64 characters.
    } ros;
    struct {
        bool enabled;        ///< The bridge may drive.
        uint8_t command;     ///< Bits of the types that cmd_vel accepts: `ros_command_types_t`.
        uint32_t timeout_ms; ///< Time without a command after which the bridge stops, 50..500.
        bool auto_arm;       ///< A command may arm: commands.h.
        bool allow_reset;    ///< The reset service is executed; otherwise it is refused.
    } drive;
    struct {
        uint32_t rate_hz;    ///< Rate of odometry, 1..100.
        char odom_frame[65]; ///< Fixed frame.
        char base_frame[65]; ///< Frame of the machine.
        bool tf;             ///< The bridge publishes the transform between both frames.
    } odometry;
} ros_settings_t;

/// The defaults, for keys that the file does not set.
extern const ros_settings_t ros_settings_standard;

/// The keys with their types, ranges and help.
extern const settings_form_t ros_settings_form;

/// Returns the namespace; empty if it is `none`. The text is valid as long as `*settings`.
const char *ros_settings_space(const ros_settings_t *settings);

#endif
