# SPDX-License-Identifier: MIT
"""Decides from a bus log and a timeline whether each safety rule was obeyed.

Written from the rules of motion permission, not from the gateway's code. The bus log is the only witness of what the gateway
did; the timeline lists the actions of the scenario. Times are integer microseconds of CLOCK_MONOTONIC; see judge_log.py for the timeline.
"""

import bisect
import itertools

from judge_log import (
    ECHO_US,
    GAP_US,
    HOLD_MAX_US,
    JITTER_US,
    PAIR_US,
    PRESS_US,
    RESIDUAL_US,
    RESIDUAL_ZERO_US,
    REST_RPM,
    SETTLED_US,
    SPEED_IDS,
    OFFLINE_US,
    Reading,
    percentile,
    signed,
)


class Judge(Reading):
    """`judge()` returns the violations; the figures are in `estop_latencies` (when, how long), `gap_max_us`, `pair_max_us`."""

    def judge(self):
        self._read()
        self._sessions()
        self._happened()
        for side in (0, 1):
            self._motion([s for s in self.setpoints if s.side == side])
            self._slew([s for s in self.setpoints if s.side == side])
        self._pairs()
        for session, next_us in zip(self.sessions, [*self._begins[1:], self.finished_us], strict=False):
            self._presence(session, next_us)
        self._listening()
        self._estop()
        return self.found

    def _happened(self):
        """A log in which nothing happened proves nothing."""
        telemetry = [frame for frame in self.frames if frame.id in SPEED_IDS and not frame.own]
        if not telemetry:
            self._say("empty", 0, "the log holds no telemetry: nothing was recorded")
            return
        if not self.moves:
            return
        if not any(not setpoint.zero for setpoint in self.setpoints):
            self._say("never_moved", 0, "no nonzero setpoint in the whole log")
        if not any(abs(signed(frame.data, 0)) > REST_RPM for frame in telemetry if len(frame.data) >= 2):
            self._say("never_turned", 0, "no wheel ever turned")

    def _motion(self, setpoints):
        """Invariants 1, 2 and 3: every nonzero setpoint must have a fresh command behind it and no stop before it."""
        previous = None
        after_press = {}
        for setpoint in setpoints:
            if not setpoint.zero:
                self._one_motion(setpoint, previous, after_press)
            previous = setpoint

    def _one_motion(self, setpoint, previous, after_press):
        session, t_us = self._session_at(setpoint.t_us), setpoint.t_us
        name = f"{'left' if setpoint.side == 0 else 'right'} {setpoint.speed} mm/s"
        if session is None:
            self._say("motion_unarmed", t_us, f"{name} although no client had armed")
            return
        drives = [drive for drive in session.drives if drive.kind == "drive" and drive.t_us <= t_us]
        if not any(drive.left or drive.right for drive in drives):
            self._say("motion_without_drive", t_us, f"{name} without a fresh drive command since arm")
            return
        if any(begin + 2 * ECHO_US < t_us < end for begin, end in self.dead):
            self._say("motion_on_dead_bus", t_us, f"{name} while the bus accepted no frames")
        if self._is_residual(setpoint):
            return
        self._within_command(setpoint, previous, drives)
        self._lease_rule(setpoint, name, drives)
        for end in session.ends:
            self._after_end(setpoint, name, session, end, after_press)

    def _is_residual(self, setpoint):
        """The one old frame per wheel that a controller had in hand when the bus died; its zero follows within 2 ms."""
        for begin, end in self.dead:
            from_us = max(end, begin + 2 * ECHO_US)
            if not from_us <= setpoint.t_us < end + RESIDUAL_US:
                continue
            later = [s for s in self._setpoints_between(from_us) if s.side == setpoint.side]
            if later[0] is setpoint:
                self.residual += 1
                followed = len(later) > 1 and later[1].zero
                excess_us = later[1].t_us - setpoint.t_us - RESIDUAL_ZERO_US if followed else None
                if not followed or excess_us > 0:
                    text = f"an old frame of {setpoint.speed} mm/s without a zero right behind it"
                    self._say("old_frame", setpoint.t_us, text, excess_us)
                return True
        return False

    def _within_command(self, setpoint, previous, drives):
        """Between what it was, zero and what was commanded lately; never beyond."""
        recent = [drive for number, drive in enumerate(drives) if number + 1 == len(drives) or drives[number + 1].done_us >= setpoint.t_us - GAP_US]
        wanted = [(drive.left, drive.right)[setpoint.side] for drive in recent]
        hull = [*wanted, 0, previous.speed if previous else 0]
        if not min(hull) - 1 <= setpoint.speed <= max(hull) + 1:
            self._say("beyond_command", setpoint.t_us, f"{setpoint.speed} mm/s, commanded {wanted[-1]} mm/s")

    def _ramp_us(self, speed):
        """With the current as a setpoint it ramps too, and may take as long as the speed from its maximum would."""
        speed = speed if self.config.role == "limit" else self.config.max_speed_mm_s
        return int(abs(speed) * 1_000_000 / self.config.decel_mm_s2)

    def _lease_rule(self, setpoint, name, drives):
        config, last = self.config, drives[-1]
        limit_us = last.done_us + (config.lease_ms + config.period_ms) * 1000 + self._ramp_us(config.max_speed_mm_s) + JITTER_US
        if setpoint.t_us > limit_us:
            excess_us = setpoint.t_us - limit_us
            self._say("lease", setpoint.t_us, f"{name} later than lease, period and ramp by {excess_us / 1000:.0f} ms", excess_us)

    def _speed_at(self, t_us):
        before = [abs(s.speed) for s in self._setpoints_between(t_us - GAP_US, t_us + JITTER_US + 1)]
        return max(before, default=self.config.max_speed_mm_s)

    def _after_end(self, setpoint, name, session, end, after_press):
        end_us, kind, within_us = end
        if setpoint.t_us <= end_us:
            return
        if kind == "press":
            if setpoint.t_us <= end_us + within_us:  # Not answered yet; `_estop` limits its latency.
                return
            count = after_press.setdefault(end_us, [])
            count.append(setpoint)
            if len(count) > 1:
                self._say(
                    "nonzero_after_estop",
                    setpoint.t_us,
                    f"{name}, {(setpoint.t_us - end_us) / 1000:.1f} ms after the e-stop, the {len(count)}. such frame of this wheel",
                )
            return
        if kind == "killed":
            limit_us = end_us + JITTER_US
        elif kind == "cut":
            limit_us = end_us + within_us + JITTER_US
        else:
            start_us = end_us + within_us + self.config.period_ms * 1000
            limit_us = start_us + self._ramp_us(self._speed_at(end_us)) + self.config.period_ms * 1000 + JITTER_US
        if setpoint.t_us > limit_us:
            excess_us = setpoint.t_us - limit_us
            self._say(
                "nonzero_after_" + kind,
                setpoint.t_us,
                f"{name}, {(setpoint.t_us - end_us) / 1000:.0f} ms after the stop, {excess_us / 1000:.0f} ms too late",
                excess_us,
            )

    def _slew(self, setpoints):
        """Invariant 8: no step steeper than the configured slopes; a jump to zero only where the rules want one.

        Compared with the frame before the last (the last one may have come late) and with the one ten frames ago (a slope
        that is a little too steep all the time).
        """
        for number, after in enumerate(setpoints[1:], 1):
            for back in (min(2, number), 10):
                if back <= number and not (back == 10 and after.speed == 0):
                    self._one_slew(setpoints[number - back], after)

    def _one_slew(self, before, after):
        config = self.config
        elapsed_us = after.t_us - before.t_us
        reverses = before.speed * after.speed < 0
        if abs(after.speed) > abs(before.speed) or reverses:
            slope = max(config.accel_mm_s2, config.decel_mm_s2 if reverses else 0)
        else:
            slope = config.decel_mm_s2
        step, allowed = abs(after.speed - before.speed), slope * (elapsed_us + JITTER_US) / 1e6 + 2
        if step <= allowed:
            return
        if after.speed != 0:
            text = f"{before.speed} to {after.speed} mm/s in {elapsed_us / 1000:.1f} ms"
            self._say("slew", after.t_us, text, (step - allowed) * 1e6 / slope)
        elif not self._cut_near(after.t_us):
            text = f"{before.speed} mm/s to zero without ramp and without a reason"
            self._say("hard_stop", after.t_us, text, 0)  # a stalled machine is a reason: its wheels go offline

    def _cut_near(self, t_us):
        kinds = ("press", "estop", "cut", "restart_hold")
        return any(event.kind in kinds and event.t_us <= t_us <= event.t_us + event.within_us + GAP_US for event in self.events) or self._is_dead(t_us, t_us)

    def _pairs(self):
        """Invariant 5: left and right leave together, left first.

        After a stall of the bus two pairs may come out sorted by id (left, left, right, right); that is no fault of the
        gateway, and excused where a stall was seen.
        """
        waiting, excused = None, False  # excused: the left one of this pair was still within the time of a dead bus
        for setpoint in self.setpoints:
            if self._is_dead(setpoint.t_us, setpoint.t_us):
                waiting, excused = None, setpoint.side == 0
            elif setpoint.side == 0:
                if waiting is not None and self._alone(waiting):
                    self._say("pair", waiting.t_us, "a left setpoint without its right one", 0)
                waiting, excused = setpoint, False
            elif waiting is None:
                if not excused and self._alone(setpoint):
                    self._say("pair", setpoint.t_us, "a right setpoint without its left one", 0)
                excused = False
            else:
                spread_us = setpoint.t_us - waiting.t_us
                self.pair_max_us = max(self.pair_max_us, spread_us)
                if spread_us > self.pair_limit_us:
                    text = f"{spread_us / 1000:.1f} ms between left and right"
                    self._say("pair_spread", setpoint.t_us, text, spread_us - self.pair_limit_us)
                waiting = None
        if waiting is not None and self._alone(waiting):
            self._say("pair", waiting.t_us, "a left setpoint without its right one", 0)

    def _alone(self, setpoint):
        """A pair may be broken only by the death of the process in its middle, or by the end of the recording; a zero pair by an exit that clears."""
        kinds = ("end", "exit") if self.exit_clears and setpoint.zero else ("end",)
        died = any(event.kind in kinds and abs(event.t_us - setpoint.t_us) < JITTER_US for event in self.events)
        return not died and setpoint.t_us < self.finished_us - PAIR_US

    def _presence(self, session, next_us):
        """Invariant 4: no gap while armed, stopping or holding; and the hold ends neither early nor late."""
        for side in (0, 1):
            times = [s.t_us for s in self._setpoints_between(session.begin_us, next_us) if s.side == side]
            if not times:
                self._say("never_sent", session.begin_us, "armed, but no setpoint was sent to a wheel")
                continue
            until_us = self._must_send_until(session, side)
            if next_us < self.finished_us or not self._reported_silent(session, next_us):
                until_us = min(until_us, next_us)
            self._no_gap([max(session.armed_us - GAP_US // 2, times[0])] + [t for t in times if t <= until_us] + [until_us])
            self._silence(session, times, next_us)

    def _reported_silent(self, session, next_us):
        """The gateway reported the end, or it has exited: no later setpoint is expected."""
        begin_us = max((at for at, _, _ in session.ends), default=next_us)
        return any(event.kind in ("silent", "exit") and begin_us < event.t_us <= next_us for event in self.events)

    def _no_gap(self, times):
        for before, after in itertools.pairwise(times):
            if after <= before or self._is_dead(before, after):
                continue
            self.gap_max_us = max(self.gap_max_us, after - before)
            if after - before >= GAP_US:
                self._say("gap", after, f"{(after - before) / 1000:.0f} ms without a setpoint", after - before - GAP_US)

    def _killed_us(self, session):
        return min((end[0] for end in session.ends if end[1] == "killed"), default=None)

    def _first_zero_us(self, session, side):
        """When the zeros of the final hold began; on a dead bus they begin unseen."""
        end_us = session.end_us()
        if end_us is None:
            return None
        within_us = max(within for at, _, within in session.ends if at == end_us)  # an action that cuts the bus may last a while
        if any(begin <= end_us + within_us + GAP_US and end_us < alive for begin, alive in self.dead):
            return end_us
        last = None
        index = bisect.bisect_right(self._begins, session.begin_us)
        next_us = self._begins[index] if index < len(self._begins) else 1 << 62
        for setpoint in self._setpoints_between(end_us, next_us):
            if setpoint.side == side:
                if not setpoint.zero:
                    last = None
                elif last is None:
                    last = setpoint.t_us
        return last

    def _must_send_until(self, session, side):
        killed_us = self._killed_us(session)
        zero_us = self._first_zero_us(session, side)
        if zero_us is None:
            until_us = session.end_us() or self.finished_us
        else:
            until_us = zero_us + (self.config.zero_hold_ms - self.config.period_ms) * 1000 - JITTER_US
        resets = [event.t_us for event in self.events if event.kind == "reset" and event.ok and event.t_us > session.begin_us]
        return min([until_us] + ([killed_us] if killed_us else []) + resets[:1])

    def _rest_since_us(self, from_us):
        """When both wheels have been at standstill for the settling time, at from_us or later. An offline wheel is not at standstill."""
        since = {SPEED_IDS[0]: None, SPEED_IDS[1]: None}
        newest_us = dict(since)
        # What was before the settling time does not matter: telemetry of a wheel at standstill is back within OFFLINE_US.
        first = bisect.bisect_left(self._frame_times, from_us - SETTLED_US - 2 * OFFLINE_US)
        for frame in itertools.islice(self.frames, first, None):
            if frame.id not in since or frame.own or len(frame.data) < 2:
                continue
            before, newest_us[frame.id] = newest_us[frame.id], frame.t_us
            if before is not None and frame.t_us - before > OFFLINE_US:
                since[frame.id] = None
            if abs(signed(frame.data, 0)) > REST_RPM:
                since[frame.id] = None
            elif since[frame.id] is None:
                since[frame.id] = frame.t_us
            settled = all(t is not None and frame.t_us - t >= SETTLED_US for t in since.values())
            if settled and frame.t_us >= from_us and all(frame.t_us - t <= OFFLINE_US for t in newest_us.values()):
                return frame.t_us
        return None

    def _silence(self, session, times, next_us):
        end_us = session.end_us()
        if end_us is None:
            return
        zero_us = max((t for t in (self._first_zero_us(session, side) for side in (0, 1)) if t is not None), default=None)
        if zero_us is None:
            if (
                end_us + self._ramp_us(self.config.max_speed_mm_s) + GAP_US * 2 < min(next_us, self.finished_us)
                and self._killed_us(session) is None
                and not self._is_dead(end_us, end_us)
            ):
                self._say("no_zero", end_us, "the session ended without a zero setpoint")
            return
        hold_us = zero_us + self.config.zero_hold_ms * 1000
        rest_us = self._rest_since_us(zero_us)
        limit_us = max(hold_us, rest_us if rest_us is not None else zero_us + HOLD_MAX_US)
        limit_us = min(limit_us, max(hold_us, zero_us + HOLD_MAX_US)) + GAP_US
        if times[-1] > limit_us and not self._is_dead(zero_us, times[-1]):
            late_us = times[-1] - limit_us
            self._say("no_silence", times[-1], f"still sending {late_us / 1000:.0f} ms after the hold should have ended", late_us)

    def _listening(self):
        """Nothing is sent before arm, and nothing while no gateway runs."""
        for setpoint in self.setpoints:
            if self._session_at(setpoint.t_us) is None:
                self._say("sent_in_listening", setpoint.t_us, "a setpoint although no client had asked to arm")
                return
        for reset in (event for event in self.events if event.kind == "reset" and event.ok):
            index = bisect.bisect_left(self._begins, reset.t_us)
            next_us = self._begins[index] if index < len(self._begins) else 1 << 62
            for setpoint in self._setpoints_between(reset.done_us + JITTER_US + 1, next_us):
                session = self._session_at(setpoint.t_us)
                late_us = setpoint.t_us - reset.done_us - JITTER_US
                if session is not None:
                    self._say("sent_after_reset", setpoint.t_us, "a setpoint after reset and before arm", late_us)
                    return

    def _estop(self):
        """Invariant 2: the first zero pair follows the edge within 5 ms (p99)."""
        for event in self.events:
            if event.kind not in ("press", "estop") or not self._sending_at(event.t_us):
                continue
            zeros = [self.next_zero_us(side, event.t_us) for side in (0, 1)]
            if None in zeros:
                self._say("estop_no_zero", event.t_us, "no zero pair after the e-stop")
                continue
            if event.kind == "estop" or event.done_us - event.t_us <= PRESS_US:
                self.estop_latencies.append((event.t_us, max(zeros) - event.t_us))
        if self.estop_latencies:
            count = len(self.estop_latencies)
            p99_us = percentile([latency_us for _, latency_us in self.estop_latencies], 99)
            worst_us = max(self.estop_latencies, key=lambda pair: pair[1])[0]
            if p99_us > self.estop_limit_us:
                text = f"first zero pair {p99_us / 1000:.1f} ms after the e-stop (p99 of {count}), "
                text += f"{self.estop_limit_us / 1000:.0f} ms allowed"
                self._say("estop_latency", worst_us, text, p99_us - self.estop_limit_us)

    def moving_at(self, t_us):
        """Whether one of the last two setpoints was none of zero, and lately."""
        return any(not setpoint.zero for setpoint in self._setpoints_between(t_us - GAP_US + 1, t_us + 1)[-2:])

    def _sending_at(self, t_us):
        session = self._session_at(t_us)
        ended = session is None or any(end[0] < t_us for end in session.ends)
        recent = self._setpoints_between(t_us - GAP_US + 1, t_us + 1)
        return (not ended and bool(recent)) or self.moving_at(t_us)
