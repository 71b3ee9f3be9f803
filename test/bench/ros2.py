#!/usr/bin/env python3
# SPDX-License-Identifier: MIT
"""The bridge to ROS 2 beside a program in C: how soon a command is on the bus, what it costs. Prints; docs/speed.md has a paragraph of it.

usage: test/bench/ros2.py [--build DIR] [--rounds N]    with .venv's python

In turns in one run: commands by libiwheel-client (the call to the first frame of its speed), and by cmd_vel (the same from the publisher's
write, so all of DDS is in it). Beside it how soon another subscriber has such a message: that much of it is DDS's way, not the bridge's.
"""

import argparse
import ctypes
import os
import sys
import threading
import time

ROOT = os.path.dirname(os.path.dirname(os.path.dirname(os.path.abspath(__file__))))
sys.path[:0] = [os.path.join(ROOT, "test", part) for part in ("system", "ros2")]

from bus import now_us  # noqa: E402
from harness import Process, Rig, percentile  # noqa: E402
from peer import Peer  # noqa: E402

from cyclonedds.core import Listener  # noqa: E402
from cyclonedds.sub import DataReader  # noqa: E402

COMMANDS, EVERY_S, COST_S = 120, 0.053, 10
CONFIG = {"limits": {"wheel_silent_ms": 200, "echo_ms": 200}, "drive": {"lease_ms": 300, "accel_mm_s2": 20000, "decel_mm_s2": 20000}}


class Heard(Listener):
    """When another subscriber's reader has a message."""

    def __init__(self):
        super().__init__()
        self.times, self.came = [], threading.Event()

    def on_data_available(self, reader):
        self.times.append(now_us())
        reader.take(10)


def measure(rig, send, speeds=(200, 260)):
    """Microseconds from each command to the first frame with its speed."""
    sent = []
    for number in range(COMMANDS):
        speed = speeds[number % 2]
        sent.append((now_us(), speed))
        send(speed)
        time.sleep(EVERY_S)
    frames, found = rig.bus.setpoints(sent[0][0]), []
    for t_us, speed in sent[5:]:
        hit = next((at for at, _, told in frames if at >= t_us and told == speed), None)
        if hit is not None and hit - t_us < EVERY_S * 1e6:
            found.append(hit - t_us)
    return found


def by_client(rig, build):
    library = ctypes.CDLL(os.path.join(build, "client", "c", "libiwheel-client.so"))
    library.iwc_new.restype = ctypes.c_void_p
    gateway = ctypes.c_void_p(library.iwc_new())
    assert library.iwc_connect(gateway, rig.path("gateway.sock").encode(), 1000) == 0
    assert library.iwc_arm(gateway, b"bench", False, 1000, None) == 0
    try:
        return measure(rig, lambda speed: library.iwc_twist(gateway, speed, 0, 40, None))
    finally:
        library.iwc_stop(gateway, 1000)
        library.iwc_free(gateway)


def by_bridge(rig, peer, writer):
    for _ in range(60):
        if peer.call("iwheel/arm")[0]:
            break
        time.sleep(0.1)
    messages = {speed: peer.twist(speed / 1000) for speed in (200, 260)}
    return measure(rig, lambda speed: writer.write(messages[speed]))


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
        domain = 1 + os.getpid() % 230
        with open(rig.path("ros2.conf"), "w", encoding="utf-8") as file:
            file.write(f"[gateway]\nsocket = {rig.path('gateway.sock')}\n[ros]\ndomain = {domain}\nnetwork = loopback\n")
        bridge = Process([os.path.join(options.build, "bridge/ros2/iwheel-ros2"), "-c", rig.path("ros2.conf")], rig.path("bridge.out"))
        rig.processes.append(bridge)
        peer, client = Peer(domain), rig.client()
        writer = peer.writer("cmd_vel", "geometry_msgs/msg/Twist")
        writer.await_match()
        client_us, bridge_us = [], []
        for _ in range(options.rounds):
            client_us += by_client(rig, options.build)
            at_rest(rig, client)
            bridge_us += by_bridge(rig, peer, writer)
            at_rest(rig, client)
        other, heard, way_us = Peer(domain), Heard(), []
        reader = DataReader(other.participant, other.reader("unheard", "geometry_msgs/msg/Twist").reader.topic, listener=heard)
        probe = peer.writer("unheard", "geometry_msgs/msg/Twist")
        probe.await_match()
        time.sleep(0.3)
        for _ in range(COMMANDS):
            heard.times.clear()
            t_us = now_us()
            probe.write(peer.twist(0.1))
            time.sleep(0.02)
            way_us += [heard.times[0] - t_us] if heard.times else []
        begin_s = bridge.cpu_seconds()
        time.sleep(COST_S)
        cost = (bridge.cpu_seconds() - begin_s) / COST_S
        print(f"drive by the C client to frame: {words(client_us)}")
        print(f"cmd_vel published to frame:     {words(bridge_us)}, {percentile(bridge_us, 50) / percentile(client_us, 50):.2f} x")
        print(f"published to another subscriber: {words(way_us)}")
        received = percentile(bridge_us, 50) - percentile(way_us, 50)
        print(f"so from reception to frame:     p50 about {received} µs, {received / percentile(client_us, 50):.2f} x")
        print(f"bridge at 50 Hz odometry:       {100 * cost:.1f} % of one processor, {bridge.resident_kB() / 1024:.1f} MiB resident, {len(os.listdir(f'/proc/{bridge.child.pid}/task'))} threads")
        del reader
    finally:
        rig.close()


if __name__ == "__main__":
    main()
