// SPDX-License-Identifier: MIT
#include "assumption.h"

#include <inttypes.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

static const char *yes_or_no(bool yes) {
    return yes ? "yes" : "no";
}

static const char *unit_word(iw_force_unit_t unit) {
    return (unit == IW_FORCE_CN) ? "cN" : "dN";
}

static const char *role_word(iw_current_role_t role) {
    return (role == IW_ROLE_LIMIT) ? "limit" : (role == IW_ROLE_SETPOINT) ? "setpoint" : "";
}

static void write_gear(const iw_config_t *config, char out_value[IWN_VALUE_SIZE]) {
    char per[8] = "";
    if (config->gear_per != 1U) {
        (void)snprintf(per, sizeof per, "/%u", config->gear_per);
    }
    (void)snprintf(out_value, IWN_VALUE_SIZE, "%u%s, rpm of the %s", config->gear_turns, per,
                   config->rpm_of_rotor ? "rotor" : "wheel");
}

void inspect_assumption_value(const inspect_configured_t *configured, iw_assumption_item_t item,
                              char out_value[IWN_VALUE_SIZE]) {
    const iw_config_t *config = configured->core;
    const char *word = "yes";
    out_value[0] = '\0';
    switch (item) {
    case IW_ASSUMPTION_SETPOINT_TYPE:
        if (config->setpoint_type_set) {
            (void)snprintf(out_value, IWN_VALUE_SIZE, "%u", config->setpoint_type);
        }
        return;
    case IW_ASSUMPTION_WHEEL_RADIUS:
        (void)snprintf(out_value, IWN_VALUE_SIZE, "%u", config->radius_mm);
        return;
    case IW_ASSUMPTION_TRACK:
        if (configured->track_mm != 0U) {
            (void)snprintf(out_value, IWN_VALUE_SIZE, "%u", configured->track_mm);
        }
        return;
    case IW_ASSUMPTION_GEAR_RATIO:
        write_gear(config, out_value);
        return;
    case IW_ASSUMPTION_CURRENT_ROLE:
        word = role_word(config->current_role);
        break;
    case IW_ASSUMPTION_FORCE_UNIT_LEFT:
    case IW_ASSUMPTION_FORCE_UNIT_RIGHT:
        word = unit_word(config->force_unit[(item == IW_ASSUMPTION_FORCE_UNIT_LEFT) ? IW_LEFT : IW_RIGHT]);
        break;
    case IW_ASSUMPTION_MOUNT_SIGN_LEFT:
    case IW_ASSUMPTION_MOUNT_SIGN_RIGHT:
        word = yes_or_no(config->invert[(item == IW_ASSUMPTION_MOUNT_SIGN_LEFT) ? IW_LEFT : IW_RIGHT]);
        break;
    default:
        break;
    }
    (void)snprintf(out_value, IWN_VALUE_SIZE, "%s", word);
}

const char *inspect_assumption_values(iw_assumption_item_t item) {
    switch (item) {
    case IW_ASSUMPTION_SETPOINT_TYPE:
        return "0 to 255";
    case IW_ASSUMPTION_CURRENT_ROLE:
        return "limit or setpoint";
    case IW_ASSUMPTION_FORCE_UNIT_LEFT:
    case IW_ASSUMPTION_FORCE_UNIT_RIGHT:
        return "cN or dN";
    case IW_ASSUMPTION_MOUNT_SIGN_LEFT:
    case IW_ASSUMPTION_MOUNT_SIGN_RIGHT:
        return "yes or no, as invert in the configuration";
    case IW_ASSUMPTION_WHEEL_RADIUS:
        return "20 to 500 (mm)";
    case IW_ASSUMPTION_TRACK:
        return "50 to 5000 (mm)";
    case IW_ASSUMPTION_GEAR_RATIO:
        return "N or N/M, as gear_ratio in the configuration";
    default:
        return "yes or no";
    }
}

/// Reads at most five decimal digits. `*out_rest` points to the rest.
static bool read_number(const char *text, unsigned *out_number, const char **out_rest) {
    unsigned number = 0;
    unsigned digits = 0;
    for (; *text >= '0' && *text <= '9' && digits < 5U; ++text, ++digits) {
        number = number * 10U + (unsigned)(*text - '0');
    }
    *out_number = number;
    *out_rest = text;
    return digits > 0U;
}

static inspect_found_t compare_number(const char *found, unsigned wanted, unsigned low, unsigned high,
                                      unsigned percent) {
    unsigned number;
    const char *rest;
    if (!read_number(found, &number, &rest) || *rest != '\0' || number < low || number > high) {
        return INSPECT_FOUND_IMPOSSIBLE;
    }
    const unsigned off = (number > wanted) ? number - wanted : wanted - number;
    return (off * 100U <= wanted * percent) ? INSPECT_FOUND_SAME : INSPECT_FOUND_DIFFERENT;
}

static inspect_found_t compare_gear(const char *found, const iw_config_t *config) {
    unsigned turns;
    unsigned per = 1;
    const char *rest;
    bool good = read_number(found, &turns, &rest);
    if (good && *rest == '/') {
        good = read_number(rest + 1, &per, &rest);
    }
    if (!good || *rest != '\0' || turns < 1U || turns > 1000U || per < 1U || per > 1000U) {
        return INSPECT_FOUND_IMPOSSIBLE;
    }
    return (turns * config->gear_per == per * config->gear_turns) ? INSPECT_FOUND_SAME : INSPECT_FOUND_DIFFERENT;
}

/// Compares one of two words.
static inspect_found_t compare_word(const char *found, const char *wanted, const char *one, const char *other) {
    if (strcmp(found, one) != 0 && strcmp(found, other) != 0) {
        return INSPECT_FOUND_IMPOSSIBLE;
    }
    return (strcmp(found, wanted) == 0) ? INSPECT_FOUND_SAME : INSPECT_FOUND_DIFFERENT;
}

inspect_found_t inspect_assumption_compare(const inspect_configured_t *configured, iw_assumption_item_t item,
                                           const char *found) {
    const iw_config_t *config = configured->core;
    char wanted[IWN_VALUE_SIZE];
    inspect_assumption_value(configured, item, wanted);
    if (wanted[0] == '\0') {
        return INSPECT_FOUND_UNSET;
    }
    if (found[0] == '\0') {
        return INSPECT_FOUND_SAME;
    }
    switch (item) {
    case IW_ASSUMPTION_SETPOINT_TYPE:
        return compare_number(found, config->setpoint_type, 0U, UINT8_MAX, 0U);
    case IW_ASSUMPTION_WHEEL_RADIUS:
        return compare_number(found, config->radius_mm, 20U, 500U, INSPECT_RADIUS_PERCENT);
    case IW_ASSUMPTION_TRACK:
        return compare_number(found, configured->track_mm, 200U, 1500U, INSPECT_TRACK_PERCENT);
    case IW_ASSUMPTION_GEAR_RATIO:
        return compare_gear(found, config);
    case IW_ASSUMPTION_CURRENT_ROLE:
        return compare_word(found, wanted, "limit", "setpoint");
    case IW_ASSUMPTION_FORCE_UNIT_LEFT:
    case IW_ASSUMPTION_FORCE_UNIT_RIGHT:
        return compare_word(found, wanted, "cN", "dN");
    default:
        return compare_word(found, wanted, "yes", "no");
    }
}

/// Writes the measured value.
static void write_figure(iw_assumption_item_t item, const iw_assumption_entry_t *entry,
                         char out_text[INSPECT_SOURCE_SIZE]) {
    const int figure = (int)entry->figure;
    const char *sign = (figure < 0) ? "-" : "";
    const int whole = abs(figure / 1000);
    const int part = abs(figure % 1000);
    switch (item) {
    case IW_ASSUMPTION_FORCE_UNIT_LEFT:
    case IW_ASSUMPTION_FORCE_UNIT_RIGHT:
    case IW_ASSUMPTION_OFFSET_INCLUDED:
        (void)snprintf(
            out_text, INSPECT_SOURCE_SIZE,
            "at standstill, raw / offset is %s%d.%03d (about 10 is cN, 1 is dN, 0 is a raw force without offset)", sign,
            whole, part);
        break;
    case IW_ASSUMPTION_FEEDBACK_SIGN_LEFT:
    case IW_ASSUMPTION_FEEDBACK_SIGN_RIGHT:
        (void)snprintf(out_text, INSPECT_SOURCE_SIZE, "measured %d mm/s while commanded forward", figure);
        break;
    case IW_ASSUMPTION_SETPOINT_TYPE:
        (void)snprintf(out_text, INSPECT_SOURCE_SIZE, "the wheels ran at %s%d.%03d of the commanded speed", sign, whole,
                       part);
        break;
    case IW_ASSUMPTION_GEAR_RATIO:
        (void)snprintf(out_text, INSPECT_SOURCE_SIZE, "the ticks moved %s%d.%03d times as far as the rpm", sign, whole,
                       part);
        break;
    case IW_ASSUMPTION_POSE_BYTE_ORDER:
        (void)snprintf(out_text, INSPECT_SOURCE_SIZE, "in the other byte order the pose moves %s%d.%03d times as far",
                       sign, whole, part);
        break;
    case IW_ASSUMPTION_DLC:
    default:
        (void)snprintf(out_text, INSPECT_SOURCE_SIZE, "received a frame of %d bytes%s", figure,
                       (entry->state == IW_CONTRADICTED) ? "; the table has another length" : ", as in the table");
        break;
    }
}

/// Writes "the operator found 181 by a tape", "found by bringup: 5.00 m pushed ..."; without `how` only the operator's
/// value.
static void write_word(bool denied, const inspect_word_t *word, char out_text[INSPECT_SOURCE_SIZE]) {
    const char *found = (word->found[0] != '\0') ? word->found : "something else";
    const char *by = (word->how[0] != '\0') ? " by " : "";
    if (denied) {
        (void)snprintf(out_text, INSPECT_SOURCE_SIZE, "the operator found %s%s%s", found, by, word->how);
    } else if (word->how[0] != '\0') {
        (void)snprintf(out_text, INSPECT_SOURCE_SIZE, "found by %s", word->how);
    } else {
        (void)snprintf(out_text, INSPECT_SOURCE_SIZE, "confirmed by the operator");
    }
}

void inspect_assumption_source(iw_assumption_item_t item, const iw_assumption_entry_t *entry,
                               const inspect_word_t *word, char out_text[INSPECT_SOURCE_SIZE]) {
    switch (entry->source) {
    case IW_SOURCE_BUS:
        write_figure(item, entry, out_text);
        break;
    case IW_SOURCE_OPERATOR:
        write_word(entry->state == IW_CONTRADICTED, word, out_text);
        break;
    case IW_SOURCE_CONFIGURATION:
        (void)snprintf(out_text, INSPECT_SOURCE_SIZE, "configured, not verified");
        break;
    case IW_SOURCE_DOCUMENT:
        (void)snprintf(out_text, INSPECT_SOURCE_SIZE, "as documented, not verified");
        break;
    case IW_SOURCE_NONE:
    default:
        (void)snprintf(out_text, INSPECT_SOURCE_SIZE, "not documented, not verified");
        break;
    }
}

const char *inspect_assumption_cost(iw_assumption_item_t item) {
    static const char *const costs[IW_ASSUMPTION_ITEMS] = {
        [IW_ASSUMPTION_SETPOINT_TYPE] = "arm is refused; correct setpoint_type under [wheels]",
        [IW_ASSUMPTION_CURRENT_ROLE] = "arm is refused; correct current_role under [wheels]",
        [IW_ASSUMPTION_FORCE_UNIT_LEFT] = "no net force of the left wheel; correct force_unit under [left]",
        [IW_ASSUMPTION_FORCE_UNIT_RIGHT] = "no net force of the right wheel; correct force_unit under [right]",
        [IW_ASSUMPTION_OFFSET_INCLUDED] = "no net force until both wheels are unloaded and tared: iwheelctl tare",
        [IW_ASSUMPTION_FEEDBACK_SIGN_LEFT] =
            "arm is refused; see why the left wheel turned against its command, then: iwheelctl confirm "
            "feedback_sign_left",
        [IW_ASSUMPTION_FEEDBACK_SIGN_RIGHT] =
            "arm is refused; see why the right wheel turned against its command, then: iwheelctl confirm "
            "feedback_sign_right",
        [IW_ASSUMPTION_MOUNT_SIGN_LEFT] = "arm is refused; correct invert under [left]",
        [IW_ASSUMPTION_MOUNT_SIGN_RIGHT] = "arm is refused; correct invert under [right]",
        [IW_ASSUMPTION_WHEEL_RADIUS] = "no speed in mm/s and no distance; correct radius_mm under [wheels]",
        [IW_ASSUMPTION_TRACK] = "a twist can only go straight ahead; correct track_mm under [wheels], or send drive",
        [IW_ASSUMPTION_GEAR_RATIO] =
            "no distance, and no speed in mm/s if the rpm are the rotor's; correct gear_ratio or "
            "rpm_of under [wheels]",
        [IW_ASSUMPTION_POSE_BYTE_ORDER] = "no pose; this version reads it most significant byte first only",
        [IW_ASSUMPTION_DLC] = "nothing: longer frames are read, shorter ones are ignored and counted as bad_length",
    };
    return ((unsigned)item < IW_ASSUMPTION_ITEMS) ? costs[item] : "unknown";
}

const char *inspect_assumption_fix(iw_assumption_item_t item) {
    static const char *const fixes[IW_ASSUMPTION_ITEMS] = {
        [IW_ASSUMPTION_SETPOINT_TYPE] =
            "correct setpoint_type under [wheels] (iwheelctl bringup finds it), then: systemctl "
            "restart iwheel-gateway",
        [IW_ASSUMPTION_CURRENT_ROLE] = "correct current_role under [wheels], then: systemctl restart iwheel-gateway",
        [IW_ASSUMPTION_FORCE_UNIT_LEFT] = "correct force_unit under [left], then: systemctl restart iwheel-gateway",
        [IW_ASSUMPTION_FORCE_UNIT_RIGHT] = "correct force_unit under [right], then: systemctl restart iwheel-gateway",
        [IW_ASSUMPTION_OFFSET_INCLUDED] = "unload both wheels, then: iwheelctl tare",
        [IW_ASSUMPTION_FEEDBACK_SIGN_LEFT] =
            "see why the left wheel turned against its command, then: iwheelctl confirm feedback_sign_left",
        [IW_ASSUMPTION_FEEDBACK_SIGN_RIGHT] =
            "see why the right wheel turned against its command, then: iwheelctl confirm feedback_sign_right",
        [IW_ASSUMPTION_MOUNT_SIGN_LEFT] = "correct invert under [left], then: systemctl restart iwheel-gateway",
        [IW_ASSUMPTION_MOUNT_SIGN_RIGHT] = "correct invert under [right], then: systemctl restart iwheel-gateway",
        [IW_ASSUMPTION_WHEEL_RADIUS] = "correct radius_mm under [wheels], then: systemctl restart iwheel-gateway",
        [IW_ASSUMPTION_TRACK] =
            "correct track_mm under [wheels] (iwheelctl bringup measures it), then: systemctl restart "
            "iwheel-gateway",
        [IW_ASSUMPTION_GEAR_RATIO] =
            "correct gear_ratio or rpm_of under [wheels], then: systemctl restart iwheel-gateway",
        [IW_ASSUMPTION_POSE_BYTE_ORDER] =
            "the pose is lost, everything else works; send us a recording (iwheelctl record), and if "
            "it came from another device: iwheelctl confirm pose_byte_order",
        [IW_ASSUMPTION_DLC] = "find the device that sends on the wheels' ids (iwheelctl watch frame shows them); when "
                              "it is gone: iwheelctl confirm dlc",
    };
    const char *fix = ((unsigned)item < IW_ASSUMPTION_ITEMS) ? fixes[item] : NULL;
    return (fix != NULL) ? fix : "decide it: iwheelctl ledger shows it, iwheelctl confirm stores the right value";
}
