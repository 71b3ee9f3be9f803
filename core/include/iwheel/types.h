// SPDX-License-Identifier: MIT
/// @file
/// Types that every module shares: time, sides, status codes, commands for a pair of wheels, states, causes of a stop,
/// refusals, and assumptions about the wheels.
///
/// All quantities are integers. Each name ends with its unit: `_mm_s _mm_s2 _mA _mN _rpm _dV _degC _ms _us _permille`.
/// The core does not check for programmer errors (a null pointer, an enumerator that does not exist): the caller must
/// avoid them. A function returns a status for a bad argument, and counts a bad frame.
#ifndef IW_TYPES_H
#define IW_TYPES_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#ifdef __cplusplus
extern "C" {
#endif

/// Stops the compilation if `condition` (a constant expression) is false. `name` must be unique in its file.
#define IW_STATIC_ASSERT(condition, name) typedef char iw_static_assert_##name[(condition) ? 1 : -1]

/// Monotonic time in microseconds since any fixed instant. It does not wrap in the life of a device.
typedef uint64_t iw_time_us_t;

/// Later than every time. It means "no wake-up needed" or "never happened".
#define IW_NEVER UINT64_MAX

#define IW_US_PER_MS 1000U ///< Microseconds in a millisecond.

/// The two wheels. The values are array indices.
typedef enum { IW_LEFT = 0, IW_RIGHT = 1 } iw_side_t;
#define IW_SIDES 2 ///< Number of wheels.

/// Result of a function that checks its arguments. It writes its outputs only if the status is IW_OK.
typedef enum {
    IW_OK = 0,
    IW_ERR_RANGE, ///< A value is outside its documented range.
    IW_ERR_ID,    ///< The protocol has no such message.
} iw_status_t;

/// Command for one wheel: bytes 1-4 of its setpoint frame.
typedef struct {
    int16_t speed_mm_s; ///< Positive is forward: for the machine, or on the bus for the wheel.
    int16_t current_mA; ///< Limit or setpoint, by `iw_config_t::current_role`: the document does not specify it.
} iw_command_t;

/// Commands for both wheels, indexed by `iw_side_t`. The core sends both or neither.
typedef struct {
    iw_command_t wheel[IW_SIDES]; ///< Commands, indexed by side.
} iw_pair_t;

/// Counters of sent frames since the start.
typedef struct {
    uint32_t pairs;      ///< Pairs that the port accepted as a whole.
    uint32_t later;      ///< Setpoints that the port did not accept.
    uint32_t clamped;    ///< Currents that the encoder clamped. A nonzero value is an error of the core.
    uint32_t gap_us;     ///< Time between the last two pairs; 0 if the last pair was the first one after a pause.
    uint32_t gap_max_us; ///< Largest `gap_us` since the last pause.
} iw_sent_t;

/// Meaning of the current in a setpoint. The document does not specify it, so there is no default, and the core does
/// not move the wheels until it is configured.
typedef enum {
    IW_ROLE_UNSET = 0,
    IW_ROLE_LIMIT,    ///< A limit. A zero command is speed 0 with the maximum current. `invert` does not negate it.
    IW_ROLE_SETPOINT, ///< A setpoint. A zero command is 0/0. The current ramps with the speed, and `invert` negates it.
} iw_current_role_t;

/// Unit of a wheel's raw normal force. In the document it is cN for the left and dN for the right wheel.
typedef enum { IW_FORCE_CN = 0, IW_FORCE_DN = 1 } iw_force_unit_t;

/// Id of a client. The owner of the gateway chooses it and never reuses it for another connection.
typedef uint32_t iw_client_t;
#define IW_CLIENT_NONE 0U ///< No client.

/// State that the gateway reports to clients.
typedef enum { IW_STATE_LISTENING = 0, IW_STATE_ARMED, IW_STATE_STOPPING, IW_STATE_LATCHED } iw_state_t;

/// Target of the scheduler.
typedef enum {
    IW_DEMAND_SILENCE = 0, ///< Send nothing.
    IW_DEMAND_ZERO,        ///< Zero without ramp.
    IW_DEMAND_BRAKE,       ///< Ramp to zero, then zero.
    IW_DEMAND_FOLLOW,      ///< Ramp to the client's command.
} iw_demand_t;

/// Cause of a stop. Each entry describes its `iw_stop_t::detail`. The causes that latch come first. If several are
/// present, the first one in this order refuses arm and reset.
typedef enum {
    IW_CAUSE_NONE = 0,
    IW_CAUSE_ESTOP_LINE,      ///< The e-stop is pressed or had an edge (detail 1), or is unreadable (detail 2).
    IW_CAUSE_ESTOP_DISAGREES, ///< The two contacts of the button disagree: see IW_ESTOP_DISAGREES. Detail: 1.
    IW_CAUSE_ESTOP_SOFTWARE,  ///< A client sent an e-stop request. Detail: its iw_client_t.
    IW_CAUSE_BUS_DOWN,        ///< The bus is down, absent or bus-off. Detail: an iw_bus_state_t.
    IW_CAUSE_SECOND_MASTER,   ///< Another node sends setpoints. Detail: the id of its frame.
    IW_CAUSE_SEND_STALLED,    ///< A setpoint was not echoed. Detail: waiting time in ms.
    IW_CAUSE_WHEEL_REBOOTED,  ///< A wheel restarted. Detail: an iw_reboot_t.
    IW_CAUSE_WHEEL_LOST,      ///< A wheel sends no telemetry. Detail: age of the last frame in ms, or UINT32_MAX: none.
    IW_CAUSE_FEEDBACK_SIGN,   ///< A wheel turns against its command. Detail: |measured| mm/s.
    IW_CAUSE_OVERSPEED,       ///< A wheel is faster than the applied speed. Detail: |measured| mm/s.
    IW_CAUSE_LOOP_HUNG,       ///< A step was late by more than 500 ms. Detail: lateness in ms.
    IW_CAUSE_INTERNAL,        ///< An internal check failed. Detail: an iw_envelope_verdict_t.
    IW_CAUSE_LOOP_LATE,       ///< A step was late by 100 to 500 ms: zero without ramp. Detail: lateness in ms.
    IW_CAUSE_WHEEL_BLOCKED,   ///< A wheel is below 20 % of its command. Detail: |measured| mm/s.
    IW_CAUSE_PAIR_DIVERGES,   ///< The pair leaves its path. Detail: deviation in mm, right minus left.
    IW_CAUSE_LEASE_LOST,  ///< The holder sent no drive command in time. Detail: ms since its last one, or since arm.
    IW_CAUSE_CLIENT_GONE, ///< The holder disconnected. Detail: 0.
    IW_CAUSE_CLIENT_STOP, ///< A client sent stop or disarm. Detail: 0.
    IW_CAUSE_SHUTDOWN,    ///< The gateway ends. Detail: 0.
    IW_CAUSE_RESTART,     ///< The gateway restarted after a crash while armed. Detail: 0.
    IW_CAUSES,
} iw_cause_t;

/// Bits for `sides`: the wheels that a cause refers to.
#define IW_SIDES_NONE  0U ///< Neither.
#define IW_SIDES_LEFT  1U ///< The left one.
#define IW_SIDES_RIGHT 2U ///< The right one.
#define IW_SIDES_BOTH  3U ///< Both.

/// Reason why a request was refused. Each has one name in the northbound protocol.
typedef enum {
    IW_REFUSE_NONE = 0, ///< Not refused.
    IW_REFUSE_OUT_OF_RANGE,
    IW_REFUSE_MISSING_FIELD, ///< The request has no currents although the current is a setpoint.
    IW_REFUSE_NOT_HOLDER,    ///< Another client holds the lease.
    IW_REFUSE_BUSY,          ///< Another client holds the lease, and the request does not ask for a takeover.
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
    IW_REFUSE_CAUSE_PRESENT, ///< A cause in `iw_snapshot_t::present`, or the zeros after a restart have not ended.
    IW_REFUSE_TYPE_NOT_SET,  ///< Setpoint type or current role is not configured.
    IW_REFUSE_TRACK_NOT_SET, ///< The distance between the wheels is not configured. Every yaw limit depends on it.
    /// Arm, reset: a nonzero drive command was sent less than IW_STALE_COMMAND_US ago. Drive: sent before ARMED began.
    IW_REFUSE_STALE_COMMAND,
    IW_REFUSE_LISTEN_ONLY,
    IW_REFUSE_CONTRADICTED, ///< A measurement contradicts `iw_snapshot_t::doubt`, an assumption that motion depends on.
    IW_REFUSALS,
} iw_refusal_t;

/// Returns cause and fix of a refusal in one line of English, for a program without the northbound protocol. Never
/// empty; the text is static. Inline, so that an image contains the texts only if it calls this function.
static inline const char *iw_refusal_text(iw_refusal_t refusal) {
    static const char *const texts[] = {
        // In the order of iw_refusal_t, because C++ has no designators for arrays.
        "not refused",
        "a speed, yaw rate or current is outside its range; nothing was applied",
        "the request has no currents, and current_role is setpoint; add the currents of both wheels",
        "another client holds the lease; stop it first",
        "another client holds the lease; stop it first, or request a takeover with both wheels at standstill",
        "not armed; arm first",
        "latched after a stop; remove its cause, then reset",
        "the e-stop is pressed or unreadable; release the button, then reset",
        "the bus is down; check cable, termination and bit rate",
        "bit rate or sample point of the bus differ from the configuration; set both",
        "a wheel sends no telemetry; check its power, cable and termination",
        "a wheel did not follow its command; free it, and wait until the hold of zeros ends",
        "the pair left its path; check the slower wheel, and wait until the hold of zeros ends",
        "the wheels are not at standstill; wait until both are",
        "a setpoint was not acknowledged on the bus; check that the wheels have power and the bus is terminated",
        "another device sends setpoints; switch it off, and wait a second",
        "a cause of a stop is present; remove it, and wait a second",
        "setpoint_type or current_role is not configured; ask the vendor of the wheels for both",
        "track_mm is not configured, and every limit of turning depends on it; measure and set it",
        "a nonzero drive command was sent too recently, or before arming; release the stick, wait, then arm again",
        "the gateway is configured to listen only; it never sends",
        "a measurement contradicts an assumption that motion depends on; check the configuration of the wheels",
    };
    const unsigned index = (unsigned)refusal;
    return (index < sizeof texts / sizeof texts[0]) ? texts[index]
                                                    : "refused for a reason that has no text; report this";
}

/// The last stop, for `why`.
typedef struct {
    iw_time_us_t at_us;    ///< Time of the stop.
    uint32_t number;       ///< Number of stops so far; 0 if there was none.
    uint32_t detail;       ///< See iw_cause_t.
    iw_client_t client;    ///< Client that held the lease, or that requested the stop.
    iw_pair_t applied;     ///< Last pair before the stop, in the machine's frame.
    iw_cause_t cause;      ///< The cause. In a latch an e-stop that begins is a stop of its own.
    iw_state_t from;       ///< State before the stop.
    uint8_t sides;         ///< Wheels that the cause refers to: IW_SIDES_...
    bool latched;          ///< The stop needs a reset.
    bool at_once;          ///< The stop was a zero without a ramp.
    uint8_t first_sides;   ///< `sides` of the first cause of the latch.
    iw_cause_t first;      ///< The first cause of the latch. After such an e-stop it differs from `cause`.
    uint32_t first_detail; ///< `detail` of the first cause.
} iw_stop_t;

/// Facts that the document leaves open. The core assumes each of them until a measurement or the operator decides it.
typedef enum {
    IW_ASSUMPTION_SETPOINT_TYPE,      ///< Byte 0 of a setpoint.
    IW_ASSUMPTION_CURRENT_ROLE,       ///< Limit or setpoint.
    IW_ASSUMPTION_FORCE_UNIT_LEFT,    ///< cN, as documented.
    IW_ASSUMPTION_FORCE_UNIT_RIGHT,   ///< dN, as documented.
    IW_ASSUMPTION_OFFSET_INCLUDED,    ///< The raw force still contains the offset, as documented.
    IW_ASSUMPTION_FEEDBACK_SIGN_LEFT, ///< A positive command is measured as a positive speed.
    IW_ASSUMPTION_FEEDBACK_SIGN_RIGHT,
    IW_ASSUMPTION_MOUNT_SIGN_LEFT, ///< A positive command moves the machine forward. Only the operator can see it.
    IW_ASSUMPTION_MOUNT_SIGN_RIGHT,
    IW_ASSUMPTION_WHEEL_RADIUS,    ///< "Approximately 192 mm".
    IW_ASSUMPTION_TRACK,           ///< Distance between the wheels. It relates wheel speeds to yaw.
    IW_ASSUMPTION_GEAR_RATIO,      ///< Rotor turns per wheel turn, and which of the two the rpm in telemetry refer to.
    IW_ASSUMPTION_POSE_BYTE_ORDER, ///< Most significant byte first. The document does not state it for the pose.
    IW_ASSUMPTION_DLC,             ///< Frames have the lengths of the table. The document does not state it.
    IW_ASSUMPTION_ITEMS,
} iw_assumption_item_t;

/// State of an assumption.
typedef enum { IW_ASSUMED = 0, IW_CONFIRMED, IW_CONTRADICTED } iw_assumption_state_t;

/// Source of an assumption's value.
typedef enum {
    IW_SOURCE_NONE = 0,      ///< None: neither configured nor documented.
    IW_SOURCE_DOCUMENT,      ///< The document.
    IW_SOURCE_CONFIGURATION, ///< The configuration. No measurement has confirmed it.
    IW_SOURCE_BUS,           ///< A measurement: see `figure`.
    IW_SOURCE_OPERATOR,      ///< The operator, who has seen the machine.
} iw_source_t;

/// One assumption: its state and source.
typedef struct {
    iw_assumption_state_t state; ///< Assumed, confirmed or contradicted.
    iw_source_t source;          ///< Source of that state.
    int32_t figure; ///< Measured value with IW_SOURCE_BUS. Force unit and offset: 1000 x raw / offset in dN. Sign: mm/s
        ///< measured at a positive command. DLC: length in bytes. Setpoint type: 1000 x measured / applied speed.
        ///< Gear ratio: 1000 x ticks moved / expected. Pose: 1000 x distance read byte-swapped / read in order.
} iw_assumption_entry_t;

#ifdef __cplusplus
}
#endif
#endif
