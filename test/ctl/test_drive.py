# SPDX-License-Identifier: MIT
"""iwheelctl drive with the real gateway and simulated wheels that a hand pushes."""

import subprocess
import time
import unittest

import ctl
from harness import Rig
from verdict import hold

GENEROUS = {"limits": {"echo_ms": 200, "wheel_silent_ms": 200}, "drive": {"lease_ms": 300}}  # These tests do not judge how late the gateway may be.


class Pushed(unittest.TestCase):
    """`iwheelctl drive` waits while a hand pushes the wheels."""

    def setUp(self):
        self.rig = Rig(ctl.BUILD, GENEROUS)
        self.addCleanup(self.rig.close)
        self.rig.start_gateway()
        self.other = self.rig.client("other")

    def push(self):
        self.hand = self.rig.hand()
        self.addCleanup(self.hand.let_go)
        self.rig.wait_status(self.other, lambda status: not status["left"]["at_rest"])

    def drive(self):
        """The process, once it waits for standstill of wheels that are pushed."""
        self.push()
        command = [ctl.program(), "--socket", self.rig.path("gateway.sock"), "drive", "200", "200", "--for", "300ms"]
        process = subprocess.Popen(command, stdin=subprocess.DEVNULL, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, env=ctl.environment())
        self.addCleanup(process.communicate)
        self.addCleanup(process.kill)
        self.assertIn("waiting for one second at most, because", process.stderr.readline())
        return process

    def moved(self):
        return [speed for _, _, speed in self.rig.bus.setpoints() if speed != 0]

    def test_drive_that_waits_begins_once_wheels_are_at_rest(self):
        process = self.drive()
        self.hand.let_go()
        _, err = process.communicate(timeout=10)
        self.assertEqual(0, process.returncode, err)
        self.assertTrue(self.moved())

    def test_stop_of_another_client_ends_a_drive_that_waits(self):
        for cmd in ("stop", "estop"):
            process = self.drive()
            self.assertTrue(self.other.request(cmd)["ok"])
            self.hand.let_go()
            _, err = process.communicate(timeout=10)
            hold(not self.moved(), f"{cmd} was undone: {self.moved()[:1]} mm/s")
            self.assertEqual(1, process.returncode, err)
            self.assertRegex(err, r"refused \(stale_command\): the wheels were stopped after t_us of this request, \d+ ms ago; read why")
            time.sleep(1.0)
            hold(not self.moved(), f"{cmd} was undone: {self.moved()[:1]} mm/s")
