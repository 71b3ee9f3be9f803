// SPDX-License-Identifier: MIT
/// A frame as named values with units, for text and for CSV. The core's codec defines the bytes. Pure.
#ifndef DECODE_FIELDS_H
#define DECODE_FIELDS_H

#include "iwheel/codec.h"
#include "iwheel/config.h"

#include <stdio.h>

/// All values of the eleven messages; the columns of the CSV, in this order.
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
    const char *message; ///< "setpoint", "speed" ...; "unknown" for another id; "ignored" or "error" for a bad frame.
    const char *wheel;   ///< "left", "right", or "" for an unknown id.
    const char *note;    ///< Remark about the values; "" if none.
    uint32_t present;    ///< Bit per field_t.
    int32_t value[FIELDS];
} decoded_t;

/// Decodes a frame. The unit of the force is that of the configuration (iw_config_default: that of the document).
void decode_fields(const iw_can_frame_t *frame, const iw_config_t *config, decoded_t *out);

/// Returns the name of the CSV column, unit last.
const char *field_column(field_t field);

/// Prints all values as text, such as "battery 24.8 V, ...".
void field_print_all(const decoded_t *decoded, FILE *out);

#endif
