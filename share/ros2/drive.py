# SPDX-License-Identifier: MIT
"""Drives for a stated time, then stops: one command for a person at a keyboard.

It publishes zeros, so that the bridge knows this publisher, calls iwheel/arm, publishes the speed for the stated time and calls iwheel/stop.
It needs rclpy only: `python3 drive.py 0.2 --for 2`, or `ros2 run iwheel_bringup drive 0.2 --for 2`. Exit status: 0 driven, 1 refused or stopped.
"""

import argparse
import json
import sys
import time

import rclpy
from geometry_msgs.msg import Twist, TwistStamped
from rclpy.qos import DurabilityPolicy, QoSProfile
from rclpy.signals import SignalHandlerOptions
from std_msgs.msg import String
from std_srvs.srv import Trigger

RATE_HZ = 20
ZEROS_S = 1.2  # The bridge learns the clock of a publisher on another machine in a second.
LONGEST_S = 10.0
WAIT_S = 10.0


class Refused(Exception):
    """The bridge refused or stopped; the text is the reason, with the fix."""


class Drive:
    def __init__(self, namespace, stamped):
        self.node = rclpy.create_node("iwheel_drive", namespace=namespace)
        self.type = TwistStamped if stamped else Twist
        self.publisher = self.node.create_publisher(self.type, "cmd_vel", 10)
        self.clients = {verb: self.node.create_client(Trigger, f"iwheel/{verb}") for verb in ("arm", "stop")}
        retained = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)
        self.node.create_subscription(String, "iwheel/state", self.on_state, retained)
        self.state, self.was_armed = {}, False

    def on_state(self, message):
        self.state = json.loads(message.data)
        self.was_armed = self.was_armed or self.state.get("state") == "armed"

    def send(self, linear, angular):
        message = self.type()
        twist = message
        if self.type is TwistStamped:
            message.header.stamp = self.node.get_clock().now().to_msg()
            twist = message.twist
        twist.linear.x, twist.angular.z = float(linear), float(angular)
        self.publisher.publish(message)

    def stream(self, linear, angular, seconds, until=lambda: False):
        """Publishes at RATE_HZ for this number of seconds, or until the condition is true."""
        due = time.monotonic()
        end = due + seconds
        while time.monotonic() < end and not until():
            self.send(linear, angular)
            due += 1.0 / RATE_HZ
            while (left := due - time.monotonic()) > 0:
                rclpy.spin_once(self.node, timeout_sec=left)

    def call(self, verb):
        """Calls a service and publishes zeros until it replies. Returns the reply, or None after 3 s."""
        future = self.clients[verb].call_async(Trigger.Request())
        self.stream(0.0, 0.0, 3.0, future.done)
        return future.result() if future.done() else None

    def await_bridge(self):
        end = time.monotonic() + WAIT_S
        while not (self.clients["arm"].service_is_ready() and self.publisher.get_subscription_count() > 0):
            if time.monotonic() > end:
                raise Refused("no iwheel-ros2 in this domain: check ROS_DOMAIN_ID, the namespace, and the profile of Fast DDS (docs: This machine only)")
            rclpy.spin_once(self.node, timeout_sec=0.05)

    def has_stopped(self):
        return self.was_armed and self.state.get("state") != "armed"

    def run(self, linear, angular, seconds):
        self.await_bridge()
        self.stream(0.0, 0.0, ZEROS_S)
        answer = self.call("arm")
        if answer is None or not answer.success:
            raise Refused(f"iwheel/arm: {answer.message if answer else 'no answer within 3 s'}")
        try:
            self.stream(linear, angular, seconds, self.has_stopped)
            if self.has_stopped():
                raise Refused(f"stopped: {self.state.get('last_stop') or self.state}")
        finally:
            self.call("stop")


def main(arguments=None):
    parser = argparse.ArgumentParser(prog="drive", description=__doc__.splitlines()[0])
    parser.add_argument("linear", type=float, help="m/s, forward positive")
    parser.add_argument("angular", type=float, nargs="?", default=0.0, help="rad/s, to the left positive")
    parser.add_argument("--for", dest="seconds", type=float, default=2.0, help=f"seconds, at most {LONGEST_S:g} (2)")
    parser.add_argument("--namespace", default="", help="namespace of the bridge")
    parser.add_argument("--stamped", action="store_true", help="send TwistStamped")
    options = parser.parse_args(arguments)
    if not 0 < options.seconds <= LONGEST_S:
        parser.error(f"--for must be above 0 and at most {LONGEST_S:g} seconds")
    # rclpy must not handle the signals: Ctrl-C then raises KeyboardInterrupt, and the stop is still sent.
    rclpy.init(args=[], signal_handler_options=SignalHandlerOptions.NO)
    drive = Drive(options.namespace, options.stamped)
    try:
        drive.run(options.linear, options.angular, options.seconds)
        print(f"drove {options.linear:g} m/s, {options.angular:g} rad/s for {options.seconds:g} s, and stopped")
        return 0
    except Refused as error:
        print(error, file=sys.stderr)
        return 1
    except KeyboardInterrupt:
        return 130
    finally:
        drive.node.destroy_node()
        rclpy.try_shutdown()


if __name__ == "__main__":
    sys.exit(main())
