// SPDX-License-Identifier: MIT
#include "decode_fields.h"

#include "text/ctl_text.h"

#define PERCENT_MAX     100
#define MN_PER_CN       10
#define MN_PER_DN       100
#define BATTERY_NOTE    "battery at least 25.5 V: the byte has its largest value"
#define IMPOSSIBLE_NOTE "a temperature above 200 degC or a load above 100 % is impossible and left out"
#define SATURATED_NOTE  "force at the end of its range: it may be larger"

typedef struct {
    const char *column; ///< Name for CSV, in the unit of the bus.
    const char *label;  ///< Name for text, with a space.
    const char *unit;
    unsigned digits; ///< Decimals in text.
} field_words_t;

static const field_words_t words[FIELDS] = {
    [FIELD_SETPOINT_TYPE] = {"setpoint_type", "type ", "", 0},
    [FIELD_SETPOINT_SPEED] = {"setpoint_speed_mm_s", "speed ", "mm/s", 0},
    [FIELD_SETPOINT_CURRENT] = {"setpoint_current_mA", "current ", "mA", 0},
    [FIELD_SPEED] = {"speed_rpm", "", "rpm", 0},
    [FIELD_ACCELERATION] = {"acceleration_raw", "acceleration ", "(unit unknown)", 0},
    [FIELD_BATTERY] = {"battery_dV", "battery ", "V", 1},
    [FIELD_TEMPERATURE] = {"temperature_degC", "temperature ", "degC", 0},
    [FIELD_ODOMETRY] = {"odometry_ticks", "odometry ", "ticks", 0},
    [FIELD_CPU] = {"cpu_percent", "CPU ", "%", 0},
    [FIELD_POSE_X] = {"pose_x_mm", "x ", "mm", 0},
    [FIELD_POSE_Y] = {"pose_y_mm", "y ", "mm", 0},
    [FIELD_POSE_Z] = {"pose_z_mm", "z ", "mm", 0},
    [FIELD_POSE_PSI] = {"pose_psi_mrad", "psi ", "mrad", 0},
    [FIELD_FORCE_RAW] = {"force_raw", "raw ", "", 0},
    [FIELD_FORCE] = {"force_with_offset_mN", "force with offset ", "N", 3},
    [FIELD_FORCE_DEBUG] = {"force_debug_raw", "debug ", "", 0},
    [FIELD_OFFSET] = {"force_offset_dN", "force offset ", "N", 1},
};

static void put(decoded_t *out, field_t field, int32_t value) {
    out->present |= 1U << field;
    out->value[field] = value;
}

static void put_status(const iw_codec_status_t *status, decoded_t *out) {
    const bool hot = status->temperature_degC > IW_TEMPERATURE_MAX_degC;
    const bool busy = status->cpu_percent > PERCENT_MAX;
    put(out, FIELD_BATTERY, status->battery_dV);
    put(out, FIELD_ODOMETRY, status->odometry_ticks);
    if (!hot) {
        put(out, FIELD_TEMPERATURE, status->temperature_degC);
    }
    if (!busy) {
        put(out, FIELD_CPU, status->cpu_percent);
    }
    out->note = (hot || busy) ? IMPOSSIBLE_NOTE : (status->battery_dV == IW_BATTERY_SATURATED_dV) ? BATTERY_NOTE : "";
}

static void put_force(const iw_codec_force_t *force, iw_force_unit_t unit, decoded_t *out) {
    put(out, FIELD_FORCE_RAW, force->force_raw);
    put(out, FIELD_FORCE, force->force_raw * ((unit == IW_FORCE_CN) ? MN_PER_CN : MN_PER_DN));
    put(out, FIELD_FORCE_DEBUG, force->debug_raw);
    out->note = (force->force_raw == INT16_MIN || force->force_raw == INT16_MAX) ? SATURATED_NOTE : "";
}

static void put_message(iw_codec_kind_t kind, const iw_codec_wheel_t *told, iw_force_unit_t unit, decoded_t *out) {
    switch (kind) {
    case IW_CODEC_SETPOINT:
        put(out, FIELD_SETPOINT_TYPE, told->setpoint.type);
        put(out, FIELD_SETPOINT_SPEED, told->setpoint.speed_mm_s);
        put(out, FIELD_SETPOINT_CURRENT, told->setpoint.current_mA);
        break;
    case IW_CODEC_SPEED:
        put(out, FIELD_SPEED, told->speed.speed_rpm);
        put(out, FIELD_ACCELERATION, told->speed.acceleration_raw);
        break;
    case IW_CODEC_STATUS:
        put_status(&told->status, out);
        break;
    case IW_CODEC_POSE:
        put(out, FIELD_POSE_X, told->pose.x_mm);
        put(out, FIELD_POSE_Y, told->pose.y_mm);
        put(out, FIELD_POSE_Z, told->pose.z_mm);
        put(out, FIELD_POSE_PSI, told->pose.psi_mrad);
        break;
    case IW_CODEC_FORCE:
        put_force(&told->force, unit, out);
        break;
    case IW_CODEC_OFFSET:
    default:
        put(out, FIELD_OFFSET, told->offset.offset_dN);
        break;
    }
}

void decode_fields(const iw_can_frame_t *frame, const iw_config_t *config, decoded_t *out) {
    iw_codec_wheel_t told[IW_SIDES];
    const iw_side_t side = iw_codec_side(frame->id);
    const iw_codec_kind_t kind = iw_codec_decode(frame, told);
    *out = (decoded_t){.message = "unknown", .wheel = "", .note = ""};
    switch (kind) {
    case IW_CODEC_UNKNOWN:
        break;
    case IW_CODEC_BAD_FORMAT:
        out->message = "ignored";
        out->note =
            ((frame->id & IW_CAN_EXTENDED) != 0U)
                ? "the wheels use only 11-bit ids: the gateway ignores this one; python-can: is_extended_id=False"
                : "the wheels use only classic data frames with 11-bit ids: the gateway ignores this one";
        break;
    case IW_CODEC_BAD_LENGTH:
        out->message = "ignored";
        out->note = "shorter than in the wheels' document: the gateway ignores it";
        break;
    default:
        out->message = iw_codec_name(kind);
        out->wheel = text_side(side);
        put_message(kind, &told[side], config->force_unit[side], out);
        break;
    }
    if ((frame->id & IW_CAN_ERROR) != 0U) {
        out->message = "error";
        out->note = "the controller's report of an error on the bus, not a frame";
    }
}

const char *field_column(field_t field) {
    return words[field].column;
}

void field_add_all(const decoded_t *decoded, iwn_text_t *line) {
    const char *gap = "";
    for (unsigned field = 0; field < FIELDS; field++) {
        if ((decoded->present & (1U << field)) != 0U) {
            const field_words_t *word = &words[field];
            iwn_text_add(line, gap);
            iwn_text_add(line, word->label);
            text_add_number(decoded->value[field], word->digits, word->unit, line);
            gap = ", ";
        }
    }
}
