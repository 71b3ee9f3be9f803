# SPDX-License-Identifier: MIT
"""iwheelctl doctor on interfaces of a real kernel: what it finds, and the command that fixes it, which the test then runs."""

import json
import subprocess
import time

import netdev
from catalogue import kernel_test
from kernel_rig import SlcanRig


def doctor(rig, *words, meanwhile=None):
    """(exit code, {check: first finding}); `meanwhile` is called while it listens."""
    command = [rig.program("iwheelctl"), "--socket", rig.path("gateway.sock"), "--json", "doctor", *words]
    process = subprocess.Popen(command, stdin=subprocess.DEVNULL, stdout=subprocess.PIPE, text=True)
    if meanwhile:
        time.sleep(1.0)
        meanwhile()
    output, _ = process.communicate()
    checks = {}
    for finding in json.loads(output)["findings"]:
        checks.setdefault(finding["check"], finding)
    return process.returncode, checks


def expect(t, checks, check, verdict, text, fix=""):
    finding = checks.get(check, {"verdict": "missing", "text": "", "cure": ""})
    good = finding["verdict"] == verdict and text in finding["text"] and fix in (finding["cure"] or "")
    t.check(good, f"{check}: {verdict}, {text!r}, {fix!r} expected, found {finding}")


@kernel_test("doctor without a gateway: interface, e-stop line, the command that fixes it", "bus", 0)
def doctor_on_vcan(t):
    rig = t.rig()
    time.sleep(0.6)
    line = ("--config", rig.path("gateway.conf"), "--estop", rig.estop_line())
    code, checks = doctor(rig, rig.interface, *line)
    t.check(code == 0, f"exit code {code}: {checks}")
    expect(t, checks, "kernel", "ok", "CAN sockets are available")
    expect(t, checks, "interface", "ok", "is up")
    expect(t, checks, "left_wheel", "ok", "speed")
    expect(t, checks, "right_wheel", "ok", "pose")
    expect(t, checks, "load", "ok", "%")
    expect(t, checks, "echo", "warn", "unproven", "IFF_ECHO")
    expect(t, checks, "estop", "ok", "released")
    _, checks = doctor(rig, rig.interface, *line, meanwhile=lambda: rig.chip.pull(rig.active == "high"))
    expect(t, checks, "estop", "ok", "pressed")
    rig.release()
    netdev.down(rig.interface)
    code, checks = doctor(rig, rig.interface, *line)
    t.check(code == 1, f"down: exit code {code}")
    expect(t, checks, "interface", "fail", "is down", f"ip link set {rig.interface} up")
    netdev.command(*checks["interface"]["cure"].split())
    code, checks = doctor(rig, rig.interface, *line)
    expect(t, checks, "interface", "ok", "is up")
    _, checks = doctor(rig, "vcan77", "--estop", "none")
    expect(t, checks, "interface", "fail", "no such interface", "ip -brief link")
    _, checks = doctor(rig, "lo", "--estop", "none")
    expect(t, checks, "interface", "fail", "not a CAN interface")
    _, checks = doctor(rig, rig.interface, "--estop", "NO_SUCH_LINE")
    expect(t, checks, "estop", "fail", "counts as pressed", "gpioinfo")
    t.rule(not rig.bus.setpoints(), "nothing was sent")


@kernel_test("doctor on an adapter without bit timing: reported as unproven, next to a gateway too", "adapter", 0, SlcanRig, pace=1)
def doctor_on_an_adapter(t):
    rig = t.rig()
    time.sleep(0.6)
    _, checks = doctor(rig, rig.adapter.interface, "--estop", "none")
    expect(t, checks, "bit_timing", "warn", "wanted 1000000 bit/s, 62.5 %", "sample-point 0.625")
    expect(t, checks, "left_wheel", "ok", "speed 2")
    rig.start_gateway()
    _, checks = doctor(rig)
    expect(t, checks, "gateway", "ok", f"serves {rig.adapter.interface}")
    t.rule(not rig.bus.setpoints(), "nothing was sent")
