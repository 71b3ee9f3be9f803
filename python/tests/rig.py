# SPDX-License-Identifier: MIT
"""The real gateway with simulated wheels for one test, and checks of the frames on their bus.

The gateway, its simulator and its test rig are in the project's folder. From the source package of this client, without that folder, the tests that
need them are skipped; IWHEEL_ROOT names the folder.
"""

import os
import sys
import time
import unittest

HERE = os.path.dirname(os.path.abspath(__file__))
ROOT = os.environ.get("IWHEEL_ROOT", os.path.dirname(os.path.dirname(HERE)))
HAS_GATEWAY = os.path.isdir(os.path.join(ROOT, "test", "system"))
SOURCES = os.path.join(os.path.dirname(HERE), "src")
sys.path[:0] = [SOURCES, *(os.path.join(ROOT, "test", folder) for folder in ("system", "support"))]

if HAS_GATEWAY:
    from bus import now_us
    from harness import Rig
    from judge_log import ALWAYS_US
    from verdict import hold
else:

    def now_us():
        return time.monotonic_ns() // 1000


BUILD = os.environ.get("IWHEEL_BUILD", os.path.join(ROOT, "build", "default"))
EXAMPLES = os.path.join(os.path.dirname(HERE), "examples")


def require_gateway():
    """Skips the test, or the whole module while it is imported."""
    if not HAS_GATEWAY:
        raise unittest.SkipTest("it needs the gateway's sources; set IWHEEL_ROOT to their folder")


class RigCase(unittest.TestCase):
    """`self.rig` runs; `self.socket` is the socket of its gateway."""

    # Generous limits: a busy machine may be late, and these tests do not judge how late the gateway may be.
    config: dict = {"drive": {"lease_ms": 300}, "limits": {"echo_ms": 200, "wheel_silent_ms": 200}}

    def setUp(self):
        require_gateway()
        self.rig = Rig(BUILD, self.config)
        self.addCleanup(self.rig.close)
        self.rig.start_gateway()
        self.socket = self.rig.path("gateway.sock")

    def last_motion_us(self):
        """Time of the last nonzero setpoint on the bus; 0: none."""
        return max((t for t, _, speed in self.rig.bus.setpoints() if speed != 0), default=0)

    def assert_never_moved(self):
        speeds = [speed for _, _, speed in self.rig.bus.setpoints() if speed != 0]
        hold(not speeds, f"{len(speeds)} nonzero setpoints, the first {speeds[:1]} mm/s")

    def assert_stood_by(self, t_us, within_ms):
        """Asserts that no nonzero setpoint came later than that, and that zeros followed the last one."""
        last = self.last_motion_us()
        self.assertGreater(last, 0, "the wheels never moved: this test would prove nothing")
        hold((last - t_us) / 1000 < within_ms + ALWAYS_US / 1000, f"motion {(last - t_us) / 1000:.0f} ms later, {within_ms} ms allowed")
        self.assertLess((last - t_us) / 1000, within_ms)
        self.assertTrue([1 for t, _, speed in self.rig.bus.setpoints(last) if speed == 0], "no zeros after the motion")

    def wait_until(self, condition, seconds=3.0):
        deadline = time.monotonic() + seconds
        while not condition():
            self.assertLess(time.monotonic(), deadline, "the condition did not become true")
            time.sleep(0.01)

    def push(self):
        """A hand that pushes the wheels, so arm waits until `let_go`."""
        hand = self.rig.hand()
        self.addCleanup(hand.let_go)
        looker = self.rig.client("looker")
        self.wait_until(lambda: not looker.request("status")["left"]["at_rest"])
        looker.close()
        return hand


__all__ = ["BUILD", "EXAMPLES", "HERE", "ROOT", "SOURCES", "RigCase", "now_us", "require_gateway"]
