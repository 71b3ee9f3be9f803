# SPDX-License-Identifier: MIT
"""The argument of a scenario: a rig, checks, figures. @scenario registers scenarios."""

import time
import unittest

from client import Streamer
from harness import Rig
from judge_log import percentile
from verdict import CHECK, RULE, TIMING, Failure, Findings

REGISTRY = {}
# Refusals of arm that end without an action: the wheels roll out, or the last zero is not on the bus yet.
AWAITED = ("not_at_rest", "stale_command", "cause_present", "send_stalled")


# These depend on the rate of the telemetry: it is as documented in virtual time too.
AS_DOCUMENTED = ("nominal_drive_and_turn", "force_offset_and_tare", "row23_", "trap12_", "frames_", "ledger_", "memory_", "tare_")


def as_documented(name):
    """Those, and the first of each row of the fault catalogue."""
    rows = {}
    for one in REGISTRY:
        rows.setdefault(one[:5] if one.startswith("row") else one, one)
    return name.startswith(AS_DOCUMENTED) or (name.startswith("row") and rows.get(name[:5]) == name)


class Skip(unittest.SkipTest):
    """This cannot be tested here; the text names the missing part."""


def scenario(title, seconds=5, native=""):
    """`seconds`: the approximate duration; the longest start first. `native`: why virtual time cannot show it, as in pytest_virtual.py."""

    def register(function):
        function.scenario, function.native = (title, seconds), native
        REGISTRY[function.__name__] = (title, seconds, function)
        return function

    return register


class Test(Findings):
    """Collects failures as verdict.Failure, figures, and stalls that the test itself has measured."""

    __test__ = False  # pytest does not collect tests from it.
    rig_type = Rig

    def __init__(self, build, rig_type=None):
        super().__init__()
        self.build, self.rig_type = build, rig_type or self.rig_type
        self.latencies, self.rigs = self.data.setdefault("latencies", []), []

    def said(self):
        return "".join(rig.said() for rig in self.rigs)

    def rig(self, *arguments, **options):
        rig = self.rig_type(self.build, *arguments, **options)
        self.rigs.append(rig)
        return rig

    def running(self, config=None, sim=(), setup=None, wheels=True, **options):
        """A rig with a running gateway, and a client; `sim`: commands to the simulator before. With `wheels` both are online and at standstill."""
        rig = self.rig(config, **options)
        for command in sim:
            rig.sim.ask(command)
        return rig, rig.connect_to_new(setup=setup, wheels=wheels)

    def driving(self, config=None, speed=300, seconds=0.7, every=0.02, **options):
        """A rig that drives, with a command every 20 ms: rig, client, stream."""
        rig, client = self.running(config, **options)
        return rig, client, self.start_driving(client, speed, speed, seconds, every)

    def check(self, condition, text, timing=False, at_us=0, need_us=None):
        """`need_us`: the shortest stall of the machine that explains the failure, as in verdict.Failure."""
        if not condition:
            self.failures.append(Failure(text, TIMING if timing else CHECK, at_us, need_us))
        return bool(condition)

    def rule(self, condition, text, at_us=0):
        """A safety rule holds, however late the machine is: no motion that is not permitted, no latch that opens on its own."""
        if not condition:
            self.failures.append(Failure(text, RULE, at_us))
        return bool(condition)

    def expect(self, reply, error=None):
        """The reply is ok, or has that error and a message worth reading."""
        if error is None:
            return self.check(reply["ok"], f"refused: {reply.get('error')}: {reply.get('message')}")
        refused = self.check(not reply["ok"] and reply["error"] == error, f"{error} expected, got {reply}")
        return refused and self.check(len(reply.get("message") or "") > 10, f"{error} without a message: {reply}")

    def arm(self, client, **fields):
        """Arms; tries again for a while if the wheels are not at standstill yet."""
        reply = client.arm(**fields)
        for _ in range(60):
            if reply["ok"] or reply["error"] not in AWAITED:
                break
            time.sleep(0.05)
            reply = client.arm(**fields)
        self.expect(reply)
        return reply

    def start_driving(self, client, left, right, seconds, every=0.05):
        """Arms, and drives in the background. Returns the Streamer after that time."""
        self.arm(client)
        stream = Streamer(client, left, right, every)
        time.sleep(seconds)
        return stream

    def arm_and_drive(self, client, left, right, seconds, every=0.05):
        self.arm(client)
        self.drive_for(client, left, right, seconds, every)

    def drive_for(self, client, left, right, seconds, every=0.05):
        refusal = client.stream(left, right, seconds, every)
        self.overslept(client.late)
        self.check(refusal is None, f"drive was refused: {refusal}")

    def stop_for(self, client, seconds):
        client.request("stop")
        time.sleep(seconds)

    def silence(self, rig, client, seconds=4, text="silence"):
        """Checks that the gateway listens within that time, so that it sends nothing any more."""
        return self.check(rig.wait_status(client, lambda s: s["state"] == "listening", seconds), text)

    def stop_until_silent(self, rig, client):
        client.request("stop")
        self.silence(rig, client)

    def reset(self, client, seconds=6.0):
        """Repeats reset until the gateway accepts it. Returns the errors of the refusals."""
        reasons, end = [], time.monotonic() + seconds
        while True:
            reply = client.request("reset")
            if reply["ok"] or time.monotonic() > end:
                self.expect(reply)
                return reasons
            reasons.append(reply["error"])
            time.sleep(0.05)

    def overslept(self, waits):
        """Waits of the test's own client that ended late, [(end_us, late_us)]. A rig in real time counts the long ones as stalls."""

    def stopped_by(self, client, cause, state="latched"):
        """Checks that `why` names that cause, and that the state is `state`."""
        why, status = client.request("why"), client.request("status")
        self.check(why.get("cause") == cause, f"cause {cause} expected, why reports {why.get('cause')}: {why.get('sentence')}")
        self.check(status["state"] == state, f"state {state} expected, it is {status['state']}")
        self.check(len(why.get("sentence") or "") > 20, f"why has no sentence: {why}")
        return why

    def measure(self, name, value):
        """A figure for the table of the fault catalogue, where there is one."""

    def figure(self, text):
        self.figures.append(text)

    def first_after(self, rig, t_us, wanted, text, limit_ms):
        """Milliseconds from t_us to the first setpoint that fulfils wanted(mm_s); checked against the limit."""
        hit = next((t for t, _, speed in rig.bus.setpoints(t_us) if wanted(speed)), None)
        if not self.check(hit is not None, f"{text}: never"):
            return None
        elapsed_ms = (hit - t_us) / 1000
        self.check(elapsed_ms <= limit_ms, f"{text} after {elapsed_ms:.1f} ms, {limit_ms} ms allowed", True, hit, (elapsed_ms - limit_ms) * 1000)
        return elapsed_ms

    def drive_and_judge(self, rig, client):
        """At the end of a scenario: it drives again, or still."""
        self.arm_and_drive(client, 200, 200, 0.5)
        self.judge(rig)

    def judge(self, rig, moves=True, **options):
        judge = rig.judge(moves=moves, **options)
        for found in judge.found[:6]:
            at = f"at {(found.t_us - rig.timeline[0].t_us) / 1e6:.3f} s: " if found.t_us else ""
            self.failures.append(Failure(f"{found.rule}: {at}{found.text}", TIMING if found.timing else RULE, found.t_us, found.excess_us))
        if judge.gap_max_us:
            self.figure(f"longest gap {judge.gap_max_us / 1000:.0f} ms")
        self.claims += judge.bus_stalls()
        self.stalls += judge.machine_stalls()
        if judge.estop_latencies:
            self.latencies += judge.estop_latencies
            values = [latency_us for _, latency_us in judge.estop_latencies]
            self.figure(f"e-stop to zero p99 {percentile(values, 99) / 1000:.2f} ms of {len(values)}")
        return judge
