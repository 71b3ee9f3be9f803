# SPDX-License-Identifier: MIT
"""What the judge reads: bus log and timeline, sorted into setpoints and sessions. No verdicts on motion here.

Times are integer microseconds of CLOCK_MONOTONIC. Timeline events (Event.kind):
  start, end        the gateway process was started; is gone (killed or exited)
  restart_hold      it was started after a crash: zeros are due immediately although no client armed
  arm, drive, reset a request was sent at t_us and answered at done_us; ok: the answer; drive has left, right (mm/s)
  stop, gone        a client sent stop; the holder of the lease disconnected: ramp
  press, estop      the button was pressed; a client sent estop: zero immediately
  cut, ramp         the scenario caused something that must stop the wheels within within_us, without or with ramp
  silent, exit      the gateway reports that it listens again; it exited on its own, after its hold
  dead, alive       the bus accepts no frames any more; accepts them again
"""

import bisect
import itertools
import math
from typing import NamedTuple

LEFT, RIGHT = 266, 298
SPEED_IDS = (256, 288)
KNOWN = {LEFT, RIGHT, 256, 257, 288, 289, 290, 512, 513, 544, 545}
GAP_US = 100_000  # invariant 4
PAIR_US = 5_000  # invariant 5: no two cycles are nearer to each other; 0.88 ms on a full bus
PAIR_REAL_US = PAIR_US + 10_000  # of ordinary programs: the kernel may run another one between two frames of one call (docs/user/pair.md: 6.1 ms)
ESTOP_US = 5_000  # invariant 2
STOP_US = 60_000  # a client's stop is obeyed within this, whatever the load of the gateway
PRESS_US = 2_000  # a press that took longer to make has no known time
JITTER_US = 10_000  # between the gateway's clock and the bus
BUS_STALL_US = 5_500  # no telemetry for so long: the simulator waited for the processor
REST_RPM = 2
SETTLED_US = 500_000
OFFLINE_US = 50_000  # a wheel is lost after this
HOLD_MAX_US = 60_000_000
FIRST_LEASE_US = 1_000_000
ALWAYS_US = 200_000  # a limit missed by more than this is no matter of a busy machine,
ABSENT = ("gap", "estop_latency")  # except for these: a process misses them for as long as the machine does not run it (verdict.py, LONG_US)
ECHO_US = 50_000
RESIDUAL_US = 5_000_000  # an old frame comes out this soon after the bus lives again, if ever
RESIDUAL_ZERO_US = 2_000  # and its zero follows


class Frame(NamedTuple):
    t_us: int
    id: int  # with the flag bits of struct can_frame
    data: bytes
    own: bool = False  # sent by the scenario itself


class Event(NamedTuple):
    t_us: int
    kind: str
    done_us: int = 0
    ok: bool = True
    left: int = 0
    right: int = 0
    within_us: int = 0


class Config(NamedTuple):
    setpoint_type: int = 1
    role: str = "limit"
    dlc: int = 5
    period_ms: int = 20
    lease_ms: int = 200
    accel_mm_s2: int = 800
    decel_mm_s2: int = 1500
    max_speed_mm_s: int = 1000
    max_yaw_mrad_s: int = 1000
    track_mm: int = 540
    radius_mm: int = 192
    max_current_mA: int = 2000
    zero_hold_ms: int = 1500
    invert: tuple = (False, False)


class Violation(NamedTuple):
    rule: str
    t_us: int
    text: str
    timing: bool  # a stalled machine could have caused it,
    excess_us: float = 0  # if it stalled for so long


class Setpoint(NamedTuple):
    t_us: int
    side: int  # 0 left, 1 right
    speed: int  # mm/s in the machine's frame
    current: int
    zero: bool


class Session:
    """From one arm until the gateway stops sending."""

    def __init__(self, begin_us, armed_us):
        self.begin_us, self.armed_us = begin_us, armed_us
        self.drives = []
        self.refuses_us = 1 << 62  # No drive is accepted from then on.
        self.ends = []  # (t_us, kind, within_us), kind: ramp, cut, press, killed

    def end_us(self):
        return min((end[0] for end in self.ends), default=None)


def signed(data, at):
    return int.from_bytes(data[at : at + 2], "big", signed=True)


class Reading:
    """Setpoints, sessions and windows of a dead bus, and what is wrong with their form. `found` collects violations."""

    def __init__(self, config, frames, events, moves=True, finished_us=None, estop_limit_us=ESTOP_US, pair_limit_us=PAIR_US, exit_clears=False):
        self.config, self.moves, self.estop_limit_us, self.pair_limit_us = config, moves, estop_limit_us, pair_limit_us
        self.exit_clears = exit_clears  # The bus loses the frames that a program sent just before it exited.
        self.frames = sorted(frames, key=lambda frame: frame.t_us)
        self.events = sorted(events, key=lambda event: event.t_us)
        self.finished_us = finished_us or (self.frames[-1].t_us if self.frames else 0)
        self.found = []
        self.estop_latencies = []
        self.gap_max_us = self.pair_max_us = self.residual = 0
        self.setpoints = []
        self.dead = self._dead_windows()

    def _say(self, rule, t_us, text, excess_us=None):
        timing = excess_us is not None and (excess_us < ALWAYS_US or rule in ABSENT)
        self.found.append(Violation(rule, t_us, text, timing, excess_us or 0))

    def _dead_windows(self):
        windows, since = [], None
        for event in self.events:
            if event.kind == "dead" and since is None:
                since = event.t_us
            if event.kind == "alive" and since is None:
                self._say("timeline", event.t_us, "the bus lives again, but was never dead: the scenario wrote it down wrongly")
            elif event.kind == "alive":
                windows.append((since, event.done_us or event.t_us))
                since = None
        windows = [(begin, self._first_out_us(end)) for begin, end in windows]
        return windows + ([(since, 1 << 62)] if since is not None else [])

    def _first_out_us(self, alive_us):
        """The bus accepts frames again when one is on it: a wheel that has power first starts, then acknowledges."""
        return next(
            (frame.t_us for frame in self.frames if frame.id in (LEFT, RIGHT) and not frame.own and alive_us <= frame.t_us < alive_us + RESIDUAL_US), alive_us
        )

    def bus_stalls(self):
        """When the simulated bus was stalled, [(until_us, for_us)]: two wheels send a frame every 4 ms each. A scenario may be the cause."""
        times = [frame.t_us for frame in self.frames if frame.id in SPEED_IDS and not frame.own]
        return [(b, b - a) for a, b in itertools.pairwise(times) if b - a > BUS_STALL_US]

    def machine_stalls(self):
        """When the program that runs the wheels was certainly stalled, [(until_us, for_us)]; only rigs that measure it report this."""
        return []

    def _is_dead(self, from_us, to_us):
        return any(begin < to_us + GAP_US and from_us < end + GAP_US for begin, end in self.dead)

    def _read(self):
        """Sorts out the gateway's frames and checks their form (invariant 8)."""
        for frame in self.frames:
            if frame.own:
                continue
            if frame.id not in KNOWN:
                if not frame.id & 0x20000000:
                    self._say("unknown_id", frame.t_us, f"frame with id word 0x{frame.id:X}")
                continue
            if frame.id in (LEFT, RIGHT):
                self._read_setpoint(frame)
        self._setpoint_times = [setpoint.t_us for setpoint in self.setpoints]
        self._frame_times = [frame.t_us for frame in self.frames]

    def _setpoints_between(self, from_us, to_us=1 << 62):
        """Those at from_us or later and before to_us: the search in long logs does not begin at their start each time."""
        times = self._setpoint_times
        return self.setpoints[bisect.bisect_left(times, from_us) : bisect.bisect_left(times, to_us)]

    def next_zero_us(self, side, after_us):
        """When the first zero of that wheel after a moment was sent; None if none was."""
        for number in range(bisect.bisect_right(self._setpoint_times, after_us), len(self.setpoints)):
            if self.setpoints[number].side == side and self.setpoints[number].zero:
                return self._setpoint_times[number]
        return None

    def _read_setpoint(self, frame):
        config, side = self.config, 0 if frame.id == LEFT else 1
        if len(frame.data) != config.dlc:
            self._say("dlc", frame.t_us, f"{len(frame.data)} bytes on {frame.id}, {config.dlc} configured")
            return
        if any(frame.data[5:]):
            self._say("padding", frame.t_us, "bytes behind the setpoint are not zero")
        if frame.data[0] != config.setpoint_type:
            self._say("type", frame.t_us, f"setpoint type {frame.data[0]}, {config.setpoint_type} configured")
        speed, current = signed(frame.data, 1), signed(frame.data, 3)
        if abs(speed) > config.max_speed_mm_s:
            self._say("speed", frame.t_us, f"{speed} mm/s, {config.max_speed_mm_s} allowed")
        if abs(current) > min(config.max_current_mA, 2000):
            self._say("current", frame.t_us, f"{current} mA, {config.max_current_mA} allowed")
        zero = speed == 0 and (config.role == "limit" or current == 0)
        speed = -speed if config.invert[side] else speed
        self.setpoints.append(Setpoint(frame.t_us, side, speed, current, zero))
        self._read_turn()

    def _read_turn(self):
        """The right wheel's setpoint completes a pair, which turns the real machine. A wheel assumes a radius of 192 mm."""
        config, (left, right) = self.config, self.setpoints[-2:] if len(self.setpoints) > 1 else (None, None)
        if left is None or (left.side, right.side) != (0, 1) or right.t_us - left.t_us > PAIR_US:
            return
        yaw_mrad_s = abs(right.speed - left.speed) * 1000 * config.radius_mm / 192 / config.track_mm
        if yaw_mrad_s > config.max_yaw_mrad_s:
            self._say("yaw", right.t_us, f"{left.speed} and {right.speed} mm/s turn by {yaw_mrad_s:.0f} mrad/s, {config.max_yaw_mrad_s} allowed")

    def _sessions(self):
        sessions, current = [], None
        for event in self.events:
            if event.kind == "arm" and event.ok:
                if current is None or current.ends:
                    current = Session(event.t_us, event.done_us)
                    sessions.append(current)
                current.drives.append(Event(event.t_us, "arm", event.done_us))
            elif event.kind == "restart_hold":
                current = Session(event.t_us, event.t_us)
                current.ends.append((event.t_us, "cut", 0))
                sessions.append(current)
            elif current is not None:
                self._take(current, event)
        for session in sessions:
            self._lapse(session)
        self.sessions, self._begins = sessions, [session.begin_us for session in sessions]

    def _take(self, session, event):
        if event.kind == "drive" and event.ok:
            if event.t_us > session.refuses_us + ECHO_US:
                self._say("drive_after_end", event.t_us, "a drive was accepted although the session had ended")
            session.drives.append(event)
        kinds = {"stop": "ramp", "gone": "ramp", "ramp": "ramp", "press": "press", "estop": "press", "cut": "cut", "end": "killed"}
        if event.kind in kinds:
            session.refuses_us = min(session.refuses_us, max(event.t_us + event.within_us, event.done_us))
            answered_us = max(0, event.done_us - event.t_us)  # Before, it may not have been made: `_estop` limits the latency of others than a stop.
            obeyed_us = min(answered_us, STOP_US) if event.kind == "stop" else answered_us
            session.ends.append((event.t_us, kinds[event.kind], max(event.within_us, obeyed_us)))

    def _lapse(self, session):
        """The lease ends on its own; a drive after that must have been refused."""
        config, previous = self.config, None
        for drive in session.drives:
            if previous is not None and drive.kind == "drive":
                late_us = drive.t_us - (previous.done_us + self._lease_us(previous)) - config.period_ms * 1000
                if late_us > JITTER_US:
                    self._say("late_drive", drive.t_us, f"a drive was accepted {late_us / 1000:.0f} ms after the lease had ended")
            previous = drive
        if previous is not None:
            end_us = previous.done_us + self._lease_us(previous)
            if end_us < self.finished_us:
                session.ends.append((end_us, "ramp", 0))
        session.ends.sort()

    def _lease_us(self, feed):
        lease_us = self.config.lease_ms * 1000
        return max(lease_us, FIRST_LEASE_US) if feed.kind == "arm" else lease_us

    def _session_at(self, t_us):
        index = bisect.bisect_right(self._begins, t_us) - 1
        return self.sessions[index] if index >= 0 else None


def percentile(values, percent):
    ordered = sorted(values)
    return ordered[max(0, math.ceil(len(ordered) * percent / 100) - 1)]
