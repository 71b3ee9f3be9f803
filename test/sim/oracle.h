// SPDX-License-Identifier: MIT
/// Judges a gateway from outside, by the rules of motion permission: from its requests, its input through the port and
/// its output.
///
/// It is written from the rules and not from the core: it decodes frames itself and tracks permission, lease, echoes,
/// standstill and silence independently. It reads only the public state of the gateway. It stores the first broken rule.
#ifndef SIM_TEST_ORACLE_H
#define SIM_TEST_ORACLE_H

#include "iwheel/gateway.h"

#define ORACLE_NO_RULE 0U

/// Maximum time for which two contacts of the e-stop may differ.
#define ORACLE_CONTACTS_US 200000U

/// A wheel from the oracle's point of view.
typedef struct {
    iw_time_us_t fresh_us;   ///< Speed frame received in a step that was on time.
    iw_time_us_t rest_us;    ///< Begin of standstill without a gap.
    iw_time_us_t excused_us; ///< A late step may excuse silence before it, once.
    iw_time_us_t sent_us;    ///< Last setpoint accepted by the port; IW_NEVER: none since silence.
    iw_time_us_t tried_us;   ///< Last setpoint passed to the port, accepted or not.
    iw_time_us_t waiting[8]; ///< Un-echoed, oldest first.
    iw_time_us_t proven_us;  ///< Time when the last echoed setpoint was sent.
    iw_time_us_t against_us; ///< Begin of motion against the command; IW_NEVER: none.
    iw_time_us_t faster_us;
    iw_time_us_t blocked_us;
    iw_time_us_t ticks_us;
    iw_time_us_t offset_us; ///< Last offset frame, or a later time when the wheel was found or its reboot became known.
    uint32_t reboots;       ///< Reboots that the gateway knows of.
    int32_t ticks;
    int32_t rpm;
    int32_t speed;  ///< Last speed passed to the port, as on the bus.
    int32_t before; ///< The same when this step began: the core judges before it sends.
    int32_t current;
    uint32_t old_on_bus; ///< Nonzero frames on the bus since the last e-stop edge.
    uint8_t pending;
    bool accepted_zero; ///< The last accepted frame was zero.
    bool tried_now;
    bool accepted_now;
    bool after_stale; ///< An old nonzero frame came out: the next must be zero.
} oracle_wheel_t;

typedef struct {
    const iw_config_t *config;
    const iw_gateway_t *gateway;
    oracle_wheel_t wheel[IW_SIDES];
    uint32_t rule; ///< The broken rule, or ORACLE_NO_RULE.
    iw_time_us_t broken_us;
    char text[200];

    bool armed;
    bool fresh; ///< A drive was accepted since arming.
    bool hard;  ///< Only zero is allowed until the next arm.
    bool broken_pair;
    bool restarting;
    bool hold_active; ///< With after_stop = hold: the hold has not ended since arm, a latch or the restart.
    bool ended;       ///< The process ends: a latch starts no hold any more.
    iw_time_us_t released_us;
    bool hold_unsure; ///< The frames may be of the dead process or of another master; the oracle cannot decide.
    bool proven;      ///< Echoes prove something in this run.
    bool purges;
    iw_client_t holder;
    iw_client_t pending_arm;
    iw_time_us_t arm_us;
    iw_time_us_t armed_us;
    iw_time_us_t lease_until_us;
    iw_time_us_t ramp_us; ///< End of the permission; IW_NEVER: it has not ended.
    iw_time_us_t nonzero_drive_us;
    iw_pair_t target;

    iw_state_t state;
    bool was_arming;
    bool latched_silent; ///< Latched while nothing was being sent.
    iw_time_us_t stopped_us;
    iw_time_us_t latched_us;
    iw_time_us_t held_us; ///< In LATCHED: zeros are held from this time on, at the latest a period later.
    iw_time_us_t path_at_us;
    int64_t path_nm;           ///< Deviation of the pair from its path without any lag: right minus left, with leak.
    iw_time_us_t turn_us;      ///< Time when both wheels' setpoints were passed to the port.
    iw_time_us_t unsettled_us; ///< During a hold without end a wheel turned: later zeros are timed from then on.
    iw_time_us_t silent_us;    ///< End of the zeros; IW_NEVER: zeros are held, or a client drives.
    uint32_t stops;
    bool rolling_fault;
    iw_time_us_t turning_us;  ///< Begin of a turn although nothing is sent; IW_NEVER: no wheel turns.
    iw_time_us_t turned_us;   ///< Last time when a wheel turned; IW_NEVER: never.
    iw_time_us_t setpoint_us; ///< Last time when setpoints were due; IW_NEVER: never.

    int estop;
    iw_time_us_t estop_us[2]; ///< Last time of an e-stop by the line and by a client; IW_NEVER: never.
    bool estop_new;           ///< It began since the last observation.
    uint32_t latch_stop;      ///< Number of the last stop at the last observation.
    iw_time_us_t apart_us;    ///< Begin of the difference of its contacts, if `apart`.
    bool apart;
    bool quarrel;      ///< They differed for too long ...
    bool both_pressed; ///< ... and have both been pressed since.
    iw_bus_state_t bus;
    iw_time_us_t foreign_us;
    uint32_t foreign;     ///< Foreign setpoints since the start.
    iw_time_us_t edge_us; ///< Edge of the line itself.
    iw_time_us_t late_us;
    iw_time_us_t refused_us;
    iw_time_us_t bus_bad_us;
    iw_time_us_t step_us;
    uint32_t received;
    bool timing_bad;
    bool stalled; ///< In this step the time of its frames is unknown.
    bool late_stop;
    bool hung;
    bool foreign_now;
    bool jump_now;
    bool back_now;    ///< Offset frames came back after a long pause,
    bool may_be_back; ///< or after a pause that need not have consequences.
} oracle_t;

/// The client of a request, the time when it was sent and the time when it reached the gateway.
typedef struct {
    iw_time_us_t now_us;
    iw_time_us_t sent_us;
    iw_client_t client;
} oracle_asked_t;

void oracle_start(oracle_t *self, const iw_gateway_t *gateway, iw_time_us_t now_us, bool restarted);

void oracle_step_begin(oracle_t *self, iw_time_us_t now_us, iw_time_us_t promised_us);
void oracle_step_end(oracle_t *self, iw_time_us_t now_us);

/// Input and output of the gateway through the port.
void oracle_estop(oracle_t *self, iw_time_us_t now_us, int result);
/// The readings of both contacts, where there are two, and the result of the port.
void oracle_contacts(oracle_t *self, iw_time_us_t now_us, const int reading[2], int result);
void oracle_bus(oracle_t *self, iw_time_us_t now_us, iw_bus_state_t state);
void oracle_received(oracle_t *self, iw_time_us_t now_us, const iw_can_frame_t *frame);
/// The frames of one call; `oracle_sent` follows for each frame that the port tries to send.
void oracle_call(oracle_t *self, iw_time_us_t now_us, const iw_can_frame_t *frames, uint32_t count);
void oracle_sent(oracle_t *self, iw_time_us_t now_us, const iw_can_frame_t *frame, bool accepted);
void oracle_purged(oracle_t *self);

/// Events outside: an edge of the e-stop line; one of the gateway's own frames on the bus.
void oracle_edge(oracle_t *self, iw_time_us_t now_us);
void oracle_on_bus(oracle_t *self, iw_time_us_t now_us, const iw_can_frame_t *frame, iw_time_us_t handed_us);

/// Requests and their results, immediately after them.
void oracle_arm(oracle_t *self, iw_time_us_t now_us, iw_client_t client, bool takeover, iw_refusal_t result);
void oracle_drive(oracle_t *self, const oracle_asked_t *asked, const iw_drive_t *request, iw_refusal_t result,
                  const iw_applied_t *applied);
void oracle_stop(oracle_t *self, iw_time_us_t now_us, bool matters);
void oracle_soft_estop(oracle_t *self, iw_time_us_t now_us);
void oracle_reset(oracle_t *self, iw_time_us_t now_us, iw_state_t before, const iw_stop_t *stop);
void oracle_release(oracle_t *self, iw_time_us_t now_us, iw_refusal_t result);
/// The process receives the signal to end.
void oracle_shutdown(oracle_t *self, iw_time_us_t now_us);

/// Fails by a rule of the rig.
void oracle_fail(oracle_t *self, iw_time_us_t now_us, uint32_t rule, const char *text);

#endif
