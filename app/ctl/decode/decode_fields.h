// SPDX-License-Identifier: MIT
/// A frame as named values with units, for text and for CSV. What the bytes mean is the core's codec's affair. Pure.
#ifndef DECODE_FIELDS_H
#define DECODE_FIELDS_H

#include "iwheel/codec.h"
#include "iwheel/config.h"
#include "iwheel_northbound/text.h"

/// Every value that any of the eleven messages carries; the columns of the CSV, in this order.
typedef enum {
    FIELD_SETPOINT_TYPE = 0,
    FIELD_SETPOINT_SPEED,
    FIELD_SETPOINT_CURRENT,
    FIELD_SPEED,
    FIELD_ACCELERATION,
    FIELD_BATTERY,
    FIELD_TEMPERATURE,
    FIELD_ODOMETRY,
    FIELD_CPU,
    FIELD_POSE_X,
    FIELD_POSE_Y,
    FIELD_POSE_Z,
    FIELD_POSE_PSI,
    FIELD_FORCE_RAW,
    FIELD_FORCE,
    FIELD_FORCE_DEBUG,
    FIELD_OFFSET,
    FIELDS,
} field_t;

typedef struct {
    const char *message; ///< "setpoint", "speed" ...; "unknown" for any other id; what is wrong for a bad frame.
    const char *wheel;   ///< "left", "right", or "" for an unknown id.
    const char *note;    ///< What is to be known about the values; "" if nothing.
    uint32_t present;    ///< Bit per field_t.
    int32_t value[FIELDS];
} decoded_t;

/// Decodes; the unit of the force is the configuration's (iw_config_default: the document's).
void decode_fields(const iw_can_frame_t *frame, const iw_config_t *config, decoded_t *out);

/// Name of the CSV's column, unit last.
const char *field_column(field_t field);

/// "battery 24.8 V, ..." : all values for people.
void field_add_all(const decoded_t *decoded, iwn_text_t *line);

#endif
