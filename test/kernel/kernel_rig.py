# SPDX-License-Identifier: MIT
"""The rigs of test/system on interfaces and GPIO lines of a real kernel, and the parameters of a scenario."""

import contextlib
import itertools
import os
import time
from typing import NamedTuple

import netdev
from can_bus import CanBus
from fake_slcan import FakeSlcan
from gpio_sim import RISING, Edges, GpioChip
from harness import Rig, now_us
from judge_log import PAIR_REAL_US, PAIR_US, Event, percentile
from scenario import Test
from verdict import read_stalls

NUMBERS = itertools.count()
EDGE_S = 1.0
MARKERS = "/run/iwheel"
TICK_US = 10_000
BEFORE_TICK_US, BEFORE_TICK_REAL_US, SPIN_US = 200, 700, 3_000  # in real time, moving two lines needs some time
RAW_ESTOP_US = 1_000_000  # the judge's own limit; the limit from the edge is tested separately
ESTOP_US = 5_000  # invariant 2, 99th percentile
MOVE_US = 2_000  # if moving the contact took longer, the time of the change of level is unknown
LEVEL_US = TICK_US + ESTOP_US  # from the level: the simulated line reports its edge a tick later at the latest
CLOCK = {"virtual": False}  # set once, by guest.py, before the first scenario
WITNESS = {"file": None}  # set by guest.py in real time: what iwheel-sleeper writes
PRESS_LATE_US = 3_000  # a press must stop within 5 ms; a machine that is later than this could be the cause of a failure
STALL_US = 10_000  # what the judge allows between the gateway's clock and the bus


def late_wakings(from_us, to_us, more_than_us):
    """When the witness woke up that late in this time, and how late. In virtual time there is no witness, and nothing is late."""
    return read_stalls(WITNESS["file"], from_us, to_us, more_than_us) if WITNESS["file"] else []


def machine_late(from_us, to_us, more_than_us):
    return bool(late_wakings(from_us, to_us, more_than_us))


class Press(NamedTuple):
    """The level began to change, had changed, and its edge happened."""

    level_us: int
    moved_us: int
    edge_us: int


class GpioButton:
    """The e-stop contact on a simulated line. Mixed into a rig; `active` is the level of a pressed button.

    The simulated chip changes the level immediately but delivers edges at the kernel's next timer tick, up to 10 ms later. So the
    contact is moved right before a tick, and a second line, the witness, is pulled in the same instant: the kernel's time stamp of
    its edge is the time of the edge. `presses` lists all presses.
    """

    two_contacts = False
    active = "low"  # with "high" the bias that the gateway requests is stronger than the contact to ground: see HighVcanRig

    def make_button(self):
        self.line = f"ESTOP{next(NUMBERS)}"
        self.line2 = f"SECOND{next(NUMBERS)}" if self.two_contacts else None
        self.chip = GpioChip(f"iwheel{os.getpid()}-{next(NUMBERS)}", self.line, self.line2)
        self.chip.pull(self.active == "low")
        self.chip.pull(False, self.chip.WITNESS)
        self.witness = Edges(self.chip.chip, self.chip.WITNESS, RISING)
        self.presses = []
        self.tick_us = self._learn_tick()
        self.configure(estop={"line": self.line, "active": self.active})

    def estop_line(self):
        return self.line if self.estop else "none"

    def _learn_tick(self):
        self.chip.pull(True, self.chip.WITNESS)
        edge = self.witness.next(EDGE_S)
        self.chip.pull(False, self.chip.WITNESS)
        if edge is None:
            raise RuntimeError("the simulated GPIO chip delivered no edge")
        return edge[0]

    def _contact(self, pressed):
        """Moves the witness, then the contact. Returns the times when the level began to change and when this was done."""
        self.chip.pull(pressed, self.chip.WITNESS)
        level_us = now_us()
        self.chip.pull(pressed == (self.active == "high"))
        return level_us, now_us()

    def _press(self):
        """Moves the contact right before the next tick."""
        before_us, spin_us = (BEFORE_TICK_US, 0) if virtual() else (BEFORE_TICK_REAL_US, SPIN_US)
        begin_us = now_us()
        due_us = begin_us + TICK_US - (begin_us + before_us - self.tick_us) % TICK_US
        time.sleep(max(due_us - begin_us - spin_us, 0) / 1e6)
        while spin_us and now_us() < due_us:
            pass  # a sleep ends too late in real time, and the edge would be reported a whole tick after the level
        return self._contact(True)

    def _pressed(self, moved):
        """Waits for the edge and writes both into the timeline: after the change of level the gateway may stop."""
        level_us, done_us = moved
        edge = self.witness.next(EDGE_S)
        if edge is None:
            raise RuntimeError("the simulated GPIO chip delivered no edge")
        self.tick_us = edge[0]  # in real time the ticks are not exact
        edge_us = max(edge[0], done_us)  # the machine may stall between the two lines
        self.presses.append(Press(level_us, done_us, edge_us))
        self.timeline.append(Event(level_us, "cut", within_us=edge_us - level_us))
        self.timeline.append(Event(edge_us, "press", now_us()))
        return edge_us

    def press(self):
        return self._pressed(self._press())

    def release(self):
        self._contact(False)

    def pulse(self, seconds):
        """Presses and releases; returns when it began."""
        moved = self._press()
        if seconds:
            time.sleep(seconds)
        self.chip.pull(self.active == "low")
        edge_us = self._pressed(moved)
        self.release()
        return edge_us

    def lose_chip(self):
        """The chip is removed while its line is requested. For the rules this is a press."""
        self.witness.close()
        self.pressed_by(self.chip.vanish)

    def find_chip(self):
        self.chip.appear()
        self.chip.pull(False, self.chip.WITNESS)
        self.witness = Edges(self.chip.chip, self.chip.WITNESS, RISING)
        self.release()

    def remove_button(self):
        self.witness.close()
        self.chip.remove()


def remove_marker(interface):
    """Removes the marker that a killed gateway left for the next one on this interface, so that it does not affect the next test."""
    with contextlib.suppress(FileNotFoundError):
        os.unlink(f"{MARKERS}/{interface}.armed")


class VcanRig(GpioButton, Rig):
    """Gateway, simulated wheels and recorder on one vcan interface; the e-stop is a GPIO line."""

    exit_clears = False

    ids = ()  # ids that the recorder receives; empty: all

    def prepare(self):
        self.interface = f"vcan{next(NUMBERS)}"
        netdev.add_vcan(self.interface)
        self.make_button()

    def listen(self, frames=None):
        return CanBus(self.interface, frames, CLOCK["virtual"], self.ids)

    def wheels_bus(self):
        return self.interface

    def close(self, keep=False):
        super().close(keep)
        self.remove_button()
        netdev.remove_all([self.interface])
        remove_marker(self.interface)


class TwoContactsRig(VcanRig):
    """The button has a second contact, on another line of the same chip. `press` moves the first one alone."""

    two_contacts = True

    def make_button(self):
        super().make_button()
        self.second(False)
        self.configure(estop={"line2": self.line2, "line2_active": "low", "estop_discrepancy_ms": 1000})

    def second(self, pressed):
        """Moves the second contact alone; a press may stop the wheels from now on."""
        if pressed:
            self.note("cut", within_us=RAW_ESTOP_US)
        self.chip.pull(not pressed, self.chip.SECOND)


class HighVcanRig(VcanRig):
    """The contact as it should be wired: normally closed to ground, so that a press or a cut wire is high.

    gpio-sim models one pull only: when the gateway requests its pull-up, the line becomes high although the contact is closed.
    So the contact is closed again after the gateway has opened the line, and the latch that this caused is reset.
    """

    active = "high"

    def start_gateway(self, *extra, wheels=True, **options):
        answered_ms = super().start_gateway(*extra, wheels=False, **options)
        if wheels:
            self.close_contact()
        return answered_ms

    def close_contact(self):
        self.release()
        client = self.client("starter")
        self.wait_at_rest(client)
        for _ in range(100):
            if client.request("reset")["ok"]:
                break
            time.sleep(0.05)
        client.close()


class SlcanRig(GpioButton, Rig):
    """Gateway on the interface of a fake slcan adapter; wheels and recorder on the simulator's bus behind it.

    The recorder is at the wheels' end: it records the frames on the bus, not those that the kernel accepted.
    """

    queue_length = 4
    exit_clears = False

    def prepare(self):
        self.adapter = None
        self.make_button()
        # It reports no bit timing; the gateway must work without it.

    def __init__(self, *arguments, **options):
        super().__init__(*arguments, **options)
        self.adapter = FakeSlcan(self.path("bus"), self.queue_length)

    def gateway_bus(self):
        return self.adapter.interface

    def close(self, keep=False):
        self.adapter.stall(False)
        super().close(keep)
        self.adapter.end()
        self.remove_button()
        remove_marker(self.adapter.interface)


class KernelTest(Test):
    """A test on a rig of that type. `measures` has figures for the table of the fault catalogue."""

    def __init__(self, build, rig_type):
        super().__init__(build)
        self.rig_type = rig_type
        self.measures = {}
        self.from_level = []  # (level changed at, microseconds to the zero pair) of presses in motion
        self.met = 0  # the number of presses in motion, including those that could not be timed
        self.late_machine = 0  # presses that do not count, because the machine was late

    def measure(self, name, value):
        """Stores the worst value of that name, and prints it."""
        self.measures[name] = max(value, self.measures.get(name, value))

    def judge(self, rig, moves=True, **options):
        known = len(self.latencies)
        limits = {"estop_limit_us": RAW_ESTOP_US, "pair_limit_us": PAIR_US if virtual() else PAIR_REAL_US}
        judge = super().judge(rig, moves=moves, **{**limits, **options})
        if judge.gap_max_us:
            self.measure("gap_ms", judge.gap_max_us / 1000)
        pairs = [self.after_edge(rig, judge, *pair) for pair in self.latencies[known:]]
        self.latencies[known:] = [pair for pair in pairs if not self.excused(*pair)]
        self.late_machine += len(pairs) - len(self.latencies[known:])
        if pairs:
            self.figures.pop()  # the judge's own findings that are not excused yet
        self.judge_estop("e-stop to zero", self.latencies[known:], ESTOP_US)
        known = len(self.from_level)
        self.take_levels(rig, judge)
        if not virtual():
            self.judge_estop("from the level", self.from_level[known:], LEVEL_US)
        return judge

    def overslept(self, waits):
        """The witness has the gateway's priority; the client has a lower one, and can be late alone."""
        if not virtual():
            self.stalls += [(end_us, late_us) for end_us, late_us in waits if late_us > STALL_US]

    def judge_estop(self, name, pairs, limit_us):
        """For one kind of latency: a figure, and the limit of its 99th percentile."""
        values_ms = [latency_us / 1000 for _, latency_us in pairs]
        if values_ms:
            p50_ms, p99_ms = percentile(values_ms, 50), percentile(values_ms, 99)
            self.check(p99_ms <= limit_us / 1000, f"{name}, p99 {p99_ms:.2f} ms of {len(values_ms)}", True, need_us=p99_ms * 1000 - limit_us)
            self.figure(f"{name} p50 {p50_ms:.2f} ms, p99 {p99_ms:.2f} ms of {len(values_ms)}")

    @staticmethod
    def excused(since_us, latency_us, limit_us=ESTOP_US):
        """Too late, and the machine was late before the end of the limit: a later stall explains nothing.

        A late machine makes no stop faster: a stop in time counts, whatever else ran.
        """
        return latency_us > limit_us and machine_late(since_us - TICK_US, since_us + limit_us, PRESS_LATE_US)

    def take_levels(self, rig, judge):
        """For each press in motion: when the level changed, and the time until both wheels had their zero."""
        for press in rig.presses:
            zeros = [judge.next_zero_us(side, press.level_us) for side in (0, 1)]
            if None in zeros or not judge.moving_at(press.level_us):
                continue
            self.met += 1
            latency_us = max(zeros) - press.level_us
            if press.moved_us - press.level_us <= MOVE_US and not self.excused(press.level_us, latency_us, LEVEL_US):
                self.from_level.append((press.level_us, latency_us))

    @staticmethod
    def after_edge(rig, judge, edge_us, latency_us):
        """If the gateway read the level, its zeros began before the edge: its pair is the first one after the level."""
        for level_us in (press.level_us for press in rig.presses if press.edge_us == edge_us):
            zeros = [judge.next_zero_us(side, level_us) for side in (0, 1)]
            if None not in zeros and min(zeros) <= edge_us:
                return edge_us, max(max(zeros) - edge_us, 0)
        return edge_us, latency_us

    def first_after(self, rig, t_us, wanted, text, limit_ms):
        elapsed_ms = super().first_after(rig, t_us, wanted, text, limit_ms)
        if elapsed_ms is not None:
            self.measure("stop_ms", elapsed_ms)
        return elapsed_ms


def virtual():
    """Whether time does not advance while a process computes."""
    return CLOCK["virtual"]
