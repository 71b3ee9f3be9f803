# SPDX-License-Identifier: MIT
"""Inside the kernel: one CAN interface, simulated wheels, an e-stop line, the gateway, and the measured programs."""

import grp
import os
import signal
import subprocess
import sys
import time

import netdev
from client import Client
from gpio_sim import GpioChip
from harness import as_a_service

HERE = os.path.dirname(os.path.abspath(__file__))
PERIOD_US = 20_000
START_S = 15.0
END_S = 3.0
ARM_TRIES = 200
AWAITED = ("not_at_rest", "stale_command", "cause_present", "send_stalled", "estop_pressed", "wheel_lost", "latched")


class Started:
    """A program that is ended by its process id, and its output. `served`: with the priority of the gateway's service."""

    def __init__(self, command, folder, standard_input=None, environment=None, piped=False, served=False):
        self.words = list(map(str, command))
        self.errors = open(os.path.join(folder, f"{os.path.basename(self.words[0])}.err"), "ab")  # noqa: SIM115
        self.child = subprocess.Popen(
            self.words,
            stdin=standard_input or subprocess.DEVNULL,
            stdout=subprocess.PIPE if piped else subprocess.DEVNULL,
            stderr=self.errors,
            env=environment,
            preexec_fn=as_a_service if served else None,
        )

    def text(self, within_s):
        """All its output until it ends on its own; raises if the lines are incomplete."""
        output, _ = self.child.communicate(timeout=within_s)
        if self.child.returncode != 0:
            with open(self.errors.name, encoding="utf-8", errors="replace") as file:
                raise RuntimeError(f"{self.words[0]} ended with {self.child.returncode}: {file.read()[-500:]}")
        return output.decode()

    def end(self):
        """Sends it the signal to end; returns its output."""
        if self.child.poll() is None:
            self.child.send_signal(signal.SIGTERM)
        try:
            output, _ = self.child.communicate(timeout=END_S)
        except subprocess.TimeoutExpired:
            self.child.kill()
            output, _ = self.child.communicate()
        self.errors.close()
        return (output or b"").decode()


class Surroundings:
    """The surroundings of all measured programs."""

    def __init__(self, plan):
        self.plan, self.folder = plan, os.getcwd()
        self.interface, self.gateway, self.wheels = "vcan0", None, None
        netdev.add_vcan(self.interface)
        with open("/proc/sys/net/core/rmem_max", "w", encoding="ascii") as file:  # The same for all, as the package sets it.
            file.write("4194304")
        self.chip = GpioChip("timed", "ESTOP")
        self.chip.pull(True)
        self.socket = os.path.join(self.folder, "gateway.sock")
        with open("gateway.conf", "w", encoding="ascii") as file:
            file.write(
                "[wheels]\nsetpoint_type = 1\ncurrent_role = limit\ntrack_mm = 540\n[limits]\nwheel_silent_ms = 200\nrest_ms = 50\n"
                "[drive]\nzero_hold_ms = 1100\nlease_ms = 400\nmax_speed_mm_s = 500\n[estop]\nline = ESTOP\nactive = low\n"
                f"[northbound]\nmode = 0600\ngroup = {grp.getgrgid(os.getgid()).gr_name}\n[record]\ndirectory = {self.folder}\n"
            )

    def tool(self, name, *arguments, **options):
        """One of the small programs that measure."""
        return Started([os.path.join(self.plan["tools"], name), *arguments], self.folder, **options)

    def floor(self, name, *arguments, **options):
        """One of the small programs that are measured."""
        return self.tool(f"floor_{name}", *arguments, served=True, **options)

    def peer(self, *command, **options):
        return Started(command, self.folder, served=True, **options)

    def python_can(self, *arguments):
        environment = {**os.environ, "PYTHONPATH": self.plan["peers"]}
        return Started([sys.executable, os.path.join(HERE, "python_can_peer.py"), *arguments], self.folder, environment=environment, piped=True, served=True)

    def built(self, folder, name, *arguments, **options):
        return Started([os.path.join(self.plan["build"], "app", folder, name), *arguments], self.folder, **options)

    def start_wheels(self, slow=1):
        """Telemetry of both wheels, 617 frames a second divided by `slow`."""
        with open("pace", "w", encoding="ascii") as file:
            file.write(f"at 0 slow {slow}\n")
        self.wheels = self.built(
            "sim",
            "iwheel-sim",
            "--quiet",
            "--uptime",
            "120",
            "--can",
            self.interface,
            "--estop",
            f"{self.folder}/button",
            "--control",
            f"{self.folder}/control",
            "--script",
            f"{self.folder}/pace",
        )

    def end_wheels(self):
        if self.wheels is not None:
            self.wheels.end()
            self.wheels = None

    def start_gateway(self, program=None, served=True):
        program = program or os.path.join(self.plan["build"], "app", "gateway", "iwheel-gateway")
        self.gateway = Started(
            [program, "-c", f"{self.folder}/gateway.conf", "--can", self.interface, "--socket", self.socket, "--log-level", "error"], self.folder, served=served
        )
        client = self.client()
        client.request("hello")
        client.close()

    def end_gateway(self):
        if self.gateway is not None:
            self.gateway.end()
            self.gateway = None

    def client(self):
        deadline = time.monotonic() + START_S
        while True:
            try:
                return Client(self.socket, name="bench")
            except OSError:
                if time.monotonic() > deadline:
                    raise
                time.sleep(0.005)

    def arm(self, client):
        """Waits until the wheels are online and at standstill, and nothing is latched."""
        for _ in range(ARM_TRIES):
            reply = client.arm()
            if reply["ok"]:
                return
            if client.request("status")["state"] == "latched":
                client.request("reset")
            time.sleep(0.02)
        raise RuntimeError(f"the gateway cannot be armed: {reply}")
