# SPDX-License-Identifier: MIT
"""The gateway as a process, over the local bus: system calls per frame, memory, threads, allocations, and the time until it is back after a kill.

Figures of this machine at this moment, so they are printed and not checked; the counts (threads, allocations) do not depend on the load.
"""

import grp
import json
import os
import re
import shutil
import signal
import socket
import struct
import subprocess
import sys
import tempfile
import time
from pathlib import Path

HERE = Path(__file__).resolve().parent
sys.path.insert(0, str(HERE / "timed"))

import growth
import host
import local

WATCH_S = 4.0
START_S = 10.0


class Client:
    def __init__(self, path, within_s=START_S):
        deadline = time.monotonic() + within_s
        while True:
            self.socket = socket.socket(socket.AF_UNIX)
            try:
                self.socket.connect(str(path))
                break
            except OSError:
                self.socket.close()
                if time.monotonic() > deadline:
                    raise
                time.sleep(0.0005)
        self.lines = self.socket.makefile("r")

    def ask(self, **request):
        self.socket.sendall((json.dumps({"id": 1, **request}) + "\n").encode())
        while True:
            reply = json.loads(self.lines.readline())
            if "ok" in reply:
                return reply

    def close(self):
        self.lines.close()
        self.socket.close()


# A traced gateway is late now and then; it need not stop for that here.
TRACED = "[limits]\nwheel_silent_ms = 200\necho_ms = 200\n[drive]\nlease_ms = 500\nmax_speed_mm_s = 700\n"


class Pair:
    """A simulator and a gateway in a separate folder."""

    def __init__(self, build, folder, under=()):
        self.folder, self.under = Path(folder), under
        self.build = Path(build)
        self.northbound = self.folder / "gateway.sock"
        self.allocations = self.folder / "allocations"
        self.preload = self.folder / "count_allocations.so"
        subprocess.run(["gcc", "-shared", "-fPIC", "-O1", "-o", self.preload, HERE / "daemon/count_allocations.c"], check=True)
        (self.folder / "gateway.conf").write_text(
            f"[wheels]\nsetpoint_type = 1\ncurrent_role = limit\ntrack_mm = 540\n{TRACED}[northbound]\nmax_clients = 64\nmode = 0600\ngroup = {grp.getgrgid(os.getgid()).gr_name}\n[record]\n"
            f"directory = {self.folder}\n"
        )
        self.simulator = local.start_wheels(self.build, f"{self.folder}/")
        for name in ("bus", "estop"):  # A gateway that starts without its e-stop latches.
            self.await_file(name)
        self.gateway = self.start()

    def await_file(self, name, seconds=20):
        end = time.monotonic() + seconds
        while not (self.folder / name).exists():
            if time.monotonic() > end or self.simulator.poll() is not None:
                raise RuntimeError(f"the simulator has not made {name}")
            time.sleep(0.01)

    def start(self):
        environment = dict(os.environ, LD_PRELOAD=str(self.preload), BENCH_ALLOCATIONS=str(self.allocations))
        return subprocess.Popen(
            [
                *self.under,
                self.build / "app/gateway/iwheel-gateway",
                "-c",
                self.folder / "gateway.conf",
                "--can",
                f"unix:{self.folder}/bus",
                "--estop",
                f"unix:{self.folder}/estop",
                "--socket",
                self.northbound,
                "--log-level",
                "error",
            ],
            env=environment,
            stderr=subprocess.DEVNULL,
        )

    def allocated(self):
        return struct.unpack("=Q", self.allocations.read_bytes())[0]

    def end(self):
        for process in (self.gateway, self.simulator):
            process.send_signal(signal.SIGTERM)
            process.wait(10)


def received(client):
    counters = client.ask(cmd="status")
    return int(re.search(r'"received": (\d+)', json.dumps(counters))[1])


def calls_per_frame(pair):
    """System calls of the gateway per telemetry frame, without a client; None without the permission for strace."""
    if shutil.which("strace") is None:
        return None
    client = Client(pair.northbound)
    before = received(client)
    client.close()
    trace = subprocess.Popen(["strace", "-c", "-q", "-p", str(pair.gateway.pid)], stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True)
    time.sleep(WATCH_S)
    trace.send_signal(signal.SIGINT)
    total = re.search(r"^\s*100\.00\s+\S+\s+\S+\s+(\d+).*total$", trace.communicate()[1], re.MULTILINE)
    client = Client(pair.northbound)
    frames = received(client) - before
    client.close()
    return int(total[1]) / frames if total and frames else None


def kilobytes(pid, what):
    return int(re.search(rf"^{what}:\s+(\d+) kB", Path(f"/proc/{pid}/status").read_text(), re.MULTILINE)[1])


def family(pid):
    """The process and its children."""
    children = " ".join(path.read_text() for path in Path(f"/proc/{pid}/task").glob("*/children")).split()
    return [pid, *(one for child in children for one in family(int(child)))]


def together(pid):
    """(processes, kB of memory of all of them, shared memory counted once: PSS)"""
    all_of_it = family(pid)
    return len(all_of_it), sum(int(re.search(r"^Pss:\s+(\d+) kB", Path(f"/proc/{one}/smaps_rollup").read_text(), re.MULTILINE)[1]) for one in all_of_it)


def allocations_in_use(pair):
    """Allocations while a client asks, arms, drives and leaves."""
    before = pair.allocated()
    client = Client(pair.northbound)
    for request in [
        {"cmd": "status"},
        {"cmd": "watch", "topics": ["state", "force", "frame"], "rate_hz": 50},
        {"cmd": "arm", "name": "bench"},
        *[{"cmd": "drive", "left_mm_s": 50, "right_mm_s": 50}] * 20,
        {"cmd": "stop"},
        {"cmd": "why"},
        {"cmd": "nonsense"},
    ]:
        client.ask(**request)
        time.sleep(0.01)
    client.close()
    time.sleep(0.5)
    return pair.allocated() - before


def back_after_kill(pair):
    """Seconds from SIGKILL to the first reply, with a supervisor that restarts immediately."""
    killed = time.monotonic()
    pair.gateway.kill()
    pair.gateway.wait()
    pair.gateway = pair.start()
    client = Client(pair.northbound)
    client.ask(cmd="hello")
    duration_s = time.monotonic() - killed
    client.close()
    return duration_s


def measure(build):
    """Rows of (metric, figure, goal)."""
    with tempfile.TemporaryDirectory(prefix="iwheel-bench-", ignore_cleanup_errors=True) as folder:
        pair = Pair(build, folder)
        try:
            Client(pair.northbound).close()
            time.sleep(1.0)
            calls = calls_per_frame(pair)
            allocations = allocations_in_use(pair)
            resident = kilobytes(pair.gateway.pid, "VmRSS")
            processes, pss = together(pair.gateway.pid)
            box, files = kilobytes(pair.gateway.pid, "RssShmem"), kilobytes(pair.gateway.pid, "RssFile")
            threads = len(list(Path(f"/proc/{pair.gateway.pid}/task").iterdir()))
            host.be_prompt()
            host.build_tools(Path(folder))
            more = [*local.rows(local.measure(pair, Client, folder)), *growth.rows(growth.measure(pair, Client))]
            back = sorted(back_after_kill(pair) for _ in range(5))[2]
        finally:
            pair.end()
    return [
        ("system calls per frame received, no client", "not measured: no strace" if calls is None else f"{calls:.2f}", "≤ 2.5"),
        (
            "resident memory of the first process",
            f"{resident / 1024:.1f} MiB: black box {box / 1024:.1f}, programs and libraries {files / 1024:.1f}",
            "≤ 3 MiB",
        ),
        (f"memory of all {processes} processes together (PSS)", f"{pss / 1024:.1f} MiB", "--"),
        ("threads of each process", str(threads), "1"),
        ("allocations while a client watches, arms, drives, stops", str(allocations), "0"),
        ("SIGKILL to first answer, median of 5", f"{back * 1000:.0f} ms", "≤ 300 ms"),
        *more,
    ]


if __name__ == "__main__":
    for row in measure(sys.argv[1]):
        print(row)
