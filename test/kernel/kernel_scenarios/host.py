# SPDX-License-Identifier: MIT
"""Rows 24, 27 and 30: clocks that jump, processes that stand still, disks that are full, a second gateway."""

import fcntl
import os
import signal
import subprocess
import sys
import time

from catalogue import add, kernel_test
from client import Streamer
from harness import Process, now_us
from judge_log import Event
from kernel_rig import SlcanRig, VcanRig
from scenario import REGISTRY
from scenarios.bus_faults import wait_reset

from .interface import driving

HOUR_NS = 3600 * 10**9
STOPS_S = (0.15, 0.25, 0.45, 0.7, 1.5, 3.0)
F_SETPIPE_SZ = 1031


def step_clock(nanoseconds):
    now_ns = time.clock_gettime_ns(time.CLOCK_REALTIME)
    time.clock_settime_ns(time.CLOCK_REALTIME, now_ns + nanoseconds)


@kernel_test("wall clock one hour back and forth in motion: nothing happens", "host", 24)
def row24_wall_clock(t):
    rig, client, stream = driving(t)
    for step in (HOUR_NS, -2 * HOUR_NS, HOUR_NS):
        step_clock(step)
        time.sleep(1.0)
    refusal = stream.stop()
    t.check(refusal is None, f"the owner was refused: {refusal}")
    status = client.request("status")
    t.check(status["state"] == "armed", f"{status['state']}")
    off_s = abs(status["wall_us"] / 1e6 - time.time())
    t.check(off_s < 1, f"status tells the new wall time, off by {off_s:.0f} s")
    client.request("stop")
    time.sleep(0.4)
    t.judge(rig)


def stop_process(t, seconds):
    """The gateway's process stands still in motion for that long (SIGSTOP), while its client drives on."""
    rig, client, stream = driving(t, {"drive": {"lease_ms": 500, "accel_mm_s2": 2000, "decel_mm_s2": 5000}}, speed=500)
    begin_us = now_us()
    rig.note("cut", within_us=int(seconds * 1e6) + 60_000)
    rig.note("dead")
    rig.gateway.signal(signal.SIGSTOP)
    time.sleep(seconds)
    back_us = now_us()
    rig.gateway.signal(signal.SIGCONT)
    rig.note("alive")
    time.sleep(0.4)
    stream.stop()
    sent = [(at, value) for at, _, value in rig.bus.setpoints(back_us) if at < back_us + 300_000]
    first = [value for _, value in sent[:2]]
    t.check(first and not any(first), f"stopped for {seconds} s, its first pair is zero: {first}")
    burst = len([at for at, _ in sent if at < back_us + 10_000])
    t.check(burst <= 4, f"{burst} setpoints in the first 10 ms")
    state, cause = client.request("status")["state"], client.request("why")["cause"]
    if seconds >= 0.15:
        t.check(cause in ("loop_late", "loop_hung", "lease_lost", "wheel_lost"), f"cause {cause}")
    if seconds > 0.5:
        t.check(state == "latched" and cause == "loop_hung", f"{state}, {cause} after {seconds} s")
    t.measure("stale_frames", len([value for _, value in sent if value]))
    t.check(not any(value for _, value in sent), f"nothing but zeros afterwards: {sent[:6]}")
    return f"{seconds} s: {cause}"


@kernel_test("the gateway's process stands still for 70 ms: it drives on without a burst", "host", 24)
def row24_stopped_70_ms(t):
    rig, client, stream = driving(t)
    rig.gateway.signal(signal.SIGSTOP)
    time.sleep(0.07)
    back_us = now_us()
    rig.gateway.signal(signal.SIGCONT)
    time.sleep(0.4)
    t.check(stream.stop() is None, f"it drives on: {stream.refusal}")
    burst = len([at for at, _, _ in rig.bus.setpoints(back_us) if at < back_us + 10_000])
    t.check(burst <= 4, f"{burst} setpoints in the first 10 ms")
    client.request("stop")
    time.sleep(0.4)
    t.judge(rig)


for duration in STOPS_S:

    def stopped(t, duration=duration):
        rig_figure = stop_process(t, duration)
        t.figure(rig_figure)
        t.rigs[-1].bus.frames[:] = [f for f in t.rigs[-1].bus.frames if not f.own]
        t.judge(t.rigs[-1])

    add(
        f"row24_stopped_{int(duration * 1000)}_ms",
        f"the gateway's process stands still for {duration} s: from zero, with a fresh command",
        stopped,
        groups="host realtime" if duration in (0.25, 0.7) else "host",
        row=24,
        rig=VcanRig,
    )


@kernel_test("the client's process stands still for 1 s: the lease stops it, its old commands move nothing", "host realtime", 24)
def row24_client_stopped(t):
    REGISTRY["row02_client_frozen"][2](t)


@kernel_test("CPU starved: six hogs beside it; the gap holds or it stops from zero", "realtime", 24)
def row24_starved(t):
    rig, client, stream = driving(t)
    hogs = [subprocess.Popen([sys.executable, "-c", "while True: pass"]) for _ in range(6)]
    for hog in hogs:
        os.setpriority(os.PRIO_PROCESS, hog.pid, 19)
    time.sleep(4.0)
    for hog in hogs:
        hog.kill()
        hog.wait()
    refusal = stream.stop()
    why = client.request("why")
    causes = (None, "loop_late", "loop_hung", "lease_lost", "wheel_lost", "send_stalled")
    t.check(why["cause"] in causes, f"cause {why['cause']}")
    t.figure("drove on" if refusal is None else f"stopped: {why['cause']}")
    if why["cause"] is not None:
        rig.timeline.append(Event(why["at_us"], "cut", within_us=200_000))
    client.request("stop")
    time.sleep(0.5)
    t.judge(rig)


def full_disk(folder):
    """A file system without a byte left."""
    os.makedirs(folder, exist_ok=True)
    subprocess.run(["mount", "-t", "tmpfs", "-o", "size=64k", "tmpfs", folder], check=True)
    try:
        with open(os.path.join(folder, "filler"), "wb", buffering=0) as file:
            while True:
                file.write(bytes(4096))
    except OSError:
        pass


@kernel_test("disk full where records go, then read-only: motion unaffected", "host", 27)
def row27_disk_full(t):
    rig = t.rig()
    folder = rig.path("records")
    full_disk(folder)
    rig.settings.setdefault("record", {})["directory"] = folder
    rig.write_config()
    try:
        rig.start_gateway()
        client = rig.client()
        for remount in (None, "ro"):
            if remount:
                subprocess.run(["mount", "-o", "remount,ro", folder], check=True)
            t.arm(client)
            stream = Streamer(client, 300, 300, 0.02)
            time.sleep(0.7)
            rig.press()
            time.sleep(0.3)
            stream.stop()
            t.stopped_by(client, "estop_line")
            rig.release()
            wait_reset(t, client)
            time.sleep(0.5)
        t.arm(client)
        t.drive_for(client, 200, 200, 0.5)
        t.judge(rig)
    finally:
        rig.gateway.end()
        subprocess.run(["umount", "-l", folder], check=True)


@kernel_test("stderr is a full pipe that nobody reads: motion unaffected", "host realtime", 27)
def row27_stderr_blocked(t):
    rig = t.rig()
    read_end, write_end = os.pipe()
    fcntl.fcntl(write_end, F_SETPIPE_SZ, 4096)
    os.set_blocking(write_end, False)
    try:
        while True:
            os.write(write_end, b"x")
    except BlockingIOError:
        os.set_blocking(write_end, True)
    rig.start_gateway("--log-level", "debug", setup=lambda: os.dup2(write_end, 2))
    client = rig.client()
    for _ in range(3):
        t.arm(client)
        stream = Streamer(client, 300, 300, 0.02)
        time.sleep(0.5)
        rig.press()
        time.sleep(0.1)
        stream.stop()
        t.stopped_by(client, "estop_line")
        rig.release()
        wait_reset(t, client)
    t.arm(client)
    t.drive_for(client, 200, 200, 0.5)
    t.judge(rig)
    os.close(read_end)
    os.close(write_end)


def second_gateway(t):
    """Another gateway on the same interface refuses and sends nothing; the first one drives on."""
    rig, client, stream = driving(t, speed=250)
    for extra in ((), ("--socket", rig.path("other.sock"))):
        other = Process(rig.gateway_command(*extra), rig.path("second.out"))
        rig.processes.append(other)
        code, text = other.wait(5), other.text()
        t.check(code == 69, f"exit code {code} with {extra}: {text[-200:]}")
        t.check("gateway" in text and len(text) > 40, f"it says why: {text[-200:]}")
    t.check(stream.stop() is None, f"the first one drives on: {stream.refusal}")
    client.request("stop")
    time.sleep(0.5)
    t.judge(rig)


@kernel_test("two gateways on one vcan interface", "host", 30)
def row30_two_gateways(t):
    second_gateway(t)


@kernel_test("two gateways on one adapter", "adapter", 30, SlcanRig)
def row30_two_gateways_adapter(t):
    second_gateway(t)


@kernel_test("the first gateway is killed: its interface is free again at once", "host", 30)
def row30_after_a_crash(t):
    rig, client = t.running()
    rig.kill_gateway(signal.SIGKILL)
    rig.start_gateway()
    again = rig.client()
    t.arm(again)
    t.drive_for(again, 200, 200, 0.5)
    t.judge(rig)
