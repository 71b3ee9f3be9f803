#!/usr/bin/env python3
# SPDX-License-Identifier: MIT
"""Measures how many machines a broker and the console can serve: unchanged iwheel-mqtt, one process per machine, with recorded lines of a gateway.

usage: test/mqtt/scale.py [--build DIR] [--broker KIND]... [--machines N]... [--every MS]... [--seconds N] [--update]

A gateway with simulated wheels is driven and stopped by its button once a minute; its lines are recorded, for watchers at 1 Hz and at 10 Hz.
Then one process is the gateway of all N machines: each bridge connects to it, sends its requests, and receives these lines at their times, each machine's
shifted against the others'; if the recorded gateway was late with a state, the previous state again. The console (iwheel-fleet) runs in parallel; stamps.c (preloaded) records the age of each line after its
processing. Brokers: mosquitto, nats (one nats-server with JetStream), nats3 (three, three replicas); all without TLS.

Processor time is the kernel's count for each process, so other programs change it little; they do change latencies.
--update writes the rows into docs/user/mqtt.md. A run needs about 2 MB of memory and 3 descriptors per machine.
"""

import argparse
import contextlib
import itertools
import json
import multiprocessing
import os
import pwd
import re
import resource
import select
import shutil
import signal
import socket
import statistics
import struct
import subprocess
import sys
import tempfile
import threading
import time
from pathlib import Path

HERE = Path(__file__).resolve().parent
sys.path[:0] = [str(HERE), str(HERE.parent / "system")]

from bus import now_us
from harness import die_with_parent, find_program
from judge_log import percentile
from free_port import free_port
from mqtt_rig import MqttRig, await_port, put_table
from trials import ROOT, Skip, until

PAGE = ROOT / "docs/user/mqtt.md"
STAMP = struct.Struct("=QQIIII")  # The format of stamps.c.
HEAD = [
    "broker",
    "machines",
    "state every",
    "kB/s at the console",
    "processor, ms per s: broker",
    "console",
    "all bridges",
    "memory, MB: broker",
    "console",
    "line to console: median",
    "99 %",
    "longest",
    "states missing",
    "stops sent",
    "arrived",
    "doubled",
]
MINUTE_S = 60
BATCH = 25  # Bridges that start together: each finds a gateway within 0.2 s.


# ---- the lines of a gateway -------------------------------------------------------------------------------------------


class Tape:
    """A gateway's lines in slots of a watcher's period, each split around its time, and its replies."""

    def __init__(self, rig, seconds):
        self.seconds, self.slots, self.answers = seconds, {}, {}
        watchers = {}
        for rate_hz in (1, 10):
            link = socket.socket(socket.AF_UNIX)
            link.connect(rig.path("watch.sock"))
            watchers[link] = (rate_hz, [], bytearray())
        for cmd in ("hello", "why"):
            self.answers[cmd] = re.sub(
                r'"id":\d+', '"id":%d', json.dumps(rig.client(name="tape").request(cmd), separators=(",", ":")).replace("%", "%%"), count=1
            )
        for link, (rate_hz, *_) in watchers.items():
            link.sendall(json.dumps({"cmd": "watch", "id": 1, "topics": ["state", "bus", "estop", "lease", "stop"], "rate_hz": rate_hz}).encode() + b"\n")
        actor = threading.Thread(target=self.act, args=(rig,))
        actor.start()
        begun = time.monotonic()
        while (passed := time.monotonic() - begun) < seconds:
            for link in select.select(list(watchers), [], [], 0.05)[0]:
                _, lines, rest = watchers[link]
                rest += link.recv(65536)
                *whole, last = rest.split(b"\n")
                rest[:] = last
                lines += [(passed, line) for line in whole]
        actor.join()
        for link, (rate_hz, lines, _) in watchers.items():
            link.close()
            self.hello = lines[0][1] + b"\n"
            self.slots[rate_hz] = [[] for _ in range(int(seconds * rate_hz))]
            first = next(at for at, line in lines if b'"event":"state"' in line) - 0.5 / rate_hz  # A state is in the middle of its slot.
            for at, line in lines:
                head, found, tail = line.partition(b'"t_us":')
                if found and b'"event":"hello"' not in line:
                    self.slots[rate_hz][min(int(max(0, at - first) * rate_hz), len(self.slots[rate_hz]) - 1)].append(
                        (head + found, tail.lstrip(b"0123456789") + b"\n")
                    )
            self.fill(self.slots[rate_hz])
        self.stops = sum(b'"event":"stop"' in head + tail for slot in self.slots[1] for head, tail in slot)
        assert self.stops == 1, f"{self.stops} stops on the tape, not 1"

    @staticmethod
    def fill(slots):
        """Repeats the previous state in slots without one, where the gateway was woken late: each slot has a state."""
        last = next(line for slot in slots for line in slot if b'"event":"state"' in line[0])
        for slot in slots:
            states = [line for line in slot if b'"event":"state"' in line[0]]
            last = states[-1] if states else last
            if not states:
                slot.append(last)

    def act(self, rig):
        """Drives and stops: most of a short tape, or the first seconds of a minute."""
        client = rig.client(name="walker")
        time.sleep(0.5)
        until(lambda: client.request("arm", name="walker")["ok"], what="armed")
        for _ in range(20):
            client.request("drive", left_mm_s=200, right_mm_s=200)
            time.sleep(0.05)
        rig.press()
        time.sleep(0.6)
        rig.press(False)
        until(lambda: client.request("reset")["ok"], what="the latch is reset")
        client.close()


class Gateway:
    """A separate process that acts as the gateway of all machines, on one socket."""

    def __init__(self, path, tape, machines, rate_hz):
        self.path, self.tape, self.machines, self.rate_hz = path, tape, machines, rate_hz
        self.count = multiprocessing.Array("Q", 4)  # Connections, lines, stops, lines that a bridge did not accept.
        self.go, self.end = multiprocessing.Event(), multiprocessing.Event()
        self.process = multiprocessing.get_context("fork").Process(target=self.run, daemon=True)
        self.process.start()

    def run(self):
        listener = socket.socket(socket.AF_UNIX)
        listener.bind(self.path)
        listener.listen(self.machines)
        poll, links, listening = select.epoll(), {}, []
        poll.register(listener, select.EPOLLIN)
        begun, turn = None, 0
        while not self.end.is_set():
            for fd, _ in poll.poll(0.002):
                if fd == listener.fileno():
                    link = listener.accept()[0]
                    link.setblocking(False)
                    links[link.fileno()] = link
                    poll.register(link, select.EPOLLIN)
                    self.send(link, self.tape.hello)
                elif not self.answer(links[fd], listening):
                    poll.unregister(fd)
                    link = links.pop(fd)
                    link.close()
                    if link in listening:  # A bridge without a reply in time connects again.
                        listening.remove(link)
                self.count[0] = len(listening)
            if begun is None and self.go.is_set():
                begun = time.monotonic()
            # Machine `turn % machines` receives its slot `turn / machines`.
            due = int((time.monotonic() - begun) * self.machines * self.rate_hz) if begun else 0
            while turn < due:
                turn += 1
                machine = turn % self.machines
                if machine < len(listening):
                    self.send_slot(listening[machine], turn // self.machines + 7 * machine)

    def send(self, link, line):
        try:
            return link.send(line) == len(line)
        except OSError:  # As in the gateway, a slow reader loses lines.
            return False

    def answer(self, link, listening):
        try:
            data = link.recv(65536)
        except OSError:
            return False
        for line in data.splitlines():
            asked = json.loads(line)
            if asked["cmd"] == "watch":
                assert asked["rate_hz"] == self.rate_hz, asked
                reply = json.dumps({"id": asked["id"], "ok": True, "topics": asked["topics"], "rate_hz": self.rate_hz, "limited": False}, separators=(",", ":"))
                listening.append(link)
            else:
                reply = self.tape.answers[asked["cmd"]] % asked["id"]
            self.send(link, reply.encode() + b"\n")
        return bool(data)

    def send_slot(self, link, slot):
        slots = self.tape.slots[self.rate_hz]
        for head, tail in slots[slot % len(slots)]:
            line = head + str(now_us()).encode() + tail
            accepted = self.send(link, line)
            self.count[1] += accepted
            self.count[2] += accepted and b'"event":"stop"' in line
            self.count[3] += not accepted


# ---- brokers ------------------------------------------------------------------------------------------------------------


def mosquitto_files(folder, port):
    config = Path(folder, "mosquitto.conf")
    config.write_text(f"listener {port} 127.0.0.1\nallow_anonymous true\npersistence false\nuser {pwd.getpwuid(os.getuid()).pw_name}\n", encoding="ascii")
    return [("127.0.0.1", ["mosquitto", "-c", str(config)])]


def nats_files(folder, port, servers):
    """One server, or three with their routes; configured like share/fleet/nats-server.conf, without TLS and rights."""
    routes, made = free_port(), []
    for number in range(1, servers + 1):
        host, config = f"127.0.0.{number}", Path(folder, f"nats{number}.conf")
        cluster = f'cluster {{ name: fleet, listen: "{host}:{routes}", routes: [{", ".join(f"nats-route://127.0.0.{one}:{routes}" for one in range(1, servers + 1))}] }}\n'
        config.write_text(
            f'server_name: n{number}\nlisten: "{host}:{free_port()}"\njetstream {{ store_dir: "{folder}/n{number}" }}\n'
            + (cluster if servers > 1 else "")
            + f'mqtt {{ listen: "{host}:{port}", stream_replicas: {servers}, ack_wait: "10s" }}\n',
            encoding="ascii",
        )
        made.append((host, ["nats-server", "-c", str(config)]))
    return made


BROKERS = {"mosquitto": mosquitto_files, "nats": lambda folder, port: nats_files(folder, port, 1), "nats3": lambda folder, port: nats_files(folder, port, 3)}


# ---- measuring ----------------------------------------------------------------------------------------------------------


def cpu_s(pid):
    """The kernel's count for all threads of a process, including those that have ended."""
    return time.clock_gettime((~pid << 3) | 2)


def memory_kB(pid, what="Rss"):
    return int(re.search(rf"^{what}:\s+(\d+)", Path(f"/proc/{pid}/smaps_rollup").read_text(encoding="ascii"), re.M)[1])


class Load:
    """Broker, console and machines. `measure` returns a row of the table."""

    def __init__(self, build, tape, kind, machines, every_ms):
        if not shutil.which("mosquitto" if kind == "mosquitto" else "nats-server"):
            raise Skip(f"{kind} is missing (scripts/install_tools check brings it)")
        self.folder, self.kind, self.machines, self.every_ms = tempfile.mkdtemp(prefix="iwheel-"), kind, machines, every_ms
        self.rate_hz, self.build, self.tape, self.port, self.children = max(1, 1000 // every_ms), build, tape, free_port(), []
        resource.setrlimit(resource.RLIMIT_NOFILE, (resource.getrlimit(resource.RLIMIT_NOFILE)[1],) * 2)
        try:
            self.start()
        except BaseException:
            self.close()
            raise

    def spawn(self, name, command, **options):
        with open(f"{self.folder}/{name}.out", "wb") as out:
            child = subprocess.Popen(command, stdin=subprocess.DEVNULL, stdout=options.pop("stdout", out), stderr=out, preexec_fn=die_with_parent, **options)
        self.children.append(child)
        return child

    def start(self):
        made = BROKERS[self.kind](self.folder, self.port)
        self.hosts = [host for host, _ in made]
        self.brokers = [self.spawn(f"broker{number}", command) for number, (_, command) in enumerate(made)]
        for host in self.hosts:
            await_port(self.port, host, 30)
        time.sleep(3 if len(self.hosts) > 1 else 0)  # The servers need this time to elect a leader.
        self.gateway = Gateway(f"{self.folder}/gateway.sock", self.tape, self.machines, self.rate_hz)
        self.console = self.start_console()
        until(lambda: self.connected() == 1, 60, "the console is at the broker")
        self.bridges = []
        for number in range(self.machines):
            self.bridges.append(self.start_bridge(number))
            if number % BATCH == BATCH - 1 or number == self.machines - 1:
                until(
                    lambda: self.gateway.count[0] == len(self.bridges) and self.connected() == len(self.bridges) + 1,
                    60,
                    f"{len(self.bridges)} bridges are at the broker",
                )

    def start_console(self):
        library, config = f"{self.folder}/stamps.so", Path(self.folder, "fleet.conf")
        subprocess.run(["cc", "-O2", "-shared", "-fPIC", "-o", library, HERE / "stamps.c", "-ldl"], check=True)
        config.write_text(f"[broker]\nhost = {self.hosts[0]}\nport = {self.port}\n", encoding="ascii")
        return self.spawn(
            "console",
            [find_program(self.build, "iwheel-fleet"), "-c", str(config)],
            stdout=subprocess.DEVNULL,
            env={**os.environ, "LD_PRELOAD": library, "IWHEEL_STAMPS": f"{self.folder}/stamps"},
        )

    def start_bridge(self, number):
        spool, config = Path(self.folder, f"m{number:04}"), Path(self.folder, f"m{number:04}.conf")
        spool.mkdir(mode=0o700)
        place = number % len(self.hosts)
        config.write_text(
            f"[gateway]\nsocket = {self.folder}/gateway.sock\n[machine]\nid = m{number:04}\n[broker]\nhost = {' '.join(self.hosts[place:] + self.hosts[:place])}\n"
            f"port = {self.port}\n[state]\nevery_ms = {self.every_ms}\n[spool]\ndirectory = {spool}\n",
            encoding="ascii",
        )
        return self.spawn(spool.name, [find_program(self.build, "iwheel-mqtt"), "-c", str(config)])

    def connected(self):
        """Connections that the broker has accepted."""
        lines = [line.split() for line in Path("/proc/net/tcp").read_text(encoding="ascii").splitlines()[1:]]
        return sum(line[1].endswith(f":{self.port:04X}") and line[3] == "01" for line in lines)

    def times(self):
        return [sum(cpu_s(child.pid) for child in group) for group in (self.brokers, [self.console], self.bridges)]

    def measure(self, seconds):
        self.gateway.go.set()
        time.sleep(max(2, self.every_ms / 1000))
        begin_us, before = now_us(), self.times()
        time.sleep(seconds)
        end_us, after = now_us(), self.times()
        memory = [sum(memory_kB(child.pid) for child in group) / 1000 for group in (self.brokers, [self.console])]
        self.bridge_kB = [statistics.median(memory_kB(child.pid, what) for child in self.bridges[:20]) for what in ("Rss", "Pss")]
        self.gateway.end.set()
        self.gateway.process.join(10)
        self.drain()
        self.console.terminate()
        self.console.wait(20)
        stamps = list(STAMP.iter_unpack(Path(self.folder, "stamps").read_bytes()))
        cpu = [(now - then) * 1e6 / (end_us - begin_us) * 1000 for now, then in zip(after, before, strict=False)]
        self.not_accepted = self.gateway.count[3]
        return self.judge(stamps, begin_us, end_us, cpu, memory)

    def drain(self):
        """Waits until broker and console are idle, for at most half a minute."""
        for _ in range(15):
            before = self.times()
            time.sleep(2)
            if sum(now - then for now, then in zip(self.times()[:2], before[:2], strict=False)) < 0.02 + self.machines / 20000:
                return

    def judge(self, stamps, begin_us, end_us, cpu, memory):
        inside = [stamp for stamp in stamps if begin_us <= stamp[0] - stamp[2] < end_us]
        late_ms = sorted(stamp[2] / 1000 for stamp in inside) or [float("nan")]
        states, missing = {}, 0
        for at_us, boot, late_us, number, _, _ in inside:
            if number == 0:
                states.setdefault(boot, []).append(at_us - late_us)
        for times in states.values():
            times.sort()
            missing += sum(max(0, round((later - before) / 1000 / self.every_ms) - 1) for before, later in itertools.pairwise(times))
        stops = [(boot, number) for _, boot, _, number, _, _ in stamps if number]
        self.row = {
            "kind": self.kind,
            "machines": self.machines,
            "every_ms": self.every_ms,
            "states": sum(map(len, states.values())),
            "missing": missing,
            "heard": len(states),
            "kB_s": sum(stamp[4] for stamp in inside) / (end_us - begin_us) * 1000,
            "cpu": cpu,
            "memory": memory,
            "late_ms": (percentile(late_ms, 50), percentile(late_ms, 99), late_ms[-1]),
            "stops": (self.gateway.count[2], len(set(stops)), len(stops) - len(set(stops))),
        }
        return self.row

    def close(self):
        if hasattr(self, "gateway"):
            self.gateway.end.set()
            self.gateway.process.join(5)
        for number in (signal.SIGTERM, signal.SIGKILL):
            for child in self.children:
                if child.poll() is None:
                    child.send_signal(number)
            end = time.monotonic() + 10
            for child in self.children:
                with contextlib.suppress(subprocess.TimeoutExpired):
                    child.wait(max(0.01, end - time.monotonic()))
        shutil.rmtree(self.folder, ignore_errors=True)


def short(number):
    return f"{number:.1f}" if number < 10 else f"{number:.0f}"


def cells(row):
    period = f"{row['every_ms'] / 1000:g} s"
    numbers = [short(one) for one in (row["kB_s"], *row["cpu"], *row["memory"])] + [f"{short(one)} ms" for one in row["late_ms"]]
    return [row["kind"], str(row["machines"]), period, *numbers, f"{row['missing']} of {row['states'] + row['missing']}", *(str(one) for one in row["stops"])]


# ---- in ./check ---------------------------------------------------------------------------------------------------------


def run_load(rig, seconds, **load):
    rig.start_gateway()
    tape = Tape(rig, seconds)
    one = Load(rig.build, tape, **load)
    try:
        row = one.measure(seconds)
    finally:
        one.close()
    print("        " + ", ".join(f"{name} {cell}" for name, cell in zip(HEAD, cells(row), strict=False)), flush=True)
    sent, arrived, doubled = row["stops"]
    assert arrived == sent > 0 and doubled == 0, row
    assert row["heard"] == load["machines"] and row["missing"] <= row["states"] / 20, row


# ---- the table ------------------------------------------------------------------------------------------------------------


def update(rows):
    """Rows of the same broker, number and period replace the existing ones."""
    begin = "<!-- figures: test/mqtt/scale.py --update -->"
    section = PAGE.read_text(encoding="utf-8").split(begin, 1)[1].split("<!-- end", 1)[0]
    old = [[cell.strip() for cell in line.strip("|").split("|")] for line in section.splitlines() if line.startswith("| ")][2:]
    every = {tuple(one[:3]): one for one in old + rows}
    kinds = list(BROKERS)
    order = sorted(every.values(), key=lambda one: (-float(one[2].split()[0]), kinds.index(one[0]), int(one[1])))
    put_table(PAGE, "test/mqtt/scale.py --update", ["| " + " | ".join(one) + " |" for one in (HEAD, ["---"] + ["---:"] * (len(HEAD) - 1), *order)])


def main():
    parser = argparse.ArgumentParser(
        usage=__doc__.split("\n\n")[1].removeprefix("usage: "), description=__doc__.split("\n\n", 2)[2], formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--build", default=ROOT / "build/default")
    parser.add_argument("--broker", action="append", choices=BROKERS, help="mosquitto")
    parser.add_argument("--machines", action="append", type=int, help="1 10 100 300 1000")
    parser.add_argument("--every", action="append", type=int, help="5000 and 100 ms")
    parser.add_argument("--seconds", type=int, default=20)
    parser.add_argument("--update", action="store_true")
    options = parser.parse_args()
    rig = MqttRig(options.build)
    try:
        rig.start_gateway()
        tape = Tape(rig, MINUTE_S)
    finally:
        rig.close()
    rows = []
    for kind in options.broker or ["mosquitto"]:
        for every_ms in options.every or [5000, 100]:
            for machines in options.machines or [1, 10, 100, 300, 1000]:
                load = Load(options.build, tape, kind, machines, every_ms)
                try:
                    rows.append(cells(load.measure(options.seconds)))
                finally:
                    load.close()
                print(", ".join(f"{name} {cell}" for name, cell in zip(HEAD, rows[-1], strict=False)))
                print(
                    f"        a bridge: {load.bridge_kB[0] / 1000:.1f} MB, of which private and share of shared memory {load.bridge_kB[1] / 1000:.1f} MB; "
                    f"{load.not_accepted} lines not accepted",
                    flush=True,
                )
                if options.update:
                    update(rows)
    return 0


if __name__ == "__main__":
    sys.exit(main())
