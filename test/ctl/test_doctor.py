# SPDX-License-Identifier: MIT
"""iwheelctl doctor on the simulator's bus, with and without a gateway, as its user meets it."""

import bisect
import json
import signal
import time
import unittest

from ctl import BUILD, environment, program, run
from harness import Rig
from operator_at_terminal import Operator


class Doctor(unittest.TestCase):
    def setUp(self):
        self.rig = Rig(BUILD)
        self.addCleanup(self.rig.close)
        time.sleep(0.5)  # The simulated wheels boot.

    def words(self, listen):
        return ("--socket", self.rig.path("gateway.sock"), "doctor", f"unix:{self.rig.path('bus')}", "--listen", listen)

    def doctor(self, *words):
        """(exit code, {check: [finding]}, the whole object)"""
        code, out, _ = run("--json", *self.words("0.6s"), *words)
        whole = json.loads(out)
        checks = {}
        for finding in whole["findings"]:
            checks.setdefault(finding["check"], []).append(finding)
            self.assertTrue(finding["verdict"] == "ok" or finding["cure"], f"no fix: {finding}")
        return code, checks, whole

    def verdict(self, checks, check):
        return [finding["verdict"] for finding in checks.get(check, [])]

    def button(self):
        return ("--estop", f"unix:{self.rig.path('button')}")

    def rates_on_the_bus(self, can_id, listened_us=600_000):
        """(least, most) in mHz, over any stretch as long as the doctor listened: a simulator that the machine held up sends fewer."""
        times = [frame.t_us for frame in list(self.rig.bus.frames) if frame.id == can_id]
        rates = [
            (bisect.bisect_right(times, begin + listened_us) - at) * 10**9 // listened_us for at, begin in enumerate(times) if begin + listened_us <= times[-1]
        ]
        return min(rates), max(rates)

    def setpoints(self):
        time.sleep(0.05)
        return self.rig.bus.setpoints()

    def test_healthy_pair_without_gateway_passes_and_sends_nothing(self):
        code, checks, whole = self.doctor(*self.button())
        self.assertEqual((0, True, False), (code, whole["ok"], whole["gateway"]), whole)
        self.assertEqual(["ok"], self.verdict(checks, "left_wheel"))
        self.assertIn("none is running", checks["gateway"][0]["text"])
        rates = {rate["id"]: rate["measured_mHz"] for rate in whole["rates"]}
        for can_id in (256, 290):
            least, most = self.rates_on_the_bus(can_id)
            self.assertTrue(0.9 * least - 5000 <= rates[can_id] <= 1.1 * most + 5000, (can_id, least, rates[can_id], most))
        self.assertEqual({256: 250000, 290: 25000}, {rate["id"]: rate["nominal_mHz"] for rate in whole["rates"] if rate["id"] in (256, 290)})
        self.assertIn("released, SIMULATED", checks["estop"][0]["text"])
        self.assertFalse(self.setpoints())

    def test_silent_wheel_is_named_with_exit_code_1(self):
        self.rig.sim.ask("mute left")
        code, checks, _ = self.doctor(*self.button())
        self.assertEqual(1, code)
        self.assertEqual(["fail"], self.verdict(checks, "left_wheel"))
        self.assertEqual(["ok"], self.verdict(checks, "right_wheel"))

    def test_lost_frames_show_in_the_rates(self):
        self.rig.sim.ask("loss 40")
        _, checks, _ = self.doctor(*self.button())
        self.assertIn("warn", self.verdict(checks, "rates"))

    def test_second_master_and_unknown_ids(self):
        self.rig.sim.ask("foreign on")
        self.rig.sim.ask("babble 333 20000 on")
        code, checks, _ = self.doctor(*self.button())
        self.assertEqual(1, code)
        self.assertEqual(["fail"], self.verdict(checks, "second_master"))
        self.assertIn("0x333", checks["unknown_ids"][0]["text"])

    def test_bus_without_wheels_and_no_bus(self):
        self.rig.sim.ask("power off")
        code, checks, _ = self.doctor(*self.button())
        self.assertEqual((1, ["fail"], ["fail"]), (code, self.verdict(checks, "left_wheel"), self.verdict(checks, "right_wheel")))
        self.rig.sim.end()
        code, checks, _ = self.doctor(*self.button())
        self.assertEqual(1, code)
        self.assertIn("no simulator there", checks["interface"][0]["text"])
        self.assertEqual(["fail"], self.verdict(checks, "estop"))

    def test_setpoints_of_driving_gateway_are_no_second_master(self):
        self.rig.start_gateway()
        client = self.rig.client()
        client.request("arm")
        code, checks, whole = self.doctor()
        self.assertTrue(whole["gateway"])
        self.assertEqual(0, code, whole)
        self.assertNotIn("second_master", checks)
        self.assertIn("serves unix:", checks["gateway"][0]["text"])
        self.assertIn("ledger", checks)

    def test_gateway_whose_configuration_lacks_what_arm_needs(self):
        for key in ("setpoint_type", "current_role", "track_mm"):
            right = self.rig.settings["wheels"].pop(key)
            self.rig.write_config()
            self.rig.start_gateway()
            code, checks, _ = self.doctor()
            self.assertEqual((0, [f"{key} not configured: the gateway refuses arm"]), (code, [finding["text"] for finding in checks["config"]]))
            self.assertIn("iwheelctl bringup finds it", checks["config"][0]["cure"])
            self.rig.kill_gateway(signal.SIGTERM)
            self.rig.settings["wheels"][key] = right

    def test_second_master_with_a_gateway(self):
        self.rig.start_gateway()
        self.rig.sim.ask("foreign on")
        time.sleep(0.1)
        code, checks, _ = self.doctor()
        self.assertEqual((1, ["fail"]), (code, self.verdict(checks, "second_master")))

    def test_latched_gateway_names_the_way_out(self):
        self.rig.start_gateway()
        self.rig.sim.ask("estop press")
        time.sleep(0.1)
        _, checks, _ = self.doctor()
        self.assertIn("iwheelctl reset", checks["gateway"][0]["cure"])
        self.assertIn("pressed", checks["estop"][0]["text"])

    def test_bus_off_and_error_passive_are_reported_without_cable(self):
        for next_to_gateway in (False, True):
            if next_to_gateway:
                self.rig.start_gateway()
            words = () if next_to_gateway else self.button()
            self.rig.sim.ask("busoff on")
            code, checks, _ = self.doctor(*words)
            self.assertEqual((1, ["fail"]), (code, self.verdict(checks, "bus_state")), (next_to_gateway, checks))
            self.assertIn("bus-off", checks["bus_state"][0]["text"])
            self.assertNotIn("left_wheel", checks)
            self.rig.sim.ask("busoff off")
            self.assertEqual([], self.verdict(self.doctor(*words)[1], "bus_state"))
        self.rig.sim.ask("passive on")
        time.sleep(0.1)  # Reported once: a later doctor reads it from the gateway.
        _, checks, _ = self.doctor()
        self.assertEqual(["warn"], self.verdict(checks, "bus_state"), checks)
        self.assertIn("error passive", checks["bus_state"][0]["text"])

    def test_guided_press_on_a_terminal(self):
        operator = Operator([program(), *self.words("0.3s"), *self.button()], environment(TERM="dumb"))
        self.addCleanup(operator.close)
        operator.expect("Press the e-stop button now")
        self.rig.sim.ask("estop press")
        operator.expect("Release it")
        self.rig.sim.ask("estop release")
        self.assertEqual(0, operator.wait(), operator.text)
        operator.expect("press and release were seen")

    def test_gateway_without_answer_is_reported_estop_line_unused(self):
        self.rig.start_gateway()
        self.rig.gateway.signal(signal.SIGSTOP)
        code, checks, _ = self.doctor()
        self.rig.gateway.signal(signal.SIGCONT)
        self.assertEqual(1, code)
        self.assertIn("does not answer", checks["gateway"][0]["text"])
        self.assertNotIn("estop", checks)
        self.assertEqual(["ok"], self.verdict(checks, "left_wheel"))

    def test_wrong_words(self):
        for words, about in (
            (("--listen",), "--listen needs"),
            (("--listen", "0s"), "200ms to 1min"),
            (("--estop",), "needs a value"),
            (("a", "b"), "does not understand"),
            (("--frobnicate",), "does not understand"),
            (("eth0/..",), "IFACE"),
        ):
            code, out, err = run("doctor", *words)
            self.assertEqual(64, code, (words, out, err))
            self.assertIn(about, err)
