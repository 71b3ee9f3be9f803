// SPDX-License-Identifier: MIT
#include "config_keys.h"

#include "words/similar.h"

#include <string.h>

#define FIELD(member)             .offset = offsetof(gateway_config_t, member), .size = sizeof(((gateway_config_t *)0)->member)
#define CORE(member, fault)       .kind = CONFIG_NUMBER, .range_of = (fault), FIELD(core.member)
#define NUMBER(member, low, high) .kind = CONFIG_NUMBER, .min = (low), .max = (high), FIELD(member)
#define WORD(member, list)        .kind = CONFIG_WORD, .words = (list), FIELD(member)

static const config_word_t no_yes[] = {{"no", 0}, {"yes", 1}, {NULL, 0}};
static const config_word_t wheel_rotor[] = {{"wheel", 0}, {"rotor", 1}, {NULL, 0}};
static const config_word_t low_high[] = {{"low", 0}, {"high", 1}, {NULL, 0}};
static const config_word_t mismatch[] = {
    {"refuse", GATEWAY_MISMATCH_REFUSE}, {"warn", GATEWAY_MISMATCH_WARN}, {NULL, 0}};
static const config_word_t roles[] = {{"limit", IW_ROLE_LIMIT}, {"setpoint", IW_ROLE_SETPOINT}, {NULL, 0}};
static const config_word_t units[] = {{"cN", IW_FORCE_CN}, {"dN", IW_FORCE_DN}, {NULL, 0}};

const config_key_t config_keys[] = {
    {"bus", "interface", "", "CAN interface, or unix:PATH for a local bus (its hub is iwheel-sim).",
     .kind = CONFIG_INTERFACE, FIELD(bus.interface)},
    {"bus", "bitrate", " bit/s", "Expected of the kernel and checked against it, never set by the gateway.",
     NUMBER(bus.bitrate, 10000, 1000000)},
    {"bus", "sample_point_permille", " permille",
     "Expected sample point. Off by more than 5: warning; by more than 25: mismatch; not reported: warning.",
     NUMBER(bus.sample_point_permille, 500, 900)},
    {"bus", "on_mismatch", "", "What a wrong bit rate or sample point does: refuse to arm, or only warn.",
     WORD(bus.on_mismatch, mismatch)},

    {"wheels", "setpoint_type", "",
     "Byte 0 of every setpoint. The wheels' document lists no values, so there is no default and the gateway does\n"
     "not arm until it is set. Take it from the vendor, or from a recording of a controller that works.",
     .kind = CONFIG_TYPE, .max = 255, FIELD(core.setpoint_type)},
    {"wheels", "current_role", "",
     "What the current beside the speed means to the wheel. The document does not say: no default, no arming until\n"
     "it is set. limit: zero is speed 0 with max_current_mA. setpoint: zero is speed 0 with current 0.",
     WORD(core.current_role, roles)},
    {"wheels", "rpm_of", "", "Whose turns the measured rpm count.", WORD(core.rpm_of_rotor, wheel_rotor)},
    {"wheels", "radius_mm", " mm", "Of the wheel. The document says approximately 192; measure it.",
     CORE(radius_mm, IW_CONFIG_RADIUS)},
    {"wheels", "gear_ratio", "", "Rotor turns per wheel turn, N or N/M: each 1..1000, together 1..100.",
     .kind = CONFIG_RATIO, FIELD(core.gear_turns)},
    {"wheels", "track_mm", " mm", "Distance between the wheels; only for twist commands.", NUMBER(track_mm, 50, 5000)},
    {"wheels", "setpoint_dlc", "", "Length of a setpoint frame, zero padded; the document's table has 5 bytes.",
     CORE(setpoint_dlc, IW_CONFIG_SETPOINT_DLC)},

    {"left", "invert", "", "yes if this wheel is mounted mirrored: its speed is negated, both ways.",
     WORD(core.invert[IW_LEFT], no_yes)},
    {"left", "force_unit", "", "Unit of the raw normal force. cN as documented; `iwheelctl status` shows the evidence.",
     WORD(core.force_unit[IW_LEFT], units)},
    {"right", "invert", "", "yes if this wheel is mounted mirrored: its speed is negated, both ways.",
     WORD(core.invert[IW_RIGHT], no_yes)},
    {"right", "force_unit", "",
     "Unit of the raw normal force. dN as documented; `iwheelctl status` shows the evidence.",
     WORD(core.force_unit[IW_RIGHT], units)},

    {"drive", "period_ms", " ms", "Spacing of setpoint pairs, the keep-alive of the wheels.",
     CORE(period_ms, IW_CONFIG_PERIOD)},
    {"drive", "lease_ms", " ms",
     "How long a drive command holds: three periods of the client. It cannot be disabled.\n"
     "lease_ms + period_ms + 1000 * max_speed_mm_s / decel_mm_s2 must not exceed 1000 ms, the wheels' own watchdog.",
     CORE(lease_ms, IW_CONFIG_LEASE)},
    {"drive", "accel_mm_s2", " mm/s2", "Slope away from zero.", CORE(accel_mm_s2, IW_CONFIG_ACCEL)},
    {"drive", "decel_mm_s2", " mm/s2", "Slope towards zero, also after a lost client.",
     CORE(decel_mm_s2, IW_CONFIG_DECEL)},
    {"drive", "max_speed_mm_s", " mm/s", "Faster commands are scaled down, both wheels by one factor.",
     CORE(max_speed_mm_s, IW_CONFIG_MAX_SPEED)},
    {"drive", "max_current_mA", " mA", "Limit of every current sent.", CORE(max_current_mA, IW_CONFIG_MAX_CURRENT)},
    {"drive", "zero_hold_ms", " ms", "Zeros are sent this long after a stop.", CORE(zero_hold_ms, IW_CONFIG_ZERO_HOLD)},

    {"limits", "wheel_silent_ms", " ms",
     "A wheel not heard for this long is lost; raise it for adapters that deliver late.",
     CORE(wheel_silent_ms, IW_CONFIG_WHEEL_SILENT)},
    {"limits", "echo_ms", " ms", "A setpoint not seen on the bus after this long is stalled.",
     CORE(echo_ms, IW_CONFIG_ECHO)},
    {"limits", "rest_rpm", " rpm", "At rest means |rpm| not above this ...", CORE(rest_rpm, IW_CONFIG_REST_RPM)},
    {"limits", "rest_ms", " ms", "... for this long.", CORE(rest_ms, IW_CONFIG_REST)},
    {"limits", "follow_mm_s", " mm/s", "A wheel faster than it was told by this ...",
     CORE(follow_mm_s, IW_CONFIG_FOLLOW_SPEED)},
    {"limits", "follow_ms", " ms", "... for this long latches.", CORE(follow_ms, IW_CONFIG_FOLLOW)},
    {"limits", "blocked_ms", " ms", "A wheel below 20 % of its command for this long stops the pair.",
     CORE(blocked_ms, IW_CONFIG_BLOCKED)},

    {"estop", "line", "", "gpiod line name, gpiochipN:OFFSET, unix:PATH (the simulator's button), or none.",
     .kind = CONFIG_LINE, FIELD(estop.line)},
    {"estop", "active", "",
     "Level that means pressed. high: a contact normally closed to ground, with a pull-up, so that a cut wire reads "
     "as\n"
     "pressed. low is accepted with a warning: a cut wire would go unseen.",
     WORD(estop.active_high, low_high)},
    {"estop", "debounce_ms", " ms", "On release only; a press acts at once.", NUMBER(estop.debounce_ms, 0, 1000)},

    {"northbound", "socket", "", "Where clients connect.", .kind = CONFIG_PATH, FIELD(northbound.socket)},
    {"northbound", "mode", "", "Permissions of the socket, octal: who may connect may move the wheels.",
     .kind = CONFIG_MODE, FIELD(northbound.mode)},
    {"northbound", "group", "", "Group of the socket; none: the gateway's own.", .kind = CONFIG_GROUP,
     FIELD(northbound.group)},
    {"northbound", "max_clients", " clients", "Connections at the same time.", NUMBER(northbound.max_clients, 1, 64)},
    {"northbound", "watch_socket", "",
     "Where clients connect that may look, stop and e-stop, but never drive; none: there is no such socket. Tools find "
     "it\n"
     "as watch/NAME.sock in the directory of socket NAME.sock.",
     .kind = CONFIG_PATH, FIELD(northbound.watch_socket)},
    {"northbound", "watch_mode", "", "Permissions of that socket, octal: who may connect may stop the wheels.",
     .kind = CONFIG_MODE, FIELD(northbound.watch_mode)},
    {"northbound", "watch_group", "", "Group of that socket; none: the gateway's own.", .kind = CONFIG_GROUP,
     FIELD(northbound.watch_group)},
    {"northbound", "max_watchers", " clients", "Connections to it at the same time; they take none of max_clients.",
     NUMBER(northbound.max_watchers, 1, 64)},

    {"record", "blackbox_s", " s", "Ring in memory, written on every latched stop; 0: none.",
     NUMBER(record.blackbox_s, 0, 600)},
    {"record", "directory", "", "Where recordings are written.", .kind = CONFIG_PATH, FIELD(record.directory)},
};
const size_t config_key_count = sizeof config_keys / sizeof config_keys[0];
IW_STATIC_ASSERT(sizeof config_keys / sizeof config_keys[0] <= CONFIG_KEYS_MAX, keys_fit);

const config_key_t *config_key_find(const char *section, const char *key) {
    for (size_t i = 0; i < config_key_count; i++) {
        if (strcmp(config_keys[i].section, section) == 0 && strcmp(config_keys[i].key, key) == 0) {
            return &config_keys[i];
        }
    }
    return NULL;
}

const config_key_t *config_key_elsewhere(const char *key) {
    for (size_t i = 0; i < config_key_count; i++) {
        if (strcmp(config_keys[i].key, key) == 0) {
            return &config_keys[i];
        }
    }
    return NULL;
}

const config_key_t *config_key_similar(const char *section, const char *key) {
    const config_key_t *best = NULL;
    size_t best_distance = GW_WORD_STRANGE;
    for (size_t i = 0; i < config_key_count; i++) {
        const config_key_t *row = &config_keys[i];
        const size_t far = (strcmp(row->section, section) == 0) ? gw_word_distance(key, row->key) : GW_WORD_STRANGE;
        if (far < best_distance) {
            best = row;
            best_distance = far;
        }
    }
    return best;
}

bool config_section_known(const char *section) {
    for (size_t i = 0; i < config_key_count; i++) {
        if (strcmp(config_keys[i].section, section) == 0) {
            return true;
        }
    }
    return false;
}

void config_keys_list(const char *section, char *out, size_t size) {
    const char *last = "";
    size_t used = 0;
    out[0] = '\0';
    for (size_t i = 0; i < config_key_count; i++) {
        const config_key_t *row = &config_keys[i];
        const char *name = (section != NULL) ? row->key : row->section;
        if ((section != NULL && strcmp(row->section, section) != 0) || strcmp(name, last) == 0) {
            continue;
        }
        const int n = snprintf(out + used, size - used, "%s%s", (used > 0) ? ", " : "", name);
        if (n < 0 || (size_t)n >= size - used) {
            return;
        }
        used += (size_t)n;
        last = name;
    }
}
