#!/usr/bin/env python3
# SPDX-License-Identifier: MIT
"""Compares the bridge to ROS 2 with a program in C: time until a command is on the bus, and cost. Prints the figures; docs/developer/speed.md has a paragraph on them.

usage: test/bench/ros2.py [--build DIR] [--rounds N]    with .venv's python

In turns in one run: commands through libiwheel-client (from the call to the first frame of its speed), and through cmd_vel: from the publisher's write, and from
the time when DDS in the bridge's process had received it (ros2_stamps.c, preloaded).
"""

import argparse
import ctypes
import os
import sys
import subprocess
import time

ROOT = os.path.dirname(os.path.dirname(os.path.dirname(os.path.abspath(__file__))))
sys.path[:0] = [os.path.join(ROOT, "test", part) for part in ("support", "system", "ros2")]

from bus import now_us
from free_domain import free_domain
from harness import Process, Rig
from judge_log import percentile
from peer import Peer

COMMANDS, EVERY_S, COST_S = 120, 0.053, 10
SPEEDS = (200, 260)
CONFIG = {"limits": {"wheel_silent_ms": 200, "echo_ms": 200}, "drive": {"lease_ms": 300, "accel_mm_s2": 20000, "decel_mm_s2": 20000}}


def to_frame(rig, commands):
    """Microseconds from each (t_us, speed) to the first frame with its speed."""
    frames, found = rig.bus.setpoints(commands[0][0]), []
    for t_us, speed in commands[5:]:
        hit = next((at for at, _, sent_speeds in frames if at >= t_us and sent_speeds == speed), None)
        if hit is not None and hit - t_us < EVERY_S * 1e6:
            found.append(hit - t_us)
    return found


def command(send):
    """Sends two speeds in turn; returns them as (t_us, speed)."""
    sent = []
    for number in range(COMMANDS):
        sent.append((now_us(), SPEEDS[number % 2]))
        send(sent[-1][1])
        time.sleep(EVERY_S)
    return sent


def by_client(rig, build):
    library = ctypes.CDLL(os.path.join(build, "lib", "client", "libiwheel-client.so"))
    library.iwc_new.restype = ctypes.c_void_p
    gateway = ctypes.c_void_p(library.iwc_new())
    assert library.iwc_connect(gateway, rig.path("gateway.sock").encode(), 1000) == 0
    for _ in range(60):
        if library.iwc_arm(gateway, b"bench", False, 1000, None) == 0:
            break
        time.sleep(0.1)
    try:
        return to_frame(rig, command(lambda speed: library.iwc_twist(gateway, speed, 0, 40, None)))
    finally:
        library.iwc_stop(gateway, 1000)
        library.iwc_free(gateway)


def by_bridge(rig, peer, writer):
    """(from published, from received, inside the bridge)"""
    for _ in range(60):
        if peer.call("iwheel/arm")[0]:
            break
        time.sleep(0.1)
    messages = {speed: peer.twist(speed / 1000) for speed in SPEEDS}
    sent = command(lambda speed: writer.write(messages[speed]))
    with open(rig.path("stamps"), encoding="ascii") as file:
        stamps = [tuple(map(int, line.split())) for line in file]
    received = []
    for t_us, speed in sent:
        found = next((stamp for stamp in stamps if t_us <= stamp[0] < t_us + EVERY_S * 1e6), None)
        received += [(found, speed)] if found else []
    inside = [left - came for (came, left), _ in received]
    return to_frame(rig, sent), to_frame(rig, [(came, speed) for (came, _), speed in received]), inside


def at_rest(rig, client):
    rig.wait_status(client, lambda s: s["state"] == "listening" and s["left"]["at_rest"] and s["right"]["at_rest"], 10)
    time.sleep(0.6)


def words(values):
    return f"p50 {percentile(values, 50)} µs, p90 {percentile(values, 90)} µs ({len(values)})"


def main():
    parser = argparse.ArgumentParser()
    parser.add_argument("--build", default=os.path.join(ROOT, "build", "default"))
    parser.add_argument("--rounds", type=int, default=3)
    options = parser.parse_args()
    rig = Rig(options.build, CONFIG)
    try:
        rig.start_gateway()
        domain = free_domain()
        with open(rig.path("ros2.conf"), "w", encoding="utf-8") as file:
            file.write(f"[gateway]\nsocket = {rig.path('gateway.sock')}\n[ros]\ndomain = {domain}\nnetwork = loopback\n")
        preload = rig.path("stamps.so")
        subprocess.run(["cc", "-shared", "-fPIC", "-O1", "-o", preload, os.path.join(ROOT, "test/bench/ros2_stamps.c"), "-ldl"], check=True)
        surroundings = {**os.environ, "LD_PRELOAD": preload, "BENCH_STAMPS": rig.path("stamps")}
        bridge = Process([os.path.join(options.build, "app/bridge/ros2/iwheel-ros2"), "-c", rig.path("ros2.conf")], rig.path("bridge.out"), env=surroundings)
        rig.processes.append(bridge)
        peer, client = Peer(domain), rig.client()
        writer = peer.writer("cmd_vel", "geometry_msgs/msg/Twist")
        writer.await_match()
        client_us, all_us = [], [[], [], []]
        for _ in range(options.rounds):
            client_us += by_client(rig, options.build)
            at_rest(rig, client)
            for total, part in zip(all_us, by_bridge(rig, peer, writer), strict=False):
                total += part
            at_rest(rig, client)
        begin_s = bridge.cpu_seconds()
        time.sleep(COST_S)
        cost = (bridge.cpu_seconds() - begin_s) / COST_S
        print(f"drive by the C client to frame: {words(client_us)}")
        for what, values in zip(
            ("cmd_vel received to frame", "cmd_vel published to frame", "within the bridge"), (all_us[1], all_us[0], all_us[2]), strict=False
        ):
            print(f"{what + ':':<31} {words(values)}, {percentile(values, 50) / percentile(client_us, 50):.2f} x")
        print(
            f"bridge at 50 Hz odometry:       {100 * cost:.1f} % of one processor, {bridge.resident_kB() / 1024:.1f} MiB resident, {len(os.listdir(f'/proc/{bridge.child.pid}/task'))} threads"
        )
    finally:
        rig.close()


if __name__ == "__main__":
    main()
