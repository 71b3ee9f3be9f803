#!/usr/bin/env python3
# SPDX-License-Identifier: MIT
"""What a late machine excuses in real time, and what it does not, tested with an invented file of a witness. Needs no kernel.

Usage: test/kernel/test_verdicts.py
"""

import os
import sys
import tempfile
import unittest
from unittest import mock

HERE = os.path.dirname(os.path.abspath(__file__))
sys.path[:0] = [HERE, os.path.join(os.path.dirname(HERE), "system")]
import kernel_rig
from guest_run import GuestRun, attempt_of
from verdict import RETRIES

BEGIN_US, FAULT_US, END_US = 1_000_000, 3_000_000, 5_000_000
GAP = ["gap: at 2.000 s: 180 ms without a setpoint", "timing", FAULT_US]
REFUSED = ["drive was refused: loop_late", "check", 0]
MOTION = ["nonzero_after_estop: at 2.000 s: left 300 mm/s", "rule", FAULT_US]
UNLATCHED = ["latched expected after a press, it is armed, None", "rule", FAULT_US]
FAST = ["speed: at 2.000 s: 1200 mm/s, 1000 allowed", "rule", FAULT_US]
PAIR = ["pair_spread: at 2.000 s: 17.0 ms between left and right", "timing", FAULT_US]


def plan():
    return {"group": "realtime", "full": False, "build": "/nowhere"}


class Scripted(GuestRun):
    """Each attempt ends with those failures."""

    def __init__(self, *failures):
        super().__init__(plan())
        self.failures, self.attempts = failures, 0

    def work_off(self, name):
        self.attempts += 1
        return attempt_of({"failures": self.failures, "figures": [], "skip": None, "begin_us": BEGIN_US, "end_us": END_US})


class Witnessed(unittest.TestCase):
    def setUp(self):
        self.file = self.enterContext(tempfile.NamedTemporaryFile("w", suffix=".late"))
        kernel_rig.WITNESS["file"] = self.file.name
        self.addCleanup(kernel_rig.WITNESS.update, file=None)

    def late(self, at_us, by_us):
        """The witness woke up at that time, this much too late."""
        self.file.write(f"{at_us} {by_us}\n")
        self.file.flush()

    def outcome(self, *failures):
        run = Scripted(*failures)
        return run.again("made up")[0], run.attempts


class Overslept(unittest.TestCase):
    def test_long_waits_of_the_client_are_stalls_in_real_time_only(self):
        for is_virtual, stalls in ((False, [(5, 161_000)]), (True, [])):
            test = kernel_rig.KernelTest("", None)
            with self.subTest(is_virtual), mock.patch.dict(kernel_rig.CLOCK, virtual=is_virtual):
                test.overslept([(1, 9_000), (5, 161_000)])
                self.assertEqual(stalls, test.stalls)


class Verdicts(Witnessed):
    def test_late_gateway_on_a_quiet_machine_fails_immediately(self):
        for failures in ([GAP], [REFUSED], [GAP, REFUSED], [PAIR]):
            with self.subTest(failures):
                self.assertEqual(("failed", 1), self.outcome(*failures))

    def test_stalled_machine_is_repeated_then_inconclusive(self):
        self.late(FAULT_US, 200_000)
        for failures in ([GAP], [REFUSED], [GAP, REFUSED], [PAIR]):
            with self.subTest(failures):
                self.assertEqual(("inconclusive", RETRIES), self.outcome(*failures))

    def test_repeat_waits_for_a_quiet_second_or_end_of_patience(self):
        clock, run = [10.0], Scripted(GAP)
        self.late(12_000_000, 200_000)
        with mock.patch("verdict.now_us", lambda: int(clock[0] * 1e6)), mock.patch("verdict.time") as time:
            time.monotonic, time.sleep = (lambda: clock[0]), lambda seconds: clock.__setitem__(0, clock[0] + seconds)
            for begin, end in ((10.0, 10.0), (12.1, 13.0), (13.5, 13.5)):
                clock[0] = begin
                run.await_quiet()
                self.assertAlmostEqual(end, clock[0], delta=0.15)
            for at in range(20, 60):
                self.late(at * 1_000_000, 20_000)
            clock[0] = 20.5
            run.await_quiet()
            self.assertAlmostEqual(30.5, clock[0], delta=0.15)

    def test_stalled_machine_excuses_no_motion_no_latch_and_no_form(self):
        self.late(FAULT_US, 200_000)
        for failures in ([MOTION], [UNLATCHED], [FAST], [GAP, MOTION], [REFUSED, UNLATCHED]):
            with self.subTest(failures):
                self.assertEqual(("failed", 1), self.outcome(*failures))

    def test_stall_of_another_test_excuses_nothing(self):
        self.late(END_US + 1_000_000, 200_000)
        self.late(BEGIN_US - 1_000_000, 200_000)
        self.assertEqual(("failed", 1), self.outcome(GAP, REFUSED))

    def test_stall_far_from_a_gap_does_not_excuse_it(self):
        self.late(FAULT_US + 1_000_000, 200_000)
        self.assertEqual(("failed", 1), self.outcome(GAP))

    def test_delay_too_short_to_matter_excuses_nothing(self):
        self.late(FAULT_US, kernel_rig.STALL_US - 1)
        self.assertEqual(("failed", 1), self.outcome(GAP, REFUSED))

    def test_virtual_time_excuses_nothing(self):
        self.late(FAULT_US, 200_000)
        kernel_rig.WITNESS["file"] = None  # There is no witness where no machine is late.
        self.assertEqual(("failed", 1), self.outcome(GAP))


class Presses(Witnessed):
    """Presses during which the machine was late do not count."""

    def excused(self, latency_us, *limit):
        return kernel_rig.KernelTest.excused(FAULT_US, latency_us, *limit)

    def test_late_stop_on_a_quiet_machine_counts(self):
        self.assertFalse(self.excused(30_000))
        self.assertFalse(self.excused(30_000, kernel_rig.LEVEL_US))

    def test_late_stop_on_a_late_machine_does_not(self):
        self.late(FAULT_US + 12_000, 10_000)
        self.assertTrue(self.excused(30_000))
        self.assertTrue(self.excused(30_000, kernel_rig.LEVEL_US))

    def test_stop_in_time_counts_whatever_else_ran(self):
        self.late(FAULT_US + 4_000, 10_000)
        self.assertFalse(self.excused(kernel_rig.ESTOP_US))
        self.assertFalse(self.excused(kernel_rig.LEVEL_US, kernel_rig.LEVEL_US))

    def test_machine_late_after_the_limit_excuses_nothing(self):
        self.late(FAULT_US + 30_000, 10_000)
        self.assertFalse(self.excused(30_000))
        self.assertFalse(self.excused(30_000, kernel_rig.LEVEL_US))


if __name__ == "__main__":
    unittest.main()
