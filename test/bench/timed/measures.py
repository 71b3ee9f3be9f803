# SPDX-License-Identifier: MIT
"""Inside the kernel: the measures. Each measure has candidates, and each candidate is one turn: it returns figures."""

import contextlib
import itertools
import os
import re
import subprocess
import threading
import time

from can_bus import CanBus
from gpio_sim import FALLING, Edges
from harness import as_a_service
from surroundings import PERIOD_US, START_S


def percentile(values, percent):
    ordered = sorted(values)
    if not ordered:
        raise RuntimeError("nothing was measured")
    return ordered[min(len(ordered) - 1, int(len(ordered) * percent / 100))]


def numbers(text):
    return [int(line) for line in text.split()]


class Renewal(threading.Thread):
    """Renews the lease with the same command, so only the period causes setpoints."""

    def __init__(self, client):
        super().__init__(daemon=True)
        self.client, self.quit = client, threading.Event()
        self.start()

    def run(self):
        while not self.quit.wait(0.1):
            self.client.drive(100, 100)

    def end(self):
        self.quit.set()
        self.join()


class Insistence(Renewal):
    """The same, and armed again after each stop: on a machine with other load the loop is late at times."""

    def run(self):
        while not self.quit.wait(0.1):
            if not self.client.drive(100, 100)["ok"]:
                if self.client.request("status")["state"] == "latched":
                    self.client.request("reset")
                self.quit.wait(0.6)  # so that no drive is stale
                self.client.arm()


@contextlib.contextmanager
def driven(around, program=None, served=True, renewal=Renewal):
    """A separate gateway that a client drives meanwhile."""
    around.start_gateway(program, served)
    client = around.client()
    around.arm(client)
    client.drive(100, 100)
    thread = renewal(client)
    try:
        yield
    finally:
        thread.end()
        client.request("stop")
        client.close()
        around.end_gateway()


# Computes for some milliseconds, then sleeps: the machine delays a guest that computes all the time.
WORK = "while :; do i=0; while [ $i -lt 3000 ]; do i=$((i+1)); done; sleep 0.02; done"


def as_a_hog():
    """Hogs with the gateway's priority delay the loop, and it stops."""
    os.setpriority(os.PRIO_PROCESS, 0, 0)


@contextlib.contextmanager
def busy(command, count, setup=None):
    """So many hogs meanwhile."""
    hogs = [subprocess.Popen(["sh", "-c", command], preexec_fn=setup) for _ in range(count)]
    try:
        yield
    finally:
        for hog in hogs:
            hog.kill()
            hog.wait()


class Measure:
    """Calls `turn(candidate)` for one candidate after the other, round after round."""

    candidates = ()

    def __init__(self, around):
        self.around, self.plan = around, around.plan

    def begin(self):
        """Called before the first turn."""

    def end(self):
        self.around.end_gateway()
        self.around.end_wheels()

    def turn(self, candidate):
        return getattr(self, candidate)()


class Period(Measure):
    """Deviation of the period of setpoint pairs, and its mean error."""

    candidates = ("floor", "gateway", "bcm", "cangen", "python_can")
    slow = 10

    def begin(self):
        self.around.start_wheels(self.slow)

    def judge(self, process=None):
        """Reads the kernel's stamps of the left setpoint; returns the deviations of their distances in microseconds."""
        stamps = numbers(self.around.tool("stamps", self.around.interface, "10A", self.plan["period_s"], piped=True).text(60))
        if process is not None:
            process.end()
        gaps = [(b - a) / 1000 for a, b in itertools.pairwise(stamps)]
        if len(gaps) < self.plan["period_s"] * 1e6 / PERIOD_US * 0.8:
            raise RuntimeError(f"{len(gaps)} pairs in {self.plan['period_s']} s")
        off = [abs(gap - PERIOD_US) for gap in gaps]
        mean_us = (stamps[-1] - stamps[0]) / 1000 / len(gaps)
        return {"p50": percentile(off, 50), "p99": percentile(off, 99), "ppm": (mean_us / PERIOD_US - 1) * 1e6}

    def floor(self):
        return self.judge(self.around.floor("period", self.around.interface, PERIOD_US))

    def bcm(self):
        return self.judge(self.around.tool("bcm_period", self.around.interface, PERIOD_US, served=True))

    def cangen(self):
        return self.judge(self.around.peer("cangen", self.around.interface, "-g", "20", "-I", "10A", "-L", "5", "-D", "0100640000"))

    def python_can(self):
        return self.judge(self.around.python_can("period", self.around.interface, PERIOD_US))

    def gateway(self):
        with driven(self.around):
            time.sleep(0.7)
            return self.judge()


class PeriodLoaded(Period):
    """The same next to the telemetry of both wheels at its nominal rate."""

    slow = 1


def processor_ns(pid):
    """Processor time of a process by its own clock: the ticks in /proc are charged to the process that runs at the tick."""
    return time.clock_gettime_ns((~pid << 3) | 2)  # clock_getcpuclockid(3) of Linux


class Flood(Measure):
    """A full bus of shortest frames: lost frames, and a receiver's share of the processor."""

    candidates = ("floor", "gateway", "candump")
    rate = 21000

    def send(self, pid):
        """Sent frames, and the processor time of a receiver meanwhile."""
        time.sleep(0.3)
        before = processor_ns(pid)
        sent = int(self.around.tool("flood", self.around.interface, self.rate, self.plan["flood_s"], piped=True).text(60))
        time.sleep(0.2)
        return sent, processor_ns(pid) - before

    def floor(self):
        receiver = self.around.floor("receive", self.around.interface, piped=True)
        sent, used = self.send(receiver.child.pid)
        return {"processor_ns": used, "sent": sent, "lost": sent - int(receiver.end())}

    def received(self):
        client = self.around.client()
        count = client.request("status")["counters"]["received"]
        client.close()
        return count

    def gateway(self):
        self.around.start_gateway()
        before = self.received()
        sent, used = self.send(self.around.gateway.child.pid)
        lost = sent - (self.received() - before)
        self.around.end_gateway()
        return {"processor_ns": used, "sent": sent, "lost": lost}

    def candump(self):
        with open("candump.log", "wb") as log:
            receiver = subprocess.Popen(["candump", "-L", self.around.interface], stdout=log, stderr=subprocess.DEVNULL, preexec_fn=as_a_service)
            sent, used = self.send(receiver.pid)
            receiver.terminate()
            receiver.wait()
        with open("candump.log", "rb") as log:
            lines = sum(block.count(b"\n") for block in iter(lambda: log.read(1 << 20), b""))
        return {"processor_ns": used, "sent": sent, "lost": sent - lines}


class FloodLoaded(Flood):
    """The same on a machine with other load: a receiver with a small buffer loses frames while it waits for the processor."""

    hogs = 4

    def turn(self, candidate):
        with busy("while :; do :; done", self.hogs):
            return super().turn(candidate)


class Pair(Measure):
    """Delay of the right setpoint after the left one, next to hogs and programs that every frame wakes: for this build, and for an earlier program."""

    candidates = ("before", "gateway")
    hogs, receivers = 2, 4

    def begin(self):
        """Pairs come every 5 ms, so there are enough of them. The driving client and the wheels have the gateway's priority: they must not stop it."""
        as_a_service()
        self.around.start_wheels()
        with open("gateway.conf", encoding="ascii") as file:
            text = file.read()
        with open("gateway.conf", "w", encoding="ascii") as file:
            file.write(text.replace("[drive]\n", "[drive]\nperiod_ms = 5\n"))

    def judge(self):
        gaps = numbers(self.around.tool("pair_stamps", self.around.interface, self.plan["pair_s"], piped=True).text(self.plan["pair_s"] + 30))
        return {"gaps_ns": gaps}

    def drive(self, program):
        with driven(self.around, program, renewal=Insistence), busy(WORK, self.hogs, as_a_hog):
            others = [self.around.tool("floor_receive", self.around.interface) for _ in range(self.receivers)]
            try:
                return self.judge()
            finally:
                for other in others:
                    other.end()

    def before(self):
        return self.drive(self.plan["before"])

    def gateway(self):
        return self.drive(None)


class Calls(Measure):
    """System calls per frame of the wheels' telemetry; reading a clock is none if the kernel maps it."""

    candidates = ("driving", "gateway", "attended", "candump", "python_can")

    def begin(self):
        self.around.start_wheels()
        time.sleep(0.5)

    def driving(self):
        """The gateway while a client drives."""
        with driven(self.around):
            time.sleep(0.7)
            return self.trace(self.around.gateway.child.pid)

    def trace(self, pid):
        seconds = self.plan["calls_s"]
        trace = subprocess.Popen(["strace", "-f", "-c", "-q", "-p", str(pid)], stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True)
        time.sleep(0.3)
        counter = self.around.tool("floor_receive", self.around.interface, piped=True)
        time.sleep(seconds)
        trace.send_signal(2)
        frames = int(counter.end())
        calls = {name: int(count) for count, name in re.findall(r"^\s*[\d.]+\s+[\d.]+\s+\d+\s+(\d+)\s+(?:\d+\s+)?(\w+)$", trace.communicate()[1], re.M)}
        calls.pop("total", None)
        calls.pop("clock_gettime", None)
        return {"per_frame": sum(calls.values()) / frames * (seconds / (seconds + 0.3)), "frames": frames, "calls": calls}

    def of(self, process):
        time.sleep(0.5)
        try:
            return self.trace(process.child.pid)
        finally:
            process.end()

    def gateway(self):
        self.around.start_gateway()
        time.sleep(1.0)
        try:
            return self.trace(self.around.gateway.child.pid)
        finally:
            self.around.end_gateway()

    def attended(self):
        """The gateway while a client is connected and watches no frames."""
        self.around.start_gateway()
        client = self.around.client()
        time.sleep(1.0)
        try:
            return self.trace(self.around.gateway.child.pid)
        finally:
            client.close()
            self.around.end_gateway()

    def candump(self):
        return self.of(self.around.peer("candump", self.around.interface))

    def python_can(self):
        process = self.around.python_can("receive", self.around.interface)
        process.child.stdout.readline()
        return self.of(process)


class Line(Measure):
    """Time from a client's line to the frame on the bus."""

    candidates = ("floor", "gateway", "looks", "python_can", "cansend")
    lines = ("50 50", "60 60")

    def begin(self):
        self.around.start_wheels(10)
        time.sleep(0.5)

    def ask(self, path, *first, lines=lines):
        asked = self.around.tool("ask_line", self.around.interface, path, self.plan["count"], *lines, *first, piped=True)
        return self.judge(asked.text(120))

    def judge(self, text):
        values = [value / 1000 for value in numbers(text)]
        return {"p50": percentile(values, 50), "p90": percentile(values, 90), "count": len(values)}

    def at_socket(self, start):
        path = f"{self.around.folder}/line.{time.monotonic_ns()}"
        process = start(path)
        deadline = time.monotonic() + START_S
        while not os.path.exists(path) and time.monotonic() < deadline:
            time.sleep(0.01)
        time.sleep(0.1)
        try:
            return self.ask(path)
        finally:
            process.end()

    def floor(self):
        return self.at_socket(lambda path: self.around.floor("line", self.around.interface, path))

    def looking(self, *path, **options):
        """The leanest program that reads bus and e-stop before it acts, as the gateway does."""
        chip = self.around.chip
        return self.around.floor("looks", self.around.interface, f"/dev/{chip.chip}", chip.OFFSET, *path, **options)

    def looks(self):
        return self.at_socket(self.looking)

    def python_can(self):
        return self.at_socket(lambda path: self.around.python_can("line", self.around.interface, path))

    def cansend(self):
        count = max(self.plan["count"] // 5, 5)
        return self.judge(
            self.around.tool("ask_program", self.around.interface, count, "cansend", self.around.interface, "10A#0100640000", piped=True).text(120)
        )

    def gateway(self):
        self.around.start_gateway()
        time.sleep(0.7)
        try:
            drive = '{"id":1,"cmd":"drive","left_mm_s":%d,"right_mm_s":%d}'
            return self.ask(self.around.socket, '{"id":1,"cmd":"arm","name":"bench"}', lines=[drive % (v, v) for v in (50, 60)])
        finally:
            self.around.end_gateway()


class Reported(Line):
    """Time from a frame on the bus to the line at a client."""

    candidates = ("floor", "gateway", "looks", "candump")

    def begin(self):
        """There are no wheels: the awaited frame is the only one."""

    def piped(self, process):
        time.sleep(0.2)
        asking = self.around.tool("ask_frame", self.around.interface, self.plan["count"], standard_input=process.child.stdout, piped=True)
        text = asking.text(120)
        process.child.stdout.close()
        process.child.stdout = None
        process.end()
        return self.judge(text)

    def floor(self):
        return self.piped(self.around.floor("print", self.around.interface, piped=True))

    def looks(self):
        return self.piped(self.looking(piped=True))

    def candump(self):
        return self.piped(self.around.peer("candump", self.around.interface, piped=True))

    def gateway(self):
        self.around.start_gateway()
        try:
            watch = '{"id":1,"cmd":"watch","topics":["frame"]}'
            return self.judge(self.around.tool("ask_frame", self.around.interface, self.plan["count"], self.around.socket, watch, piped=True).text(120))
        finally:
            self.around.end_gateway()


class Estop(Measure):
    """Time from the press to the second of both zeros. The simulated line shows the level immediately and reports the edge at the kernel's
    next tick, and the press comes just before that tick: a program that reads the level may be faster than one that waits for the edge.
    """

    candidates = ("floor", "gateway", "gpiomon")
    TICK_US, BEFORE_US, SPIN_US = 10_000, 200, 3_000

    def begin(self):
        self.around.start_wheels()
        self.chip = self.around.chip
        self.chip.pull(True, self.chip.WITNESS)
        self.witness = Edges(self.chip.chip, self.chip.WITNESS, FALLING)
        self.tick_us = self.press_now()
        self.release()
        time.sleep(0.5)

    def end(self):
        self.witness.close()
        super().end()

    def press_now(self):
        self.chip.pull(False, self.chip.WITNESS)
        self.chip.pull(False)
        edge = self.witness.next(1.0)
        if edge is None:
            raise RuntimeError("the line reported no edge")
        return edge[0]

    def release(self):
        self.chip.pull(True)
        self.chip.pull(True, self.chip.WITNESS)

    def press(self):
        """Waits until just before a tick, so the time between level and edge is short for programs that read levels."""
        now_us = time.monotonic_ns() // 1000
        due_us = now_us + self.TICK_US - (now_us + self.BEFORE_US - self.tick_us) % self.TICK_US
        time.sleep(max(due_us - now_us - self.SPIN_US, 0) / 1e6)
        while time.monotonic_ns() // 1000 < due_us:
            pass  # Sleeping would end too late, and the edge would be reported a whole tick after the level.
        return time.monotonic_ns() // 1000, self.press_now()

    @staticmethod
    def zeros(bus, can_id, since_us):
        return [f.t_us for f in bus.frames if f.id == can_id and f.t_us > since_us and not any(f.data[1:3])]

    def once(self, bus, settle_s=0.0):
        """Microseconds from the press to the later one of the first zeros after it."""
        level_us, _ = self.press()
        time.sleep(0.03 + settle_s)
        end = time.monotonic() + 1.0
        while not all(zeros := [self.zeros(bus, can_id, level_us) for can_id in (0x10A, 0x12A)]) and time.monotonic() < end:
            time.sleep(0.01)
        self.release()
        if not all(zeros):
            raise RuntimeError("no zeros after a press")
        return max(times[0] for times in zeros) - level_us

    def presses(self, before, settle_s=0.0):
        bus = CanBus(self.around.interface, ids=(0x10A, 0x12A))
        values = []
        try:
            for _ in range(self.plan["presses"]):
                before()
                values.append(self.once(bus, settle_s))
        finally:
            bus.close()
        return {"p50": percentile(values, 50), "p90": percentile(values, 90), "count": len(values)}

    def floor(self):
        process = self.around.floor("estop", self.around.interface, f"/dev/{self.chip.chip}", self.chip.OFFSET)
        time.sleep(0.2)
        try:
            return self.presses(lambda: time.sleep(0.05))
        finally:
            process.end()

    def gpiomon(self):
        frames = " && ".join(f"cansend {self.around.interface} {can_id}#0100000000" for can_id in ("10A", "12A"))
        script = f"gpiomon -b -f -B pull-up {self.chip.chip} {self.chip.OFFSET} | while read -r _; do {frames}; done"
        process = self.around.peer("setsid", "sh", "-c", script)
        time.sleep(0.5)
        try:
            return self.presses(lambda: time.sleep(0.1), 0.15)
        finally:
            subprocess.run(["kill", "--", f"-{process.child.pid}"], check=False)
            process.end()

    def gateway(self):
        self.around.start_gateway()
        client = self.around.client()
        renewal = None

        def drive():
            nonlocal renewal
            if renewal:
                renewal.end()
            self.around.arm(client)
            client.drive(100, 100)
            renewal = Renewal(client)
            time.sleep(0.25)

        try:
            return self.presses(drive)
        finally:
            if renewal:
                renewal.end()
            client.close()
            self.around.end_gateway()


MEASURES = {
    "period_idle": Period,
    "period_loaded": PeriodLoaded,
    "flood": Flood,
    "flood_loaded": FloodLoaded,
    "pair": Pair,
    "calls": Calls,
    "line": Line,
    "reported": Reported,
    "estop": Estop,
}
