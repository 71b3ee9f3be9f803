// SPDX-License-Identifier: MIT
/// @file
/// Types that every module shares: time, sides, status codes, a command for a pair of wheels; states, causes of a stop,
/// refusals; what is assumed of the wheels.
///
/// Units stand at the end of a name: `_mm_s _mm_s2 _mA _mN _rpm _dV _degC _ms _us _permille`. Everything is an
/// integer. Programmer errors (a null pointer, an enumerator that does not exist) are not reported: they are the
/// caller's contract. Bad arguments come back as a status; trouble on the wire is counted.
#ifndef IW_TYPES_H
#define IW_TYPES_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

/// A relation between constants that must hold, or the file does not compile. `name` must be unique in its file.
#define IW_STATIC_ASSERT(condition, name) typedef char iw_static_assert_##name[(condition) ? 1 : -1]

/// Monotonic time in microseconds since any fixed instant. 64 bits do not wrap in the life of a device.
typedef uint64_t iw_time_us_t;

/// Later than every time; "no wake-up wanted" and "never happened".
#define IW_NEVER UINT64_MAX

#define IW_US_PER_MS 1000U ///< Microseconds in a millisecond.

/// The two wheels. Usable as an array index.
typedef enum { IW_LEFT = 0, IW_RIGHT = 1 } iw_side_t;
#define IW_SIDES 2 ///< So many wheels.

/// What a function made of its arguments. Outputs are untouched unless the status is IW_OK.
typedef enum {
    IW_OK = 0,
    IW_ERR_RANGE, ///< A value is outside its documented range.
    IW_ERR_ID,    ///< There is no such message.
} iw_status_t;

/// What one wheel is told: bytes 1-4 of its setpoint frame.
typedef struct {
    int16_t speed_mm_s; ///< Positive is forward, of the machine; on the bus, of the wheel.
    int16_t current_mA; ///< A limit or a setpoint: the document does not say, `iw_config_t::current_role` does.
} iw_command_t;

/// What both wheels are told, indexed by `iw_side_t`. They leave together or not at all.
typedef struct {
    iw_command_t wheel[IW_SIDES]; ///< By side.
} iw_pair_t;

/// What was sent: counted since the start.
typedef struct {
    uint32_t pairs;      ///< Whole pairs taken by the port.
    uint32_t later;      ///< Setpoints that the port did not take.
    uint32_t clamped;    ///< Currents that the encoder had to clamp. Nonzero means an error of ours.
    uint32_t gap_us;     ///< Between the last two pairs; 0: the last one was the first after silence.
    uint32_t gap_max_us; ///< The largest since the last silence ended.
} iw_sent_t;

/// What the current beside the speed means to the wheel. The document does not say, so there is no default and the
/// wheels do not move until it is set.
typedef enum {
    IW_ROLE_UNSET = 0,
    IW_ROLE_LIMIT,    ///< Zero is speed 0 with the configured maximum current; its sign is never inverted.
    IW_ROLE_SETPOINT, ///< Zero is 0/0; current ramps with the speed; `invert` negates it too.
} iw_current_role_t;

/// Unit of a wheel's raw normal force. The document says cN for the left and dN for the right wheel.
typedef enum { IW_FORCE_CN = 0, IW_FORCE_DN = 1 } iw_force_unit_t;

/// Who asks: chosen by the owner, never reused for another connection. 0 is nobody.
typedef uint32_t iw_client_t;
#define IW_CLIENT_NONE 0U ///< No client.

/// What a client is told.
typedef enum { IW_STATE_LISTENING = 0, IW_STATE_ARMED, IW_STATE_STOPPING, IW_STATE_LATCHED } iw_state_t;

/// What the scheduler aims at.
typedef enum {
    IW_DEMAND_SILENCE = 0, ///< Send nothing.
    IW_DEMAND_ZERO,        ///< Zero without ramp.
    IW_DEMAND_BRAKE,       ///< Ramp to zero, then zero.
    IW_DEMAND_FOLLOW,      ///< Ramp to the client's command.
} iw_demand_t;

/// Why the wheels were stopped. `iw_stop_t::detail` is given with each. Those that latch come first; of several that
/// are present the first one refuses arm and reset.
typedef enum {
    IW_CAUSE_NONE = 0,
    IW_CAUSE_ESTOP_LINE,      ///< Pressed, an edge, or unreadable. Detail: 1 pressed or edge, 2 unreadable.
    IW_CAUSE_ESTOP_DISAGREES, ///< Two contacts of one button: see IW_ESTOP_DISAGREES. Detail: 1.
    IW_CAUSE_ESTOP_SOFTWARE,  ///< A client said estop. Detail: which iw_client_t.
    IW_CAUSE_BUS_DOWN,        ///< Down, gone or bus-off. Detail: an iw_bus_state_t.
    IW_CAUSE_SECOND_MASTER,   ///< Somebody else sends setpoints. Detail: their id.
    IW_CAUSE_SEND_STALLED,    ///< A setpoint was not echoed. Detail: ms waited.
    IW_CAUSE_WHEEL_REBOOTED,  ///< Detail: an iw_reboot_t.
    IW_CAUSE_WHEEL_LOST,      ///< Not heard. Detail: ms since it was; UINT32_MAX: never.
    IW_CAUSE_FEEDBACK_SIGN,   ///< Turns against its command. Detail: |measured| mm/s.
    IW_CAUSE_OVERSPEED,       ///< Faster than applied. Detail: |measured| mm/s.
    IW_CAUSE_LOOP_HUNG,       ///< Our own loop was late by more than 500 ms. Detail: ms.
    IW_CAUSE_INTERNAL,        ///< An internal check failed. Detail: an iw_envelope_verdict_t.
    IW_CAUSE_LOOP_LATE,       ///< Late by 100 to 500 ms: zero without ramp. Detail: ms.
    IW_CAUSE_WHEEL_BLOCKED,   ///< Below 20 % of its command. Detail: |measured| mm/s.
    IW_CAUSE_PAIR_DIVERGES,   ///< The pair leaves its path. Detail: by so many mm, right against left.
    IW_CAUSE_LEASE_LOST,  ///< The holder sent no drive command in time. Detail: ms since its last one, or since arm.
    IW_CAUSE_CLIENT_GONE, ///< The holder disconnected. Detail: 0.
    IW_CAUSE_CLIENT_STOP, ///< A client said stop or disarm. Detail: 0.
    IW_CAUSE_SHUTDOWN,    ///< The gateway is ending. Detail: 0.
    IW_CAUSE_RESTART,     ///< The gateway began anew after a crash while armed. Detail: 0.
    IW_CAUSES,
} iw_cause_t;

/// Bits for `sides`: which wheel a cause speaks of.
#define IW_SIDES_NONE  0U ///< Neither.
#define IW_SIDES_LEFT  1U ///< The left one.
#define IW_SIDES_RIGHT 2U ///< The right one.
#define IW_SIDES_BOTH  3U ///< Both.

/// Why a request was refused. Each has one name in the northbound protocol.
typedef enum {
    IW_REFUSE_NONE = 0, ///< Not refused.
    IW_REFUSE_OUT_OF_RANGE,
    IW_REFUSE_MISSING_FIELD, ///< Currents omitted although the current is a setpoint.
    IW_REFUSE_NOT_HOLDER,    ///< Somebody else holds the lease.
    IW_REFUSE_BUSY,          ///< Somebody else holds the lease, and no takeover was asked for.
    IW_REFUSE_NOT_ARMED,
    IW_REFUSE_LATCHED,
    IW_REFUSE_ESTOP_PRESSED,
    IW_REFUSE_BUS_DOWN,
    IW_REFUSE_TIMING_MISMATCH,
    IW_REFUSE_WHEEL_LOST,
    IW_REFUSE_WHEEL_BLOCKED,
    IW_REFUSE_PAIR_DIVERGES,
    IW_REFUSE_NOT_AT_REST,
    IW_REFUSE_SEND_STALLED,
    IW_REFUSE_SECOND_MASTER,
    IW_REFUSE_CAUSE_PRESENT, ///< `iw_snapshot_t::present` tells which.
    IW_REFUSE_TYPE_NOT_SET,  ///< Setpoint type or current role not configured.
    IW_REFUSE_TRACK_NOT_SET, ///< The distance of the wheels not configured: every bound of yaw rests on it.
    IW_REFUSE_STALE_COMMAND, ///< `iw_snapshot_t::stale_client` sent a nonzero drive too recently.
    IW_REFUSE_LISTEN_ONLY,
    IW_REFUSE_CONTRADICTED, ///< An assumption that motion depends on: `iw_snapshot_t::doubt` tells which.
    IW_REFUSALS,
} iw_refusal_t;

/// The last stop, for `why`.
typedef struct {
    iw_time_us_t at_us; ///< When.
    uint32_t number;    ///< Counts stops; 0: there was none.
    uint32_t detail;    ///< See iw_cause_t.
    iw_client_t client; ///< Who held the lease, or asked for the stop.
    iw_pair_t applied;  ///< What the wheels were told right before it, in the machine's frame.
    iw_cause_t cause;   ///< The first cause.
    iw_state_t from;    ///< The state that it ended.
    uint8_t sides;      ///< Which wheel the cause speaks of: IW_SIDES_...
    bool latched;       ///< It needs a reset.
    bool at_once;       ///< Zero without a ramp.
} iw_stop_t;

/// What the document leaves open, and is therefore assumed until it is found out.
typedef enum {
    IW_ASSUMPTION_SETPOINT_TYPE,      ///< Byte 0 of a setpoint.
    IW_ASSUMPTION_CURRENT_ROLE,       ///< Limit or setpoint.
    IW_ASSUMPTION_FORCE_UNIT_LEFT,    ///< cN, as documented.
    IW_ASSUMPTION_FORCE_UNIT_RIGHT,   ///< dN, as documented.
    IW_ASSUMPTION_OFFSET_INCLUDED,    ///< The raw force still contains the offset, as documented.
    IW_ASSUMPTION_FEEDBACK_SIGN_LEFT, ///< A positive command is measured as a positive speed.
    IW_ASSUMPTION_FEEDBACK_SIGN_RIGHT,
    IW_ASSUMPTION_MOUNT_SIGN_LEFT, ///< A positive command moves the machine forward. Only the operator can know.
    IW_ASSUMPTION_MOUNT_SIGN_RIGHT,
    IW_ASSUMPTION_WHEEL_RADIUS,    ///< "Approximately 192 mm".
    IW_ASSUMPTION_TRACK,           ///< Distance between the wheels. It turns a twist into wheel speeds, and bounds yaw.
    IW_ASSUMPTION_GEAR_RATIO,      ///< Rotor turns per wheel turn, and which of them the rpm count.
    IW_ASSUMPTION_POSE_BYTE_ORDER, ///< Most significant byte first: the table does not say it for the pose.
    IW_ASSUMPTION_DLC,             ///< Frames are as long as the table: the document does not state it.
    IW_ASSUMPTION_ITEMS,
} iw_assumption_item_t;

/// What has become of an assumption.
typedef enum { IW_ASSUMED = 0, IW_CONFIRMED, IW_CONTRADICTED } iw_assumption_state_t;

/// Where it is known from.
typedef enum {
    IW_SOURCE_NONE = 0,      ///< Nothing: not configured and not documented.
    IW_SOURCE_DOCUMENT,      ///< The document says so.
    IW_SOURCE_CONFIGURATION, ///< The operator configured it, nothing confirmed it.
    IW_SOURCE_BUS,           ///< Measured; `figure` tells what.
    IW_SOURCE_OPERATOR,      ///< The operator looked at the machine.
} iw_source_t;

/// What is known of an assumption.
typedef struct {
    iw_assumption_state_t state; ///< Assumed, confirmed or contradicted.
    iw_source_t source;          ///< What that rests on.
    int32_t figure; ///< Of IW_SOURCE_BUS: force unit and offset: 1000 x raw / offset in dN; sign: measured mm/s at a
        ///< positive command; DLC: the length received; setpoint type: 1000 x measured / applied speed; gear
        ///< ratio: 1000 x ticks moved / expected; pose: 1000 x way read byte-swapped / way as it is read.
} iw_assumption_entry_t;

#endif
