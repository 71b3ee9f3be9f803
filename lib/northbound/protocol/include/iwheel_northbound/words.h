// SPDX-License-Identifier: MIT
/// @file
/// Names of the northbound protocol for errors, causes, states and other lists. Each list is closed and documented in
/// docs/user/northbound.md. A value outside its list is "unknown".
#ifndef IWHEEL_NORTHBOUND_WORDS_H
#define IWHEEL_NORTHBOUND_WORDS_H

#include "iwheel/gateway.h"

#ifdef __cplusplus
extern "C" {
#endif

/// Errors of the protocol: docs/user/northbound.md.
typedef enum {
    IWN_OK = 0,
    IWN_BAD_JSON,
    IWN_LINE_TOO_LONG,
    IWN_UNKNOWN_CMD,
    IWN_UNKNOWN_FIELD,
    IWN_MISSING_FIELD,
    IWN_BAD_VALUE,
    IWN_OUT_OF_RANGE,
    IWN_NOT_HOLDER,
    IWN_BUSY,
    IWN_NOT_ARMED,
    IWN_LATCHED,
    IWN_ESTOP_PRESSED,
    IWN_BUS_DOWN,
    IWN_TIMING_MISMATCH,
    IWN_WHEEL_LOST,
    IWN_WHEEL_BLOCKED,
    IWN_PAIR_DIVERGES,
    IWN_NOT_AT_REST,
    IWN_SEND_STALLED,
    IWN_SECOND_MASTER,
    IWN_CAUSE_PRESENT,
    IWN_TYPE_NOT_SET,
    IWN_TRACK_NOT_SET,
    IWN_STALE_COMMAND,
    IWN_LISTEN_ONLY,
    IWN_TOO_MANY_CLIENTS,
    IWN_DENIED,
    IWN_INTERNAL,
    IWN_ERRORS,
} iwn_error_t;

/// Topics. The values are bit numbers.
typedef enum {
    IWN_TOPIC_STATE = 0,
    IWN_TOPIC_BUS,
    IWN_TOPIC_ESTOP,
    IWN_TOPIC_LEASE,
    IWN_TOPIC_STOP,
    IWN_TOPIC_FORCE,
    IWN_TOPIC_FRAME,
    IWN_TOPICS,
} iwn_topic_t;

/// Size of the longest value of an assumption, with its terminator.
#define IWN_VALUE_SIZE 40U
#define IWN_HOW_SIZE   128U ///< Size of the longest description of a method, with its terminator.

/// Returns the name of an error, for example "bad_json".
const char *iwn_error_name(iwn_error_t error);
/// Returns the error of the protocol for a refusal of the core.
iwn_error_t iwn_error_of(iw_refusal_t refusal);

/// Returns the name of a topic, for example "state".
const char *iwn_topic_name(iwn_topic_t topic);
/// Returns the name of a state, for example "listening".
const char *iwn_state_name(iw_state_t state);
/// Returns the name of a cause, for example "estop_line".
const char *iwn_cause_name(iw_cause_t cause);
/// Returns the name of a state of the bus, for example "active".
const char *iwn_bus_state_name(iw_bus_state_t state);
/// Returns the name of a result of `estop_pressed`. `present`: there is an e-stop.
const char *iwn_estop_name(int answer, bool present);
/// Returns "left", "right" or "both"; NULL for none.
const char *iwn_sides_name(uint8_t sides);
/// Returns the name of a provenance, for example "operator".
const char *iwn_provenance_name(iw_offset_provenance_t provenance);
/// Returns the word for an offset in use: "stored" for one of an earlier run (`offset_us` is IW_NEVER), otherwise its
/// provenance.
const char *iwn_offset_word(iw_offset_provenance_t provenance, iw_time_us_t offset_us);
/// Returns the name of a judgement, for example "good".
const char *iwn_window_name(iw_window_t window);
/// Returns the name of an observed unit, for example "cN".
const char *iwn_unit_observation_name(iw_unit_observation_t source);
/// Returns the name of a validity, for example "valid".
const char *iwn_force_validity_name(iw_force_validity_t validity);
/// Returns the name of an item, for example "setpoint_type".
const char *iwn_assumption_item_name(iw_assumption_item_t item);
/// Finds an item by its name. Returns false if there is none.
bool iwn_assumption_item_of(const char *name, iw_assumption_item_t *out_item);
/// Returns the name of a state of an assumption, for example "assumed".
const char *iwn_assumption_state_name(iw_assumption_state_t state);
/// Returns the name of a source, for example "document".
const char *iwn_source_name(iw_source_t source);

#ifdef __cplusplus
}
#endif
#endif
