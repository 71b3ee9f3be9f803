// SPDX-License-Identifier: MIT
#include "ros_settings.h"

#include <ctype.h>
#include <string.h>

#define NUMBER(member, from, to)                                                                                       \
    .kind = SETTINGS_NUMBER, SETTINGS_FIELD(ros_settings_t, member), .min = (from), .max = (to)
#define WORD(member, list)  .kind = SETTINGS_WORD, SETTINGS_FIELD(ros_settings_t, member), .words = (list)
#define TEXT(member, judge) .kind = SETTINGS_TEXT, SETTINGS_FIELD(ros_settings_t, member), .wrong = (judge)

static const settings_word_t networks[] = {{"default", 0}, {"loopback", 1}, {NULL, 0}};
static const settings_word_t clocks[] = {{"unknown", 0}, {"synchronised", 1}, {NULL, 0}};
static const settings_word_t releases[] = {{"jazzy", 0}, {"humble", 1}, {NULL, 0}};
static const settings_word_t twists[] = {{"twist", 0}, {"twist_stamped", 1}, {NULL, 0}};

/// As ROS wants names: letters, digits, _ and between names /, not beginning with a digit.
static const char *wrong_name(const char *text) {
    bool first = true;
    for (; *text != '\0'; text++) {
        const unsigned char c = (unsigned char)*text;
        if ((first && isdigit(c)) || (!isalnum(c) && c != '_' && (c != '/' || first || text[1] == '\0'))) {
            return "no name for ROS; use letters, digits and _, no digit or / first";
        }
        first = c == '/';
    }
    return NULL;
}

static const settings_key_t keys[] = {
    {"gateway", "socket", "", "Of the gateway; to watch only, its watch socket suffices.",
     TEXT(gateway.socket, settings_wrong_socket)},
    {"ros", "domain", "", "DDS domain, ROS_DOMAIN_ID of the others.", NUMBER(ros.domain, 0, 232)},
    {"ros", "network", "",
     "loopback: this machine only, without multicast. default: as CYCLONEDDS_URI says; the unit also keeps it on this\n"
     "machine, docs/ros2.md tells how to open it.",
     WORD(ros.loopback, networks)},
    {"ros", "clocks", "",
     "Of other machines. synchronised: NTP or PTP keeps them equal to this one's; only then other machines may arm\n"
     "and reset.",
     WORD(ros.synchronised, clocks)},
    {"ros", "release", "", "jazzy: Iron and newer; humble: Humble and older. Only `ros2 node list` depends on it.",
     WORD(ros.humble, releases)},
    {"ros", "namespace", "", "Before all names, for several machines in one domain, or none.",
     TEXT(ros.ns, wrong_name)},
    {"ros", "node", "", "Name in `ros2 node list`.", TEXT(ros.node, wrong_name)},
    {"drive", "enabled", "", "no: watch only. WHO REACHES THE DDS DOMAIN MAY DRIVE AND ARM.",
     WORD(drive.enabled, settings_no_yes)},
    {"drive", "command", "", "What cmd_vel is.", WORD(drive.stamped, twists)},
    {"drive", "timeout_ms", " ms", "Silence of cmd_vel after which the bridge says stop. The lease may end earlier.",
     NUMBER(drive.timeout_ms, 50, 500)},
    {"drive", "auto_arm", "",
     "yes: a command after 500 ms of zeros or silence arms; not after a stop that had another reason than its\n"
     "own source's silence, and after a person's stop only once the source was silent for a second.",
     WORD(drive.auto_arm, settings_no_yes)},
    {"drive", "allow_reset", "", "yes: the service iwheel/reset resets a latched stop.",
     WORD(drive.allow_reset, settings_no_yes)},
    {"odometry", "rate_hz", " Hz", "Of odom, joint_states, wrench.", NUMBER(odometry.rate_hz, 1, 100)},
    {"odometry", "odom_frame", "", "Frame of odom.", TEXT(odometry.odom_frame, wrong_name)},
    {"odometry", "base_frame", "", "Frame of the machine.", TEXT(odometry.base_frame, wrong_name)},
    {"odometry", "tf", "", "yes: publish the transform too; no, if robot_localization does.",
     WORD(odometry.tf, settings_no_yes)},
};
const ros_settings_t ros_settings_standard = {
    .gateway = {"/run/iwheel/gateway.sock"},
    .ros = {.loopback = true, .ns = "none", .node = "iwheel"},
    .drive = {.enabled = true, .timeout_ms = 500},
    .odometry = {.rate_hz = 50, .odom_frame = "odom", .base_frame = "base_link"},
};

const char *ros_settings_space(const ros_settings_t *settings) {
    return (strcmp(settings->ros.ns, "none") == 0) ? "" : settings->ros.ns;
}

const settings_form_t ros_settings_form = {
    .keys = keys,
    .count = sizeof keys / sizeof keys[0],
    .program = "iwheel-ros2",
    .missing = "create it from share/ros2.conf",
};
