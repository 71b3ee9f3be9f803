// SPDX-License-Identifier: MIT
// Separate from the other words: an image without the protocol needs only these.
#include "pick.h"

const char *iwn_pick(const char *const *table, size_t size, size_t index) {
    return (index < size && table[index] != NULL) ? table[index] : "unknown";
}

const char *iwn_state_name(iw_state_t state) {
    static const char *const names[] = {
        [IW_STATE_LISTENING] = "listening",
        [IW_STATE_ARMED] = "armed",
        [IW_STATE_STOPPING] = "stopping",
        [IW_STATE_LATCHED] = "latched",
    };
    return PICK(names, state);
}

const char *iwn_cause_name(iw_cause_t cause) {
    static const char *const names[IW_CAUSES] = {
        [IW_CAUSE_NONE] = "none",
        [IW_CAUSE_ESTOP_LINE] = "estop_line",
        [IW_CAUSE_ESTOP_DISAGREES] = "estop_disagrees",
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
        [IW_CAUSE_PAIR_DIVERGES] = "pair_diverges",
        [IW_CAUSE_LEASE_LOST] = "lease_lost",
        [IW_CAUSE_CLIENT_GONE] = "client_gone",
        [IW_CAUSE_CLIENT_STOP] = "client_stop",
        [IW_CAUSE_SHUTDOWN] = "shutdown",
        [IW_CAUSE_RESTART] = "restart",
    };
    return PICK(names, cause);
}

const char *iwn_bus_state_name(iw_bus_state_t state) {
    static const char *const names[] = {
        [IW_BUS_DOWN] = "down",
        [IW_BUS_OFF] = "bus_off",
        [IW_BUS_PASSIVE] = "passive",
        [IW_BUS_ACTIVE] = "active",
    };
    return PICK(names, state);
}
