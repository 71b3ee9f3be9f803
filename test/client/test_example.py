# SPDX-License-Identifier: MIT
"""The example program of libiwheel-client drives simulated wheels through the real gateway; the wheels stop however the program ends."""

import os
import shutil
import signal
import subprocess
import sys
import time
import unittest

ROOT = os.path.dirname(os.path.dirname(os.path.dirname(os.path.abspath(__file__))))
sys.path[:0] = [os.path.join(ROOT, "python", "tests"), os.path.join(ROOT, "python", "src")]

from rig import BUILD, RigCase, now_us

from iwheel import Gateway

with open(os.path.join(BUILD, "CMakeCache.txt"), encoding="utf-8") as cache:
    SANITIZED = ["-fsanitize=address,undefined"] if "-fsanitize=address,undefined" in cache.read() else []
LEASE_MS = 300  # The rig configures this lease.
RAMP_MS = 200  # The ramp from 200 mm/s at 1500 mm/s2 lasts 133 ms; the rest allows for a busy machine.


class Example(RigCase):
    def start(self, seconds):
        child = subprocess.Popen(
            [os.path.join(BUILD, "lib", "client", "drive_20"), str(seconds)],
            stderr=subprocess.PIPE,
            text=True,
            env={**os.environ, "IWHEEL_SOCKET": self.socket},
        )
        self.addCleanup(child.stderr.close)
        self.addCleanup(child.wait)
        self.addCleanup(child.kill)
        return child

    def speed(self):
        with Gateway(self.socket) as gateway:
            return gateway.status()["left"]["speed_mm_s"] or 0

    def start_driving(self):
        """Starts a drive of ten minutes and waits until the wheel turns at more than 150 mm/s."""
        child = self.start(600)
        self.wait_until(lambda: self.speed() > 150)
        return child

    def cause(self):
        with Gateway(self.socket) as gateway:
            return gateway.why()["cause"]

    def assert_ends(self, child, code, words):
        _, err = child.communicate(timeout=10)
        self.assertEqual(code, child.returncode)
        self.assertIn(words, err)

    def test_example_drives_for_its_time_and_stops(self):
        begin_us = now_us()
        child = self.start(1)
        _, err = child.communicate(timeout=10)
        self.assertEqual((0, ""), (child.returncode, err))
        self.assertEqual("client_stop", self.cause())
        self.assertGreater(self.last_motion_us() - begin_us, 900_000)
        time.sleep(0.3)
        self.assert_stood_by(now_us(), 0)

    def test_example_that_dies_ends_its_lease_with_its_connection(self):
        for number in (signal.SIGKILL, signal.SIGSEGV, signal.SIGABRT, signal.SIGINT, signal.SIGTERM, signal.SIGPIPE):
            child = self.start_driving()
            died_us = now_us()
            child.send_signal(number)
            self.assertIn(child.wait(5), (-number, 1) if SANITIZED else (-number,))  # A sanitizer turns a crash into exit status 1.
            time.sleep(0.7)
            self.assertEqual("client_gone", self.cause(), number)
            self.assert_stood_by(died_us, 60 + RAMP_MS + (500 if SANITIZED else 0))  # A sanitizer first writes its report, and the lease ends meanwhile.

    def test_example_that_is_frozen_loses_its_lease(self):
        child = self.start_driving()
        frozen_us = now_us()
        child.send_signal(signal.SIGSTOP)
        time.sleep(1.0)
        self.assertEqual("lease_lost", self.cause())
        self.assert_stood_by(frozen_us, LEASE_MS + 60 + RAMP_MS)
        time.sleep(1.5)
        thawed_us = now_us()
        child.send_signal(signal.SIGCONT)
        self.assert_ends(child, 1, "arm")  # The gateway refuses the next command and names the remedy.
        self.assertLess(self.last_motion_us(), thawed_us)

    def test_example_when_gateway_restarts_ends_and_moves_nothing(self):
        child = self.start_driving()
        self.rig.kill_gateway(signal.SIGKILL)
        killed_us = now_us()
        self.assert_ends(child, 1, "there is no connection; connect, and arm again")
        self.rig.start_gateway(restart_hold=True)
        time.sleep(0.3)
        self.assertLess(self.last_motion_us(), killed_us + 1000)

    @unittest.skipUnless(shutil.which("c++"), "no C++ compiler (apt-get install g++)")
    def test_program_in_cpp_drives_and_stops(self):
        program = self.rig.path("client")
        library = os.path.join(BUILD, "lib", "client", "libiwheel-client.a")
        source, headers = os.path.join(ROOT, "test", "package", "client.cpp"), os.path.join(ROOT, "lib", "client", "include")
        subprocess.run(["c++", "-std=c++11", "-I", headers, source, library, *SANITIZED, "-o", program], check=True)
        done = subprocess.run([program], capture_output=True, text=True, timeout=10, env={**os.environ, "IWHEEL_SOCKET": self.socket}, check=False)
        self.assertEqual((0, ""), (done.returncode, done.stderr))
        with Gateway(self.socket) as gateway:
            self.assertEqual(("client_stop", "client.cpp"), (gateway.why()["cause"], gateway.why()["client_name"]))

    def test_example_without_or_with_second_gateway_reports_it(self):
        self.start_driving()
        second = self.start(1)
        self.assert_ends(second, 1, "drive_20")  # The message names the client that has the lease.
        self.socket = "/nonexistent/gateway.sock"
        lost = self.start(1)
        self.assert_ends(lost, 1, "no program listens")
