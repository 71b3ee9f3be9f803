// SPDX-License-Identifier: MIT
/// @file
/// Codec of the eleven iWheel messages: a table of the messages, and conversion between frames and values.
///
/// Source of every id, layout, unit and range: the document "CAN Frames for controlling the iWheel". Integers are
/// two's complement, most significant byte first. The functions have no state and may be called from any context,
/// including an interrupt.
///
/// | id          | message  | DLC | bytes                                                                | period  |
/// |-------------|----------|-----|----------------------------------------------------------------------|---------|
/// | 266 (0x10A) | setpoint | 5   | 0 type u8, 1-2 speed i16 mm/s, 3-4 current i16 mA (to the left)      | < 1 s   |
/// | 298 (0x12A) | setpoint | 5   | same, to the right                                                   | < 1 s   |
/// | 256 (0x100) | speed    | 4   | 0-1 speed i16 rpm, 2-3 acceleration i16, unit unknown (left)         | 4 ms    |
/// | 288 (0x120) | speed    | 4   | same, right                                                          | 4 ms    |
/// | 257 (0x101) | status   | 7   | 0 battery u8 dV, 1 temperature u8 degC, 2-5 odometry i32, 6 CPU u8 % | 40 ms   |
/// | 289 (0x121) | status   | 7   | same, right                                                          | 40 ms   |
/// | 290 (0x122) | pose     | 8   | 0-1 X i16 mm, 2-3 Y, 4-5 Z, 6-7 PSI i16 mrad (the right sends it)    | 40 ms   |
/// | 512 (0x200) | force    | 4   | 0-1 normal force i16 (document: cN), 2-3 debug (left)                | 50 ms   |
/// | 544 (0x220) | force    | 4   | 0-1 normal force i16 (document: dN), 2-3 debug (right)               | 50 ms   |
/// | 513 (0x201) | offset   | 2   | 0-1 force offset i16 dN (left), in the wheel's first 60 s only       | 1000 ms |
/// | 545 (0x221) | offset   | 2   | same, right                                                          | 1000 ms |
///
/// To read a bus, pass every frame to `iw_codec_decode` with an array of two `iw_codec_wheel_t`. The array then has the
/// last values of each message, and the returned kind is that of the new message.
#ifndef IW_CODEC_H
#define IW_CODEC_H

#include "iwheel/can_frame.h"
#include "iwheel/types.h"

#ifdef __cplusplus
extern "C" {
#endif

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

#define IW_DLC_SETPOINT 5U ///< Minimum length of a setpoint in bytes.
#define IW_DLC_SPEED    4U ///< Minimum length of a speed message in bytes.
#define IW_DLC_STATUS   7U ///< Minimum length of a status message in bytes.
#define IW_DLC_POSE     8U ///< Minimum length of a pose in bytes.
#define IW_DLC_FORCE    4U ///< Minimum length of a force message in bytes.
#define IW_DLC_OFFSET   2U ///< Minimum length of an offset in bytes.

/// Limit of the current in a setpoint, from the document: +/- this value.
#define IW_CURRENT_LIMIT_mA 2000
/// Odometry ticks in one turn of the rotor.
#define IW_TICKS_PER_TURN 60U
/// A wheel stops on its own after this time without a setpoint.
#define IW_WHEEL_WATCHDOG_US 1000000U
/// Higher temperatures are not valid: the unsigned byte cannot represent a temperature below 0 degC.
#define IW_TEMPERATURE_MAX_degC 200U
/// A battery byte with this value means at least 25.5 V.
#define IW_BATTERY_SATURATED_dV 255U

/// Message of a frame, or the reason why the frame is not a message.
typedef enum {
    IW_CODEC_SPEED,
    IW_CODEC_STATUS,
    IW_CODEC_FORCE,
    IW_CODEC_OFFSET,
    IW_CODEC_SETPOINT,
    IW_CODEC_POSE,
    IW_CODEC_UNKNOWN,    ///< No message: the id is not one of the eleven, in any format.
    IW_CODEC_BAD_FORMAT, ///< No message: one of the ids on a remote, extended, error or FD frame.
    IW_CODEC_BAD_LENGTH, ///< No message: shorter than in the table, or dlc > 8.
} iw_codec_kind_t;

/// Number of message kinds. Smaller values of iw_codec_kind_t are messages.
#define IW_CODEC_KINDS IW_CODEC_UNKNOWN

/// One message of the table.
typedef struct {
    uint16_t id;        ///< 11 bits.
    uint16_t period_ms; ///< Documented period; for a setpoint the longest allowed period.
    uint8_t length;     ///< Minimum number of bytes.
    uint8_t kind;       ///< An iw_codec_kind_t. Only IW_CODEC_SETPOINT is sent to a wheel; wheels send all others.
    uint8_t side;       ///< An iw_side_t: the wheel that sends the message, or that receives the setpoint.
} iw_codec_row_t;

#define IW_CODEC_ROWS 11U ///< Messages in the table.

/// All messages, ordered by kind, left before right.
extern const iw_codec_row_t iw_codec_rows[IW_CODEC_ROWS];

/// Speed message.
typedef struct {
    int16_t acceleration_raw; ///< The unit is unknown ("???" in the document). Shown, never used.
    int16_t speed_rpm;        ///< Speed of the wheel or of its rotor: see `iw_config_t::rpm_of_rotor`.
} iw_codec_speed_t;

/// Status message.
typedef struct {
    int32_t odometry_ticks;   ///< Odometry. Wraps.
    uint8_t battery_dV;       ///< Battery voltage. Saturates at IW_BATTERY_SATURATED_dV.
    uint8_t temperature_degC; ///< Temperature. Valid up to IW_TEMPERATURE_MAX_degC.
    uint8_t cpu_percent;      ///< Load of the wheel's processor.
} iw_codec_status_t;

/// Force message: the sensor on the shaft.
typedef struct {
    int16_t debug_raw; ///< "Debugging (not important)" in the document.
    int16_t force_raw; ///< Normal force. Document: cN on the left, dN on the right. See force_offset.h.
} iw_codec_force_t;

/// Pose message: pose of the machine as the right wheel computes it.
typedef struct {
    int16_t x_mm;     ///< X position. Wraps.
    int16_t y_mm;     ///< Y position. Wraps.
    int16_t z_mm;     ///< Z position. Wraps.
    int16_t psi_mrad; ///< Heading. Wraps at 65536 mrad, which is not a multiple of a turn.
} iw_codec_pose_t;

/// Offset message: force without a load, measured by the wheel at its start.
typedef struct {
    int16_t offset_dN; ///< Offset. Document: dN for both wheels.
} iw_codec_offset_t;

/// Setpoint message.
typedef struct {
    int16_t speed_mm_s; ///< Speed as on the bus: positive is the wheel's own forward.
    int16_t current_mA; ///< Limit or setpoint. As decoded it may exceed IW_CURRENT_LIMIT_mA; the encoder clamps it.
    uint8_t type;       ///< Setpoint type. The document lists no values.
} iw_codec_setpoint_t;

/// Last values of each message of one wheel. Only the right wheel sends a pose.
typedef struct {
    iw_codec_speed_t speed;       ///< Sent every 4 ms.
    iw_codec_status_t status;     ///< Sent every 40 ms.
    iw_codec_force_t force;       ///< Sent every 50 ms.
    iw_codec_pose_t pose;         ///< Sent every 40 ms by the right wheel.
    iw_codec_setpoint_t setpoint; ///< Last setpoint on the bus for this wheel.
    iw_codec_offset_t offset;     ///< Sent in the first 60 s after the wheel's start.
} iw_codec_wheel_t;

/// Returns the minimum length of a message in bytes. `kind` < IW_CODEC_KINDS.
uint8_t iw_codec_length(iw_codec_kind_t kind);

/// Returns the table row of an id, or NULL if the id is not one of the eleven.
const iw_codec_row_t *iw_codec_find(uint32_t id);

/// Returns the name of a message: "speed", "status", "force", "offset", "setpoint" or "pose". `kind` < IW_CODEC_KINDS.
const char *iw_codec_name(iw_codec_kind_t kind);

/// Returns the wheel of one of the eleven ids: the sender of telemetry, the receiver of a setpoint. It does not check
/// the id: for any other id the result has no meaning.
iw_side_t iw_codec_side(uint32_t id);

/// Decodes a frame into the values of its wheel and returns the kind of the message. If the frame is not a message, it
/// returns the reason and leaves the values unchanged. It accepts a frame that is longer than in the table, and
/// ignores the bytes after that length.
iw_codec_kind_t iw_codec_decode(const iw_can_frame_t *frame, iw_codec_wheel_t wheel[IW_SIDES]);

/// Encodes the message `kind` of `side` from the values of `*wheel`. The frame has the table's length, zero bytes after
/// it, and kind IW_CAN_RECEIVED. Returns IW_ERR_ID and leaves `*out_frame` unchanged if there is no such message (a
/// pose of the left wheel, or `kind` >= IW_CODEC_KINDS). Clamps the current of a setpoint like
/// `iw_codec_encode_setpoint`.
iw_status_t iw_codec_encode(iw_codec_kind_t kind, iw_side_t side, const iw_codec_wheel_t *wheel,
                            iw_can_frame_t *out_frame);

/// Encodes a setpoint of `dlc` bytes, with zeros in bytes 5 to 7 and kind IW_CAN_RECEIVED. `side` and `dlc` (5..8) are
/// not checked. Clamps the current to +/- IW_CURRENT_LIMIT_mA, which is the last check before the bus; does not limit
/// the speed. Always writes `*out_frame`. Returns true if it clamped the current; the caller counts that.
bool iw_codec_encode_setpoint(iw_side_t side, const iw_codec_setpoint_t *setpoint, uint8_t dlc,
                              iw_can_frame_t *out_frame);

#ifdef __cplusplus
}
#endif
#endif
