// SPDX-License-Identifier: MIT
/// Ids, lengths and typed values of the eleven messages; `iwheel/proto.h` has the table they come from.
#ifndef IW_PROTO_TYPES_H
#define IW_PROTO_TYPES_H

#include "iwheel/can_frame.h"

#define IW_ID_LEFT_SETPOINT  266U ///< 0x10A
#define IW_ID_RIGHT_SETPOINT 298U ///< 0x12A
#define IW_ID_LEFT_SPEED     256U ///< 0x100
#define IW_ID_LEFT_STATUS    257U ///< 0x101
#define IW_ID_RIGHT_SPEED    288U ///< 0x120
#define IW_ID_RIGHT_STATUS   289U ///< 0x121
#define IW_ID_RIGHT_POSE     290U ///< 0x122
#define IW_ID_LEFT_FORCE     512U ///< 0x200
#define IW_ID_LEFT_OFFSET    513U ///< 0x201
#define IW_ID_RIGHT_FORCE    544U ///< 0x220
#define IW_ID_RIGHT_OFFSET   545U ///< 0x221

#define IW_DLC_SETPOINT 5U
#define IW_DLC_SPEED    4U
#define IW_DLC_STATUS   7U
#define IW_DLC_POSE     8U
#define IW_DLC_FORCE    4U
#define IW_DLC_OFFSET   2U

/// The document's range of the current setpoint is +/- this.
#define IW_CURRENT_LIMIT_mA 2000
/// Odometry ticks in one turn of the rotor.
#define IW_TICKS_PER_TURN 60U
/// The wheel stops by itself this long after the last setpoint it received.
#define IW_WHEEL_WATCHDOG_US 1000000U
/// A battery byte of 255 means "at least 25.5 V".
#define IW_BATTERY_SATURATED_dV 255U

typedef enum {
    IW_PROTO_SPEED,
    IW_PROTO_STATUS,
    IW_PROTO_FORCE,
    IW_PROTO_POSE,
    IW_PROTO_OFFSET,
    IW_PROTO_SETPOINT,
} iw_proto_kind_t;

typedef struct {
    int16_t speed_mm_s;
    int16_t current_mA;
    uint8_t type; ///< Opaque: the document lists no values.
} iw_proto_setpoint_t;

typedef struct {
    int16_t acceleration_raw; ///< Unit unknown ("???" in the document): shown, never used.
    int16_t speed_rpm;        ///< Of the wheel or the rotor: see `iw_config_t::rpm_of_rotor`.
} iw_proto_speed_t;

typedef struct {
    int32_t odometry_ticks; ///< Wraps; see wheel.h for the unwrapped count.
    uint8_t battery_dV;
    uint8_t temperature_degC;
    uint8_t cpu_percent;
} iw_proto_status_t;

typedef struct {
    int16_t x_mm;
    int16_t y_mm;
    int16_t z_mm;
    int16_t psi_mrad; ///< Wraps at 65536 mrad, which is no multiple of a turn.
} iw_proto_pose_t;

typedef struct {
    int16_t debug_raw; ///< "Debugging (not important)".
    int16_t force_raw; ///< cN on the left, dN on the right, says the document. See force.h.
} iw_proto_force_t;

typedef struct {
    int16_t offset_dN;
} iw_proto_offset_t;

/// One message: `kind` tells which member of `as` is valid.
typedef struct {
    iw_proto_kind_t kind;
    iw_side_t side; ///< The wheel that sent it, or for a setpoint the wheel it is for. A pose is the right wheel's.
    union {
        iw_proto_setpoint_t setpoint;
        iw_proto_speed_t speed;
        iw_proto_status_t status;
        iw_proto_pose_t pose;
        iw_proto_force_t force;
        iw_proto_offset_t offset;
    } as;
} iw_proto_message_t;

#endif
