# SPDX-License-Identifier: MIT
"""Faults at the touch of a key: iwheel-sim on a terminal."""

import json
import os
import signal
import subprocess
import tempfile
import termios
import time
import unittest

from ctl import program, run
from operator_at_terminal import Operator
from trials import until

# Fields of `status` that each key changes, and the new values; a second press restores them.
TOGGLES = {
    "e": lambda s: s["estop"] == "pressed",
    "w": lambda s: s["estop"] == "unplugged",
    "p": lambda s: not s["power"],
    "c": lambda s: s["bus"]["stalled"],
    "a": lambda s: not s["bus"]["ack"],
    "o": lambda s: s["bus"]["off"],
    "i": lambda s: s["bus"]["down"],
    "f": lambda s: s["bus"]["foreign"],
    "m": lambda s: s["left"]["muted"] and not s["right"]["muted"],
    "b": lambda s: s["left"]["blocked"],
    "l": lambda s: s["left"]["load_mN"] == 60000,
}


class Keys(unittest.TestCase):
    def setUp(self):
        folder = tempfile.TemporaryDirectory()
        self.addCleanup(folder.cleanup)
        self.control = os.path.join(folder.name, "control")
        bus, button = f"unix:{folder.name}/bus", os.path.join(folder.name, "button")
        self.command = [program("iwheel-sim"), "--control", self.control, "--can", bus, "--estop", button, "--uptime", "10"]

    def start(self, *words):
        operator = Operator([*self.command, *words], {**os.environ, "TERM": "xterm"})
        self.addCleanup(operator.close)
        operator.expect("commands: iwheel-sim")
        return operator

    def status(self):
        return json.loads(run("--control", self.control, "status", name="iwheel-sim")[1].removeprefix("ok "))

    def wait_for(self, holds, what):
        until(lambda: holds(self.status()), 5, what)

    def test_each_key_injects_reports_and_removes_its_fault(self):
        operator = self.start()
        operator.expect("quit")
        for key, fault in TOGGLES.items():
            self.wait_for(lambda s, f=fault: not f(s), f"healthy before {key}")
            operator.type(key)
            self.wait_for(fault, key)
            printed = operator.expect("\n", 5) + operator.expect("\n", 5)
            self.assertRegex(printed, r"\[ +\d+\.\d{3} s\] [a-z]+ ", key)
            operator.type("?")
            self.assertIn(f"*{key} ", operator.expect("quit"))
            operator.type(key)
            self.wait_for(lambda s, f=fault: not f(s), key)
            operator.expect("\n", 5)
        for key, command in (("n", "loss 20"), ("x", "passive on"), ("r", "reboot right"), ("0", "normal")):
            operator.type(key)
            operator.expect(command)
        operator.type("?")
        self.assertNotIn("*", operator.expect("quit"))
        operator.type("q")
        self.assertEqual(0, operator.wait())
        self.assertIn("ended", operator.text)

    def test_normal_removes_all_and_an_unknown_key_does_nothing(self):
        operator = self.start()
        operator.type("mbeZ$")
        self.wait_for(lambda s: s["left"]["muted"] and s["left"]["blocked"] and s["estop"] == "pressed", "three")
        operator.type("0")
        self.wait_for(lambda s: not s["left"]["muted"] and not s["left"]["blocked"] and s["estop"] == "released", "normal")
        operator.type("m")  # On, not off: "normal" has undone the first one.
        self.wait_for(lambda s: s["left"]["muted"], "again")

    def test_terminal_is_left_as_it_was_also_by_ctrl_c(self):
        for end in ("q", "\x03"):
            operator = self.start()
            operator.expect("quit")
            self.assertFalse(termios.tcgetattr(operator.parent)[3] & termios.ICANON)
            operator.type(end)
            self.assertEqual(0, operator.wait())
            self.assertTrue(termios.tcgetattr(operator.parent)[3] & termios.ICANON, repr(end))
            self.assertTrue(termios.tcgetattr(operator.parent)[3] & termios.ECHO, repr(end))

    def test_without_a_terminal_and_with_no_keys_there_are_none(self):
        for words in (("--no-keys",), ("--quiet",)):
            operator = Operator([*self.command, *words], {**os.environ, "TERM": "xterm"})
            self.addCleanup(operator.close)
            while not os.path.exists(self.control):
                operator.pump(0.02)
            self.assertTrue(termios.tcgetattr(operator.parent)[3] & termios.ICANON, words)
            operator.process.send_signal(signal.SIGTERM)
            self.assertEqual(0, operator.wait())
            self.assertNotIn("bus-off", operator.text)
        piped = subprocess.Popen(self.command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True)
        while not os.path.exists(self.control):
            time.sleep(0.01)
        piped.stdin.write("e")
        piped.stdin.flush()
        self.assertEqual("released", self.status()["estop"])
        piped.terminate()
        self.assertNotIn("bus-off", piped.communicate(timeout=5)[0])
