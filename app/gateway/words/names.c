// SPDX-License-Identifier: MIT
#include "names.h"

#define PICK(table, index)                                                                                             \
    ((size_t)(index) < sizeof(table) / sizeof(table)[0] && (table)[index] != NULL ? (table)[index] : "unknown")

const char *gw_error_name(gw_error_t error) {
    static const char *const names[GW_ERRORS] = {
        [GW_OK] = "ok",
        [GW_BAD_JSON] = "bad_json",
        [GW_LINE_TOO_LONG] = "line_too_long",
        [GW_UNKNOWN_CMD] = "unknown_cmd",
        [GW_UNKNOWN_FIELD] = "unknown_field",
        [GW_MISSING_FIELD] = "missing_field",
        [GW_BAD_VALUE] = "bad_value",
        [GW_OUT_OF_RANGE] = "out_of_range",
        [GW_NOT_HOLDER] = "not_holder",
        [GW_BUSY] = "busy",
        [GW_NOT_ARMED] = "not_armed",
        [GW_LATCHED] = "latched",
        [GW_ESTOP_PRESSED] = "estop_pressed",
        [GW_BUS_DOWN] = "bus_down",
        [GW_TIMING_MISMATCH] = "timing_mismatch",
        [GW_WHEEL_LOST] = "wheel_lost",
        [GW_WHEEL_BLOCKED] = "wheel_blocked",
        [GW_NOT_AT_REST] = "not_at_rest",
        [GW_SEND_STALLED] = "send_stalled",
        [GW_SECOND_MASTER] = "second_master",
        [GW_CAUSE_PRESENT] = "cause_present",
        [GW_TYPE_NOT_SET] = "type_not_set",
        [GW_STALE_COMMAND] = "stale_command",
        [GW_LISTEN_ONLY] = "listen_only",
        [GW_TOO_MANY_CLIENTS] = "too_many_clients",
        [GW_DENIED] = "denied",
        [GW_INTERNAL] = "internal",
    };
    return PICK(names, error);
}

gw_error_t gw_error_of(iw_refusal_t refusal) {
    static const gw_error_t errors[] = {
        [IW_REFUSE_NONE] = GW_OK,
        [IW_REFUSE_OUT_OF_RANGE] = GW_OUT_OF_RANGE,
        [IW_REFUSE_MISSING_FIELD] = GW_MISSING_FIELD,
        [IW_REFUSE_NOT_HOLDER] = GW_NOT_HOLDER,
        [IW_REFUSE_BUSY] = GW_BUSY,
        [IW_REFUSE_NOT_ARMED] = GW_NOT_ARMED,
        [IW_REFUSE_LATCHED] = GW_LATCHED,
        [IW_REFUSE_ESTOP_PRESSED] = GW_ESTOP_PRESSED,
        [IW_REFUSE_BUS_DOWN] = GW_BUS_DOWN,
        [IW_REFUSE_TIMING_MISMATCH] = GW_TIMING_MISMATCH,
        [IW_REFUSE_WHEEL_LOST] = GW_WHEEL_LOST,
        [IW_REFUSE_WHEEL_BLOCKED] = GW_WHEEL_BLOCKED,
        [IW_REFUSE_NOT_AT_REST] = GW_NOT_AT_REST,
        [IW_REFUSE_SEND_STALLED] = GW_SEND_STALLED,
        [IW_REFUSE_SECOND_MASTER] = GW_SECOND_MASTER,
        [IW_REFUSE_CAUSE_PRESENT] = GW_CAUSE_PRESENT,
        [IW_REFUSE_TYPE_NOT_SET] = GW_TYPE_NOT_SET,
        [IW_REFUSE_STALE_COMMAND] = GW_STALE_COMMAND,
        [IW_REFUSE_LISTEN_ONLY] = GW_LISTEN_ONLY,
        [IW_REFUSE_CONTRADICTED] = GW_DENIED,
    };
    return (size_t)refusal < sizeof errors / sizeof errors[0] ? errors[refusal] : GW_INTERNAL;
}

const char *gw_topic_name(gw_topic_t topic) {
    static const char *const names[GW_TOPICS] = {"state", "bus", "estop", "lease", "stop", "force", "frame"};
    return PICK(names, topic);
}

const char *gw_state_name(iw_state_t state) {
    static const char *const names[] = {
        [IW_STATE_LISTENING] = "listening",
        [IW_STATE_ARMED] = "armed",
        [IW_STATE_STOPPING] = "stopping",
        [IW_STATE_LATCHED] = "latched",
    };
    return PICK(names, state);
}

const char *gw_cause_name(iw_cause_t cause) {
    static const char *const names[IW_CAUSES] = {
        [IW_CAUSE_NONE] = "none",
        [IW_CAUSE_ESTOP_LINE] = "estop_line",
        [IW_CAUSE_ESTOP_SOFTWARE] = "estop_software",
        [IW_CAUSE_WHEEL_LOST] = "wheel_lost",
        [IW_CAUSE_WHEEL_REBOOTED] = "wheel_rebooted",
        [IW_CAUSE_SEND_STALLED] = "send_stalled",
        [IW_CAUSE_BUS_DOWN] = "bus_down",
        [IW_CAUSE_SECOND_MASTER] = "second_master",
        [IW_CAUSE_FEEDBACK_SIGN] = "feedback_sign",
        [IW_CAUSE_OVERSPEED] = "overspeed",
        [IW_CAUSE_LOOP_HUNG] = "loop_hung",
        [IW_CAUSE_INTERNAL] = "internal",
        [IW_CAUSE_LOOP_LATE] = "loop_late",
        [IW_CAUSE_WHEEL_BLOCKED] = "wheel_blocked",
        [IW_CAUSE_LEASE_LOST] = "lease_lost",
        [IW_CAUSE_CLIENT_GONE] = "client_gone",
        [IW_CAUSE_CLIENT_STOP] = "client_stop",
        [IW_CAUSE_SHUTDOWN] = "shutdown",
        [IW_CAUSE_RESTART] = "restart",
    };
    return PICK(names, cause);
}

const char *gw_bus_state_name(iw_bus_state_t state) {
    static const char *const names[] = {
        [IW_BUS_DOWN] = "down",
        [IW_BUS_OFF] = "bus_off",
        [IW_BUS_PASSIVE] = "passive",
        [IW_BUS_ACTIVE] = "active",
    };
    return PICK(names, state);
}

const char *gw_estop_name(int answer, bool present) {
    if (!present) {
        return "none";
    }
    return answer == 0 ? "released" : answer > 0 ? "pressed" : "unreadable";
}

const char *gw_sides_name(uint8_t sides) {
    static const char *const names[] = {NULL, "left", "right", "both"};
    return names[sides & IW_SIDES_BOTH];
}

const char *gw_provenance_name(iw_offset_provenance_t provenance) {
    static const char *const names[] = {
        [IW_OFFSET_NONE] = "none",   [IW_OFFSET_STORED] = "stored",     [IW_OFFSET_ESTIMATED] = "estimated",
        [IW_OFFSET_WHEEL] = "wheel", [IW_OFFSET_OPERATOR] = "operator",
    };
    return PICK(names, provenance);
}

const char *gw_offset_word(iw_offset_provenance_t provenance, iw_time_us_t offset_us) {
    const bool stored = provenance != IW_OFFSET_NONE && offset_us == IW_NEVER;
    return gw_provenance_name(stored ? IW_OFFSET_STORED : provenance);
}

const char *gw_window_name(iw_window_t window) {
    static const char *const names[] = {
        [IW_WINDOW_OPEN] = "open",           [IW_WINDOW_GOOD] = "good",   [IW_WINDOW_MOVING] = "moving",
        [IW_WINDOW_NOISY] = "noisy",         [IW_WINDOW_DRIFT] = "drift", [IW_WINDOW_LOADED] = "loaded",
        [IW_WINDOW_SATURATED] = "saturated",
    };
    return PICK(names, window);
}

const char *gw_unit_evidence_name(iw_unit_evidence_t evidence) {
    static const char *const names[] = {
        [IW_UNIT_UNKNOWN] = "unknown", [IW_UNIT_CN] = "cN",
        [IW_UNIT_DN] = "dN",           [IW_UNIT_OFFSET_REMOVED] = "offset_removed",
        [IW_UNIT_UNCLEAR] = "unclear",
    };
    return PICK(names, evidence);
}

const char *gw_force_validity_name(iw_force_validity_t validity) {
    static const char *const names[] = {
        [IW_FORCE_VALID] = "valid",
        [IW_FORCE_NOT_HEARD] = "not_heard",
        [IW_FORCE_SATURATED] = "saturated",
        [IW_FORCE_NO_OFFSET] = "no_offset",
        [IW_FORCE_UNIT_CONTRADICTED] = "unit_contradicted",
        [IW_FORCE_OFFSET_REMOVED] = "offset_removed",
        [IW_FORCE_OFFSET_DOUBTED] = "offset_doubted",
    };
    return PICK(names, validity);
}

const char *gw_ledger_item_name(iw_ledger_item_t item) {
    static const char *const names[IW_LEDGER_ITEMS] = {
        [IW_LEDGER_SETPOINT_TYPE] = "setpoint_type",
        [IW_LEDGER_CURRENT_ROLE] = "current_role",
        [IW_LEDGER_FORCE_UNIT_LEFT] = "force_unit_left",
        [IW_LEDGER_FORCE_UNIT_RIGHT] = "force_unit_right",
        [IW_LEDGER_OFFSET_INCLUDED] = "offset_included",
        [IW_LEDGER_FEEDBACK_SIGN_LEFT] = "feedback_sign_left",
        [IW_LEDGER_FEEDBACK_SIGN_RIGHT] = "feedback_sign_right",
        [IW_LEDGER_MOUNT_SIGN_LEFT] = "mount_sign_left",
        [IW_LEDGER_MOUNT_SIGN_RIGHT] = "mount_sign_right",
        [IW_LEDGER_WHEEL_RADIUS] = "wheel_radius",
        [IW_LEDGER_TRACK] = "track",
        [IW_LEDGER_GEAR_RATIO] = "gear_ratio",
        [IW_LEDGER_POSE_BYTE_ORDER] = "pose_byte_order",
        [IW_LEDGER_DLC] = "dlc",
    };
    return PICK(names, item);
}

const char *gw_ledger_state_name(iw_ledger_state_t state) {
    static const char *const names[] = {"assumed", "confirmed", "contradicted"};
    return PICK(names, state);
}

const char *gw_evidence_name(iw_evidence_t evidence) {
    static const char *const names[] = {
        [IW_EVIDENCE_NONE] = "none", [IW_EVIDENCE_DOCUMENT] = "document", [IW_EVIDENCE_CONFIGURATION] = "configuration",
        [IW_EVIDENCE_BUS] = "bus",   [IW_EVIDENCE_OPERATOR] = "operator",
    };
    return PICK(names, evidence);
}
