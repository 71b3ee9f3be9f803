// SPDX-License-Identifier: MIT
#include "ros_settings.h"

#include "ros_keys.h"

#include <ctype.h>
#include <string.h>

#define NUMBER(member, from, to)                                                                                       \
    .kind = SETTINGS_NUMBER, SETTINGS_FIELD(ros_settings_t, member), .min = (from), .max = (to)
#define WORD(member, list)  .kind = SETTINGS_WORD, SETTINGS_FIELD(ros_settings_t, member), .words = (list)
#define TEXT(member, judge) .kind = SETTINGS_TEXT, SETTINGS_FIELD(ros_settings_t, member), .wrong = (judge)

static const settings_word_t networks[] = {{"default", 0}, {"loopback", 1}, {NULL, 0}};
static const settings_word_t clocks[] = {{"unknown", 0}, {"synchronised", 1}, {NULL, 0}};
static const settings_word_t releases[] = {{"jazzy", 0}, {"humble", 1}, {NULL, 0}};
static const settings_word_t twists[] = {
    {"both", ROS_COMMAND_BOTH}, {"twist", ROS_COMMAND_TWIST}, {"twist_stamped", ROS_COMMAND_STAMPED}, {NULL, 0}};

/// Returns NULL for a name that ROS accepts: letters, digits and _, with / between names, and no digit first.
static const char *wrong_name(const char *text) {
    bool first = true;
    for (; *text != '\0'; text++) {
        const unsigned char c = (unsigned char)*text;
        if ((first && isdigit(c)) || (!isalnum(c) && c != '_' && (c != '/' || first || text[1] == '\0'))) {
            return "is not a valid name for ROS; use letters, digits and _, no digit or / first";
        }
        first = c == '/';
    }
    return NULL;
}

static const settings_key_t keys[] = {
    {"gateway", "socket", "", TEXT(gateway.socket, settings_wrong_socket)},
    {"ros", "domain", "", NUMBER(ros.domain, 0, 232)},
    {"ros", "network", "", WORD(ros.loopback, networks)},
    {"ros", "clocks", "", WORD(ros.synchronised, clocks)},
    {"ros", "release", "", WORD(ros.humble, releases)},
    {"ros", "namespace", "", TEXT(ros.ns, wrong_name)},
    {"ros", "node", "", TEXT(ros.node, wrong_name)},
    {"drive", "enabled", "", WORD(drive.enabled, settings_no_yes)},
    {"drive", "command", "", WORD(drive.command, twists)},
    {"drive", "timeout_ms", " ms", NUMBER(drive.timeout_ms, 50, 500)},
    {"drive", "auto_arm", "", WORD(drive.auto_arm, settings_no_yes)},
    {"drive", "allow_reset", "", WORD(drive.allow_reset, settings_no_yes)},
    {"odometry", "rate_hz", " Hz", NUMBER(odometry.rate_hz, 1, 100)},
    {"odometry", "odom_frame", "", TEXT(odometry.odom_frame, wrong_name)},
    {"odometry", "base_frame", "", TEXT(odometry.base_frame, wrong_name)},
    {"odometry", "tf", "", WORD(odometry.tf, settings_no_yes)},
};
const ros_settings_t ros_settings_standard = {
    .gateway = {"/run/iwheel/gateway.sock"},
    .ros = {.loopback = true, .ns = "none", .node = "iwheel"},
    .drive = {.enabled = true, .command = ROS_COMMAND_BOTH, .timeout_ms = 500},
    .odometry = {.rate_hz = 50, .odom_frame = "odom", .base_frame = "base_link"},
};

const char *ros_settings_space(const ros_settings_t *settings) {
    return (strcmp(settings->ros.ns, "none") == 0) ? "" : settings->ros.ns;
}

const settings_form_t ros_settings_form = {
    .keys = keys,
    .help = ros_keys,
    .count = sizeof keys / sizeof keys[0],
    .program = "iwheel-ros2",
    .missing = "create it from share/ros2.conf",
};
