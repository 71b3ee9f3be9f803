# SPDX-License-Identifier: MIT
"""Processes of the demonstration besides gateway and simulator: the joystick program, and a sleeper that measures the load of the machine."""

import os
import subprocess
import sys
import threading
import time

HERE = os.path.dirname(os.path.abspath(__file__))
sys.path.insert(0, os.path.join(HERE, "..", "..", "test", "system"))
from harness import as_a_service, die_with_parent


class Sleeper(threading.Thread):
    """Sleeps 5 ms again and again. The lateness of its wake-ups shows how busy the machine is."""

    def __init__(self):
        super().__init__(daemon=True)
        self.worst_s = 0.0
        self.start()

    def run(self):
        while True:
            before = time.monotonic()
            time.sleep(0.005)
            self.worst_s = max(self.worst_s, time.monotonic() - before - 0.005)


def prepare():
    die_with_parent()
    as_a_service()


class Driver:
    """The joystick program, in a process of its own."""

    def __init__(self, rig, number):
        self.output = rig.path(f"driver{number}.out")
        with open(self.output, "wb") as file:
            self.child = subprocess.Popen(
                [sys.executable, os.path.join(HERE, "driver.py"), rig.path("gateway.sock")], stdin=subprocess.PIPE, stdout=file, stderr=file, preexec_fn=prepare
            )

    def want(self, left, right):
        try:
            self.child.stdin.write(f"{left} {right}\n".encode())
            self.child.stdin.flush()
        except BrokenPipeError as error:
            raise RuntimeError("the joystick program has ended: " + (self.text().splitlines() or ["without output"])[-1]) from error

    def text(self):
        with open(self.output, encoding="utf-8") as file:
            return file.read()

    def end(self):
        if self.child.poll() is None:
            self.child.kill()
        self.child.wait()
