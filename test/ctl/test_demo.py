# SPDX-License-Identifier: MIT
"""The demonstration, interrupted at any moment, leaves nothing behind: no file, no process."""

import concurrent.futures
import contextlib
import os
import re
import shutil
import signal
import socket
import subprocess
import sys
import tempfile
import time
import unittest
from pathlib import Path

import pytest

from free_port import free_port

pytestmark = pytest.mark.native("a signal between two system calls")
ROOT = os.path.abspath(os.path.join(os.path.dirname(os.path.abspath(__file__)), "..", ".."))
BUILD = os.environ["IWHEEL_BUILD"]


IN_A_CALLBACK = """
import os, signal, time
import main
interrupts = main.Interrupts()
os.register_at_fork(before=lambda: os.kill(os.getpid(), signal.SIGINT))
try:
    with interrupts:
        if os.fork() == 0:
            os._exit(0)
        time.sleep(20)
except KeyboardInterrupt:
    print("ended")
"""


def start(name, folder, *words):
    """A demonstration, with a folder for its temporary files."""
    return subprocess.Popen(
        [sys.executable, "-u", os.path.join(ROOT, "app", "demo", name), "--build", BUILD, *words],
        stdin=subprocess.DEVNULL,
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        text=True,
        start_new_session=True,
        env={**os.environ, "TMPDIR": folder},
    )


def play(seconds, signals=(signal.SIGINT,), spacing=0.0, words=("--plain",), begun=True):
    """(exit code, what is left in its temporary folder, its processes that still run, its output). The signals come `seconds` after its first
    line, or after its start if not `begun`."""
    with tempfile.TemporaryDirectory(prefix="d") as folder:
        process = start("main.py", folder, *words)
        first = process.stdout.readline() if begun else ""
        time.sleep(seconds)
        for number in signals:
            with contextlib.suppress(ProcessLookupError):
                os.killpg(process.pid, number)  # As a terminal does: to all of them.
            time.sleep(spacing)
        output = first + process.communicate(timeout=60)[0]
        return process.returncode, os.listdir(folder), still_running(process.pid), output


def still_running(session, seconds=3.0):
    """What is left of the session after a moment: the gateway's own helpers see that it is gone and end."""
    end = time.monotonic() + seconds
    while True:
        found = subprocess.run(["pgrep", "--session", str(session)], capture_output=True, text=True, check=False).stdout.split()
        if not found or time.monotonic() > end:
            return found
        time.sleep(0.05)


class Interrupted(unittest.TestCase):
    def all_clean(self, plays):
        with concurrent.futures.ThreadPoolExecutor(3) as pool:
            for what, (code, left, running, said) in pool.map(lambda p: (p, play(**p)), plays):
                self.assertEqual(([], []), (left, running), (what, said[-600:]))
                stalled = code == 1 and "This machine was stalled" in said  # It ended on its own, with this reason, before the signal.
                if what.get("begun", True) and not stalled:  # Before its first line Python may not have started: it can swallow the signal.
                    self.assertIn(code, (130, -signal.SIGINT), (what, said[-600:]))
                    self.assertNotIn("Traceback", said)

    def test_ctrl_c_at_any_moment_leaves_nothing(self):
        self.all_clean([{"seconds": at, "begun": False} for at in (0, 0.05, 0.1, 0.15, 0.2, 0.25, 0.3, 0.4)])
        self.all_clean([{"seconds": at} for at in (0, 0.02, 0.1, 0.4, 1, 3.5, 6.5, 10.5)])

    def test_impatient_ctrl_c_leaves_nothing_either(self):
        self.all_clean([{"seconds": at, "signals": (signal.SIGINT,) * 6, "spacing": 0.07, "begun": at > 0.1} for at in (0.1, 0.15, 0.8, 4.5)])

    def test_other_signals_that_end_it(self):
        for code, left, running, said in (play(3.0, (number,)) for number in (signal.SIGTERM, signal.SIGHUP)):
            self.assertEqual((130, [], []), (code, left, running), said)

    def test_ctrl_c_in_a_callback_of_fork_ends_it(self):
        demo = os.path.join(ROOT, "app", "demo")
        done = subprocess.run([sys.executable, "-c", IN_A_CALLBACK], cwd=demo, capture_output=True, text=True, timeout=30, check=False)
        self.assertEqual(("ended\n", ""), (done.stdout, done.stderr))

    def play_with(self, program):
        """What comes of it when the programs are this script, and nothing is left behind."""
        with tempfile.TemporaryDirectory(prefix="d") as folder:
            os.makedirs(os.path.join(folder, "build", "bin"))
            os.makedirs(os.path.join(folder, "tmp"))
            for name in ("iwheel-sim", "iwheel-gateway", "iwheelctl"):
                path = Path(folder, "build", "bin", name)
                path.write_text("#!/bin/sh\n" + program, encoding="ascii")
                path.chmod(0o755)
            done = subprocess.run(
                [sys.executable, os.path.join(ROOT, "app", "demo", "main.py"), "--build", os.path.join(folder, "build")],
                capture_output=True,
                text=True,
                timeout=30,
                check=False,
                stdin=subprocess.DEVNULL,
                env={**os.environ, "TMPDIR": os.path.join(folder, "tmp")},
            )
            self.assertEqual([], os.listdir(os.path.join(folder, "tmp")), done.stdout + done.stderr)
            return done

    def test_simulator_that_does_not_start_leaves_nothing(self):
        done = self.play_with("exit 1\n")
        self.assertEqual(1, done.returncode, done.stdout + done.stderr)
        self.assertIn("the simulator does not start", done.stderr)

    def test_ctrl_c_that_ends_the_simulator_first_is_no_failure(self):
        done = self.play_with("kill -INT $PPID\nexit 1\n")
        self.assertEqual(130, done.returncode, done.stdout + done.stderr)
        self.assertNotIn("FAILED", done.stderr)


class Others(unittest.TestCase):
    """The demonstrations that run until Ctrl-C."""

    def setUp(self):
        self.folder = tempfile.mkdtemp(prefix="d")
        self.addCleanup(shutil.rmtree, self.folder)
        self.port, self.busy_port = free_port(), free_port()

    def start(self, name, *words):
        process = start(name, self.folder, *words)
        self.addCleanup(process.stdout.close)
        self.addCleanup(process.wait)
        self.addCleanup(process.kill)
        return process

    def test_web_names_the_socket_drives_and_leaves_nothing(self):
        if not os.path.exists(os.path.join(BUILD, "app", "bridge", "web", "iwheel-web")):
            self.skipTest("iwheel-web is not built")
        for number, expected in ((signal.SIGINT, 0), (signal.SIGHUP, 129), (signal.SIGTERM, 143)):
            process = self.start("web.py", "--port", str(self.port))
            said = ""
            while "Ctrl-C ends it." not in said:
                line = process.stdout.readline()
                self.assertTrue(line, said)
                said += line
            self.assertIn(f":{self.port}/", said)
            path = re.search(r"export IWHEEL_SOCKET=(\S+)", said).group(1)
            drive = re.search(r"^ +(\S*iwheelctl drive \d+ \d+) --for 3s$", said, re.MULTILINE).group(1)
            done = subprocess.run([*drive.split(), "--for", "500ms"], env={**os.environ, "IWHEEL_SOCKET": path}, cwd=os.getcwd(), timeout=30, check=False)
            self.assertEqual(done.returncode, 0)
            os.killpg(process.pid, number)
            time.sleep(0.05)
            with contextlib.suppress(ProcessLookupError):
                os.killpg(process.pid, number)  # An impatient person.
            self.assertEqual(process.wait(20), expected)
            self.assertEqual(([], []), (os.listdir(self.folder), still_running(process.pid)))

    def test_port_in_use_is_named_with_its_fix(self):
        with socket.socket() as one:
            one.bind(("127.0.0.1", self.busy_port))
            one.listen()
            for name, option in (("web.py", "--web"), ("fleet.py", "--fleet")):
                process = self.start(name, "--port", str(self.busy_port))
                said = process.communicate(timeout=20)[0]
                self.assertEqual(process.returncode, 1, said)
                self.assertIn(f"port {self.busy_port} is not free", said)
                self.assertIn(f"./demo {option} --port N", said)
        self.assertEqual([], os.listdir(self.folder))

    def test_options_without_effect_are_refused(self):
        for words, said in (
            (("--port", "8000"), "--port is for"),
            (("--web", "--port", "70000"), "1 to 65534"),
            (("--ros", "--keep"), "--keep is for"),
            (("--mcu", "--plain"), "leave out --plain"),
            (("--plain", "--web"), "leave out --plain"),
            (("--lan",), "./demo --web --lan"),
            (("--fleet", "--lan"), "./demo --web --lan"),
            (("--ros", "--web"), "all but one of"),
        ):
            done = subprocess.run([os.path.join(ROOT, "demo"), *words], capture_output=True, text=True, timeout=20, check=False)
            self.assertEqual(done.returncode, 64, (words, done.stderr))
            self.assertIn(said, done.stderr)
