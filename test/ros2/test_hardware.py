# SPDX-License-Identifier: MIT
"""The logic of iwheel_hardware with the calls of ros2_control and the gateway. system.cpp, its adapter, needs ros2_control: not compiled here."""

import os
import shutil
import signal
import subprocess
import time

from bus import now_us
from jazzy import ROOT, compiled
from judge_log import Event
from scenario import Skip, scenario

HERE = os.path.dirname(os.path.abspath(__file__))
PACKAGE = os.path.join(ROOT, "share", "ros2", "iwheel_hardware")
CLOSED, INACTIVE, ACTIVE = "012"
PATIENT = {"limits": {"wheel_silent_ms": 200, "echo_ms": 200}}


def program(t):
    if shutil.which("c++") is None:
        raise Skip("g++ is missing")
    sources = [os.path.join(PACKAGE, "src", "drive.cpp"), os.path.join(HERE, "hardware_peer.cpp")]
    header = os.path.join(PACKAGE, "include", "iwheel_hardware", "drive.hpp")
    folders = [f"-I{PACKAGE}/include", f"-I{ROOT}/lib/client/include"]
    return compiled(t, "hardware_peer", sources, "-Wall", "-Wextra", "-Werror", *folders, f"{t.build}/lib/client/libiwheel-client.a", newer=[header])


class Hardware:
    """A rig, and a process that acts as the controller manager."""

    def __init__(self, t):
        self.t, self.rig = t, t.rig(PATIENT)
        self.rig.start_gateway()
        self.client = self.rig.client()
        self.child = subprocess.Popen([program(t)], stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True)
        self.end_state = CLOSED

    def call(self, line, state=None, error=None):
        """Makes one call; it must end in this state, with an error that contains these words (None: without an error)."""
        begin_us = now_us()
        self.child.stdin.write(line + "\n")
        self.child.stdin.flush()
        output = self.child.stdout.readline().strip()
        verb = line.split()[0]
        if verb in ("activate", "deactivate", "close"):
            self.rig.timeline.append(Event(begin_us, {"activate": "arm"}.get(verb, "stop"), now_us(), "ok" in output))
        if verb == "cycles" and not line.endswith(" 0 0"):
            self.rig.timeline.append(Event(begin_us, "drive", now_us(), True, 1, 1))
        words = output.split(" ")
        good = "ok" in words
        self.t.check(good == (error is None) and (error is None or error in output), f"{line}: {output}")
        self.t.check(state is None or words[words.index("ok" if good else "error") + 1] == state, f"{line}: {output}")
        return output

    def moving(self, since_us):
        return any(speed for _, _, speed in self.rig.bus.setpoints(since_us))

    def state(self):
        return self.client.request("status")["state"]

    def listening(self):
        self.t.check(self.rig.wait_status(self.client, lambda s: s["state"] == "listening", 6), "silence")

    def close(self):
        self.child.stdin.close()
        self.child.wait(5)


@scenario("hardware interface: configure moves nothing, activate arms, cycles drive, deactivate stops; positions in rad", 20)
def lifecycle(t):
    hardware = Hardware(t)
    begin_us = now_us()
    hardware.call(f"open {hardware.rig.path('gateway.sock')}", INACTIVE)
    hardware.call("cycles 20 5.0 5.0", INACTIVE)
    t.rule(not hardware.moving(begin_us), "an inactive interface drives")
    hardware.call("activate", ACTIVE)
    t.check(hardware.state() == "armed", "armed")
    hardware.call("activate", ACTIVE, "active already")
    output = hardware.call("cycles 75 1.5 1.5", ACTIVE).split(" ")
    t.check(hardware.moving(begin_us) and 0.5 < float(output[0]) < 3.0 and abs(float(output[2]) - 1.5) < 0.4, f"{output}")
    hardware.call("deactivate", INACTIVE)
    hardware.listening()
    before_us = now_us()
    hardware.call("cycles 20 5.0 5.0", INACTIVE)
    t.rule(not hardware.moving(before_us), "the interface drives after deactivate")
    hardware.close()


@scenario("hardware interface: every error ends the lease: NaN, a stop, an e-stop, a wheel offline, a gateway that is killed", 40)
def errors(t):
    hardware = Hardware(t)

    def active():
        hardware.listening()
        time.sleep(0.6)
        hardware.call(f"open {hardware.rig.path('gateway.sock')}", INACTIVE)
        hardware.call("activate", ACTIVE)
        hardware.call("cycles 25 1.0 1.0", ACTIVE)

    for command in ("nan 1.0", "1.0 inf", "1.0 1e9"):
        active()
        hardware.call(f"cycles 2 {command}", CLOSED, "not a number")
    active()
    hardware.client.request("stop")
    hardware.call("cycles 20 1.0 1.0", CLOSED, "stopped: ")
    active()
    hardware.client.request("estop")
    hardware.call("cycles 20 1.0 1.0", CLOSED, "stopped: ")
    hardware.call(f"open {hardware.rig.path('gateway.sock')}", INACTIVE)
    hardware.call("activate", INACTIVE, "reset")
    end = time.monotonic() + 8
    while hardware.state() == "latched" and time.monotonic() < end:
        hardware.client.request("reset")
        time.sleep(0.2)
    active()
    hardware.rig.sim.ask("mute left")
    hardware.call("cycles 60 1.0 1.0", CLOSED, "")
    t.rule(hardware.state() != "armed", "armed with an offline wheel")
    hardware.rig.gateway.signal(signal.SIGKILL)
    hardware.call(f"open {hardware.rig.path('gateway.sock')}", CLOSED, "no gateway")
    hardware.close()


@scenario("hardware interface: a controller manager that hangs or is killed: the lease stops the wheels", 20)
def manager_dies(t):
    for number in (signal.SIGSTOP, signal.SIGKILL):
        hardware = Hardware(t)
        hardware.call(f"open {hardware.rig.path('gateway.sock')}", INACTIVE)
        hardware.call("activate", ACTIVE)
        hardware.call("cycles 40 1.5 1.5", ACTIVE)
        hardware.child.send_signal(number)
        stopped_us = now_us()
        time.sleep(1.5)
        t.rule(not hardware.moving(stopped_us + 700_000), f"{number.name}: the wheels turn")
        if number == signal.SIGSTOP:
            hardware.child.send_signal(signal.SIGCONT)
            hardware.call("cycles 5 1.5 1.5", CLOSED, "")
            t.rule(not hardware.moving(now_us() - 100_000), "it continues to drive")
        hardware.child.kill()
        hardware.child.wait()
