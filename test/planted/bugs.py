# SPDX-License-Identifier: MIT
"""Safety bugs to be planted in copies of the core. Each names the rule that it breaks, as docs/safety-case.md counts them.
Those of everything around the core are in parts_bugs.py.

What stands in a file is told by a few words of code; blanks and line ends between them do not matter, and they must
occur exactly once in the file.
"""
import re
from typing import NamedTuple


class Bug(NamedTuple):
    name: str
    rule: str   # Of docs/safety-case.md, or the page whose promise it breaks.
    file: str   # In core/src; around the core, from the top of the tree.
    before: str
    after: str
    tests: tuple = ()  # Around the core: the tests that must fail, each of them.


def find_code(text, words):
    """Where these words of code stand, whatever blanks are between them."""
    parts = re.findall(r"\w+|[^\w\s]", words)
    return [match.span() for match in re.finditer(r"\s*".join(map(re.escape, parts)), text)]


BUGS = [
    Bug("lease-endless", "R1", "permit.c", "now_us >= self->lease_until_us) { brake", "now_us >= self->lease_until_us + 5000000U) { brake"),
    Bug("lease-fed-by-refused", "R1", "permit.c", "if (refusal == IW_REFUSE_NONE) { grant_lease(self,", "{ grant_lease(self,"),
    Bug("disconnect-ignored", "R1", "permit.c", "if (client != self->holder) { return; } if (self->phase == IW_PHASE_ARMED) {", "if (client != self->holder) { return; } if (self->phase == IW_PHASE_LATCHED) {"),
    Bug("client-stop-ignored", "R1", "permit.c", "brake_after(self, cause, now_us, 0); self->stop.client = client;", "self->stop.client = client;"),
    Bug("ramp-by-calls", "R1", "setpoint.c", "ramp_step(config->decel_mm_s2, us)", "ramp_step(config->decel_mm_s2, (us < 8000U) ? us : 8000U)"),
    Bug("estop-only-stops", "R2", "cause.c", "[IW_CAUSE_ESTOP_LINE] = {IW_ALWAYS_LATCHES,", "[IW_CAUSE_ESTOP_LINE] = {IW_STOPS,"),
    Bug("estop-unreadable-released", "R2", "step.c", "if (pressed != 0) {", "if (pressed > 0) {"),
    Bug("estop-ramps", "R2", "permit.c", "[IW_PHASE_CUT] = {IW_STATE_LATCHED, IW_DEMAND_ZERO, IW_DEMAND_ZERO}", "[IW_PHASE_CUT] = {IW_STATE_LATCHED, IW_DEMAND_BRAKE, IW_DEMAND_BRAKE}"),
    Bug("soft-estop-only-stops", "R2", "cause.c", "[IW_CAUSE_ESTOP_SOFTWARE] = {IW_ALWAYS_LATCHES,", "[IW_CAUSE_ESTOP_SOFTWARE] = {IW_STOPS,"),
    Bug("latch-lets-go", "R2", "permit.c", "self->present = self->raised;", "self->present = self->raised; if (self->phase == IW_PHASE_CUT && self->present == 0U) { self->phase = IW_PHASE_LISTENING; }"),
    Bug("zero-waits-for-echo", "R6", "confirmation.c", "(zero ? 2U : 1U)", "(zero ? 1U : 1U)"),
    Bug("reset-arms", "R3", "permit.c", "self->phase = IW_PHASE_LISTENING; return IW_REFUSE_NONE;", "self->phase = IW_PHASE_ARMED; return IW_REFUSE_NONE;"),
    Bug("reset-while-moving", "R3", "permit.c", "if (!self->view.at_rest) { return IW_REFUSE_NOT_AT_REST; }", ""),
    Bug("reset-while-pressed", "R3", "permit.c", "if (!is_latched(self)) { return IW_REFUSE_NONE; } if (present != IW_REFUSE_NONE) {", "if (!is_latched(self)) { return IW_REFUSE_NONE; } if (present == IW_REFUSE_LATCHED) {"),
    Bug("event-gone-at-once", "R3", "cause.c", "iw_age_us(seen_us[cause], now_us) < IW_PERMIT_EVENT_US", "iw_age_us(seen_us[cause], now_us) < 20000U"),
    Bug("arm-with-stale-command", "R3", "permit.c", "if (stale_command(self, now_us)) { return IW_REFUSE_STALE_COMMAND; } if (!self->view.at_rest ||", "if (!self->view.at_rest ||"),
    Bug("reset-with-stale-command", "R3", "permit.c", "if (stale_command(self, now_us)) { return IW_REFUSE_STALE_COMMAND; } self->phase", "self->phase"),
    Bug("arm-while-moving", "R3", "permit.c", "if (!self->view.at_rest || !self->view.output_zero) {", "if (!self->view.output_zero) {"),
    Bug("arm-while-latched", "R3", "permit.c", "if (is_latched(self)) { return refuse_latched(present); } if (!may_send", "if (!may_send"),
    Bug("arm-while-cause-present", "R3", "permit.c", "if (present != IW_REFUSE_NONE) { return present; } if (!self->view.timing_ok)", "if (!self->view.timing_ok)"),
    Bug("arm-without-echo", "R3", "permit.c", "if (self->view.proven && waited_us <= limit_us) {", "if (waited_us <= limit_us) {"),
    Bug("arm-while-contradicted", "R3", "gateway.c", "self->ledger.doubt != IW_LEDGER_ITEMS) {", "self->ledger.doubt == IW_LEDGER_SETPOINT_TYPE) {"),
    Bug("takeover-unasked", "R3", "permit.c", "(!takeover || iw_permit_arming(self))", "(iw_permit_arming(self))"),
    Bug("anybody-drives", "R3", "permit.c", "if (self->holder != client) { return IW_REFUSE_NOT_HOLDER; }", "if (client == IW_CLIENT_NONE) { return IW_REFUSE_NOT_HOLDER; }"),
    Bug("target-survives-stop", "R3", "setpoint.c", "self->demand = demand; forget_command(self);", "self->demand = demand;"),
    Bug("rest-by-one-frame", "R3", "wheel.c", "return iw_age_us(self->rest_since_us, now_us);", "return UINT32_MAX;"),
    Bug("restart-without-zeros", "R3", "permit.c", "if (restarted && may_send(config)) {", "if (restarted && config->listen_only) {"),
    Bug("restart-yields-at-once", "R3", "permit.c", "self->strangers > LEFT_BEHIND_MAX", "self->strangers > 0U"),
    Bug("no-hold", "R4", "permit.c", "held_us >= self->config->zero_hold_ms * IW_US_PER_MS && time", "held_us >= 1000U && time"),
    Bug("hold-ignores-motion", "R4", "permit.c", "return self->view.settled || self->phase == IW_PHASE_RESTARTING;", "return true || self->phase == IW_PHASE_RESTARTING;"),
    Bug("hold-for-ever", "R4", "permit.c", "held_us >= IW_PERMIT_HOLD_MAX_US &&", "held_us >= 100U * IW_PERMIT_HOLD_MAX_US &&"),
    Bug("sent-while-listening", "R4", "permit.c", "[IW_PHASE_LISTENING] = {IW_STATE_LISTENING, IW_DEMAND_SILENCE, IW_DEMAND_SILENCE}", "[IW_PHASE_LISTENING] = {IW_STATE_LISTENING, IW_DEMAND_ZERO, IW_DEMAND_ZERO}"),
    Bug("one-wheel-goes-on", "R5", "step.c", "if (result == IW_SEND_LATER) { iw_setpoint_collapse(&self->setpoint, self->now_us); }", ""),
    Bug("left-only", "R5", "sender.c", "if (right && (taken || zero)) {", "if (right && zero) {"),
    Bug("queue-of-two", "R6", "confirmation.c", "(zero ? 2U : 1U)", "(zero ? 3U : 2U)"),
    Bug("purge-forgotten", "R6", "sender.c", "const int answer = self->hal->purge(self->hal->context);", "const int answer = 1;"),
    Bug("silence-takes-nothing-back", "R6", "step.c", "const int answer = ask_back(self);", "const int answer = -1;"),
    Bug("taken-back-only-if-heard", "R6", "step.c", "if (self->backlog || iw_age_us(", "if (self->backlog || !iw_wheel_heard(&self->wheel[IW_LEFT], self->now_us) || iw_age_us("),
    Bug("next-silence-waits", "R6", "step.c", "self->purged_us = IW_NEVER; if (self->bus >=", "if (self->bus >="),
    Bug("echo-never-missed", "R6", "step.c", "(since_us == IW_NEVER) ? 0U :", "(since_us != IW_NEVER) ? 0U :"),
    Bug("echo-account-kept", "R6", "step.c", "if (self->bus < IW_BUS_PASSIVE) { iw_confirmation_clear(&self->sender.confirmation);", "if (self->bus < IW_BUS_PASSIVE) {"),
    Bug("hang-forgiven", "R7", "step.c", "if (late_us > IW_GATEWAY_HUNG_US) {", "if (late_us > 100U * IW_GATEWAY_HUNG_US) {"),
    Bug("lateness-forgiven", "R7", "step.c", "} else if (blind_us >= IW_GATEWAY_STOP_US) {", "} else if (blind_us >= 100U * IW_GATEWAY_STOP_US) {"),
    Bug("late-ramps", "R7", "permit.c", "self->at_once = iw_cause_rows[event->cause].at_once; self->hold_us", "self->at_once = false; self->hold_us"),
    Bug("burst-after-stall", "R7", "setpoint.c", "(us < granted_us) ? us : granted_us)", "us)"),
    Bug("excused-again-and-again", "R7", "wheel.c", "if (self->heard_us >= self->excused_us) {", "if (self->heard_us != IW_NEVER) {"),
    Bug("drive-from-before-arm", "R7", "permit.c", "if (sent_us < self->armed_us) { return IW_REFUSE_STALE_COMMAND; }", ""),
    Bug("late-frames-count", "R7", "step.c", "iw_wheel_hear(wheel, self->now_us, kind, &self->told[side], !self->stalled);", "iw_wheel_hear(wheel, self->now_us, kind, &self->told[side], true);"),
    Bug("steep", "R12", "setpoint.c", "ramp_step(config->accel_mm_s2,", "ramp_step(3U * config->accel_mm_s2,"),
    Bug("sign-not-through-zero", "R8", "setpoint.c", "const bool through_zero = *value != 0 && (target < 0) != (*value < 0);", "const bool through_zero = false;"),
    Bug("speed-not-limited", "R8", "gateway.c", "applied.limited = scale_pair(drive.speed_mm_s, config->max_speed_mm_s);", "applied.limited = false;"),
    Bug("scaled-apart", "R8", "gateway.c", "values[IW_RIGHT] = values[IW_RIGHT] * limit / largest;", "values[IW_RIGHT] = (values[IW_RIGHT] > limit) ? limit : values[IW_RIGHT];"),
    Bug("invert-forgotten-right", "R8", "sender.c", "const bool invert = config->invert[side];", "const bool invert = config->invert[side] && side == IW_LEFT;"),
    Bug("current-not-inverted", "R8", "sender.c", "setpoint.current_mA = (int16_t)-setpoint.current_mA;", ""),
    Bug("wrong-type", "R12", "sender.c", "command->current_mA, config->setpoint_type}", "command->current_mA, (uint8_t)(config->setpoint_type + 1U)}"),
    Bug("refused-answers", "R9", "gateway.c", "if (refusal == IW_REFUSE_NONE) { *out_applied", "{ *out_applied"),
    Bug("foreign-ignored", "R13", "step.c", "} else { hear_foreign(self, side, frame->id); }", "}"),
    Bug("bus-down-ignored", "R13", "step.c", "if (self->bus < IW_BUS_PASSIVE) { iw_confirmation_clear", "if (self->bus < IW_BUS_DOWN) { iw_confirmation_clear"),
    Bug("silence-of-left-ignored", "R13", "step.c", "if (!iw_wheel_lost(wheel, self->now_us)) {", "if (side == IW_LEFT || !iw_wheel_lost(wheel, self->now_us)) {"),
    Bug("only-armed-latches", "R13", "permit.c", "default: return iw_cause_rows[cause].effect != IW_STOPS;", "default: return iw_cause_rows[cause].effect != IW_STOPS && (self->phase == IW_PHASE_ARMED || iw_cause_rows[cause].effect == IW_ALWAYS_LATCHES);"),
    Bug("sign-fault-ignored", "R13", "step.c", "if (verdict != IW_FOLLOW_OK) {", "if (verdict != IW_FOLLOW_OK && verdict != IW_FOLLOW_SIGN) {"),
    Bug("overspeed-ignored", "R13", "step.c", "if (verdict != IW_FOLLOW_OK) {", "if (verdict != IW_FOLLOW_OK && verdict != IW_FOLLOW_OVERSPEED) {"),
    Bug("blocked-ignored", "R13", "step.c", "if (verdict != IW_FOLLOW_OK) {", "if (verdict != IW_FOLLOW_OK && verdict != IW_FOLLOW_BLOCKED) {"),
    Bug("endless-offset-frames-reboot", "R13", "wheel.c", "if (iw_age_us(self->offset_us, now_us) >= IW_WHEEL_OFFSET_BACK_US) {", "if (now_us - self->first_us > 61000000U) {"),
    Bug("offset-frames-back-ignored", "R13", "wheel.c", "rebooted(self, IW_REBOOT_OFFSET_FRAMES, now_us);", ""),
    Bug("reboot-ignored", "R13", "wheel.c", "rebooted(self, IW_REBOOT_ODOMETRY, now_us);", "self->ticks = 0;"),
]
