# SPDX-License-Identifier: MIT
"""The cost of more clients: watchers at 50 Hz and a flooding client, over the local bus: gaps between setpoints, and the gateway's processor time."""

import contextlib
import itertools
import json
import os
import selectors
import signal
import socket
import statistics
import subprocess
import sys
import time
from pathlib import Path

HERE = Path(__file__).resolve().parent
ROOT = HERE.parent.parent.parent
sys.path[:0] = [str(ROOT / "test/system")]

from bus import Bus

ID_LEFT = 0x10A
WATCHERS = (0, 1, 4, 16)
STATE = (50, "state")
EVERYTHING = (100, "state,force,frame")
MANY = 62
FLOOD = (json.dumps({"id": 1, "cmd": "status"}) + "\n").encode() * 64


def connect(path):
    sock = socket.socket(socket.AF_UNIX)
    sock.connect(str(path))
    return sock


def watch(path, count, rate_hz, topics):
    """A separate process that reads all that comes."""
    selector = selectors.DefaultSelector()
    request = json.dumps({"id": 1, "cmd": "watch", "topics": topics.split(","), "rate_hz": rate_hz}) + "\n"

    def begin():
        sock = connect(path)
        sock.sendall(request.encode())
        selector.register(sock, selectors.EVENT_READ)

    for _ in range(count):
        begin()
    while True:
        for key, _ in selector.select():
            try:
                gone = not key.fileobj.recv(1 << 20)
            except ConnectionResetError:
                gone = True
            if gone:  # The gateway closed the slow client, which connects again as watchers do.
                selector.unregister(key.fileobj)
                begin()


def flood(path):
    """A separate process that sends requests as fast as it can and hardly ever reads."""
    while True:
        with contextlib.suppress(ConnectionError):
            flood_until_sent_away(connect(path))


def flood_until_sent_away(sock):
    sock.setblocking(False)
    while True:
        try:
            sock.send(FLOOD)
        except BlockingIOError:
            time.sleep(0.0002)
        with contextlib.suppress(BlockingIOError):
            sock.recv(1 << 16)


def percentile(values, percent):
    ordered = sorted(values)
    return ordered[min(len(ordered) - 1, int(len(ordered) * percent / 100))]


def cpu_ns(pid):
    return int(Path(f"/proc/{pid}/schedstat").read_text(encoding="ascii").split()[0])


def be_ordinary():
    """The crowd has no priority, whatever priority the benchmark has."""
    os.sched_setscheduler(0, os.SCHED_OTHER, os.sched_param(0))


class Crowd:
    def __init__(self, path, watchers, hostile, wanted=STATE):
        words = [["watch", str(path), str(watchers), *map(str, wanted)]] if watchers else []
        words += [["flood", str(path)]] if hostile else []
        self.children = [subprocess.Popen([sys.executable, __file__, *each], preexec_fn=be_ordinary) for each in words]

    def end(self):
        for child in self.children:
            child.send_signal(signal.SIGKILL)
            child.wait()


def arm(client):
    """Gets the lease, whatever state a late machine has caused."""
    for _ in range(200):
        if client.ask(cmd="arm", name="bench")["ok"]:
            client.ask(cmd="drive", left_mm_s=100, right_mm_s=100)
            return
        if client.ask(cmd="status")["state"] == "latched":
            client.ask(cmd="reset")
        time.sleep(0.02)
    raise RuntimeError("the gateway cannot be armed")


def one(pair, client, watchers, hostile, seconds, wanted=STATE):
    """Gap p99 in microseconds, and the gateway's share of a processor."""
    crowd = Crowd(pair.northbound, watchers, hostile, wanted)
    time.sleep(0.7)
    arm(client)
    bus = Bus(str(pair.folder / "bus"))
    before_ns, began = cpu_ns(pair.gateway.pid), time.monotonic()
    while time.monotonic() - began < seconds:
        client.ask(cmd="drive", left_mm_s=100, right_mm_s=100)
        time.sleep(0.05)
    share = (cpu_ns(pair.gateway.pid) - before_ns) / 1e9 / (time.monotonic() - began)
    bus.close()
    crowd.end()
    at = [frame.t_us for frame in bus.frames if frame.id == ID_LEFT]
    return {"gap_p99": percentile([b - a for a, b in itertools.pairwise(at)], 99), "cpu": share}


def measure(pair, client_type, rounds=3, seconds=6.0):
    """{(watchers, hostile): [figures of each round]}, in turns."""
    measured = {}
    client = client_type(pair.northbound)
    for _ in range(rounds):
        for watchers, hostile in [*((count, False) for count in WATCHERS), (0, True), (16, True)]:
            measured.setdefault((watchers, hostile), []).append(one(pair, client, watchers, hostile, seconds))
        measured.setdefault((MANY, False), []).append(one(pair, client, MANY, False, seconds, EVERYTHING))
    client.close()
    return measured


def rows(measured):
    """(metric, figure, goal)"""

    def middle(who, key):
        return statistics.median(figures[key] for figures in measured[who])

    alone_us, idle = middle((0, False), "gap_p99"), middle((0, False), "cpu")
    for watchers, hostile in measured:
        gap_us = middle((watchers, hostile), "gap_p99") - alone_us
        share = middle((watchers, hostile), "cpu") - idle
        if hostile:
            yield (f"a client that floods, {watchers} watchers: gap p99 added", f"{gap_us / 1000:+.2f} ms", "≤ 1 ms")
        elif watchers == MANY:
            yield (
                f"{watchers} watching all topics and frames at 100 Hz: gap p99 added, processor of all",
                f"{gap_us / 1000:+.2f} ms, {share:.1%}",
                "≤ 1 ms, ≤ 8%",
            )
        elif watchers:
            yield (f"{watchers} watching at 50 Hz: gap p99 added, processor for each", f"{gap_us / 1000:+.2f} ms, {share / watchers:.2%}", "≤ 1 ms, linear")


if __name__ == "__main__":
    watch(sys.argv[2], int(sys.argv[3]), int(sys.argv[4]), sys.argv[5]) if sys.argv[1] == "watch" else flood(sys.argv[2])
