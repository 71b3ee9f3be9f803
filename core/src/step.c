// SPDX-License-Identifier: MIT
#include "iwheel/gateway.h"

#include "arithmetic.h"
#include "watch_pair.h"

/// Details of IW_CAUSE_ESTOP_LINE.
#define ESTOP_PRESSED    1U
#define ESTOP_UNREADABLE 2U

static void raise_cause(iw_gateway_t *self, iw_cause_t cause, uint8_t sides, uint32_t detail) {
    const iw_event_t event = {cause, sides, detail, IW_REACT_BY_CAUSE};
    iw_permit_raise(&self->permit, &event, self->now_us);
}

/// Raises a cause whose detail is a time.
static IW_APART void raise_after(iw_gateway_t *self, iw_cause_t cause, uint32_t span_us) {
    raise_cause(self, cause, IW_SIDES_NONE, span_us / IW_US_PER_MS);
}

IW_STATIC_ASSERT(IW_SIDES_LEFT << IW_RIGHT == IW_SIDES_RIGHT, one_bit_per_side);

static uint8_t side_bit(size_t side) {
    return (uint8_t)(IW_SIDES_LEFT << side);
}

/// Returns the lateness of the step, at most UINT32_MAX. A suspend of the system counts, because the clock may stop
/// while the wheels do not.
static uint32_t read_lateness(iw_gateway_t *self) {
    const iw_time_us_t late_us = (self->now_us > self->promised_us) ? self->now_us - self->promised_us : 0U;
    const iw_time_us_t both_us = self->suspended_us + late_us;
    self->suspended_us = 0;
    return (both_us < UINT32_MAX) ? (uint32_t)both_us : UINT32_MAX;
}

/// R7: judges one long stall and a run of late steps. Both count by the time in which no fault could be judged, because
/// telemetry in a late step has no known reception time.
static void watch_loop(iw_gateway_t *self) {
    const uint32_t late_us = read_lateness(self);
    const bool late = late_us > IW_GATEWAY_LATE_US;
    const bool was_stalled = self->stalled;
    self->stalled = late || (was_stalled && self->backlog);
    if (!self->stalled) {
        return;
    }
    if (!was_stalled) {
        self->stalled_since_us = self->now_us - late_us;
    }
    if (late) {
        self->counters.late_steps++;
        iw_watch_excuse(self);
    }
    const uint32_t run_us = iw_age_us(self->stalled_since_us, self->now_us);
    const uint32_t blind_us = (run_us > late_us) ? run_us : late_us;
    if (late_us > IW_GATEWAY_HUNG_US) {
        raise_after(self, IW_CAUSE_LOOP_HUNG, late_us);
    } else if (blind_us >= IW_GATEWAY_STOP_US) {
        raise_after(self, IW_CAUSE_LOOP_LATE, blind_us);
    }
}

/// Judges lateness, the e-stop and the state of the bus.
static void begin(iw_gateway_t *self) {
    const int pressed = self->hal.estop_pressed(self->hal.context);
    if (pressed != 0) {
        raise_cause(self, (pressed == IW_ESTOP_DISAGREES) ? IW_CAUSE_ESTOP_DISAGREES : IW_CAUSE_ESTOP_LINE,
                    IW_SIDES_NONE, (pressed > 0) ? ESTOP_PRESSED : ESTOP_UNREADABLE);
    }
    watch_loop(self);
    self->bus = self->hal.bus_state(self->hal.context);
    // Contract of the port (hal.h): after a loss of the bus no earlier frame is queued, so no echo is expected.
    if (self->bus < IW_BUS_PASSIVE) {
        iw_confirmation_clear(&self->sender.confirmation);
        raise_cause(self, IW_CAUSE_BUS_DOWN, IW_SIDES_NONE, (uint32_t)self->bus);
    }
}

/// Confirms or contradicts an assumption by an observation on the bus.
static IW_APART void note(iw_gateway_t *self, iw_assumption_item_t item, bool holds, int32_t figure) {
    if (holds) {
        iw_assumption_confirm(&self->assumptions, item, IW_SOURCE_BUS, figure);
    } else {
        iw_assumption_contradict(&self->assumptions, item, IW_SOURCE_BUS, figure);
    }
}

/// Enters the unit observations of the force module into the assumption store. IW_UNIT_UNCLEAR is not entered: it makes
/// the force doubtful (force_offset.h), but it does not prove another unit.
static void note_force_observation(iw_gateway_t *self, iw_side_t side) {
    const iw_force_t *const force = &self->force[side];
    const iw_unit_observation_t configured = (self->config.force_unit[side] == IW_FORCE_CN) ? IW_UNIT_CN : IW_UNIT_DN;
    const bool fits = force->observation == configured;
    if (force->observation == IW_UNIT_CN || force->observation == IW_UNIT_DN) {
        note(self, iw_assumption_force_unit(side), fits, force->observed_permille);
    }
    if (fits || force->observation == IW_UNIT_OFFSET_REMOVED) {
        note(self, IW_ASSUMPTION_OFFSET_INCLUDED, fits, force->observed_permille);
    }
}

static void receive_force(iw_gateway_t *self, iw_codec_kind_t kind, iw_side_t side) {
    const iw_codec_wheel_t *const values = &self->telemetry[side];
    iw_force_t *const force = &self->force[side];
    const iw_unit_observation_t before = force->observation;
    if (kind == IW_CODEC_FORCE) {
        // Uses the last speed at any age: a stall of the gateway does not mean that the wheel moved.
        const bool still = iw_abs(values->speed.speed_rpm) <= self->config.rest_rpm;
        iw_force_receive(force, self->now_us, values->force.force_raw, still);
    } else {
        iw_force_receive_offset(force, self->now_us, values->offset.offset_dN);
    }
    if (force->observation != before) {
        note_force_observation(self, side);
    }
}

/// Enters only the first observation, because each entry is a change that is reported and stored, and frames arrive 500
/// times a second.
static void contradict_length(iw_gateway_t *self, uint8_t length) {
    if (self->assumptions.entry[IW_ASSUMPTION_DLC].state != IW_CONTRADICTED) {
        note(self, IW_ASSUMPTION_DLC, false, length);
    }
}

/// The document lists bytes but no DLC. A status frame with the length of the table confirms the lengths of the table.
/// A message with another length contradicts them.
static void note_length(iw_gateway_t *self, iw_codec_kind_t kind, uint8_t length) {
    if (length != iw_codec_length(kind)) {
        contradict_length(self, length);
    } else if (kind == IW_CODEC_STATUS) {
        note(self, IW_ASSUMPTION_DLC, true, length);
    }
}

/// Handles telemetry. A reboot is handled first: the frame that reveals it may be the first force or offset of the new
/// run, which belongs to a new window.
static void receive_telemetry(iw_gateway_t *self, iw_codec_kind_t kind, iw_side_t side) {
    iw_wheel_t *const wheel = &self->wheel[side];
    const bool first = wheel->first_us == IW_NEVER;
    self->counters.received++;
    iw_wheel_receive(wheel, self->now_us, kind, &self->telemetry[side], !self->stalled);
    const iw_reboot_t reboot = iw_wheel_next_reboot(wheel);
    if (reboot != IW_REBOOT_NONE) {
        raise_cause(self, IW_CAUSE_WHEEL_REBOOTED, side_bit(side), (uint32_t)reboot);
    }
    if (first || reboot != IW_REBOOT_NONE) {
        iw_force_reopen(&self->force[side], wheel->boot_seen);
    }
    if (kind == IW_CODEC_FORCE || kind == IW_CODEC_OFFSET) {
        receive_force(self, kind, side);
    } else if (kind == IW_CODEC_POSE) {
        self->pose_us = self->now_us;
    } else if (kind == IW_CODEC_SPEED) {
        iw_diverge_receive(&self->diverge, side, iw_watch_own_mm_s(self, side));
    }
}

/// With two masters on one bus, the wheels follow the last sender (fault 19).
static void receive_foreign(iw_gateway_t *self, iw_side_t side, uint32_t id) {
    self->counters.foreign++;
    raise_cause(self, IW_CAUSE_SECOND_MASTER, side_bit(side), id);
}

static bool is_setpoint_id(uint32_t id) {
    return id == IW_ID_LEFT_SETPOINT || id == IW_ID_RIGHT_SETPOINT;
}

/// Separates an echo, which is the core's own frame confirmed by the controller, from a setpoint of another sender.
static void receive_setpoint(iw_gateway_t *self, iw_side_t side, const iw_can_frame_t *frame) {
    if (frame->kind == IW_CAN_ECHO) {
        self->counters.echoes++;
        iw_confirmation_echo(&self->sender.confirmation, side, frame);
    } else {
        receive_foreign(self, side, frame->id);
    }
}

static void receive_frame(iw_gateway_t *self, const iw_can_frame_t *frame) {
    const iw_side_t side = iw_codec_side(frame->id);
    // Checked before decoding: a foreign setpoint of any length must latch, even if it cannot be decoded.
    if (is_setpoint_id(frame->id)) {
        receive_setpoint(self, side, frame);
        return;
    }
    const iw_codec_kind_t kind = iw_codec_decode(frame, self->telemetry);
    switch (kind) {
    case IW_CODEC_BAD_FORMAT:
        self->counters.bad_format++;
        break;
    case IW_CODEC_BAD_LENGTH:
        self->counters.bad_length++;
        contradict_length(self, frame->dlc);
        break;
    case IW_CODEC_UNKNOWN:
        self->counters.unknown++;
        break;
    default:
        note_length(self, kind, frame->dlc);
        receive_telemetry(self, kind, side);
        break;
    }
}

/// Receives everything before any age is judged (R7), but with a limit: a babbling node must not prevent the end of the
/// step.
static IW_APART void receive(iw_gateway_t *self) {
    iw_can_frame_t frame;
    uint32_t received = 0;
    while (received < IW_GATEWAY_DRAIN_MAX && self->hal.receive(self->hal.context, &frame) > 0) {
        receive_frame(self, &frame);
        received++;
    }
    self->backlog = received == IW_GATEWAY_DRAIN_MAX;
}

/// Returns the time for which a lost wheel has sent nothing; 0 if it is not lost.
static IW_APART uint32_t lost_for_ms(const iw_gateway_t *self, iw_side_t side) {
    const iw_wheel_t *const wheel = &self->wheel[side];
    if (!iw_wheel_lost(wheel, self->now_us)) {
        return 0;
    }
    return (wheel->received_us == IW_NEVER) ? UINT32_MAX : iw_age_us(wheel->received_us, self->now_us) / IW_US_PER_MS;
}

static void watch_presence(iw_gateway_t *self) {
    const uint32_t left_ms = lost_for_ms(self, IW_LEFT);
    const uint32_t right_ms = lost_for_ms(self, IW_RIGHT);
    const uint32_t left = (left_ms > 0U) ? IW_SIDES_LEFT : IW_SIDES_NONE;
    const uint32_t right = (right_ms > 0U) ? IW_SIDES_RIGHT : IW_SIDES_NONE;
    const uint32_t sides = left | right;
    // One of the wheels may have had no power for long and coasts: zero without ramp would turn the machine around it.
    const iw_event_t event = {IW_CAUSE_WHEEL_LOST, (uint8_t)sides, (right_ms > 0U) ? right_ms : left_ms,
                              (sides == IW_SIDES_BOTH) ? IW_REACT_ZERO : IW_REACT_RAMP};
    if (sides != IW_SIDES_NONE) {
        iw_permit_raise(&self->permit, &event, self->now_us);
    }
}

/// Returns the time for which a setpoint has waited for its echo if that is too long; otherwise 0.
static IW_APART uint32_t overdue_us(const iw_gateway_t *self) {
    const iw_time_us_t since_us = iw_confirmation_waiting_us(&self->sender.confirmation);
    const uint32_t waited_us = (since_us == IW_NEVER) ? 0U : iw_age_us(since_us, self->now_us);
    return (waited_us < self->config.echo_ms * IW_US_PER_MS) ? 0U : waited_us;
}

static IW_APART int ask_back(iw_gateway_t *self) {
    const int answer = iw_sender_purge(&self->sender);
    self->counters.purges += (answer > 0) ? 1U : 0U;
    return answer;
}

/// A missing echo latches. The zeros of that stop would wait after the stuck frame, so the core calls `purge`, once per
/// stop, because a purge may set the link down. (After IW_CAUSE_SEND_STALLED there are only zeros to send.)
static void watch_echo(iw_gateway_t *self) {
    const uint32_t waited_us = overdue_us(self);
    if (waited_us == 0U) {
        return;
    }
    raise_after(self, IW_CAUSE_SEND_STALLED, waited_us);
    if (iw_permit_demand(&self->permit) != IW_DEMAND_SILENCE && self->purged_stop != self->permit.stop.number) {
        self->purged_stop = self->permit.stop.number;
        (void)ask_back(self);
    }
}

static void watch_follow(iw_gateway_t *self, size_t side, int32_t applied_mm_s) {
    static const uint8_t causes[IW_FOLLOW_VERDICTS] = {
        [IW_FOLLOW_SIGN] = IW_CAUSE_FEEDBACK_SIGN,
        [IW_FOLLOW_OVERSPEED] = IW_CAUSE_OVERSPEED,
        [IW_FOLLOW_BLOCKED] = IW_CAUSE_WHEEL_BLOCKED,
    };
    iw_follow_t *const follow = &self->follow[side];
    const iw_assumption_item_t item =
        (side == IW_LEFT) ? IW_ASSUMPTION_FEEDBACK_SIGN_LEFT : IW_ASSUMPTION_FEEDBACK_SIGN_RIGHT;
    const int32_t measured_mm_s = self->diverge.measured_mm_s[side];
    const iw_follow_verdict_t verdict = iw_follow_step(follow, self->now_us, applied_mm_s, measured_mm_s);
    // Stored as if the command were positive.
    const int32_t along_mm_s = (applied_mm_s < 0) ? -measured_mm_s : measured_mm_s;
    if (verdict != IW_FOLLOW_OK) {
        raise_cause(self, (iw_cause_t)causes[verdict], side_bit(side), (uint32_t)iw_abs(measured_mm_s));
    }
    if (verdict == IW_FOLLOW_SIGN) {
        note(self, item, false, along_mm_s);
    }
    if (self->assumptions.entry[item].state == IW_ASSUMED && iw_follow_sign_confirmed(follow, self->now_us)) {
        note(self, item, true, along_mm_s);
    }
}

/// Judges only while the core commands: a machine that is pushed by hand in LISTENING is faster than its command of
/// zero. It is judged for each wheel, because the result for the left wheel may have ended the command.
static void watch_wheel(iw_gateway_t *self, size_t side, int32_t applied_mm_s) {
    const iw_state_t state = iw_permit_state(&self->permit);
    const bool ours = state == IW_STATE_ARMED || state == IW_STATE_STOPPING;
    if (!ours) {
        iw_follow_restart(&self->follow[side]);
    } else if (iw_wheel_online(&self->wheel[side], self->now_us)) {
        watch_follow(self, side, applied_mm_s);
    }
}

static bool turns(const iw_gateway_t *self, iw_side_t side) {
    const iw_wheel_t *const wheel = &self->wheel[side];
    return iw_abs(wheel->speed_mm_s) > IW_ROLLING_MM_S && iw_wheel_online(wheel, self->now_us);
}

/// Detects a machine that rolls away or is pushed by hand. Not while setpoints are sent: a zero is a command too, and
/// braking wheels still turn.
static void watch_rolling(iw_gateway_t *self) {
    const bool alone = self->setpoint.demand == IW_DEMAND_SILENCE;
    iw_rolling_step(&self->rolling, self->now_us, alone && (turns(self, IW_LEFT) || turns(self, IW_RIGHT)));
}

/// Returns the time for which both wheels have been at standstill; 0 if one turns. Both wheels must be online.
static uint32_t both_rest_us(const iw_gateway_t *self) {
    const iw_time_us_t since_us = iw_later(self->wheel[IW_LEFT].rest_since_us, self->wheel[IW_RIGHT].rest_since_us);
    return (since_us == IW_NEVER) ? 0U : iw_age_us(since_us, self->now_us);
}

/// Judges telemetry, reboots, echoes and wheels that do not follow; then steps the permission. Values that several
/// rules need are computed once.
static void judge_wheels(iw_gateway_t *self) {
    iw_permit_view_t *const view = &self->permit.view;
    const bool online =
        iw_wheel_online(&self->wheel[IW_LEFT], self->now_us) && iw_wheel_online(&self->wheel[IW_RIGHT], self->now_us);
    const iw_pair_t applied = iw_setpoint_applied(&self->setpoint);
    // A stalled step neither raises nor clears causes that depend on an age: the next step on time decides (R7). It
    // removes no evidence against a wheel that does not follow either: steps that are often late would hide the fault.
    if (self->stalled) {
        iw_permit_retain_present(&self->permit);
    } else {
        watch_echo(self);
        if (!online) { // A wheel that is online is not lost.
            watch_presence(self);
        }
        watch_wheel(self, IW_LEFT, applied.wheel[IW_LEFT].speed_mm_s);
        watch_wheel(self, IW_RIGHT, applied.wheel[IW_RIGHT].speed_mm_s);
        iw_watch_pair(self, &applied, online);
        watch_rolling(self);
    }
    const uint32_t rest_us = online ? both_rest_us(self) : 0U;
    view->online = online;
    view->applied = applied;
    view->at_rest = rest_us >= (uint32_t)self->config.rest_ms * IW_US_PER_MS;
    view->settled = rest_us >= IW_PERMIT_SETTLED_US;
    view->output_zero = iw_setpoint_is_zero(&self->setpoint);
    view->timing_ok = !self->facts.timing_contradicted;
    view->can_send = iw_confirmation_may_send(&self->sender.confirmation, true) == IW_SIDES_BOTH;
    // The pair must be sent at or after the request: the echo of an older zero pair does not arm.
    view->proven = iw_permit_arming(&self->permit) &&
                   iw_confirmation_proven_us(&self->sender.confirmation) >= self->permit.arming_us;
    iw_permit_step(&self->permit, self->now_us);
}

/// Sends the pair that is due. R5 (both or none): if the port refused one frame of a pair, both wheels receive zeros
/// next.
static iw_send_result_t send_pair(iw_gateway_t *self) {
    if (!iw_setpoint_due(&self->setpoint, self->now_us)) {
        return IW_SEND_DONE;
    }
    const bool zero = iw_setpoint_next_is_zero(&self->setpoint);
    if (!iw_sender_ready(&self->sender, zero)) {
        return IW_SEND_DONE;
    }
    const iw_pair_t pair = iw_setpoint_next(&self->setpoint, self->now_us);
    const iw_send_result_t result = iw_sender_send(&self->sender, &pair, self->now_us, zero);
    if (result == IW_SEND_LATER) {
        iw_setpoint_collapse(&self->setpoint, self->now_us);
    }
    return result;
}

/// While nothing is sent, no old setpoint may remain in a controller: without acknowledgement the controller repeats it
/// until a wheel gets power, and then it moves that wheel (fault 18). The core purges it, or reports `left_behind`,
/// with or without telemetry, because a frame is stuck exactly when no wheel has power to acknowledge it. A late echo
/// (`echo_ms`) or an echo in the backlog does not count as stuck yet.
static void withdraw_setpoints(iw_gateway_t *self) {
    if (overdue_us(self) == 0U) {
        self->left_behind = false;
        return;
    }
    const bool again = self->purged_us != IW_NEVER;
    if (self->backlog || iw_age_us(self->purged_us, self->now_us) < IW_GATEWAY_LOST_ECHO_US) {
        return;
    }
    const bool was_left = self->left_behind;
    const int answer = ask_back(self);
    self->purged_us = self->now_us;
    self->left_behind = answer < 0 || (answer == 0 && again);
    self->counters.left_behind += (self->left_behind && !was_left) ? 1U : 0U;
}

static void send_due(iw_gateway_t *self) {
    const iw_demand_t demand = iw_permit_demand(&self->permit);
    iw_setpoint_demand(&self->setpoint, self->now_us, demand);
    if (demand == IW_DEMAND_SILENCE) {
        iw_sender_rest(&self->sender);
        withdraw_setpoints(self);
        return;
    }
    self->rolling.setpoint_us = self->now_us;
    // Nothing is left in the controller: arm was refused until it was gone.
    self->purged_us = IW_NEVER;
    if (self->bus >= IW_BUS_PASSIVE && send_pair(self) == IW_SEND_STOPPED) {
        // R12: scheduler and envelope disagree, so one of them is wrong. This step sends zeros.
        raise_cause(self, IW_CAUSE_INTERNAL, IW_SIDES_NONE, (uint32_t)self->sender.verdict);
        iw_setpoint_demand(&self->setpoint, self->now_us, iw_permit_demand(&self->permit));
        (void)send_pair(self);
    }
}

/// Returns the time of the next call, at most one period from now. If both wheels stop sending, no frame causes a step
/// when they are offline, so that time counts too. One wheel that still sends causes the steps.
static IW_APART iw_time_us_t next_step_us(const iw_gateway_t *self) {
    const iw_time_us_t due_us = iw_setpoint_next_us(&self->setpoint);
    const iw_time_us_t offline_us = iw_watch_both_offline_us(self);
    iw_time_us_t next_us =
        iw_sooner(self->now_us + (iw_time_us_t)self->config.period_ms * IW_US_PER_MS, iw_permit_next_us(&self->permit));
    if (self->backlog) {
        return self->now_us;
    }
    // A pair that is overdue could not be sent (no echo yet, bus down). Returning a past time would cause a busy loop.
    if (due_us > self->now_us) {
        next_us = iw_sooner(next_us, due_us);
    }
    if (offline_us > self->now_us) {
        next_us = iw_sooner(next_us, offline_us);
    }
    return (next_us > self->now_us) ? next_us : self->now_us;
}

/// The order is a safety rule. The step receives everything before it judges an age (R7), and judges everything before
/// it sends, so that a fault of this step stops the pair of this step.
iw_time_us_t iw_gateway_step(iw_gateway_t *self, iw_time_us_t now_us) {
    self->now_us = now_us;
    begin(self);
    receive(self);
    judge_wheels(self);
    send_due(self);
    self->promised_us = next_step_us(self);
    return self->promised_us;
}
