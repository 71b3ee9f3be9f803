# SPDX-License-Identifier: MIT
"""Gateway and Armed against the real daemon: whatever happens to the program, the wheels stop."""

import os
import signal
import subprocess
import sys
import threading
import time
import unittest
import warnings

from rig import ROOT, RigCase, now_us

from iwheel import Gateway, GatewayUnavailable, LeaseEnded, NoAnswer, Refused, Status, WheelStatus

BUDGET_MS = 987 + 100
"""Lease, period and ramp of the default configuration of rig.py, and what a busy machine adds."""


class Driving(RigCase):
    def test_the_example_of_the_documentation_drives_and_stands_at_the_end(self):
        with Gateway(self.socket).arm("example") as wheels:
            applied = wheels.drive_for(0.6, 200, 200)
        left_us = now_us()
        self.assertEqual((applied.left_mm_s, applied.right_mm_s, applied.limited), (200, 200, False))
        self.assert_stood_by(left_us, 0)
        with Gateway(self.socket) as gateway:
            status = gateway.status()
            self.assertTrue(status["left"]["at_rest"] and status["right"]["at_rest"])
            self.assertGreater(status["left"]["distance_mm"], 30)
            self.assertEqual(gateway.why()["cause"], "client_stop")

    def test_a_single_command_does_not_outlive_its_lease(self):
        with Gateway(self.socket) as gateway:
            wheels = gateway.arm()
            wheels.drive(300, 300)
            sent_us = now_us()
            time.sleep(1.4)
            self.assert_stood_by(sent_us, BUDGET_MS)
            self.assertEqual(gateway.why()["cause"], "lease_lost")
            with self.assertRaises(Refused) as caught:
                wheels.drive(300, 300)
            self.assertEqual(caught.exception.error, "not_armed")
            with self.assertRaises(LeaseEnded):
                wheels.drive(300, 300)

    def test_an_exception_in_the_block_stops_and_is_not_swallowed(self):
        with self.assertRaises(ZeroDivisionError):
            with Gateway(self.socket).arm() as wheels:
                wheels.drive_for(0.4, 300, 300)
                1 / 0
        self.assert_stood_by(now_us(), 0)

    def test_ctrl_c_stops(self):
        script = (
            "import iwheel, sys\n"
            "with iwheel.Gateway(sys.argv[1]).arm() as w:\n"
            "    print('armed', flush=True)\n"
            "    w.drive_for(60, 300, 300)\n"
        )
        child = self.python(script)
        child.stdout.readline()
        time.sleep(0.5)
        child.send_signal(signal.SIGINT)
        sent_us = now_us()
        child.wait(5)
        self.assertNotEqual(child.returncode, 0)
        self.assert_stood_by(sent_us, 600)
        with Gateway(self.socket) as gateway:
            self.assertEqual(gateway.why()["cause"], "client_stop")

    def test_kill_9_stops_although_a_forked_child_lives_on(self):
        script = (
            "import iwheel, os, sys, time\n"
            "with iwheel.Gateway(sys.argv[1]).arm() as w:\n"
            "    w.drive(300, 300)\n"
            "    if os.fork() == 0: time.sleep(5); os._exit(0)\n"
            "    print('armed', flush=True)\n"
            "    w.drive_for(60, 300, 300)\n"
        )
        child = self.python(script)
        child.stdout.readline()
        time.sleep(0.5)
        child.kill()
        killed_us = now_us()
        time.sleep(1.0)
        self.assert_stood_by(killed_us, 600)
        with Gateway(self.socket) as gateway:
            self.assertEqual(gateway.why()["cause"], "client_gone")

    def test_a_frozen_program_is_stopped_by_the_lease(self):
        child = self.python(
            "import iwheel, sys\n"
            "with iwheel.Gateway(sys.argv[1]).arm() as w:\n"
            "    print('armed', flush=True)\n"
            "    w.drive_for(60, 300, 300)\n"
        )
        child.stdout.readline()
        time.sleep(0.5)
        child.send_signal(signal.SIGSTOP)
        frozen_us = now_us()
        time.sleep(1.4)
        self.assert_stood_by(frozen_us, BUDGET_MS)
        child.send_signal(signal.SIGCONT)
        time.sleep(0.6)
        self.assertLess(self.last_motion_us(), frozen_us + BUDGET_MS * 1000, "it moved again after waking up")

    def python(self, script):
        environment = {**os.environ, "PYTHONPATH": os.path.join(ROOT, "python", "src")}
        child = subprocess.Popen(
            [sys.executable, "-c", script, self.socket],
            env=environment,
            stdout=subprocess.PIPE,
            stderr=subprocess.DEVNULL,
            text=True,
        )

        def end():
            child.kill()
            child.wait()
            child.stdout.close()

        self.addCleanup(end)
        return child

    def test_leaving_a_block_that_lost_its_lease_does_not_stop_who_drives_now(self):
        other = Gateway(self.socket)
        self.addCleanup(other.close)
        with Gateway(self.socket) as gateway:
            with gateway.arm("first"):
                self.wait_until(lambda: gateway.status()["state"] == "listening", 5)
                mine = other.arm("second")
                mine.drive(200, 200)
                begin = time.monotonic()
            self.assertLess(time.monotonic() - begin, 0.15)
            mine.drive(200, 200)
            self.assertEqual(other.status()["state"], "armed")

    def test_an_older_permission_ends_when_the_same_gateway_arms_anew(self):
        with Gateway(self.socket) as gateway:
            old = gateway.arm()
            new = gateway.arm()
            with self.assertRaises(LeaseEnded):
                old.drive(200, 200)
            new.drive(0, 0)

    def test_values_that_do_not_fit_are_refused_and_the_permission_stays(self):
        with Gateway(self.socket) as gateway, gateway.arm() as wheels:
            for bad in (40000, -40000):
                with self.assertRaises(Refused) as caught:
                    wheels.drive(100, bad)
                self.assertEqual(caught.exception.error, "out_of_range")
            with self.assertRaises(Refused) as caught:
                wheels.drive(100, 1.5)
            self.assertEqual(caught.exception.error, "bad_value")
            with self.assertRaises(ValueError):
                wheels.drive(100, float("nan"))
            self.assertTrue(wheels.drive(4000, 2000).limited)

    def test_twist_turns(self):
        with Gateway(self.socket).arm() as wheels:
            applied = wheels.twist(200, 500)
        self.assertEqual((applied.left_mm_s, applied.right_mm_s), (65, 335))


class Reconnecting(RigCase):
    def test_a_gateway_that_was_killed_is_found_again_and_nothing_moves(self):
        with Gateway(self.socket, wait=5) as gateway:
            with warnings.catch_warnings(record=True):
                warnings.simplefilter("always")
                with gateway.arm() as wheels:
                    wheels.drive_for(0.4, 300, 300)
                    self.rig.kill_gateway(signal.SIGKILL)
                    killed_us = now_us()
                    with self.assertRaises(GatewayUnavailable):
                        wheels.drive_for(1, 300, 300)
                    self.rig.start_gateway(restart_hold=True)
                    with self.assertRaises(LeaseEnded):
                        wheels.drive(300, 300)
            self.assertIn(gateway.status()["state"], ("listening", "stopping"))
            time.sleep(0.5)
            self.assert_stood_by(killed_us, 0.1 * BUDGET_MS)

    def test_events_go_on_after_a_restart_with_the_same_subscription(self):
        with Gateway(self.socket, wait=5) as gateway:
            gateway.watch("state", rate_hz=20)
            seen = []
            restarted = False
            for event in gateway.events(timeout=5):
                seen.append(event["event"])
                if seen.count("state") == 3 and not restarted:
                    restarted = True
                    self.rig.kill_gateway(signal.SIGTERM)
                    self.rig.start_gateway(wheels=False)
                if seen[-1] == "state" and "reconnected" in seen:
                    break
            self.assertEqual([name for name in seen if name != "state"], ["disconnected", "reconnected"])

    def test_who_does_not_read_events_is_told_how_many_were_lost(self):
        with Gateway(self.socket) as gateway:
            gateway.watch("frame")
            time.sleep(4.0)
            names = []
            for event in gateway.events(timeout=1.0):
                names.append(event)
                if len(names) > 3000:
                    break
            lost = [event["count"] for event in names if event["event"] == "lost"]
            self.assertTrue(lost and lost[0] > 0)
            gateway.watch()


class Reading(RigCase):
    def test_every_declared_field_of_the_snapshot_is_there(self):
        with Gateway(self.socket) as gateway:
            status = gateway.status()
        self.assertEqual(set(Status.__annotations__) - set(status), set())
        self.assertEqual(set(WheelStatus.__annotations__) - set(status["left"]), set())
        self.assertEqual(set(Status.__annotations__["lease"].__forward_arg__.split()), {"LeaseStatus"})

    def test_what_is_not_known_is_none(self):
        with Gateway(self.socket) as gateway:
            self.assertIsNone(gateway.status()["left"]["commanded_mm_s"])
            self.assertEqual(gateway.why()["number"], 0)

    def test_two_threads_in_one_gateway_are_told(self):
        with Gateway(self.socket) as gateway:
            gateway.watch("stop")
            watcher = threading.Thread(target=lambda: list(gateway.events(timeout=0.5)))
            watcher.start()
            time.sleep(0.1)
            with self.assertRaisesRegex(RuntimeError, "give each thread its own"):
                gateway.status()
            watcher.join()
            gateway.status()

    def test_a_signal_handler_may_stop_while_a_request_waits(self):
        with Gateway(self.socket) as gateway:
            gateway.watch("state", rate_hz=5)
            before = signal.signal(signal.SIGALRM, lambda *_: gateway.estop("handler"))
            self.addCleanup(signal.signal, signal.SIGALRM, before)
            signal.setitimer(signal.ITIMER_REAL, 0.2)
            states = []
            while "latched" not in states and len(states) < 50:
                states.append(next(gateway.events(timeout=1)).get("state"))
            self.assertIn("latched", states)
            self.assertEqual(gateway.status()["state"], "latched")

    def test_estop_latches_and_reset_leaves_it(self):
        with Gateway(self.socket) as gateway:
            gateway.estop("a test")
            self.assertIn("a test", gateway.why()["sentence"])
            with self.assertRaises(Refused) as caught:
                gateway.arm()
            self.assertEqual(caught.exception.error, "latched")
            self.wait_until(lambda: self.reset_worked(gateway), 4)
            self.assertEqual(gateway.status()["state"], "listening")

    @staticmethod
    def reset_worked(gateway):
        try:
            gateway.reset()
            return True
        except Refused:
            return False

    def test_a_frozen_gateway_is_no_answer_and_ends_the_connection(self):
        with Gateway(self.socket, timeout=0.3) as gateway:
            gateway.hello()
            self.rig.gateway.signal(signal.SIGSTOP)
            begin = time.monotonic()
            with self.assertRaises(NoAnswer):
                gateway.tare()
            self.assertLess(time.monotonic() - begin, 1.0)
            self.rig.gateway.signal(signal.SIGCONT)
            self.assertEqual(gateway.hello()["name"], "iwheel-gateway")


if __name__ == "__main__":
    unittest.main()
