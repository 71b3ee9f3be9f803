# SPDX-License-Identifier: MIT
"""iwheelctl against the running gateway."""

import json
import os
import signal
import sys
import time

from harness import now_us
from scenario import scenario

from .arguments import call


def ctl(rig, *words, **options):
    return call(rig, "iwheelctl", "--socket", rig.path("gateway.sock"), *words, **options)


@scenario("iwheelctl: status, why, drive, stop, estop, reset, tare", 10)
def iwheelctl_verbs(t):
    rig, client = t.running()
    code, text = ctl(rig, "status")
    t.check(code == 0 and "listening" in text.lower() and "left" in text.lower() and "mm/s" in text, f"status: {code}, {text[:300]!r}")
    t.check("\x1b" not in text, "no colours into a pipe")
    code, text = ctl(rig, "--json", "status")
    t.check(code == 0 and json.loads(text)["state"] == "listening", f"--json status: {code}, {text[:100]!r}")
    code, text = ctl(rig, "why")
    t.check(code in (0, 1) and text.strip(), f"why before any stop: {code}, {text!r}")
    begin_us = now_us()
    code, text = ctl(rig, "drive", "300", "300", "--for", "1s", seconds=12)
    t.check(code == 0, f"drive: {code}, {text[-300:]!r}")
    moving = [at for at, _, speed in rig.bus.setpoints(begin_us) if speed]
    t.check(moving and 900_000 <= moving[-1] - moving[0] <= 1_600_000, f"it moved for {((moving[-1] - moving[0]) / 1e6) if moving else 0:.2f} s")
    t.check(rig.bus.speed_rpm(0) in (-2, -1, 0, 1, 2), "the wheels are at standstill when it returns")
    code, text = ctl(rig, "why")
    t.check(code == 0 and "iwheelctl" in text, f"why names the client: {text!r}")
    t.check(ctl(rig, "estop")[0] == 0, "estop")
    code, text = ctl(rig, "drive", "300", "300")
    t.check(code == 1 and "reset" in text, f"drive while latched is refused with the fix: {code}, {text!r}")
    rig.sim.ask("estop press")
    time.sleep(0.1)
    code, text = ctl(rig, "reset")
    t.check(code == 1 and "release" in text.lower(), f"reset while pressed: {code}, {text!r}")
    rig.sim.ask("estop release")
    time.sleep(1.2)
    code, text = ctl(rig, "reset")
    t.check(code == 0, f"reset: {code}, {text!r}")
    t.check(ctl(rig, "stop")[0] == 0 and ctl(rig, "disarm")[0] == 0, "stop and disarm need no lease")
    t.check(client.request("status")["state"] == "listening", "listening at the end")


def interrupted(t, number):
    rig, client = t.running()
    process = rig.launch([rig.program("iwheelctl"), "--socket", rig.path("gateway.sock"), "drive", "300", "300", "--for", "20s"], "ctl.out")
    time.sleep(1.2)
    cut_us = now_us()
    process.signal(number)
    code = process.wait(6)
    if number == signal.SIGKILL:
        time.sleep(0.8)
    t.check(number == signal.SIGKILL or code is not None, "it ends when interrupted")
    ms = t.first_after(rig, cut_us, lambda speed: speed < 300, "the ramp begins", 60)
    moving = [at for at, _, speed in rig.bus.setpoints(cut_us) if speed]
    t.check(not moving or moving[-1] - cut_us < 320_000, f"at zero {(moving[-1] - cut_us) / 1000 if moving else 0:.0f} ms after the signal", True)
    t.figure(f"ramp after {ms or 0:.0f} ms")
    t.silence(rig, client)


@scenario("iwheelctl drive interrupted by Ctrl-C: ends in a stop", 5)
def iwheelctl_interrupted(t):
    interrupted(t, signal.SIGINT)


@scenario("iwheelctl drive killed: ends in a ramp", 5)
def iwheelctl_killed(t):
    interrupted(t, signal.SIGKILL)


@scenario("the example client of docs/user/northbound.md drives the simulator", 6)
def documented_client(t):
    rig, _ = t.running()
    script = example_client()
    if not t.check(script, "docs/user/northbound.md holds a Python client"):
        return
    with open(rig.path("example.py"), "w", encoding="utf-8") as file:
        file.write(script)
    begin_us = now_us()
    process = rig.launch([sys.executable, rig.path("example.py"), rig.path("gateway.sock")], "example.out")
    code = process.wait(8)
    t.check(code == 0, f"exit code {code}: {process.text()[-300:]}")
    t.check(any(speed == 200 for _, _, speed in rig.bus.setpoints(begin_us)), "it drives 200 mm/s")
    t.figure(process.text().strip().replace("\n", ", "))


def example_client():
    """The code block of the documentation, as it is."""
    path = os.path.join(os.path.dirname(__file__), "..", "..", "..", "docs", "user", "northbound.md")
    if not os.path.exists(path):
        return None
    with open(path, encoding="utf-8") as file:
        parts = file.read().split("```python\n")
    return parts[1].split("```")[0] if len(parts) > 1 else None
