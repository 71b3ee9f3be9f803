# SPDX-License-Identifier: MIT
"""Rows 24, 26 and 27: a gateway whose process is stopped, suspended or stuck, or cannot write its log."""

import contextlib
import fcntl
import itertools
import os
import re
import signal
import socket
import time

from client import Streamer
from harness import hook_library, now_us
from judge_log import Event
from scenario import scenario


STOPS_S = (0.15, 0.25, 0.45, 0.7, 1.5, 3.0)
F_SETPIPE_SZ = 1031
WATCHDOG_MS = 400
SEEN_US = 40_000  # the hook reads an order with the next command, 20 ms later


# Row 24: the process is stopped ------------------------------------------------------------------------------------------


def from_zero(t, rig, back_us, what):
    """Checks what was sent after the process continued: zeros, without a burst."""
    sent = [(at, value) for at, _, value in rig.bus.setpoints(back_us) if at < back_us + 300_000]
    first = [value for _, value in sent[:2]]
    t.check(first and not any(first), f"{what}, its first pair is zero: {first}")
    burst = len([at for at, _ in sent if at < back_us + 10_000])
    t.check(burst <= 4, f"{burst} setpoints in the first 10 ms")
    t.measure("stale_frames", len([value for _, value in sent if value]))
    t.rule(not any(value for _, value in sent), f"nothing but zeros afterwards: {sent[:6]}")


def stop_process(t, seconds):
    """The gateway's process is stopped in motion for that long (SIGSTOP), while its client drives on."""
    rig, client, stream = t.driving({"drive": {"lease_ms": 500, "accel_mm_s2": 2000, "decel_mm_s2": 5000}}, speed=500)
    client.timeout = seconds + 3
    rig.note("cut", within_us=int(seconds * 1e6) + 60_000)
    rig.note("dead")
    rig.gateway.signal(signal.SIGSTOP)
    time.sleep(seconds)
    back_us = now_us()
    rig.gateway.signal(signal.SIGCONT)
    rig.note("alive")
    stream.stop(after=0.4)
    from_zero(t, rig, back_us, f"stopped for {seconds} s")
    state, cause = client.request("status")["state"], client.request("why")["cause"]
    t.check(cause in ("loop_late", "loop_hung", "lease_lost", "wheel_lost"), f"cause {cause}")
    if seconds > 0.5:
        t.check(state == "latched" and cause == "loop_hung", f"{state}, {cause} after {seconds} s")
    t.figure(f"{seconds} s: {cause}")
    t.judge(rig)


for duration in STOPS_S:

    def stopped(t, duration=duration):
        stop_process(t, duration)

    stopped.__name__ = f"row24_stopped_{int(duration * 1000)}_ms"
    scenario(f"the gateway's process is stopped for {duration} s: from zero, with a fresh command", 6)(stopped)


@scenario("the gateway's process is stopped for 70 ms: it drives on without a burst", 4)
def row24_stopped_70_ms(t):
    rig, client, stream = t.driving()
    rig.gateway.signal(signal.SIGSTOP)
    time.sleep(0.07)
    back_us = now_us()
    rig.gateway.signal(signal.SIGCONT)
    t.check(stream.stop(after=0.4) is None, f"it drives on: {stream.refusal}")
    burst = len([at for at, _, _ in rig.bus.setpoints(back_us) if at < back_us + 10_000])
    t.check(burst <= 4, f"{burst} setpoints in the first 10 ms")
    t.stop_for(client, 0.4)
    t.judge(rig)


# Row 26 and suspend: faults inside the process, by the preloaded hook (hook.c) -------------------------------------------


class Watchdog:
    """The part of a service manager that receives the gateway's notifications."""

    def __init__(self, path):
        self.socket = socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM)
        self.socket.bind(path)
        self.path = path

    def receive(self, seconds):
        """The notifications of that time, as [(t_us, text)]."""
        received, deadline = [], time.monotonic() + seconds
        while True:
            self.socket.settimeout(max(0.001, deadline - time.monotonic()))
            with contextlib.suppress(TimeoutError):
                received.append((now_us(), self.socket.recv(100).decode()))
            if time.monotonic() >= deadline:
                return received


def hooked(rig, watchdog=None):
    """What to do in the child before it becomes the gateway."""

    def prepare():
        os.environ["LD_PRELOAD"] = hook_library(rig.build)
        os.environ["IWHEEL_HOOK"] = rig.path("hook")
        if watchdog:
            os.environ.update(NOTIFY_SOCKET=watchdog.path, WATCHDOG_USEC=str(WATCHDOG_MS * 1000))

    return prepare


def order(rig, words):
    """Sends the hook an order; it follows from its next call on."""
    with open(rig.path("hook.new"), "w", encoding="ascii") as file:
        file.write(words)
    os.replace(rig.path("hook.new"), rig.path("hook"))


def stuck(t, where):
    """One part of the cycle never returns; the service manager receives no notification any more and kills the gateway."""
    rig = t.rig()
    watchdog = Watchdog(rig.path("notify"))
    client = rig.connect_to_new(setup=hooked(rig, watchdog))
    t.arm(client)
    stream = Streamer(client, 400, 400, 0.02)
    words = watchdog.receive(1.2)
    t.check(any(word == "READY=1" for _, word in words), f"it reports that it is ready: {words[:3]}")
    fed = [at for at, word in words if word == "WATCHDOG=1"]
    gap_ms = max((b - a for a, b in itertools.pairwise(fed)), default=10**9) / 1000
    t.check(gap_ms < WATCHDOG_MS, f"without a fault the watchdog is fed every {gap_ms:.0f} ms", True)
    order(rig, where)
    stuck_us = now_us()
    rig.timeline.append(Event(stuck_us + SEEN_US, "end"))
    late = [at for at, word in watchdog.receive(WATCHDOG_MS * 2.5 / 1000) if at > stuck_us + SEEN_US]
    t.check(not late, f"stuck, it feeds the watchdog no more: {len(late)} times")
    t.check(rig.gateway.child.poll() is None, "its process still runs")
    rig.gateway.signal(signal.SIGABRT)
    rig.gateway.wait(3)
    stream.stop()
    os.unlink(rig.path("hook"))
    killed_us = now_us()
    observer = rig.connect_to_new(wheels=False, restart_hold=True, name="observer")
    time.sleep(0.3)
    again = rig.bus.setpoints(killed_us)
    t.check(again and not any(speed for _, _, speed in again), f"restarted, zeros and nothing else: {again[:3]}")
    t.silence(rig, observer, text="listening after the hold")
    t.figure(f"fed every {gap_ms:.0f} ms of {WATCHDOG_MS} ms")
    t.judge(rig)


@scenario("stuck with a client: the watchdog is fed no more; killed and restarted: zeros first", 8)
def row26_stuck_clients(t):
    stuck(t, "clients")


@scenario("stuck with the bus: the watchdog is fed no more", 8)
def row26_stuck_frames(t):
    stuck(t, "frames")


@scenario("stuck with the e-stop: the watchdog is fed no more", 8)
def row26_stuck_button(t):
    stuck(t, "button")


@scenario("the machine was suspended for 2 s in motion: latched, from zero, with a fresh command", 5)
def row24_suspended(t):
    rig = t.rig()
    client = rig.connect_to_new(setup=hooked(rig))
    stream = t.start_driving(client, 300, 300, 0.7, 0.02)
    rig.note("cut", within_us=60_000)
    order(rig, "asleep 2")
    stream.stop(after=0.4)
    from_zero(t, rig, client.request("why")["at_us"], "suspended for 2 s")  # The hook obeys at one of the next calls.
    t.stopped_by(client, "loop_hung")
    t.check(re.search("suspended for (199[0-9]|2000) ms", rig.gateway.text()), f"the log has it: {rig.gateway.text()[-300:]}")
    t.reset(client)
    t.drive_and_judge(rig, client)


# Row 27 ------------------------------------------------------------------------------------------------------------------


def full_pipe():
    """Both ends of a pipe that accepts nothing more; a writer waits."""
    read_end, write_end = os.pipe()
    fcntl.fcntl(write_end, F_SETPIPE_SZ, 4096)
    os.set_blocking(write_end, False)
    try:
        while True:
            os.write(write_end, b"x")
    except BlockingIOError:
        os.set_blocking(write_end, True)
    return read_end, write_end


@scenario("stderr is a full pipe without a reader: motion unaffected", 8)
def row27_stderr_blocked(t):
    rig = t.rig()
    read_end, write_end = full_pipe()
    client = rig.connect_to_new("--log-level", "debug", setup=lambda: os.dup2(write_end, 2))
    for _ in range(3):
        stream = t.start_driving(client, 300, 300, 0.5, 0.02)
        rig.press()
        stream.stop(after=0.1)
        t.stopped_by(client, "estop_line")
        rig.release()
        t.reset(client)
    t.drive_and_judge(rig, client)
    os.close(read_end)
    os.close(write_end)
