// SPDX-License-Identifier: MIT
/// Judges a gateway from outside, by the rules of motion permission: what it was asked, what it was shown, what it
/// sent.
///
/// Written from the rules and not from the core: it decodes frames itself and keeps its own account of permission,
/// lease, echoes, rest and silence. Of the gateway it reads only the public state. The first broken rule is kept.
#ifndef SIM_TEST_ORACLE_H
#define SIM_TEST_ORACLE_H

#include "iwheel/gateway.h"

#define ORACLE_NO_RULE 0U

/// A wheel as the oracle knows it.
/// Two contacts of the e-stop may differ for so long.
#define ORACLE_CONTACTS_US 200000U

typedef struct {
    iw_time_us_t fresh_us;   ///< Speed frame received in a step that was on time.
    iw_time_us_t rest_us;    ///< Since when at rest without a gap.
    iw_time_us_t excused_us; ///< A late step may excuse silence before it, once.
    iw_time_us_t sent_us;    ///< Last setpoint accepted by the port; IW_NEVER: none since silence.
    iw_time_us_t tried_us;   ///< Last setpoint handed over, accepted or not.
    iw_time_us_t waiting[8]; ///< Un-echoed, oldest first.
    iw_time_us_t proven_us;  ///< When the last echoed one had been sent.
    iw_time_us_t against_us; ///< Since when measured against command; IW_NEVER: not.
    iw_time_us_t faster_us;
    iw_time_us_t blocked_us;
    iw_time_us_t ticks_us;
    iw_time_us_t offset_us; ///< Last offset frame since it was found or is known to have rebooted, or that itself.
    uint32_t reboots;       ///< That the gateway knows of.
    int32_t ticks;
    int32_t rpm;
    int32_t speed;  ///< Last handed over, as on the bus.
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
    uint32_t rule; ///< Broken, or ORACLE_NO_RULE.
    iw_time_us_t broken_us;
    char text[200];

    bool armed;
    bool fresh; ///< A drive was accepted since arming.
    bool hard;  ///< Nothing but zero until armed anew.
    bool broken_pair;
    bool restarting;
    bool kept;  ///< With after_stop = hold: nothing has ended it since arm, a latch or the restart.
    bool ended; ///< The process ends: a latch brings no hold any more.
    iw_time_us_t released_us;
    bool kept_unsure; ///< Frames of the dead process, or of another master: nobody can tell.
    bool proven;      ///< Echoes prove something in this run.
    bool purges;
    iw_client_t holder;
    iw_client_t pending_arm;
    iw_time_us_t arm_us;
    iw_time_us_t armed_us;
    iw_time_us_t lease_until_us;
    iw_time_us_t ramp_us; ///< Since when the permission is over; IW_NEVER: it is not.
    iw_time_us_t nonzero_drive_us;
    iw_pair_t target;

    iw_state_t state;
    bool was_arming;
    bool latched_silent; ///< Latched while nothing was being sent.
    iw_time_us_t stopped_us;
    iw_time_us_t latched_us;
    iw_time_us_t held_us; ///< In LATCHED: zeros are held since then, at the latest a period later.
    iw_time_us_t path_at_us;
    int64_t path_nm;      ///< How far the pair has left its path, without any lag: right minus left, leaking.
    iw_time_us_t turn_us; ///< When both wheels were handed a setpoint.
    iw_time_us_t
        unsettled_us; ///< A hold without end went on, and a wheel turned: the zeros that follow have their time from then on.
    iw_time_us_t silent_us; ///< Since when zeros are no longer held; IW_NEVER: they are, or it drives.
    uint32_t stops;
    bool rolling_fault;
    iw_time_us_t turning_us;  ///< Since when a wheel turns although nothing is sent; IW_NEVER: none does.
    iw_time_us_t turned_us;   ///< When a wheel turned last; IW_NEVER: never.
    iw_time_us_t setpoint_us; ///< When setpoints were last due; IW_NEVER: never.

    int estop;
    iw_time_us_t apart_us; ///< Since when its contacts say different, if `apart`.
    bool apart;
    bool quarrel;      ///< They did for too long ...
    bool both_pressed; ///< ... and have both been pressed since.
    iw_bus_state_t bus;
    iw_time_us_t foreign_us;
    uint32_t foreign;     ///< Setpoints since the start.
    iw_time_us_t edge_us; ///< Of the line itself.
    iw_time_us_t late_us;
    iw_time_us_t refused_us;
    iw_time_us_t bus_bad_us;
    iw_time_us_t step_us;
    uint32_t taken;
    bool timing_bad;
    bool stalled; ///< This step cannot tell when its frames came.
    bool late_stop;
    bool hung;
    bool foreign_now;
    bool jump_now;
    bool back_now;    ///< Offset frames came back after a long pause,
    bool may_be_back; ///< or after one of which nothing need follow.
} oracle_t;

/// Whose request it is, when it was sent and when it came to the gateway.
typedef struct {
    iw_time_us_t now_us;
    iw_time_us_t sent_us;
    iw_client_t client;
} oracle_asked_t;

void oracle_start(oracle_t *self, const iw_gateway_t *gateway, iw_time_us_t now_us, bool restarted);

void oracle_step_begin(oracle_t *self, iw_time_us_t now_us, iw_time_us_t promised_us);
void oracle_step_end(oracle_t *self, iw_time_us_t now_us);

/// What the gateway saw and did through the port.
void oracle_estop(oracle_t *self, int result);
/// What both contacts said, where there are two, and what was made of it.
void oracle_contacts(oracle_t *self, iw_time_us_t now_us, const int said[2], int result);
void oracle_bus(oracle_t *self, iw_time_us_t now_us, iw_bus_state_t state);
void oracle_received(oracle_t *self, iw_time_us_t now_us, const iw_can_frame_t *frame);
/// The frames that one call brings; `oracle_sent` follows for each that the port tries.
void oracle_call(oracle_t *self, iw_time_us_t now_us, const iw_can_frame_t *frames, uint32_t count);
void oracle_sent(oracle_t *self, iw_time_us_t now_us, const iw_can_frame_t *frame, bool accepted);
void oracle_purged(oracle_t *self);

/// What happened outside: an edge of the e-stop line; one of the gateway's own frames on the bus.
void oracle_edge(oracle_t *self, iw_time_us_t now_us);
void oracle_on_bus(oracle_t *self, iw_time_us_t now_us, const iw_can_frame_t *frame, iw_time_us_t handed_us);

/// Requests and their answers, right after them.
void oracle_arm(oracle_t *self, iw_time_us_t now_us, iw_client_t client, bool takeover, iw_refusal_t result);
void oracle_drive(oracle_t *self, const oracle_asked_t *asked, const iw_drive_t *request, iw_refusal_t result,
                  const iw_applied_t *applied);
void oracle_stop(oracle_t *self, iw_time_us_t now_us, bool matters);
void oracle_soft_estop(oracle_t *self, iw_time_us_t now_us);
void oracle_reset(oracle_t *self, iw_time_us_t now_us, iw_state_t before, const iw_stop_t *stop);
void oracle_release(oracle_t *self, iw_time_us_t now_us, iw_refusal_t result);
/// The process is told to end.
void oracle_shutdown(oracle_t *self, iw_time_us_t now_us);

/// A rule of the rig's own.
void oracle_fail(oracle_t *self, iw_time_us_t now_us, uint32_t rule, const char *text);

#endif
