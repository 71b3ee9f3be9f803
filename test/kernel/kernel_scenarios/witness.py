# SPDX-License-Identifier: MIT
"""The verdicts of real time can fail: a late gateway is found; a stalled machine does not count as one, and excuses no motion."""

import os
import signal
import tempfile
import time

from can_bus import FRAME, open_raw
from catalogue import Entry, kernel_test
from guest_run import GuestRun, attempt_of, run_one
from judge_log import LEFT, RIGHT
from kernel_rig import ESTOP_US, LEVEL_US, PRESS_LATE_US, TICK_US, VcanRig, machine_late
from scenario import Skip
from verdict import FAILED, INCONCLUSIVE, RETRIES

LATE_S = 0.03
HALT_S, HALT_LIMIT_S = 0.2, 5.0


class Rehearsal(GuestRun):
    """The runner's verdict on a test with a seeded fault, which is not reported. Run in this process, `attempts` times."""

    def __init__(self, t, function):
        folder = tempfile.mkdtemp(prefix="iwheel-rehearsal-")
        super().__init__({**t.plan, "results": os.path.join(folder, "seeded.results")})
        self.entry = Entry("seeded", "seeded", function, (), 0, VcanRig, 1)
        self.attempts = 0

    def work_off(self, _):
        self.attempts += 1
        self.last = attempt_of(run_one(self.entry, self.plan))
        return self.last

    def disturbed(self):
        """Whether the machine was late in the last attempt."""
        return machine_late(self.last.begin_us, self.last.end_us, PRESS_LATE_US)


def drive_while(halt, afterwards=None):
    """A test that drives on while a process or the machine is stopped."""

    def seeded(t):
        rig, _, stream = t.driving(seconds=0.4, every=0.05)
        halt(t, rig)
        refusal = stream.stop(after=0.3)
        t.check(refusal is None, f"drive was refused: {refusal}")
        if afterwards:
            afterwards(rig)
        t.judge(rig)

    return seeded


def halt_gateway(_, rig):
    rig.gateway.signal(signal.SIGSTOP)
    time.sleep(HALT_S)
    rig.gateway.signal(signal.SIGCONT)


def halt_machine(t, _):
    """The host stops this whole kernel: see Boot.stall_as_asked."""
    path = f"{t.plan['asks']}.stall"
    with open(path, "w", encoding="ascii") as file:
        file.write(str(HALT_S))
    end = time.monotonic() + HALT_LIMIT_S
    while os.path.exists(path):
        if time.monotonic() > end:
            raise RuntimeError("the host did not stop this kernel")
        time.sleep(0.02)


def need_a_machine(t):
    if t.plan["native"]:
        raise Skip("a machine's own kernel is not stopped; without --native this is tested")


def motion_after_estop(rig):
    """Two pairs as a gateway would send them that does not stop; the judge counts them as the gateway's."""
    rig.press()
    time.sleep(0.1)
    with open_raw(rig.interface) as other:
        for can_id in (LEFT, RIGHT, LEFT, RIGHT):
            other.send(FRAME.pack(can_id, 5, 0, 0, b"\1\1\x2c\7\xd0" + bytes(3)))
    time.sleep(0.1)


def verdict_on(t, halt, afterwards=None):
    """(verdict, rehearsal, failures) of the runner."""
    t.plan["asks"] = t.plan["results"].rsplit(".", 1)[0]
    rehearsal = Rehearsal(t, drive_while(halt, afterwards))
    verdict, attempt, _ = rehearsal.again("seeded")
    return verdict, rehearsal, [failure.text for failure in attempt.failures]


@kernel_test("a gateway that is stopped for 200 ms in motion fails the test immediately, and the machine does not count as the cause", "plumbing-realtime", 0)
def plumbing_gateway_halted(t):
    for _ in range(RETRIES):
        verdict, rehearsal, failures = verdict_on(t, halt_gateway)
        if verdict == FAILED or not rehearsal.disturbed():
            t.check(verdict == FAILED, f"{verdict} after {rehearsal.attempts} attempts: {failures}")
            t.figure(f"{verdict}: {len(failures)} failures")
            return
    raise Skip("the machine was late during each attempt; needs a quieter one")


@kernel_test("a machine that stalls for 200 ms does not count as a late gateway: repeated, then not judged", "plumbing-realtime", 0)
def plumbing_machine_halted(t):
    need_a_machine(t)
    verdict, rehearsal, failures = verdict_on(t, halt_machine)
    t.check(rehearsal.disturbed(), "the witness detected the stall of the machine")
    t.check(failures, "the stall of the machine is in the results")
    t.check(verdict == INCONCLUSIVE and rehearsal.attempts == RETRIES, f"{verdict} after {rehearsal.attempts} attempts: {failures}")
    t.figure(f"{verdict} after {rehearsal.attempts} attempts, {len(failures)} failures in the last")


@kernel_test("a stalled machine excuses no motion after the e-stop", "plumbing-realtime", 0)
def plumbing_machine_no_excuse(t):
    need_a_machine(t)
    verdict, rehearsal, failures = verdict_on(t, halt_machine, motion_after_estop)
    t.check(rehearsal.disturbed(), "the witness detected the stall of the machine")
    t.check(verdict == FAILED and rehearsal.attempts == 1, f"{verdict} after {rehearsal.attempts} attempts")
    t.check(any(text.startswith("nonzero_after_estop") for text in failures), f"it is named: {failures}")
    t.figure(f"{verdict} although the machine stalled")


def late_press(t, delay):
    """A press in motion while `delay(rig)` stops a process or the machine for LATE_S. Returns (latencies from edge and level, whether the machine was late)."""
    rig, _, stream = t.driving(seconds=0.5, every=0.05)
    undo = delay(rig)
    edge_us = rig.press()
    undo()
    stream.stop(after=0.3)
    judge = rig.judge(estop_limit_us=1 << 62)
    found = [t.after_edge(rig, judge, *pair) for pair in judge.estop_latencies]
    found = [us for at_us, us in found if not t.excused(at_us, us)]
    t.take_levels(rig, judge)
    levels = [us for _, us in t.from_level]
    t.from_level.clear()
    late = machine_late(edge_us - TICK_US, edge_us + LEVEL_US, PRESS_LATE_US)
    return max(found, default=0), max(levels, default=0), late or not levels  # or the contact itself moved too slowly to decide


def stop_gateway(rig):
    rig.gateway.signal(signal.SIGSTOP)

    def later():
        time.sleep(LATE_S)
        rig.gateway.signal(signal.SIGCONT)

    return later


@kernel_test("a gateway that is stopped for 30 ms at a press is detected, and the machine does not count as the cause", "plumbing-realtime", 0)
def plumbing_late_gateway(t):
    for _ in range(RETRIES):
        latency_us, level_us, disturbed = late_press(t, stop_gateway)
        if not disturbed:
            t.check(latency_us > ESTOP_US, f"{latency_us / 1000:.2f} ms measured although the gateway was stopped for 30 ms")
            t.check(level_us > LEVEL_US, f"{level_us / 1000:.2f} ms from the level although the gateway was stopped for 30 ms")
            t.figure(f"{latency_us / 1000:.0f} ms measured, {level_us / 1000:.0f} ms from the level")
            return
    raise Skip(f"the machine was late during each of {RETRIES} presses; needs a quieter one")
