#!/usr/bin/env python3
# SPDX-License-Identifier: MIT
"""Tests what the benchmark of the loop reports when the gateway stops during a measurement, with a fake client.

usage: test/bench/test_loop.py [unittest's arguments]
"""

import sys
import threading
import types
import unittest
from pathlib import Path
from unittest import mock

sys.path.insert(0, str(Path(__file__).resolve().parent))
import loop

STOPPED = {"ok": True, "cause": "stale_frames", "detail": "left wheel", "frames_before": ["x"] * 40, "recording": None}


class Client:
    """A gateway that accepts `drives` commands and then refuses; `why`: its reply to that, or the exception."""

    why, drives = STOPPED, 3

    def __init__(self, _path):
        self.left, self.socket = self.drives, types.SimpleNamespace(shutdown=lambda _how: None)

    def ask(self, cmd, **_fields):
        if cmd == "why":
            if isinstance(self.why, Exception):
                raise self.why
            return self.why
        self.left -= cmd == "drive"
        return {"ok": True} if self.left >= 0 else {"ok": False, "error": "not_holder", "message": "the lease has ended"}

    def close(self):
        pass


def drivers_ended():
    """The figure of a trial that waits, on a machine of any speed, until the clients were refused."""
    for thread in threading.enumerate():
        if thread not in (threading.main_thread(), threading.current_thread()):
            thread.join(10)
    return 1


class Stopped(unittest.TestCase):
    def setUp(self):
        for name, value in (("SETTLE_S", 0.05), ("COMMANDS_S", 1000)):
            patch = mock.patch.object(loop, name, value)
            patch.start()
            self.addCleanup(patch.stop)

    def stop(self, stalls=(), **client):
        """The text of the exception of the trial."""
        pair = types.SimpleNamespace(northbound="none", gateway=types.SimpleNamespace(poll=lambda: None))
        witness = types.SimpleNamespace(stalls=lambda _begin_us, _end_us: list(stalls))
        with self.assertRaises(RuntimeError) as raised:
            loop.trial(pair, type("Made", (Client,), client), "driving", drivers_ended, witness)
        return str(raised.exception)

    def test_gateway_that_stops_is_asked_why(self):
        text = self.stop()
        for what in ("the gateway has stopped", "stale_frames", "left wheel", "not_holder", "the lease has ended"):
            self.assertIn(what, text)
        self.assertNotIn("frames_before", text)

    def test_gateway_that_does_not_answer_is_reported_too(self):
        text = self.stop(why=ConnectionResetError(104, "reset by peer"))
        self.assertIn("does not answer", text)
        self.assertIn("not_holder", text)

    def test_reason_is_reported_although_the_machine_stalled(self):
        self.assertIn("stale_frames", self.stop(stalls=[(0, 1)]))

    def test_gateway_that_goes_on_is_measured(self):
        pair = types.SimpleNamespace(northbound="none")
        self.assertEqual(1, loop.trial(pair, type("Made", (Client,), {"drives": 10**9}), "driving", lambda: 1, None))


if __name__ == "__main__":
    unittest.main()
