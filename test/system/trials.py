# SPDX-License-Identifier: MIT
"""What tests of a bridge share: waiting, a client that drives, what the bus shows of both."""

import threading
import time
import unittest
from pathlib import Path

from bus import now_us
from client import Closed
from judge_log import LEFT, RIGHT

ROOT = Path(__file__).resolve().parent.parent.parent

RECENT_US = 1_000_000  # Of a bus that has been recorded for long, a condition that is asked often reads only this time.

Skip = unittest.SkipTest  # This cannot be tested here.


def until(condition, seconds=10.0, what="it"):
    """The first true value of the condition; fails loudly if there is none in time."""
    deadline = time.monotonic() + seconds
    while True:
        value = condition()
        if value:
            return value
        if time.monotonic() > deadline:
            raise AssertionError(f"not within {seconds} s: {what}")
        time.sleep(0.02)


class Driver(threading.Thread):
    """A client of the gateway that drives until it must end, or the wheels are stopped."""

    def __init__(self, rig, speed=200):
        super().__init__(daemon=True)
        self.client, self.speed, self.ended = rig.client(name="joystick"), speed, threading.Event()
        self.turning = False
        self.start()
        until(
            lambda: (sent := rig.bus.setpoints(now_us() - RECENT_US)) and abs(sent[-1][2]) == speed, what="the wheels are commanded to turn, and at this speed"
        )
        self.turning = True

    def run(self):
        """A busy machine may stop the wheels before the test begins: then once more, after the time without commands that `arm` needs."""
        wait, cmd = 0.05, {"cmd": "arm", "name": "joystick"}
        try:
            while not self.ended.wait(wait):
                done = self.client.request(**cmd)["ok"]
                if not done and self.turning:
                    return
                wait = 0.05 if done else 0.6
                cmd = {"cmd": "drive", "left_mm_s": self.speed, "right_mm_s": self.speed} if done else {"cmd": "arm", "name": "joystick"}
        except (OSError, Closed):
            return  # The rig has ended.

    def end(self):
        self.ended.set()
        self.join(2)


def longest_gap_ms(rig, since_us):
    """The longest time between two setpoints of one wheel on the bus, until now."""
    until_us = now_us()
    gaps = []
    for wheel in (LEFT, RIGHT):
        times = [since_us] + [t_us for t_us, id_, _ in rig.bus.setpoints(since_us) if id_ == wheel and t_us < until_us]
        gaps += [after - before for before, after in zip(times, [*times[1:], until_us], strict=False)]
    return max(gaps) / 1000


def braking_ms(rig, since_us, seconds=2):
    """How long after this time the first setpoint was on the bus that is nearer to zero than the one before it of that wheel."""

    def found():
        last = {}
        for t_us, wheel, speed in rig.bus.setpoints(since_us - RECENT_US):
            if t_us >= since_us and abs(speed) < last.get(wheel, 0):
                return t_us
            last[wheel] = abs(speed)
        return None

    return (until(found, seconds, "the wheels are commanded to brake") - since_us) / 1000
