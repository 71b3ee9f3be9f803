# SPDX-License-Identifier: MIT
"""Rows 5 and 33: observers that are killed, flood, connect a thousand times, use up descriptors and places."""

import base64
import contextlib
import os
import resource
import select
import socket
import subprocess
import sys
import threading
import time
import zlib

from bus import now_us
from client import Client, Streamer
from judge_log import Event
from scenario import scenario

from .arguments import call

FLOOD = "a flood"  # It never waits, so virtual time would stop.
SPARE = 6  # Descriptors that are left when clients come in a crowd.


def connect(path):
    """Waits while the backlog is full."""
    sock = socket.socket(socket.AF_UNIX)
    sock.connect(path)
    sock.settimeout(2)
    return sock


def read_some(sock, seconds=0.5):
    sock.settimeout(seconds)
    try:
        return sock.recv(65536)
    except OSError:
        return b""


@scenario("observers are killed, flood, connect 1000 times: the owner is undisturbed", 10, native=FLOOD)
def row05_many_observers(t):
    rig, owner = t.running()
    path = rig.path("gateway.sock")
    stream = t.start_driving(owner, 300, 300, 0.6)
    descriptors, memory_kB, cpu, begin = (rig.gateway.descriptors(), rig.gateway.resident_kB(), rig.gateway.cpu_seconds(), time.monotonic())
    for number in range(1000):
        sock = connect(path)
        if number % 3 == 0:
            sock.sendall(b'{"cmd":"watch","topics":["state","frame"],"rate_hz":100}\n')
        sock.close()
    t.figure(f"1000 connections in {time.monotonic() - begin:.1f} s")
    crowd = [connect(path) for _ in range(30)]
    time.sleep(0.2)
    refused = [sock for sock in crowd if b"too_many_clients" in read_some(sock, 0.3)]
    t.check(len(refused) >= 14, f"{len(refused)} of 30 received too_many_clients, at most 16 clients are allowed")
    for sock in crowd:
        sock.close()
    time.sleep(0.2)
    flood_until = time.monotonic() + 1.5

    def flood():
        sock = connect(path)
        while time.monotonic() < flood_until:
            if select.select([], [sock], [], 0.1)[1]:
                sock.sendall(b'{"cmd":"status"}\n' * 3)
            while select.select([sock], [], [], 0)[0] and sock.recv(65536):
                pass
        sock.close()

    floods = [threading.Thread(target=flood) for _ in range(2)]
    for thread in floods:
        thread.start()
    for thread in floods:
        thread.join()
    refusal = stream.stop()
    t.check(refusal is None, f"the owner was refused: {refusal}")
    time.sleep(0.4)
    t.check(rig.gateway.descriptors() <= descriptors, f"descriptors: {descriptors} before, {rig.gateway.descriptors()} after")
    t.check(rig.gateway.resident_kB() <= memory_kB + 1024, f"memory: {memory_kB} kB before, {rig.gateway.resident_kB()} kB after")
    t.figure(f"gateway used {100 * (rig.gateway.cpu_seconds() - cpu) / (time.monotonic() - begin):.0f} % CPU")
    time.sleep(0.5)
    t.judge(rig)


@scenario("no descriptor left: no busy loop, the owner is undisturbed", 8, native="processor time")
def row05_out_of_descriptors(t):
    rig = t.rig({"northbound": {"max_clients": 64}})
    owner = rig.connect_to_new(name="owner")
    t.arm(owner)
    limit = rig.gateway.descriptors() + SPARE  # The number that the gateway itself needs depends on the bus and the e-stop line.
    resource.prlimit(rig.gateway.child.pid, resource.RLIMIT_NOFILE, (limit, limit))
    stream = Streamer(owner, 200, 200)
    time.sleep(0.4)
    crowd = []
    for _ in range(40):
        sock = socket.socket(socket.AF_UNIX)
        sock.setblocking(False)
        with contextlib.suppress(OSError):
            sock.connect(rig.path("gateway.sock"))
        crowd.append(sock)
    time.sleep(0.2)
    t.check(rig.gateway.descriptors() >= limit - 1, f"{rig.gateway.descriptors()} of {limit} descriptors are in use")
    t.check("there is no place for more" in rig.gateway.text(), "clients are refused, and the log reports it")
    percent = 100 * rig.gateway.cpu_share(1.5)
    t.check(percent < 50, f"{percent:.0f} % CPU while no descriptor is left", True)
    t.figure(f"{percent:.0f} % CPU without a free descriptor")
    for sock in crowd:
        sock.close()
    t.check(stream.stop(after=0.5) is None, f"the owner was refused: {stream.refusal}")
    late = rig.client("late")
    t.expect(late.request("hello"))
    t.check(os.path.exists(rig.path("gateway.sock")), "the socket still exists")
    time.sleep(0.4)
    t.judge(rig)


@scenario("sixty observers that send requests and watch without end: the e-stop does not wait for them", 14, native=FLOOD)
def row05_sixty_observers(t):
    rig = t.rig({"northbound": {"max_clients": 64}})
    owner = rig.connect_to_new(name="owner")
    crowd = [connect(rig.path("gateway.sock")) for _ in range(60)]
    over = threading.Event()

    def observe():
        for sock in crowd:
            sock.setblocking(False)
            sock.sendall(b'{"cmd":"watch","topics":["state","force"],"rate_hz":100}\n')
        while not over.is_set():
            readable, writable, _ = select.select(crowd, crowd, [], 0.1)
            for sock in writable[::7]:
                with contextlib.suppress(OSError):
                    sock.send(b'{"cmd":"status"}\n')
            for sock in readable:
                with contextlib.suppress(OSError):
                    sock.recv(1 << 20)

    thread = threading.Thread(target=observe)
    thread.start()
    try:
        for _ in range(6):
            stream = t.start_driving(owner, 300, 300, 0.5)
            rig.press()
            stream.stop(after=0.3)
            rig.release()
            t.reset(owner)
    finally:
        over.set()
        thread.join()
    for sock in crowd:
        sock.close()
    t.judge(rig)


LARGE = 8 << 20


def read_recording(path, name, pieces, over):
    """Reads it from begin to end, again and again, each piece as soon as the one before has arrived."""
    watcher = Client(path, name="reader")
    offset = 0
    while not over.is_set():
        piece = watcher.request("recording", name=name, offset=offset)
        data = base64.b64decode(piece["data"])
        assert piece["ok"] and zlib.crc32(data) == piece["crc32"], piece
        pieces.append(len(data))
        offset = (offset + len(data)) % piece["size"]


@scenario("many watchers read a large recording, send requests and stop without end: no gap, and the stop counts", 12, native=FLOOD)
def row05_watchers_and_recordings(t):
    rig = t.rig()
    rig.configure(northbound={"watch_socket": rig.path("watch.sock"), "watch_group": "none"})
    name = "stop-000001-client_stop.log"
    with open(rig.path(name), "wb") as file:
        file.write(os.urandom(LARGE))
    os.chmod(rig.path(name), 0o640)
    owner = rig.connect_to_new(name="owner")
    over, pieces = threading.Event(), []

    def flood():
        sock = connect(rig.path("watch.sock"))
        while not over.is_set():
            if select.select([], [sock], [], 0.1)[1]:
                sock.sendall(b'{"cmd":"status"}\n{"cmd":"arm"}\n')
            while select.select([sock], [], [], 0)[0] and sock.recv(65536):
                pass
        sock.close()

    threads = [threading.Thread(target=read_recording, args=(rig.path("watch.sock"), name, pieces, over)) for _ in range(2)]
    threads += [threading.Thread(target=flood) for _ in range(4)]
    stream = t.start_driving(owner, 300, 300, 0.4)
    for thread in threads:
        thread.start()
    time.sleep(3)
    t.check(sum(pieces) > LARGE, f"{sum(pieces)} bytes were read meanwhile")
    t.figure(f"{sum(pieces) / 3e6:.0f} MB/s of recordings read meanwhile")
    watcher = Client(rig.path("watch.sock"), rig.timeline, "watcher")
    t.expect(watcher.request("drive", left_mm_s=900, right_mm_s=900), "denied")
    t.expect(watcher.request("stop"))
    time.sleep(0.1)
    over.set()
    for thread in threads:
        thread.join()
    stream.stop()
    t.check(stream.refusal is not None and stream.refusal["error"] == "not_armed", f"after the stop: {stream.refusal}")
    time.sleep(1)
    t.judge(rig)


PLACES = 16
STOP_MS = 60
FIRST_LINES = {"stop": b'{"cmd":"stop"}\n', "estop": b'{"cmd":"estop"}\n'}
RECONNECT = """
import socket, sys, time
begin, count = time.monotonic(), 0
while True:
    one = socket.socket(socket.AF_UNIX)
    one.connect(sys.argv[1])
    one.close()
    count += 1
    time.sleep(max(0, begin + count / 1000 - time.monotonic()))
"""


class Crowd:
    """Every place of both sockets, held by connections that behave alike."""

    def __init__(self, paths, used, poll):
        self.socks = [connect(path) for path in paths for _ in range(PLACES - used.get(path, 0))]
        self.over = threading.Event()
        self.thread = threading.Thread(target=self._behave, args=(poll,))
        self.thread.start()

    def _behave(self, poll):
        for sock in self.socks:
            sock.setblocking(False)
            if poll:
                sock.sendall(b'{"cmd":"watch","topics":["state","frame"],"rate_hz":100}\n')
        while not self.over.wait(0.01):
            for sock in self.socks if poll else ():
                try:
                    sock.send(b'{"cmd":"status"}\n{"cmd":"why"}\n')
                    sock.recv(1 << 20)
                except OSError:
                    pass

    def leave(self):
        self.over.set()
        self.thread.join()
        for sock in self.socks:
            sock.close()
        time.sleep(0.3)


def stop_by(t, rig, path, verb):
    """As a client that stops does it: the line with the connection, no greeting awaited."""
    sent_us = now_us()
    sock = connect(path)
    sock.sendall(FIRST_LINES[verb])
    reply = read_some(sock, 1)
    rig.timeline.append(Event(sent_us, verb, now_us()))
    sock.close()
    time.sleep(0.2)  # Until the bus log contains the reaction.
    t.check(b'"ok":true' in reply, f"{verb} by {os.path.basename(path)}: {reply[:200]!r}")
    return sent_us


@scenario("every place of both sockets in use: stop and estop are carried out within 60 ms, no client is evicted", 25)
def row33_stop_never_refused(t):
    rig = t.rig()
    rig.configure(northbound={"watch_socket": rig.path("watch.sock"), "watch_group": "none", "max_clients": PLACES})
    owner = rig.connect_to_new(name="owner")
    paths = [rig.path("gateway.sock"), rig.path("watch.sock")]
    worst = 0
    for kind in ("idle", "poll", "reconnect"):
        crowd = Crowd(paths, {paths[0]: 1}, kind == "poll")
        floods = [subprocess.Popen([sys.executable, "-c", RECONNECT, path]) for path in (paths if kind == "reconnect" else ())]
        time.sleep(0.4)
        try:
            for path in paths:
                for verb in FIRST_LINES:
                    stream = t.start_driving(owner, 300, 300, 0.6)
                    sent_us = stop_by(t, rig, path, verb)
                    slower = t.first_after(rig, sent_us, lambda mm_s: mm_s < 300, f"{verb} next to {kind}", STOP_MS)
                    worst = max(worst, slower or 0)
                    stream.stop()
                    if verb == "estop":
                        time.sleep(1.2)
                        t.reset(owner)
        finally:
            for flood in floods:
                flood.kill()
                flood.wait()
            still = sum(not _has_left(sock) for sock in crowd.socks)
            t.check(kind == "poll" or still == len(crowd.socks), f"{still} of {len(crowd.socks)} are still connected")
            crowd.leave()
    t.figure(f"slower after {worst:.1f} ms at most")
    t.judge(rig, estop_limit_us=STOP_MS * 1000)  # Includes the wait for a place of the socket.


BAD_STOPS = [
    (b'{"cmd":"stop","reason":"\\ud83d"}\n', "bad_json"),
    (b'{"reason":"a\\u0000b","cmd":"disarm"}\n', "bad_json"),
    (b'{"id":1,"id":1,"cmd":"estop"}\n', "bad_json"),
    (b'{"cmd" : "stop","t_us":1e999}\n', "bad_json"),
    (b'{"cmd":"stop","reason":' + b"[" * 9 + b"]" * 9 + b"}\n", "bad_json"),
    (b'{"cmd":"estop","reason":"cut\n', "bad_json"),
    (b'{"cmd":"stop","reason":"' + b"x" * 5000, "line_too_long"),
]


@scenario("a stop in a line that is refused as a whole, on both sockets: carried out within 60 ms, and refused", 30)
def row33_stop_in_a_bad_line(t):
    rig = t.rig()
    rig.configure(northbound={"watch_socket": rig.path("watch.sock"), "watch_group": "none"})
    owner = rig.connect_to_new(name="owner")
    observer = rig.client("observer")
    worst = 0
    for number, (line, error) in enumerate(BAD_STOPS):
        verb = "estop" if b"estop" in line else "stop"
        stream = t.start_driving(owner, 300, 300, 0.6)
        sock = connect(rig.path("watch.sock" if number % 2 else "gateway.sock"))
        read_some(sock, 1)  # The greeting
        sent_us = now_us()
        sock.sendall(line)
        reply = read_some(sock, 1)
        rig.timeline.append(Event(sent_us, verb, now_us()))
        time.sleep(0.2)  # Until the bus log contains the reaction.
        worst = max(worst, t.first_after(rig, sent_us, lambda mm_s: mm_s < 300, f"{line[:40]!r}", STOP_MS) or 0)
        t.check(f'"error":"{error}"'.encode() in reply and b"its stop is executed" in reply, f"{line[:40]!r}: {reply[:300]!r}")
        state = observer.request("status")["state"]  # The stream uses the owner.
        t.rule(state == ("latched" if verb == "estop" else "stopping"), f"{line[:40]!r}: {state}")
        sock.close()
        stream.stop()
        if verb == "estop":
            time.sleep(1.2)
            t.reset(owner)
    t.figure(f"slower after {worst:.1f} ms at most")
    t.judge(rig, estop_limit_us=STOP_MS * 1000)


def _has_left(sock):
    """The gateway has closed it."""
    try:
        while True:
            if not sock.recv(1 << 16):
                return True
    except BlockingIOError:
        return False
    except OSError:
        return True


@scenario("iwheelctl stops when its socket has no place, and by the other socket when it cannot use the one", 12)
def row33_iwheelctl_stops(t):
    rig = t.rig()
    os.makedirs(rig.path("watch"), mode=0o755)
    watch = rig.path("watch/gateway.sock")
    rig.configure(northbound={"watch_socket": watch, "watch_group": "none", "max_clients": PLACES})
    owner = rig.connect_to_new(name="owner")
    crowd = Crowd([rig.path("gateway.sock"), watch], {rig.path("gateway.sock"): 1}, False)
    away = rig.path("away")
    try:
        for moved in (None, rig.path("gateway.sock"), watch):
            for verb in (["stop"], ["estop", "a", "crowd"]):
                stream = t.start_driving(owner, 300, 300, 0.5)
                if moved:
                    os.rename(moved, away)
                sent_us = now_us()
                path = rig.path("gateway.sock") if moved != watch else watch
                code, text = call(rig, "iwheelctl", "--socket", path, *verb)
                rig.timeline.append(Event(sent_us, verb[0], now_us()))
                if moved:
                    os.rename(away, moved)
                t.check(code == 0, f"{verb[0]} with {moved} away: {code}: {text!r}")
                stream.stop(after=0.1)
                t.check(stream.refusal is not None, f"{verb[0]} with {moved} away stopped no client")
                if verb[0] == "estop":
                    time.sleep(1.2)
                    t.reset(owner)
        code, text = call(rig, "iwheelctl", "--socket", rig.path("gateway.sock"), "status")
        t.check(code == 1 and "too_many_clients" in text, f"other requests are refused: {code}: {text!r}")
    finally:
        crowd.leave()
    t.judge(rig, estop_limit_us=STOP_MS * 1000)  # From before its start: fork and exec alone take up to 5 ms.
