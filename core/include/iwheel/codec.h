// SPDX-License-Identifier: MIT
/// @file
/// The eleven messages of the iWheel: one table of rows, frames to values and back.
///
/// Source of every id, layout, unit and range: the document "CAN Frames for controlling the iWheel". Integers are
/// two's complement, most significant byte first. Pure functions: no state, callable from anywhere, also from an
/// interrupt.
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
/// To read a bus, keep two `iw_codec_wheel_t` and give every frame to `iw_codec_decode`: they hold the latest of
/// each message, and the kind that it returns says which one has just come.
#ifndef IW_CODEC_H
#define IW_CODEC_H

#include "iwheel/can_frame.h"
#include "iwheel/types.h"

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

#define IW_DLC_SETPOINT 5U ///< Least length of a setpoint, bytes.
#define IW_DLC_SPEED    4U ///< Of a speed.
#define IW_DLC_STATUS   7U ///< Of a status.
#define IW_DLC_POSE     8U ///< Of a pose.
#define IW_DLC_FORCE    4U ///< Of a force.
#define IW_DLC_OFFSET   2U ///< Of an offset.

/// The document's range of the current setpoint is +/- this.
#define IW_CURRENT_LIMIT_mA 2000
/// Odometry ticks in one turn of the rotor.
#define IW_TICKS_PER_TURN 60U
/// The wheel stops by itself this long after the last setpoint it received.
#define IW_WHEEL_WATCHDOG_US 1000000U
/// Temperatures above this are not believed: an unsigned byte cannot show one below 0 degC.
#define IW_TEMPERATURE_MAX_degC 200U
/// A battery byte of 255 means "at least 25.5 V".
#define IW_BATTERY_SATURATED_dV 255U

/// Which message a frame is, or why it is none.
typedef enum {
    IW_CODEC_SPEED,
    IW_CODEC_STATUS,
    IW_CODEC_FORCE,
    IW_CODEC_OFFSET,
    IW_CODEC_SETPOINT,
    IW_CODEC_POSE,
    IW_CODEC_UNKNOWN,    ///< No message: not one of the eleven numbers, whatever the format.
    IW_CODEC_BAD_FORMAT, ///< No message: one of the numbers on a remote, extended, error or FD frame.
    IW_CODEC_BAD_LENGTH, ///< No message: shorter than the table, or dlc > 8.
} iw_codec_kind_t;

/// So many kinds of message: what is below this is one.
#define IW_CODEC_KINDS IW_CODEC_UNKNOWN

/// One message of the table.
typedef struct {
    uint16_t id;        ///< 11 bits.
    uint16_t period_ms; ///< As documented; of a setpoint the longest allowed.
    uint8_t length;     ///< The least number of bytes.
    uint8_t kind;       ///< An iw_codec_kind_t. Only IW_CODEC_SETPOINT goes to a wheel; all others come from one.
    uint8_t side;       ///< An iw_side_t: the wheel that sends it, or for a setpoint the wheel it is for.
} iw_codec_row_t;

#define IW_CODEC_ROWS 11U ///< Messages in the table.

/// All messages, by kind, the left wheel's before the right one's.
extern const iw_codec_row_t iw_codec_rows[IW_CODEC_ROWS];

/// How fast a wheel turns.
typedef struct {
    int16_t acceleration_raw; ///< Unit unknown ("???" in the document): shown, never used.
    int16_t speed_rpm;        ///< Of the wheel or the rotor: see `iw_config_t::rpm_of_rotor`.
} iw_codec_speed_t;

/// How a wheel is.
typedef struct {
    int32_t odometry_ticks;   ///< Wraps.
    uint8_t battery_dV;       ///< Saturates at IW_BATTERY_SATURATED_dV.
    uint8_t temperature_degC; ///< Believed up to IW_TEMPERATURE_MAX_degC.
    uint8_t cpu_percent;      ///< Load of the wheel's processor.
} iw_codec_status_t;

/// What the sensor on the shaft shows.
typedef struct {
    int16_t debug_raw; ///< "Debugging (not important)".
    int16_t force_raw; ///< cN on the left, dN on the right, says the document. See force_offset.h.
} iw_codec_force_t;

/// Where the machine is, as the right wheel reckons it.
typedef struct {
    int16_t x_mm;     ///< Wraps.
    int16_t y_mm;     ///< Wraps.
    int16_t z_mm;     ///< Wraps.
    int16_t psi_mrad; ///< Wraps at 65536 mrad, which is no multiple of a turn.
} iw_codec_pose_t;

/// The force without a load, as the wheel found it at its start.
typedef struct {
    int16_t offset_dN; ///< In dN for both wheels, says the document.
} iw_codec_offset_t;

/// What a wheel is told.
typedef struct {
    int16_t speed_mm_s; ///< In the wheel's own sense.
    int16_t current_mA; ///< Within +/- IW_CURRENT_LIMIT_mA.
    uint8_t type;       ///< Opaque: the document lists no values.
} iw_codec_setpoint_t;

/// The values of one wheel's messages, each as the last frame of its kind had them. Only the right wheel has a pose.
typedef struct {
    iw_codec_speed_t speed;       ///< Every 4 ms.
    iw_codec_status_t status;     ///< Every 40 ms.
    iw_codec_force_t force;       ///< Every 50 ms.
    iw_codec_pose_t pose;         ///< Every 40 ms, of the right wheel.
    iw_codec_setpoint_t setpoint; ///< The last one that was seen for it.
    iw_codec_offset_t offset;     ///< In the first 60 s of its run.
} iw_codec_wheel_t;

/// The least length of that kind of message.
uint8_t iw_codec_length(iw_codec_kind_t kind);

/// The row of a number of 11 bits; NULL if it is not one of the eleven.
const iw_codec_row_t *iw_codec_find(uint32_t id);

/// What the message is called: "speed", "status", "force", "offset", "setpoint", "pose". Not for a refusal.
const char *iw_codec_name(iw_codec_kind_t kind);

/// Which wheel one of the eleven numbers belongs to.
iw_side_t iw_codec_side(uint32_t id);

/// Reads any of the eleven messages into the values of its wheel and tells its kind, or why it was refused: then the
/// values are as they were. Bytes behind the table's length are ignored (a longer frame is accepted).
iw_codec_kind_t iw_codec_decode(const iw_can_frame_t *frame, iw_codec_wheel_t wheel[IW_SIDES]);

/// Writes the message of that kind with the wheel's values, with the table's length, bytes behind it zero, kind
/// IW_CAN_RECEIVED. IW_ERR_ID if there is none (a pose of the left wheel). A setpoint's current is clamped as below.
iw_status_t iw_codec_encode(iw_codec_kind_t kind, iw_side_t side, const iw_codec_wheel_t *wheel,
                            iw_can_frame_t *out_frame);

/// Writes a setpoint of `dlc` 5..8 bytes, zero padded. The last line of defence for the current: it is clamped to
/// +/- IW_CURRENT_LIMIT_mA. Returns true if it had to be, which the caller counts.
bool iw_codec_encode_setpoint(iw_side_t side, const iw_codec_setpoint_t *setpoint, uint8_t dlc,
                              iw_can_frame_t *out_frame);

#endif
