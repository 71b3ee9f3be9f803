# SPDX-License-Identifier: MIT
"""Drives by a gamepad with a deadman: topic `joy` in, `cmd_vel` out at 20 Hz.

The node publishes speeds while the deadman button is held and the gamepad has reported a change within `report_timeout` seconds. A wireless gamepad whose
link has died reports nothing, with the button held or not, or its driver repeats the last report, which is no change. A stick that is held still reports no
change either: move it slightly. After the timeout, and
when the button is released, the node publishes zeros for half a second, then nothing. To drive again, release the button once. The node
never arms: call iwheel/arm.
"""

import math

import rclpy
from geometry_msgs.msg import Twist, TwistStamped
from rclpy.clock import Clock, ClockType
from rclpy.node import Node
from sensor_msgs.msg import Joy

RATE_HZ = 20.0
ZEROS_S = 0.5
LONGEST_TIMEOUT_S = 2.0


class Deadman:
    """Decides which speeds to publish. Pure: the caller passes the time in seconds.

    RELEASED --held--> DRIVING --released or no report--> ENDING --ZEROS_S--> WAITING --a report with the button released--> RELEASED
    """

    def __init__(self, timeout_s):
        if not 0.0 < timeout_s <= LONGEST_TIMEOUT_S:
            raise ValueError(f"report_timeout is {timeout_s} s; it must be above 0 and at most {LONGEST_TIMEOUT_S} s")
        self.timeout_s = timeout_s
        self.state, self.held, self.speeds = "WAITING", True, (0.0, 0.0)
        self.reported_s = self.ended_s = -math.inf
        self.last = None

    def is_new(self, report):
        """Returns true if the report differs from the one before. A joy_node that repeats sends the last one again, also after the link has died."""
        new, self.last = report != self.last, report
        return new

    def report(self, held, linear, angular, now_s):
        """Handles a report of the gamepad: button held, speeds in m/s and rad/s."""
        good = math.isfinite(linear) and math.isfinite(angular)
        if not held and self.state in ("WAITING", "ENDING"):
            self.state = "RELEASED" if self.state == "WAITING" else self.state
        elif held and good and self.state == "RELEASED":
            self.state = "DRIVING"
        elif self.state == "DRIVING" and not (held and good):
            self.end(now_s)
        self.speeds, self.reported_s = ((linear, angular) if good else (0.0, 0.0)), now_s
        self.held = held

    def end(self, now_s):
        self.state, self.ended_s = "ENDING", now_s

    def step(self, now_s):
        """Returns the speeds to publish in m/s and rad/s; None: publish nothing."""
        if self.state == "DRIVING" and now_s - self.reported_s > self.timeout_s:
            self.held = True  # The button counts as held until a report shows it released.
            self.end(now_s)
        if self.state == "ENDING" and now_s - self.ended_s > ZEROS_S:
            self.state = "WAITING" if self.held else "RELEASED"
        if self.state == "DRIVING":
            return self.speeds
        return (0.0, 0.0) if self.state == "ENDING" else None


class JoystickNode(Node):
    def __init__(self):
        super().__init__("iwheel_joystick")
        defaults = {
            "deadman_button": 4,
            "linear_axis": 1,
            "angular_axis": 0,
            "linear_scale": 0.4,
            "angular_scale": 0.8,
            "report_timeout": 2.0,
            "stamped": False,
        }
        self.values = {name: self.declare_parameter(name, value).value for name, value in defaults.items()}
        self.deadman = Deadman(self.values["report_timeout"])
        self.type = TwistStamped if self.values["stamped"] else Twist
        self.publisher = self.create_publisher(self.type, "cmd_vel", 10)
        self.create_subscription(Joy, "joy", self.on_joy, 10)
        # With a steady clock neither a step of the wall clock nor simulated time lengthens the timeout.
        self.steady = Clock(clock_type=ClockType.STEADY_TIME)
        self.create_timer(1.0 / RATE_HZ, self.on_timer, clock=self.steady)

    def now_s(self):
        return self.steady.now().nanoseconds / 1e9

    def on_joy(self, joy):
        def axis(name):
            index = self.values[name]
            return float(joy.axes[index]) if 0 <= index < len(joy.axes) else math.nan

        if not self.deadman.is_new((list(joy.axes), list(joy.buttons))):
            return
        button = self.values["deadman_button"]
        held = 0 <= button < len(joy.buttons) and joy.buttons[button] == 1
        linear, angular = axis("linear_axis") * self.values["linear_scale"], axis("angular_axis") * self.values["angular_scale"]
        self.deadman.report(held, linear, angular, self.now_s())

    def on_timer(self):
        speeds = self.deadman.step(self.now_s())
        if speeds is None:
            return
        message = self.type()
        twist = message
        if self.type is TwistStamped:
            message.header.stamp = Clock().now().to_msg()
            twist = message.twist
        twist.linear.x, twist.angular.z = speeds
        self.publisher.publish(message)


def main():
    rclpy.init()
    try:
        rclpy.spin(JoystickNode())
    except KeyboardInterrupt:
        pass
    finally:
        rclpy.try_shutdown()


if __name__ == "__main__":
    main()
