# SPDX-License-Identifier: MIT
"""The steps of the demonstration. Each announces what will happen, does it, and checks the result."""

import subprocess
import time

from cast import Driver
from harness import find_program, now_us
from judge_log import Event

TOTAL = 9


class Failed(Exception):
    """A step did not have the expected result."""


class Story:
    """The steps, in order."""

    def __init__(self, rig, view):
        self.rig, self.view = rig, view
        self.begin = time.monotonic()
        self.number = 0
        self.client = None
        self.status = None
        self.drivers = []

    # Output ------------------------------------------------------------------------------------------------------------

    def elapsed_s(self):
        return time.monotonic() - self.begin

    def step(self, title, text):
        self.number += 1
        self.view.step(self.elapsed_s(), self.number, TOTAL, title, text)

    def require(self, condition, fact, otherwise=None):
        """Shows the fact if the condition is true; otherwise ends the story."""
        if not condition:
            raise Failed(f"this did not happen: {otherwise or fact}")
        self.view.fact(self.elapsed_s(), fact.replace(f"unix:{self.rig.folder}/", ""))

    def watch(self, seconds, until=None):
        """Shows the snapshots of the gateway for this time. Ends earlier and returns True when the condition holds for a snapshot."""
        end = time.monotonic() + seconds
        while True:
            self.client.collect(0.04)
            states = [event for event in self.client.events if event["event"] == "state"]
            self.client.events.clear()
            if states:
                self.status = states[-1]
                self.view.snapshot(self.elapsed_s(), self.status)
                if until and until(self.status):
                    return True
            if time.monotonic() >= end:
                return until is None

    def measured(self):
        return self.status["left"]["speed_mm_s"], self.status["right"]["speed_mm_s"]

    def near(self, left, right, status=None):
        status = status or self.status
        pairs = ((status["left"]["speed_mm_s"], left), (status["right"]["speed_mm_s"], right))
        return all(value is not None and abs(value - wanted) <= max(30, abs(wanted) // 10) for value, wanted in pairs)

    def driver(self):
        self.drivers.append(Driver(self.rig, len(self.drivers)))
        if not self.watch(3, lambda s: s["state"] == "armed"):
            raise Failed(f"not armed: {self.drivers[-1].text()[-300:]}")
        return self.drivers[-1]

    # The steps ----------------------------------------------------------------------------------------------------------

    def run(self):
        self.find_wheels()
        self.learn_offsets()
        driver = self.arm()
        self.forward(driver)
        self.turn(driver)
        self.client_dies(driver)
        self.press()
        self.reset()
        self.why()

    def find_wheels(self):
        self.step("Finding the wheels", "Simulator and gateway start. The gateway only listens: it sends nothing until a client arms.")
        answered_ms = self.rig.start_gateway(wheels=False)
        self.client = self.rig.client("demo")
        self.client.request("watch", topics=["state"], rate_hz=20)
        online = self.watch(5, lambda s: s["left"]["at_rest"] and s["right"]["at_rest"] and s["estop"]["state"] == "released")
        self.require(answered_ms < 3000, f"the gateway answers {answered_ms:.0f} ms after its start")
        self.require(online, "both wheels are online and at standstill, the e-stop is released")
        self.watch(1.2)
        self.require(not self.rig.bus.setpoints(), "nothing was sent to the wheels")

    def learn_offsets(self):
        self.step(
            "Learning the force offsets",
            "Each wheel uses the mean force of its first two seconds as its offset and sends it for a minute. No load is on the handles, so it is valid.",
        )
        known = self.watch(6, lambda s: all(s[side]["offset_provenance"] == "wheel" and s[side]["force_net_mN"] is not None for side in ("left", "right")))
        offsets = [self.status[side]["force_offset_mN"] for side in ("left", "right")]
        self.require(known, f"offsets: left {(offsets[0] or 0) / 1000:.1f} N, right {(offsets[1] or 0) / 1000:.1f} N, sent by the wheels")
        self.rig.sim.ask("load both 60")
        self.watch(1.2)
        net = [self.status[side]["force_net_mN"] for side in ("left", "right")]
        self.require(
            all(value is not None and 50_000 < value < 70_000 for value in net),
            f"a load of 60 N on each side: net force {net[0] / 1000:.1f} N and {net[1] / 1000:.1f} N",
            f"60 N measured as {net} mN",
        )
        self.rig.sim.ask("load both 0")
        self.watch(0.8)

    def arm(self):
        self.step("Arming", "A joystick program requests the lease. From now on both wheels receive a setpoint every 20 ms, still zero.")
        driver = self.driver()
        self.require(True, f"armed; {self.status['lease']['name']} holds the lease")
        budget = self.status["budget"]
        self.require(
            budget["client_lost_ms"] <= 1000,
            f"without its commands the machine stops within {budget['client_lost_ms']} ms and {budget['client_lost_mm'] / 1000:.2f} m",
        )
        driver.want(0, 0)
        self.watch(2.0)
        self.require(
            len(self.rig.bus.setpoints()) > 40 and not any(speed for _, _, speed in self.rig.bus.setpoints()),
            f"{len(self.rig.bus.setpoints())} setpoints on the bus, all zero",
        )
        return driver

    def forward(self, driver):
        self.step("Driving forward", "400 mm/s for both wheels. The gateway ramps at 800 mm/s2; the lower bar is the measured speed.")
        driver.want(400, 400)
        self.watch(3.0)
        left, right = self.measured()
        self.require(self.near(400, 400), f"left {left} and right {right} mm/s measured", f"400/400 mm/s, measured {left}/{right}")

    def turn(self, driver):
        self.step("A turn to the left", "The right wheel is commanded to run faster than the left one. Both change together, so the curve is smooth.")
        driver.want(180, 480)
        before = self.status["pose"]["psi_mrad"]
        self.watch(3.2)
        left, right = self.measured()
        turned = self.status["pose"]["psi_mrad"] - before
        self.require(self.near(180, 480), f"left {left} and right {right} mm/s measured", f"180/480 mm/s, measured {left}/{right}")
        self.require(abs(turned) > 500, f"the machine has turned by {abs(turned) * 180 / 3141.6:.0f} degrees")
        driver.want(400, 400)
        self.watch(1.4)

    def client_dies(self, driver):
        self.step(
            "The joystick program dies",
            "kill -9 while it drives. No command renews the lease any more: the gateway ramps down, sends zeros for 1.5 s, then sends nothing.",
        )
        killed_us = now_us()
        self.rig.timeline.append(Event(killed_us, "gone"))
        driver.end()
        stopped = self.watch(2, lambda s: s["state"] == "stopping" and s["left"]["applied_mm_s"] == 0 and s["right"]["applied_mm_s"] == 0)
        setpoints = self.rig.bus.setpoints(killed_us)
        slower_ms = next(((t - killed_us) / 1000 for t, _, speed in setpoints if speed < 395), 9999)
        zero_ms = next(((t - killed_us) / 1000 for t, _, speed in setpoints if speed == 0), 9999)
        self.require(stopped and slower_ms < 100, f"the first slower setpoint was on the bus after {slower_ms:.0f} ms", f"ramp after {slower_ms:.0f} ms")
        self.require(zero_ms < 900, f"zero after {zero_ms:.0f} ms, without a jerk", f"zero after {zero_ms:.0f} ms")
        listening = self.watch(4, lambda s: s["state"] == "listening")
        self.require(listening and self.near(0, 0), "the wheels are at standstill, the gateway sends nothing")
        self.watch(1.0)

    def press(self):
        self.step("E-stop", "Another drive at 500 mm/s, and the button is pressed. Now there is no ramp: zero immediately, and the gateway latches.")
        driver = self.driver()
        driver.want(500, 500)
        if not self.watch(4, lambda s: self.near(500, 500, s)):
            raise Failed(f"no second drive: {driver.text()[-300:]}")
        self.watch(0.5)
        pressed_us = self.rig.press()
        latched = self.watch(1, lambda s: s["state"] == "latched")
        zeros = [
            next(((t - pressed_us) / 1000 for t, name, speed in self.rig.bus.setpoints(pressed_us) if name == wanted and speed == 0), 9999)
            for wanted in (266, 298)
        ]
        self.require(latched and max(zeros) < 50, f"both wheels received zero {max(zeros):.1f} ms after the press", f"zero after {max(zeros):.1f} ms")
        self.watch(0.4)
        self.require("refused: latched" in driver.text() or "refused: estop_pressed" in driver.text(), "the joystick program is refused from then on")
        at_standstill = self.watch(3, lambda s: s["left"]["at_rest"] and s["right"]["at_rest"])
        self.require(at_standstill, "the wheels are at standstill")
        self.watch(1.0)

    def reset(self):
        self.step("Reset, too early and in time", "A reset leads back to listening, not to motion. It is refused while its cause is present.")
        reply = self.client.request("reset")
        self.require(not reply["ok"] and reply["error"] == "estop_pressed", f"refused: {reply.get('message')}", f"reset while pressed: {reply}")
        self.watch(2.2)
        self.rig.release()
        self.watch(1.0)
        self.require(self.status["state"] == "latched", "the button is released; still latched")
        end = time.monotonic() + 3
        reply = self.client.request("reset")
        while not reply["ok"] and time.monotonic() < end:
            self.watch(0.2)
            reply = self.client.request("reset")
        self.require(reply["ok"], "reset: listening again", f"reset: {reply}")
        quiet_us = now_us() + 20_000
        self.watch(1.0)
        self.require(not self.rig.bus.setpoints(quiet_us), "and nothing is sent: motion needs arm and a fresh command")

    def why(self):
        self.step("Why did it stop?", "The gateway stores the last stop. `iwheelctl why` shows it.")
        tool = subprocess.run(
            [find_program(self.rig.build, "iwheelctl"), "--socket", self.rig.path("gateway.sock"), "why"],
            stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT,
            text=True,
            timeout=5,
            check=False,
        )
        self.require(tool.returncode == 0 and "500" in tool.stdout.split("\n")[0], tool.stdout.splitlines()[0], f"why: {tool.stdout}")
        self.watch(2.5)

    def judge(self):
        """The judge of the system tests checks every frame that was on the bus."""
        for driver in self.drivers:
            for line in driver.text().splitlines():
                words = line.split()
                if len(words) == len(Event._fields):
                    self.rig.timeline.append(Event(*(int(w) if w.lstrip("-").isdigit() else w for w in words))._replace(ok=words[3] == "True"))
        judge = self.rig.judge(estop_limit_us=50_000)
        broken = [found for found in judge.found if not found.timing]
        if broken:
            raise Failed(f"the judge of the bus log: {broken[0].rule}: {broken[0].text}")
        return judge
