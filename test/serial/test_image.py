# SPDX-License-Identifier: MIT
"""Scenarios of test_wires.py with the real image as the board, and scenarios that only the image can play: its e-stop pin and its resets."""

import bisect
import contextlib
import json
import os
import random
import socket
import sys
import threading
import time

sys.path.insert(0, os.path.join(os.path.dirname(os.path.dirname(os.path.dirname(os.path.abspath(__file__)))), "python", "src"))

import pytest
import test_wires as wires
from bus import now_us
from harness import Process
from iwheel import Gateway
from judge import Judge
from judge_log import Event, Frame, Violation, signed
from rig import Cable, SerialRig
from scenario import scenario
from test_wires import all_closed, await_service, bad_stop, begin, cable_pulled, client_killed, relay_killed, relay_stopped, stop_well, tool  # noqa: F401

HERE = os.path.dirname(os.path.abspath(__file__))
SLICE_US = 2000  # As in image.py.
STALL_US = 30_000  # A time without running the board counts as a stall from this duration.


class BoardBus(threading.Thread):
    """The board's reports about its bus (image.py), in the board's time; `time_of` converts this machine's time."""

    def __init__(self, link):
        super().__init__(daemon=True)
        self.link, self.frames, self.errors, self.events, self.forbidden = link, [], [], [], []
        self.walls, self.boards = [], []  # Begin of each slice in this machine's time and in the board's.
        self.closed = False
        self.start()

    def run(self):
        rest = b""
        while not self.closed:
            try:
                new = self.link.recv(1 << 16)
            except OSError:
                return
            if not new:
                return
            *lines, rest = (rest + new).split(b"\n")
            for line in lines:
                self.receive(*line.decode().split(" ", 1))

    def receive(self, kind, text):
        if kind == "T":
            wall, board = map(int, text.split())
            if not self.walls:
                self.base = wall - board
            self.boards.append(board + self.base)  # Append this before `walls`, because `time_of` searches `walls`.
            self.walls.append(wall)
        elif kind == "F":
            t_us, number, data = text.split(" ")
            self.frames.append(Frame(int(t_us) + self.base, int(number), bytes.fromhex(data)))
        elif kind == "E":
            t_us, name, within_us = text.split()
            self.events.append(Event(int(t_us) + self.base, name, int(t_us) + self.base, within_us=int(within_us)))
        else:
            self.forbidden.append(text)

    def time_of(self, wall_us):
        at = bisect.bisect_right(self.walls, wall_us) - 1
        return self.boards[at] + min(wall_us - self.walls[at], SLICE_US) if at >= 0 else wall_us

    def stalls(self):
        return [(b, b - a) for a, b in zip(self.walls, self.walls[1:], strict=False) if b - a > STALL_US]

    def setpoints(self, since_us=0):
        """As Bus.setpoints, from a time of this machine."""
        since = self.time_of(since_us) if since_us else 0
        return [(f.t_us, f.id, signed(f.data, 1)) for f in list(self.frames) if f.id in (266, 298) and f.t_us >= since and len(f.data) >= 3]

    def close(self):
        self.closed = True


class ImageBoard:
    """The process of image.py: it replaces the simulator's wheels and the board."""

    def __init__(self, rig):
        self.uart, theirs = socket.socketpair()
        self.uart.setsockopt(socket.SOL_SOCKET, socket.SO_SNDBUF, 4096)  # The buffer size of a tty.
        self.link, link = socket.socketpair()
        command = [
            sys.executable,
            os.path.join(HERE, "image.py"),
            os.environ["IWHEEL_BOARD"],
            os.environ["IWHEEL_IMAGE"],
            os.environ["IWHEEL_MODEL"],
            str(link.fileno()),
        ]
        self.process = Process(command, rig.path("board.out"), setup=lambda: os.dup2(theirs.fileno(), 0), pass_fds=[theirs.fileno(), link.fileno()])
        theirs.close()
        link.close()

    def send(self, word):
        self.link.sendall(f"{word}\n".encode())

    def end(self):
        self.link.close()
        self.process.end()


class ImageRig(SerialRig):
    """Judged in the board's time: a busy machine makes it pass more slowly and excuses nothing."""

    def start_wheels(self, sim_args):
        return ImageBoard(self)

    def listen(self, frames=None):
        return BoardBus(self.sim.link)

    def start_board(self):
        self.board = self.sim.process
        self.cable = Cable(self.path("port"), self.sim.uart)

    def pass_time(self, seconds):
        """Waits this long in the board's time."""
        end_us = self.bus.time_of(now_us()) + seconds * 1e6
        while self.bus.time_of(now_us()) < end_us and self.board.child.poll() is None:
            time.sleep(0.005)

    def times(self, count):
        return count if FULL else max(1, count // 3)

    def note_after(self, wait_us, kind, **fields):
        self.bus.events.append(Event(self.bus.time_of(now_us()) + wait_us, kind, **fields))

    def press(self):
        self.sim.send("press")

    def release(self):
        self.sim.send("release")

    def judge(self, moves=True, **options):
        self.pass_time(0.05)
        frames = list(self.bus.frames)
        finished_us = frames[-1].t_us - 20_000 if frames else 0
        of = self.bus.time_of
        timeline = [event._replace(t_us=of(event.t_us), done_us=of(event.done_us) if event.done_us else 0) for event in self.timeline]
        judge = Judge(
            self.judge_config(),
            [frame for frame in frames if frame.t_us <= finished_us],
            timeline + self.bus.events,
            moves=moves,
            finished_us=finished_us,
            **options,
        )
        judge.judge()
        judge.found += [Violation("chip", 0, f"the image did something that the chip forbids: {text}", False) for text in self.bus.forbidden]
        judge.bus_stalls, judge.machine_stalls = list, self.bus.stalls
        return judge


# ---- the same, with the real image -----------------------------------------------------------------------------------

FULL = os.environ.get("IWHEEL_FULL") == "1"
if FULL:
    from test_wires import alone, deaf, delayed, drive, flood, noisy, rights, slow, terminated, too_fast  # noqa: F401


@pytest.fixture
def rig_type():
    return ImageRig


@scenario("corrupted, cut, doubled and late lines move nothing", 15)
def bad_lines(t):
    wires.send_bad_lines(t, 5000 if FULL else 1000, 20)


@scenario("the e-stop pin at any phase: zero within 5 ms, latched, and nothing moves before reset, arm and a fresh command", 14)
def estop_pin(t):
    rig, client = begin(t)
    chance = random.Random(11)
    for turn in range(rig.times(9)):
        t.drive_for(client, 200, 200, 0.4)
        time.sleep(chance.random() / 50)
        rig.press()
        rig.pass_time(0.05)
        t.expect(client.drive(200, 200), "estop_pressed")
        t.expect(client.request("reset"), "estop_pressed")
        why = client.request("why")
        t.check(why["cause"] == "estop_line" and "PB0" in why["sentence"], f"{why['cause']}: {why['sentence']}")
        rig.release()
        released_us = now_us()
        rig.pass_time(1.3)
        t.expect(client.drive(200, 200), "latched")
        t.rule(not rig.moving(released_us), f"moved by a release, turn {turn}")
        for _ in range(40):
            reply = client.request("reset")
            if reply["ok"]:
                break
            rig.pass_time(0.1)
        t.expect(reply)
        t.rule(not rig.moving(released_us), f"moved by a reset, turn {turn}")
        t.arm(client)
    stop_well(t, rig, client)


@scenario("both resets in motion: zeros first, all clients are closed, and no later command of them is obeyed", 14)
def resets(t):
    rig, client = begin(t)
    boots = [rig.gateway.text().rsplit(": start ", 1)[-1].split(",")[0]]
    for way in ("reset", "hang"):
        watcher = rig.watcher()
        watcher.wait_event("hello")
        t.drive_for(client, 250, 250, 0.5)
        rig.sim.send(way)
        all_closed(t, rig, (client, watcher), 100, way)
        client = await_service(t, rig)
        boots.append(rig.gateway.text().rsplit(": start ", 1)[-1].split(",")[0])
        t.expect(client.drive(100, 100), "not_armed")
        t.check(rig.wait_status(client, lambda s: s["state"] == "listening" and s["left"]["at_rest"], 8), "listening")
        t.arm(client)
    t.check(len(set(boots)) == 3 and all(len(boot) == 16 for boot in boots), f"each start has a different name: {boots}")
    t.drive_for(client, 150, 150, 0.3)
    stop_well(t, rig, client)


@scenario("configured by iwheelctl and the Python client: stored values survive a reset", 12)
def kept(t):
    rig, client = t.running()
    t.check(reply_of_tool(t, rig, "config", "set", "drive.lease_ms", "300")["staged"], "staged")
    t.check("no key" in reply_of_tool(t, rig, "config", "set", "bus.interface", "can0", code=1)["message"], "a daemon's key")
    t.check(reply_of_tool(t, rig, "confirm", "wheel_radius")["state"] == "confirmed", "confirmed")
    rig.pass_time(2.5)
    tared = reply_of_tool(t, rig, "tare", "left")["left"]["offset_mN"]
    rig.pass_time(2.5)
    t.check(reply_of_tool(t, rig, "status")["memory"]["state"] == "kept", "kept")
    t.check(reply_of_tool(t, rig, "config", "commit")["restarts"], "a restart with the new value")
    with contextlib.suppress(wires.Closed, OSError):
        t.check(client.wait_event("nothing", 3.0), "its clients are closed")
    await_service(t, rig).close()
    with Gateway(rig.path("gateway.sock"), wait=3.0) as gateway:
        keys = {entry["key"]: entry["value"] for entry in gateway.config()["keys"]}
        t.check(keys["drive.lease_ms"] == "300" and keys["wheels.setpoint_type"] == "1", f"{keys}")
        t.check(gateway.config("drive.lease_ms", 200)["staged"] and not gateway.config(commit=False)["staged"], "staged and discarded")
    rig.sim.send("reset")
    rig.pass_time(1.0)
    client = await_service(t, rig)
    status = client.request("status")
    radius, left = status["ledger"]["wheel_radius"], status["left"]
    t.check((radius["state"], radius["evidence"]) == ("confirmed", "operator"), f"{radius}")
    t.check((left["offset_origin"], left["force_offset_mN"], left["offset_provenance"]) == ("operator", tared, "stored"), f"{left}")
    t.check(status["lease"]["lease_ms"] == 300, "configured")
    output = " ".join(wires.run_tool(rig, "ledger").stdout.split())
    t.check("wheel_radius: confirmed by the operator" in output and "track: configured, not verified" in output, output)
    t.judge(rig, moves=False)


def reply_of_tool(t, rig, *words, code=0):
    """Runs iwheelctl with the relay and returns its reply."""
    done = wires.run_tool(rig, "--json", *words)
    t.check(done.returncode == code, f"iwheelctl {' '.join(words)}: {done.returncode} {done.stdout} {done.stderr}")
    return json.loads(done.stdout.splitlines()[-1]) if done.stdout else {}
