// SPDX-License-Identifier: MIT
#include "pick.h"

#include <string.h>

const char *iwn_error_name(iwn_error_t error) {
    static const char *const names[IWN_ERRORS] = {
        [IWN_OK] = "ok",
        [IWN_BAD_JSON] = "bad_json",
        [IWN_LINE_TOO_LONG] = "line_too_long",
        [IWN_UNKNOWN_CMD] = "unknown_cmd",
        [IWN_UNKNOWN_FIELD] = "unknown_field",
        [IWN_MISSING_FIELD] = "missing_field",
        [IWN_BAD_VALUE] = "bad_value",
        [IWN_OUT_OF_RANGE] = "out_of_range",
        [IWN_NOT_HOLDER] = "not_holder",
        [IWN_BUSY] = "busy",
        [IWN_NOT_ARMED] = "not_armed",
        [IWN_LATCHED] = "latched",
        [IWN_ESTOP_PRESSED] = "estop_pressed",
        [IWN_BUS_DOWN] = "bus_down",
        [IWN_TIMING_MISMATCH] = "timing_mismatch",
        [IWN_WHEEL_LOST] = "wheel_lost",
        [IWN_WHEEL_BLOCKED] = "wheel_blocked",
        [IWN_PAIR_DIVERGES] = "pair_diverges",
        [IWN_NOT_AT_REST] = "not_at_rest",
        [IWN_SEND_STALLED] = "send_stalled",
        [IWN_SECOND_MASTER] = "second_master",
        [IWN_CAUSE_PRESENT] = "cause_present",
        [IWN_TYPE_NOT_SET] = "type_not_set",
        [IWN_TRACK_NOT_SET] = "track_not_set",
        [IWN_STALE_COMMAND] = "stale_command",
        [IWN_LISTEN_ONLY] = "listen_only",
        [IWN_TOO_MANY_CLIENTS] = "too_many_clients",
        [IWN_DENIED] = "denied",
        [IWN_INTERNAL] = "internal",
    };
    return PICK(names, error);
}

iwn_error_t iwn_error_of(iw_refusal_t refusal) {
    static const iwn_error_t errors[] = {
        [IW_REFUSE_NONE] = IWN_OK,
        [IW_REFUSE_OUT_OF_RANGE] = IWN_OUT_OF_RANGE,
        [IW_REFUSE_MISSING_FIELD] = IWN_MISSING_FIELD,
        [IW_REFUSE_NOT_HOLDER] = IWN_NOT_HOLDER,
        [IW_REFUSE_BUSY] = IWN_BUSY,
        [IW_REFUSE_NOT_ARMED] = IWN_NOT_ARMED,
        [IW_REFUSE_LATCHED] = IWN_LATCHED,
        [IW_REFUSE_ESTOP_PRESSED] = IWN_ESTOP_PRESSED,
        [IW_REFUSE_BUS_DOWN] = IWN_BUS_DOWN,
        [IW_REFUSE_TIMING_MISMATCH] = IWN_TIMING_MISMATCH,
        [IW_REFUSE_WHEEL_LOST] = IWN_WHEEL_LOST,
        [IW_REFUSE_WHEEL_BLOCKED] = IWN_WHEEL_BLOCKED,
        [IW_REFUSE_PAIR_DIVERGES] = IWN_PAIR_DIVERGES,
        [IW_REFUSE_NOT_AT_REST] = IWN_NOT_AT_REST,
        [IW_REFUSE_SEND_STALLED] = IWN_SEND_STALLED,
        [IW_REFUSE_SECOND_MASTER] = IWN_SECOND_MASTER,
        [IW_REFUSE_CAUSE_PRESENT] = IWN_CAUSE_PRESENT,
        [IW_REFUSE_TYPE_NOT_SET] = IWN_TYPE_NOT_SET,
        [IW_REFUSE_TRACK_NOT_SET] = IWN_TRACK_NOT_SET,
        [IW_REFUSE_STALE_COMMAND] = IWN_STALE_COMMAND,
        [IW_REFUSE_LISTEN_ONLY] = IWN_LISTEN_ONLY,
        [IW_REFUSE_CONTRADICTED] = IWN_DENIED,
    };
    return ((size_t)refusal < sizeof errors / sizeof errors[0]) ? errors[refusal] : IWN_INTERNAL;
}

const char *iwn_topic_name(iwn_topic_t topic) {
    static const char *const names[IWN_TOPICS] = {"state", "bus", "estop", "lease", "stop", "force", "frame"};
    return PICK(names, topic);
}

const char *iwn_estop_name(int answer, bool present) {
    if (!present) {
        return "none";
    }
    return (answer == 0)                    ? "released"
           : (answer == IW_ESTOP_DISAGREES) ? "disagrees"
           : (answer > 0)                   ? "pressed"
                                            : "unreadable";
}

const char *iwn_sides_name(uint8_t sides) {
    static const char *const names[] = {NULL, "left", "right", "both"};
    return names[sides & IW_SIDES_BOTH];
}

const char *iwn_provenance_name(iw_offset_provenance_t provenance) {
    static const char *const names[] = {
        [IW_OFFSET_NONE] = "none",   [IW_OFFSET_STORED] = "stored",     [IW_OFFSET_ESTIMATED] = "estimated",
        [IW_OFFSET_WHEEL] = "wheel", [IW_OFFSET_OPERATOR] = "operator",
    };
    return PICK(names, provenance);
}

const char *iwn_offset_word(iw_offset_provenance_t provenance, iw_time_us_t offset_us) {
    const bool stored = provenance != IW_OFFSET_NONE && offset_us == IW_NEVER;
    return iwn_provenance_name(stored ? IW_OFFSET_STORED : provenance);
}

const char *iwn_window_name(iw_window_t window) {
    static const char *const names[] = {
        [IW_WINDOW_OPEN] = "open",           [IW_WINDOW_GOOD] = "good",   [IW_WINDOW_MOVING] = "moving",
        [IW_WINDOW_NOISY] = "noisy",         [IW_WINDOW_DRIFT] = "drift", [IW_WINDOW_LOADED] = "loaded",
        [IW_WINDOW_SATURATED] = "saturated",
    };
    return PICK(names, window);
}

const char *iwn_unit_observation_name(iw_unit_observation_t observation) {
    static const char *const names[] = {
        [IW_UNIT_UNKNOWN] = "unknown", [IW_UNIT_CN] = "cN",
        [IW_UNIT_DN] = "dN",           [IW_UNIT_OFFSET_REMOVED] = "offset_removed",
        [IW_UNIT_UNCLEAR] = "unclear",
    };
    return PICK(names, observation);
}

const char *iwn_force_validity_name(iw_force_validity_t validity) {
    static const char *const names[] = {
        [IW_FORCE_VALID] = "valid",
        [IW_FORCE_NO_TELEMETRY] = "not_heard",
        [IW_FORCE_SATURATED] = "saturated",
        [IW_FORCE_NO_OFFSET] = "no_offset",
        [IW_FORCE_UNIT_CONTRADICTED] = "unit_contradicted",
        [IW_FORCE_OFFSET_REMOVED] = "offset_removed",
        [IW_FORCE_OFFSET_DOUBTED] = "offset_doubted",
    };
    return PICK(names, validity);
}

const char *iwn_assumption_item_name(iw_assumption_item_t item) {
    static const char *const names[IW_ASSUMPTION_ITEMS] = {
        [IW_ASSUMPTION_SETPOINT_TYPE] = "setpoint_type",
        [IW_ASSUMPTION_CURRENT_ROLE] = "current_role",
        [IW_ASSUMPTION_FORCE_UNIT_LEFT] = "force_unit_left",
        [IW_ASSUMPTION_FORCE_UNIT_RIGHT] = "force_unit_right",
        [IW_ASSUMPTION_OFFSET_INCLUDED] = "offset_included",
        [IW_ASSUMPTION_FEEDBACK_SIGN_LEFT] = "feedback_sign_left",
        [IW_ASSUMPTION_FEEDBACK_SIGN_RIGHT] = "feedback_sign_right",
        [IW_ASSUMPTION_MOUNT_SIGN_LEFT] = "mount_sign_left",
        [IW_ASSUMPTION_MOUNT_SIGN_RIGHT] = "mount_sign_right",
        [IW_ASSUMPTION_WHEEL_RADIUS] = "wheel_radius",
        [IW_ASSUMPTION_TRACK] = "track",
        [IW_ASSUMPTION_GEAR_RATIO] = "gear_ratio",
        [IW_ASSUMPTION_POSE_BYTE_ORDER] = "pose_byte_order",
        [IW_ASSUMPTION_DLC] = "dlc",
    };
    return PICK(names, item);
}

bool iwn_assumption_item_of(const char *name, iw_assumption_item_t *out_item) {
    for (unsigned item = 0; item < IW_ASSUMPTION_ITEMS; item++) {
        if (strcmp(name, iwn_assumption_item_name((iw_assumption_item_t)item)) == 0) {
            *out_item = (iw_assumption_item_t)item;
            return true;
        }
    }
    return false;
}

const char *iwn_assumption_state_name(iw_assumption_state_t state) {
    static const char *const names[] = {"assumed", "confirmed", "contradicted"};
    return PICK(names, state);
}

const char *iwn_source_name(iw_source_t source) {
    static const char *const names[] = {
        [IW_SOURCE_NONE] = "none", [IW_SOURCE_DOCUMENT] = "document", [IW_SOURCE_CONFIGURATION] = "configuration",
        [IW_SOURCE_BUS] = "bus",   [IW_SOURCE_OPERATOR] = "operator",
    };
    return PICK(names, source);
}
