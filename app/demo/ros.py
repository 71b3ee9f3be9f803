# SPDX-License-Identifier: MIT
"""./demo --ros: the real gateway and its bridge to ROS 2 drive two simulated wheels round a square, commanded by DDS messages of another process.

Everything is on the loopback interface of this machine; no ROS, no CAN and no wheels are needed.
"""

import argparse
import math
import os
import shutil
import sys
import time

ROOT = os.path.dirname(os.path.dirname(os.path.dirname(os.path.abspath(__file__))))
sys.path[:0] = [os.path.join(ROOT, "test", part) for part in ("support", "system", "ros2")]

from ends import end_with_signals
from free_domain import free_domain
from harness import Process, Rig
from peer import Peer

CONFIG = {"limits": {"wheel_silent_ms": 200, "echo_ms": 200}, "drive": {"lease_ms": 400, "max_speed_mm_s": 700}}
SIDE_M, SPEED, TURN, NEAR_M = 1.0, 0.4, 0.8, 0.25
WIDTH, HEIGHT, SPAN_M = 48, 17, 1.5
DRIFT = 0.8  # Deceleration towards each corner, in m/s² and rad/s².


class Failed(Exception):
    """A step did not have the expected result."""


class View:
    """Draws the path on a terminal. Without one it prints a line from time to time."""

    def __init__(self, plain):
        self.drawn = not plain and sys.stdout.isatty() and shutil.get_terminal_size().lines >= HEIGHT + 5
        self.path, self.printed_s, self.begin = set(), -1.0, time.monotonic()
        if self.drawn:
            print("\x1b[2J", end="")

    def show(self, text):
        print(("\x1b[K" if self.drawn else "") + f"[{time.monotonic() - self.begin:5.1f} s] {text}", flush=True)

    def pose(self, x_m, y_m, yaw, words):
        text = f"odom: x {x_m:5.2f} m  y {y_m:5.2f} m  heading {math.degrees(yaw):6.1f} deg   {words}"
        here = (round((x_m + 0.25) / SPAN_M * (WIDTH - 1)), round((y_m + 0.25) / SPAN_M * (HEIGHT - 1)))
        self.path.add(here)
        if not self.drawn:
            if time.monotonic() - self.printed_s > 1.0:
                self.printed_s = time.monotonic()
                self.show(text)
            return
        arrow = ">/^\\<,v`"[round(math.degrees(yaw) / 45) % 8]
        rows = []
        for row in range(HEIGHT - 1, -1, -1):
            cells = (arrow if (column, row) == here else "." if (column, row) in self.path else " " for column in range(WIDTH))
            rows.append("  |" + "".join(cells) + "|\x1b[K")
        print("\x1b[H" + "\n".join(["  " + text + "\x1b[K", *rows, "\x1b[K"]), flush=True)


class Drive:
    """A separate node: reads odom, publishes cmd_vel at 20 Hz."""

    def __init__(self, peer, view):
        self.peer, self.view = peer, view
        self.odom = peer.reader("odom", "nav_msgs/msg/Odometry")
        self.writer = peer.writer("cmd_vel", "geometry_msgs/msg/Twist")
        self.writer.await_match()
        self.x_m = self.y_m = self.yaw = 0.0
        self.poll()

    def poll(self, words=""):
        message = self.odom.wait(seconds=2)
        if message is None:
            raise Failed("no odometry arrived for two seconds")
        for _, newer, _ in self.odom.take():
            message = newer
        pose = message.pose.pose
        self.x_m, self.y_m = pose.position.x, pose.position.y
        heading = 2 * math.atan2(pose.orientation.z, pose.orientation.w)
        self.yaw += math.remainder(heading - self.yaw, 2 * math.pi)
        self.view.pose(self.x_m, self.y_m, self.yaw, words)

    def until(self, left, command, words, seconds=20):
        """Drives until `left()` is zero, slower towards the end."""
        due = end = time.monotonic()
        end += seconds
        while left() > 0.01:
            if time.monotonic() > end:
                raise Failed(f"{words}: not reached after {seconds} s")
            self.writer.write(command(math.sqrt(2 * DRIFT * 0.3 * left()) + 0.05))
            due += 0.05
            self.poll(words)
            time.sleep(max(0, due - time.monotonic()))

    def side(self, number):
        x_m, y_m, course = self.x_m, self.y_m, number * math.pi / 2

        def left():
            return SIDE_M - ((self.x_m - x_m) * math.cos(course) + (self.y_m - y_m) * math.sin(course))

        self.until(left, lambda most: self.peer.twist(min(SPEED, most), 1.5 * (course - self.yaw)), f"side {number + 1} of 4")

    def corner(self, number):
        course = (number + 1) * math.pi / 2
        self.until(lambda: course - self.yaw, lambda most: self.peer.twist(0, min(TURN, most)), f"corner {number + 1} of 4")


def report(rig, peer, view):
    state = peer.reader("iwheel/state", "std_msgs/msg/String", transient=True)
    if state.wait(lambda message: '"gateway":"up"' in message.data, 10) is None:
        raise Failed("the bridge does not connect to the gateway")
    drive = Drive(peer, view)
    answer = None
    end = time.monotonic() + 5
    while not (answer and answer[0]) and time.monotonic() < end:
        answer = peer.call("iwheel/arm")
    if not (answer and answer[0]):
        raise Failed(f"iwheel/arm: {answer}")
    view.show(f"iwheel/arm: {answer[1]}")
    for number in range(4):
        drive.side(number)
        drive.corner(number)
    off_m = math.hypot(drive.x_m, drive.y_m)
    view.show("no more commands are published: the wheels stop, because the lease ends")
    stopped = state.wait(lambda message: "lease_lost" in message.data, 3)
    if off_m > NEAR_M or stopped is None:
        raise Failed(f"{off_m:.2f} m from its starting point; stopped: {stopped}")
    time.sleep(0.5)
    pose = rig.client().request("status")["pose"]
    print(
        f"\nA square of {SIDE_M:g} m, back within {100 * off_m:.0f} cm by odom; by the wheel's own pose {pose['x_mm'] / 1000:.2f} {pose['y_mm'] / 1000:.2f} m."
    )


def main():
    parser = argparse.ArgumentParser(prog="./demo --ros")
    parser.add_argument("--build", required=True)
    parser.add_argument("--plain", action="store_true")
    options = parser.parse_args()
    end_with_signals()
    domain = free_domain()
    rig = Rig(options.build, CONFIG)
    view = View(options.plain)
    try:
        rig.start_gateway()
        with open(rig.path("ros2.conf"), "w", encoding="utf-8") as file:
            file.write(f"[gateway]\nsocket = {rig.path('gateway.sock')}\n[ros]\ndomain = {domain}\nnetwork = loopback\n")
        bridge = Process([os.path.join(options.build, "app/bridge/ros2/iwheel-ros2"), "-c", rig.path("ros2.conf")], rig.path("bridge.out"))
        rig.processes.append(bridge)
        report(rig, Peer(domain), view)
        print("See docs/user/ros2.md")
        return 0
    except (Failed, OSError, RuntimeError, TimeoutError) as error:
        print(f"\nFAILED: {error}", file=sys.stderr)
        return 1
    finally:
        rig.close()


if __name__ == "__main__":
    sys.exit(main())
