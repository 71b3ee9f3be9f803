// SPDX-License-Identifier: MIT
/// The bridge's configuration file, read as the gateway's: every error with file, line and cure; a file that is wrong changes nothing.
#ifndef ROS2_SETTINGS_H
#define ROS2_SETTINGS_H

#include <stdbool.h>
#include <stdint.h>
#include <stdio.h>

/// Read when no `-c FILE` is given. Its absence is no error then.
#define ROS_SETTINGS_PATH  "/etc/iwheel/ros2.conf"
#define ROS_SETTINGS_ERROR 78

typedef struct {
    struct {
        char socket[108];
    } gateway;
    struct {
        uint32_t domain; ///< 0..232.
        bool loopback;   ///< This machine only, without multicast; else as CYCLONEDDS_URI says.
        bool humble;     ///< Ids of 24 bytes in ros_discovery_info, as before Iron.
        char ns[65];     ///< Namespace without its leading slash; empty: none.
        char node[65];
    } ros;
    struct {
        bool enabled;
        bool stamped; ///< cmd_vel is TwistStamped.
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

void ros_settings_default(ros_settings_t *out_settings);

/// Reads the file over the defaults. 0, or ROS_SETTINGS_ERROR with `*out_settings` untouched and lines `FILE:LINE: what is wrong; what to do`
/// on `err`.
int ros_settings_load(const char *path, ros_settings_t *out_settings, FILE *err);

/// The same from an open stream; `name` stands for it in messages.
int ros_settings_read(FILE *in, const char *name, ros_settings_t *out_settings, FILE *err);

/// Writes what is in force as a commented file, which reads back as the same.
void ros_settings_print(const ros_settings_t *settings, FILE *out);

#endif
