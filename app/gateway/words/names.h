// SPDX-License-Identifier: MIT
/// The words of the northbound protocol for errors, causes, states and the rest. Each list is closed and documented in
/// docs/northbound.md; a value outside its list is "unknown".
#ifndef GATEWAY_NAMES_H
#define GATEWAY_NAMES_H

#include "iwheel/gateway.h"

typedef enum {
    GW_OK = 0,
    GW_BAD_JSON,
    GW_LINE_TOO_LONG,
    GW_UNKNOWN_CMD,
    GW_UNKNOWN_FIELD,
    GW_MISSING_FIELD,
    GW_BAD_VALUE,
    GW_OUT_OF_RANGE,
    GW_NOT_HOLDER,
    GW_BUSY,
    GW_NOT_ARMED,
    GW_LATCHED,
    GW_ESTOP_PRESSED,
    GW_BUS_DOWN,
    GW_TIMING_MISMATCH,
    GW_WHEEL_LOST,
    GW_WHEEL_BLOCKED,
    GW_NOT_AT_REST,
    GW_SEND_STALLED,
    GW_SECOND_MASTER,
    GW_CAUSE_PRESENT,
    GW_TYPE_NOT_SET,
    GW_STALE_COMMAND,
    GW_LISTEN_ONLY,
    GW_TOO_MANY_CLIENTS,
    GW_DENIED,
    GW_INTERNAL,
    GW_ERRORS,
} gw_error_t;

/// Subscriptions, usable as bit numbers.
typedef enum {
    GW_TOPIC_STATE = 0,
    GW_TOPIC_BUS,
    GW_TOPIC_ESTOP,
    GW_TOPIC_LEASE,
    GW_TOPIC_STOP,
    GW_TOPIC_FORCE,
    GW_TOPIC_FRAME,
    GW_TOPICS,
} gw_topic_t;

const char *gw_error_name(gw_error_t error);
/// The northbound error for a refusal of the core.
gw_error_t gw_error_of(iw_refusal_t refusal);

const char *gw_topic_name(gw_topic_t topic);
const char *gw_state_name(iw_state_t state);
const char *gw_cause_name(iw_cause_t cause);
const char *gw_bus_state_name(iw_bus_state_t state);
/// Of the last answer of the HAL's `estop_pressed`; `present` is false if there is no e-stop at all.
const char *gw_estop_name(int answer, bool present);
/// "left", "right", "both"; NULL for none.
const char *gw_sides_name(uint8_t sides);
const char *gw_provenance_name(iw_offset_provenance_t provenance);
/// The same of an offset in force: one of an earlier run (`offset_us` is IW_NEVER) is "stored", whoever took it.
const char *gw_offset_word(iw_offset_provenance_t provenance, iw_time_us_t offset_us);
const char *gw_window_name(iw_window_t window);
const char *gw_unit_evidence_name(iw_unit_evidence_t evidence);
const char *gw_force_validity_name(iw_force_validity_t validity);
const char *gw_ledger_item_name(iw_ledger_item_t item);
const char *gw_ledger_state_name(iw_ledger_state_t state);
const char *gw_evidence_name(iw_evidence_t evidence);

#endif
