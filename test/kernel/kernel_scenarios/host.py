# SPDX-License-Identifier: MIT
"""Rows 24, 27 and 30: clocks that jump, processes that are stopped, disks that are full, a second gateway."""

import os
import shutil
import signal
import subprocess
import sys
import time

from catalogue import kernel_test
from harness import STRANGER, become_stranger, lock_names, now_us, wait_connect
from judge_log import GAP_US, Event
from scenario import REGISTRY

HOUR_NS = 3600 * 10**9


def step_clock(rig, nanoseconds):
    rig.bus.before_step()
    now_ns = time.clock_gettime_ns(time.CLOCK_REALTIME)
    time.clock_settime_ns(time.CLOCK_REALTIME, now_ns + nanoseconds)
    rig.bus.after_step()


@kernel_test("wall clock one hour back and forth in motion: nothing happens", "host", 24)
def row24_wall_clock(t):
    rig, client, stream = t.driving()
    for step in (HOUR_NS, -2 * HOUR_NS, HOUR_NS):
        step_clock(rig, step)
        time.sleep(1.0)
    refusal = stream.stop()
    t.check(refusal is None, f"the owner was refused: {refusal}")
    status = client.request("status")
    t.check(status["state"] == "armed", f"{status['state']}")
    off_s = abs(status["wall_us"] / 1e6 - time.time())
    t.check(off_s < 1, f"status reports the new wall time, off by {off_s:.0f} s")
    t.stop_for(client, 0.4)
    t.judge(rig)


@kernel_test("the client's process is stopped for 1 s: the lease stops the wheels, its old commands move nothing", "host realtime-full", 24)
def row24_client_stopped(t):
    REGISTRY["row02_client_frozen"][2](t)


@kernel_test("no free CPU: six busy programs; the gap is within its limit, or it stops from zero", "starved", 24)
def row24_starved(t):
    rig, client, stream = t.driving()
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
    t.stop_for(client, 0.5)
    t.judge(rig, pair_limit_us=GAP_US)  # another program may run between the frames of the two wheels; each wheel's gap is judged anyway


def full_disk(folder):
    """A file system without a free byte."""
    os.makedirs(folder, exist_ok=True)
    subprocess.run(["mount", "-t", "tmpfs", "-o", "size=64k", "tmpfs", folder], check=True)
    try:
        with open(os.path.join(folder, "filler"), "wb", buffering=0) as file:
            while True:
                file.write(bytes(4096))
    except OSError:
        pass


@kernel_test("the disk of the recordings is full, then read-only: motion unaffected", "host", 27)
def row27_disk_full(t):
    rig = t.rig()
    folder = rig.path("records")
    full_disk(folder)
    rig.configure(record={"directory": folder})
    try:
        client = rig.connect_to_new()
        for remount in (None, "ro"):
            if remount:
                subprocess.run(["mount", "-o", "remount,ro", folder], check=True)
            stream = t.start_driving(client, 300, 300, 0.7, 0.02)
            rig.press()
            stream.stop(after=0.3)
            t.stopped_by(client, "estop_line")
            rig.release()
            t.reset(client)
            time.sleep(0.5)
        t.drive_and_judge(rig, client)
    finally:
        rig.gateway.end()
        subprocess.run(["umount", "-l", folder], check=True)


def restarted(t, rig, killed_us):
    """The gateway again, after a kill in motion: zeros first. Returns a client of it."""
    observer = rig.connect_to_new(wheels=False, restart_hold=True, name="observer")
    time.sleep(0.3)
    sent = rig.bus.setpoints(killed_us + 20_000)
    t.check(sent and not any(speed for _, _, speed in sent), f"zeros and nothing but zeros: {sent[:4]}")
    return observer


@kernel_test("processes of other users hold the names of the lock: the gateway starts, after a kill in motion too, and only once", "host", 30)
def row30_strangers(t):
    rig, _, stream = t.driving()
    names = lock_names(rig.gateway_bus())
    killed_us = now_us()
    rig.kill_gateway(signal.SIGKILL)
    stream.stop()
    stranger = rig.stranger("listening", names[:1])
    rig.stranger("silent", names[1:])
    observer = restarted(t, rig, killed_us)
    text = rig.gateway.text()
    t.check(f"process {stranger.child.pid} of user 65534 holds @{names[0]}" in text, f"who holds it: {text[:600]}")
    os.mkdir(rig.path("elsewhere"))
    other = rig.launch(rig.gateway_command("--socket", rig.path("elsewhere/gateway.sock")), "second.out")
    t.check(other.wait(5) == 69, f"a second gateway is refused: {other.text()[-300:]}")
    t.silence(rig, observer, text="listening after the hold")
    t.drive_and_judge(rig, observer)


@kernel_test("another user's gateway on the same interface ends when root's starts", "host", 30)
def row30_gives_way(t):
    rig = t.rig()
    folder = rig.path("theirs")
    os.mkdir(folder)
    os.chmod(rig.folder, 0o755)
    os.chown(folder, STRANGER, STRANGER)
    command = rig.gateway_command("--socket", os.path.join(folder, "gateway.sock"), "--estop", "none")
    shutil.copy(rig.path("gateway.conf"), folder)
    command[command.index(rig.path("gateway.conf"))] = os.path.join(folder, "gateway.conf")
    command[0] = shutil.copy(command[0], folder)  # The build may be in a folder that only its owner may enter, as in /root.
    os.chown(os.path.join(folder, "gateway.conf"), STRANGER, STRANGER)
    theirs = rig.launch(command, "theirs.out", become_stranger)
    wait_connect(os.path.join(folder, "gateway.sock"), theirs).close()
    rig.start_gateway()
    t.check(f"process {theirs.child.pid} of user 65534 holds" in rig.gateway.text(), f"named: {rig.gateway.text()[-400:]}")
    t.check(theirs.wait(5) == 69, "it ends")
    t.check("has priority over this one" in theirs.text(), f"and prints the reason: {theirs.text()[-300:]}")
    again = rig.launch(command, "again.out", become_stranger)
    t.check(again.wait(5) == 69 and "another gateway already serves" in again.text(), f"nor starts: {again.text()[-300:]}")
    client = rig.client()
    t.drive_and_judge(rig, client)


@kernel_test("the first gateway is killed: its interface is free again immediately", "host", 30)
def row30_after_a_crash(t):
    rig, _client = t.running()
    rig.kill_gateway(signal.SIGKILL)
    again = rig.connect_to_new()
    t.drive_and_judge(rig, again)


@kernel_test("killed in motion; a gateway with its socket elsewhere finds the marker: zeros first", "host", 25)
def row25_marker_found_elsewhere(t):
    rig, _client, stream = t.driving()
    killed_us = now_us()
    rig.kill_gateway(signal.SIGKILL)
    stream.stop()
    os.mkdir(rig.path("elsewhere"))
    rig.socket_name = "elsewhere/gateway.sock"
    observer = restarted(t, rig, killed_us)
    t.check(observer.request("status")["cause"] == "restart", "the cause is the restart")
    t.silence(rig, observer, text="listening after the hold")
    t.arm_and_drive(observer, 200, 200, 0.4)
    t.stop_until_silent(rig, observer)
    rig.gateway.end()
    silent_us = now_us()
    rig.start_gateway()
    time.sleep(0.3)
    t.rule(not rig.bus.setpoints(silent_us), "and removes it: the next start sends nothing")
    t.judge(rig)
