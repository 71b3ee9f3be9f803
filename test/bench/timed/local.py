# SPDX-License-Identifier: MIT
"""Floor and gateway in turns on the machine's own kernel, over the local bus: the same small programs as on vcan, with real system calls."""

import itertools
import statistics
import subprocess
import threading
import time
from pathlib import Path

from growth import percentile

PERIOD_US = 20_000
ROUNDS = 3
COUNT = 150
PERIOD_S = 3.0
DRIVE = '{"id":1,"cmd":"drive","left_mm_s":%d,"right_mm_s":%d}'
ARM = '{"id":1,"cmd":"arm","name":"bench"}'


def wait_for(path, within_s=10.0):
    deadline = time.monotonic() + within_s
    while not path.exists() and time.monotonic() < deadline:
        time.sleep(0.01)
    time.sleep(0.1)


def start_wheels(build, prefix):
    """A simulator with its bus, e-stop and control socket at these paths."""
    sockets = ["--can", f"unix:{prefix}bus", "--estop", f"{prefix}estop", "--control", f"{prefix}control"]
    return subprocess.Popen([build / "app/sim/iwheel-sim", "--quiet", "--uptime", "120", *sockets])


class Local:
    """`pair` is the benchmark's gateway and simulator; the floor runs on a separate bus with separate wheels."""

    def __init__(self, pair, tools):
        self.pair, self.tools = pair, Path(tools)
        self.bus = f"unix:{pair.folder}/floor-bus"
        self.wheels = start_wheels(pair.build, f"{pair.folder}/floor-")
        wait_for(Path(self.bus[5:]))

    def end(self):
        self.wheels.terminate()
        self.wheels.wait()

    def run(self, name, *arguments):
        done = subprocess.run([self.tools / name, *map(str, arguments)], stdout=subprocess.PIPE, text=True, check=True, timeout=120)
        return [int(line) / 1000 for line in done.stdout.split()]

    def start_next(self, name, *arguments):
        return subprocess.Popen([self.tools / name, *map(str, arguments)])

    def line_floor(self):
        path = Path(f"{self.pair.folder}/line.{time.monotonic_ns()}")
        floor = self.start_next("floor_line", self.bus, path)
        wait_for(path)
        try:
            return self.run("ask_line", self.bus, path, COUNT, "50 50", "60 60")
        finally:
            floor.terminate()
            floor.wait()

    def line_gateway(self):
        return self.run("ask_line", f"unix:{self.pair.folder}/bus", self.pair.northbound, COUNT, DRIVE % (50, 50), DRIVE % (60, 60), ARM)

    def off_period(self, bus):
        at = self.run("stamps", bus, "10A", PERIOD_S)
        return [abs(b - a - PERIOD_US) for a, b in itertools.pairwise(at)]

    def period_floor(self):
        floor = self.start_next("floor_period", self.bus, PERIOD_US)
        try:
            return self.off_period(self.bus)
        finally:
            floor.terminate()
            floor.wait()

    def period_gateway(self, client):
        client.ask(cmd="arm", name="bench")
        client.ask(cmd="drive", left_mm_s=100, right_mm_s=100)
        quit_it = threading.Event()

        def renew():
            while not quit_it.wait(0.05):
                client.ask(cmd="drive", left_mm_s=100, right_mm_s=100)

        thread = threading.Thread(target=renew)
        thread.start()
        time.sleep(0.5)
        try:
            return self.off_period(f"unix:{self.pair.folder}/bus")
        finally:
            quit_it.set()
            thread.join()


def settle(client):
    """Waits until the gateway can be armed again."""
    client.ask(cmd="stop")
    for _ in range(200):
        time.sleep(0.05)
        status = client.ask(cmd="status")
        if status["state"] == "latched":
            client.ask(cmd="reset")
        if status["state"] == "listening" and status["left"]["at_rest"] and status["right"]["at_rest"]:
            return


def figures(values):
    return {"p50": percentile(values, 50), "p90": percentile(values, 90)}


def one_round(local, client, measured):
    settle(client)
    measured["period"]["floor"].append(figures(local.period_floor()))
    measured["period"]["gateway"].append(figures(local.period_gateway(client)))
    settle(client)
    measured["line"]["floor"].append(figures(local.line_floor()))
    measured["line"]["gateway"].append(figures(local.line_gateway()))


def measure(pair, client_type, tools, rounds=ROUNDS):
    """{metric: {"floor" or "gateway": [figures of each round]}}. A round in which the gateway stopped because it was late does not count."""
    local, measured = Local(pair, tools), {"line": {"floor": [], "gateway": []}, "period": {"floor": [], "gateway": []}}
    client = client_type(pair.northbound)
    try:
        for _ in range(rounds):
            one = {name: {"floor": [], "gateway": []} for name in measured}
            try:
                one_round(local, client, one)
            except subprocess.CalledProcessError as error:
                print(f"a round is left out: {error}")
                continue
            for name, of in one.items():
                for who, values in of.items():
                    measured[name][who] += values
    finally:
        client.close()
        local.end()
    return measured


def rows(measured):
    """(metric, figure, goal): medians of the rounds' ratios to the floor."""
    for name, key, words, goal in (
        ("period", "p50", "setpoint period, deviation p50", "≤ 1.4 ×"),
        ("line", "p50", "client's line to frame on the bus, p50", "≤ 1.2 ×"),
        ("line", "p90", "client's line to frame on the bus, p90", "≤ 1.4 ×"),
    ):
        of = measured[name]
        if of["floor"]:
            ratio = statistics.median(mine[key] / max(floor[key], 0.5) for mine, floor in zip(of["gateway"], of["floor"], strict=True))
            floor_us = statistics.median(figures[key] for figures in of["floor"])
            yield (words, f"{ratio:.2f} × floor ({floor_us:.0f} µs)", goal)
