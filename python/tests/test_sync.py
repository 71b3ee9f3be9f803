# SPDX-License-Identifier: MIT
"""Gateway and Armed with the real daemon: the wheels stop, whatever happens to the program."""

import asyncio
import os
import signal
import socket
import subprocess
import sys
import threading
import time
import unittest
import warnings
from fractions import Fraction
from unittest import mock

import pytest
from rig import SOURCES, RigCase, now_us

from iwheel import AsyncGateway, ConnectionLost, Gateway, GatewayUnavailable, LeaseEnded, NoAnswer, ProtocolError, Refused
from iwheel._wire import PASSING, add_piece, reason_of

BUDGET_MS = 987 + 100
"""Lease, period and ramp of the configuration of rig.py, and the delay that a busy machine adds."""


class Crowded(RigCase):
    """Occupies every place of the gateway."""

    config = {**RigCase.config, "northbound": {"max_clients": 4}}

    def setUp(self):
        super().setUp()
        self.wheels = Gateway(self.socket).arm("first")
        self.crowd = [socket.socket(socket.AF_UNIX) for _ in range(3)]
        for one in self.crowd:
            self.addCleanup(one.close)
            one.connect(self.socket)
        time.sleep(0.1)

    def test_stop_never_refused_without_a_place(self):
        with self.assertRaises(GatewayUnavailable):
            Gateway(self.socket).status()
        self.wheels.drive(200, 200)
        began = time.monotonic()
        self.assertEqual(Gateway(self.socket).stop(), "stopping")
        self.assertLess(time.monotonic() - began, 0.15)
        self.assertEqual(Gateway(self.socket).estop("a crowd"), "latched")

    def test_stop_never_refused_by_asyncio_without_a_place(self):
        async def stop():
            self.wheels.drive(200, 200)
            return await AsyncGateway(self.socket).stop()

        self.assertEqual(asyncio.run(stop()), "stopping")

    def test_stop_never_refused_with_the_one_socket_gone(self):
        os.rename(self.socket, self.socket + ".away")
        os.makedirs(os.path.join(os.path.dirname(self.socket), "watch"), exist_ok=True)
        os.symlink(self.socket + ".away", os.path.join(os.path.dirname(self.socket), "watch", os.path.basename(self.socket)))
        self.assertEqual(Gateway(self.socket).estop(), "latched")
        os.rename(self.socket + ".away", self.socket)


class Driving(RigCase):
    def test_documented_example_drives_and_ends_at_standstill(self):
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

    def test_a_recording_comes_whole_and_a_damaged_one_not_at_all(self):
        with Gateway(self.socket) as gateway:
            gateway.estop()
            self.wait_until(lambda: gateway.why()["recording"] is not None, 8.0)
            path = gateway.why()["recording"]
            self.assertEqual(gateway.recordings()[-1]["name"] + ".log", os.path.basename(path))
            with open(path, "rb") as file:
                self.assertEqual(gateway.recording(os.path.basename(path)), file.read())
        whole = {"name": "x", "offset": 0, "size": 9, "data": "MTIzNDU2Nzg5", "crc32": 3421780262, "file_crc32": 3421780262}
        self.assertTrue(add_piece(bytearray(), whole))
        for damage in ({"data": "MTIzNDU2Nzg4"}, {"data": "MTI"}, {"offset": 1}, {"size": 8}, {"file_crc32": None}, {"data": "", "crc32": 0}):
            with self.assertRaises(ProtocolError, msg=str(damage)):
                add_piece(bytearray(), {**whole, **damage})

    def test_a_single_command_does_not_outlive_its_lease(self):
        with Gateway(self.socket) as gateway:
            wheels = gateway.arm()
            wheels.drive(300, 300)
            sent_us = now_us()
            time.sleep(1.4)
            self.assert_stood_by(sent_us, BUDGET_MS)
            self.assertEqual(gateway.why()["cause"], "lease_lost")
            with self.assertRaises(LeaseEnded) as caught:
                wheels.drive(300, 300)
            self.assertEqual(caught.exception.error, "not_armed")
            self.assertIn("lease_lost", str(caught.exception))
            with self.assertRaises(LeaseEnded):
                wheels.drive(300, 300)

    def test_exception_in_the_block_stops_and_is_raised(self):
        with self.assertRaises(ZeroDivisionError), Gateway(self.socket).arm() as wheels:
            wheels.drive_for(0.4, 300, 300)
            raise ZeroDivisionError
        self.assert_stood_by(now_us(), 0)

    def test_ctrl_c_stops(self):
        script = "import iwheel, sys\nwith iwheel.Gateway(sys.argv[1]).arm() as w:\n    print('armed', flush=True)\n    w.drive_for(60, 300, 300)\n"
        child = self.python(script)
        child.stdout.readline()
        time.sleep(0.5)
        child.send_signal(signal.SIGINT)
        sent_us = now_us()
        child.wait(5)
        self.assertNotEqual(child.returncode, 0)
        self.assert_stood_by(sent_us, 600)
        with Gateway(self.socket) as gateway:
            # The connection has ended: the interrupt came while a request was half sent, and only that undoes it.
            self.assertIn(gateway.why()["cause"], ("client_stop", "client_gone"))

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
        child = self.python("import iwheel, sys\nwith iwheel.Gateway(sys.argv[1]).arm() as w:\n    print('armed', flush=True)\n    w.drive_for(60, 300, 300)\n")
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
        environment = {**os.environ, "PYTHONPATH": SOURCES}
        child = subprocess.Popen([sys.executable, "-c", script, self.socket], env=environment, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, text=True)

        def end():
            child.kill()
            child.wait()
            child.stdout.close()

        self.addCleanup(end)
        return child

    def test_block_end_after_lost_lease_stops_no_other_driver(self):
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

    def test_older_permission_ends_when_same_gateway_arms_again(self):
        with Gateway(self.socket) as gateway:
            old = gateway.arm()
            new = gateway.arm()
            with self.assertRaises(LeaseEnded):
                old.drive(200, 200)
            new.drive(0, 0)

    def test_values_out_of_range_are_refused_and_permission_stays(self):
        with Gateway(self.socket) as gateway, gateway.arm() as wheels:
            for bad in (40000, -40000):
                with self.assertRaises(Refused) as caught:
                    wheels.drive(100, bad)
                self.assertEqual(caught.exception.error, "out_of_range")
            for bad in (1.5, float("nan"), float("inf")):
                with self.assertRaisesRegex(ValueError, "right_mm_s must be a whole number"):
                    wheels.drive(100, bad)
            for bad in (True, "100", [100]):
                with self.assertRaisesRegex(TypeError, "right_mm_s must be a whole number"):
                    wheels.drive(100, bad)
            with self.assertRaisesRegex(ValueError, "yaw_mrad_s .* not 0.5"):
                wheels.twist(100, 0.5)
            for bad in (float("nan"), -1):
                with self.assertRaisesRegex(ValueError, "seconds must be"):
                    wheels.drive_for(bad, 0, 0)
            for bad in (float("nan"), 0, 1000):
                with self.assertRaisesRegex(ValueError, "rate_hz must be"):
                    wheels.drive_for(1, 0, 0, rate_hz=bad)
            self.assertTrue(wheels.drive(4000, 2000).limited)

    def test_whole_numbers_of_other_types_are_accepted(self):
        class Index:
            def __index__(self):
                return 100

        numbers = [100.0, Index(), Fraction(100)]
        try:
            import numpy
        except ImportError:
            print("note: numpy is missing in .venv: its numbers are not tried")
        else:
            numbers += [numpy.int64(100), numpy.int8(100), numpy.uint16(100), numpy.float32(100), numpy.float64(100), numpy.array(100)]
        with Gateway(self.socket) as gateway, gateway.arm() as wheels:
            for number in numbers:
                with self.subTest(type(number)):
                    applied = wheels.drive(number, number, number, number)
                    self.assertEqual((applied.left_mm_s, applied.right_mm_s, applied.left_mA), (100, 100, 300))  # min_current_mA.
            self.assertEqual(wheels.twist(100.0, Index()).right_mm_s, 127)
            self.assertEqual(gateway.watch("bus", rate_hz=20.0)["rate_hz"], 20)

    def test_numbers_of_numpy_that_are_not_whole_are_refused(self):
        try:
            import numpy
        except ImportError:
            self.skipTest("numpy is missing in .venv")
        with Gateway(self.socket) as gateway, gateway.arm() as wheels:
            for bad in (numpy.float64(200.5), numpy.nan, numpy.bool_(True), numpy.array([1, 2]), numpy.complex128(1)):
                with self.assertRaises((TypeError, ValueError)):
                    wheels.drive(bad, 0)

    def test_twist_turns(self):
        with Gateway(self.socket).arm() as wheels:
            applied = wheels.twist(200, 500)
        self.assertEqual((applied.left_mm_s, applied.right_mm_s), (65, 335))


class Arming(RigCase):
    def test_arming_right_after_a_clean_stop_waits_it_out(self):
        for _ in range(2):
            with Gateway(self.socket).arm("again") as wheels:
                wheels.drive_for(0.3, 300, 300)
        self.assert_stood_by(now_us(), 0)

    def test_arm_right_after_unawaited_stop_waits_for_standstill(self):
        with Gateway(self.socket) as gateway:
            gateway.arm().drive_for(0.5, 400, 400)
            gateway.stop()
            begin = time.monotonic()
            with gateway.arm() as wheels:
                self.assertLess(time.monotonic() - begin, 2.0)
                self.assertTrue(gateway.status()["left"]["at_rest"])
                wheels.drive(100, 100)

    def test_arm_without_wait_raises_the_refusal_immediately(self):
        with Gateway(self.socket) as gateway:
            with gateway.arm() as wheels:
                wheels.drive_for(0.2, 300, 300)
            with self.assertRaises(Refused) as caught:
                gateway.arm(wait=0)
            self.assertEqual(caught.exception.error, "stale_command")

    def hold_stick(self):
        """Another client sends drive commands until the end of the test."""
        other = self.rig.client("joystick")
        quit_it = threading.Event()

        def hold():
            while not quit_it.wait(0.05):
                other.drive(100, 100)

        stick = threading.Thread(target=hold)
        stick.start()
        self.addCleanup(stick.join)
        self.addCleanup(quit_it.set)
        time.sleep(0.2)

    def test_stick_that_is_held_is_awaited_for_the_given_time_only(self):
        self.hold_stick()
        with Gateway(self.socket) as gateway:
            begin = time.monotonic()
            with self.assertRaises(Refused) as caught:
                gateway.arm(wait=0.7)
            self.assertEqual(caught.exception.error, "stale_command")
            self.assertGreater(time.monotonic() - begin, 0.7)
            self.assertLess(time.monotonic() - begin, 1.2)

    def test_stick_that_is_never_let_go_ends_the_wait_at_max_age(self):
        self.hold_stick()
        with Gateway(self.socket) as gateway:
            begin = time.monotonic()
            with self.assertRaisesRegex(Refused, r"more than 1000 ms after t_us.* \(it was refused before, because client \d+ .*sent a nonzero drive"):
                gateway.arm(wait=10)
            self.assertLess(time.monotonic() - begin, 3)

    def test_arm_waits_longer_than_max_age_for_standstill(self):
        hand = self.push()
        threading.Timer(1.5, hand.let_go).start()
        begin = time.monotonic()
        with Gateway(self.socket).arm(wait=10) as wheels:
            self.assertGreater(time.monotonic() - begin, 1.5)
            wheels.drive_for(0.3, 200, 200)
        self.assertGreater(self.last_motion_us(), 0)

    def test_stop_of_another_client_ends_an_arm_that_waits(self):
        def drive():
            try:
                with Gateway(self.socket).arm(wait=10) as wheels:
                    wheels.drive_for(0.3, 200, 200)
            except Refused as refusal:
                refusals.append(str(refusal))

        for seconds in (0.3, 1.5):  # The second one is longer than max_age_ms.
            refusals, hand = [], self.push()
            waiting = threading.Thread(target=drive)
            waiting.start()
            time.sleep(seconds)
            with Gateway(self.socket) as other:
                other.stop()
            hand.let_go()
            waiting.join()
            time.sleep(1)
            self.assert_never_moved()
            self.assertRegex(
                "".join(refusals), r"^arm refused \(stale_command\): the wheels were stopped after t_us .* \(it was refused before, because the wheels turn"
            )

    def test_arm_that_waits_ends_with_its_connection(self):
        hand = self.push()
        gateway = Gateway(self.socket)
        threading.Timer(0.3, self.rig.kill_gateway, [signal.SIGKILL]).start()
        with self.assertRaises(GatewayUnavailable):
            gateway.arm(wait=10)
        hand.let_go()

    def test_permanent_refusal_is_raised_immediately(self):
        with Gateway(self.socket) as gateway:
            gateway.estop()
            begin = time.monotonic()
            with self.assertRaises(Refused) as caught:
                gateway.arm(wait=5)
            self.assertEqual(caught.exception.error, "latched")
            self.assertLess(time.monotonic() - begin, 1.0)


class Ending(RigCase):
    """For each end of the permission, the first call after it reports the end."""

    def lose(self, gateway):
        wheels = gateway.arm()
        wheels.drive(200, 200)
        observer = self.rig.client()
        self.wait_until(lambda: observer.request("status")["state"] != "armed")
        return wheels

    def ended(self, call, error, *kinds):
        with self.assertRaises(LeaseEnded) as caught:
            call()
        self.assertEqual(caught.exception.error, error)
        for kind in kinds:
            self.assertIsInstance(caught.exception, kind)
        return caught.exception

    def test_lost_lease_with_unread_events_is_reported(self):
        with Gateway(self.socket) as gateway:
            gateway.watch("lease", "stop")
            wheels = self.lose(gateway)
            raised = self.ended(lambda: wheels.drive(200, 200), "not_armed")
            self.assertIsInstance(raised.__cause__, Refused)
            seen = [event.get("change", event.get("cause")) for event in gateway.events(timeout=0.3)]
            self.assertEqual(seen, ["gained", "lease_lost", "lost"])

    def test_new_permission_after_lost_lease_is_granted_immediately(self):
        with Gateway(self.socket) as gateway:
            wheels = self.lose(gateway)
            self.ended(lambda: wheels.twist(200, 0), "not_armed")
            with gateway.arm() as again:
                again.drive_for(0.2, 100, 100)

    def test_drive_for_reports_a_lost_lease(self):
        with Gateway(self.socket) as gateway:
            wheels = self.lose(gateway)
            self.ended(lambda: wheels.drive_for(1, 200, 200), "not_armed")

    def test_estop_is_reported_with_its_reason(self):
        with Gateway(self.socket) as gateway, Gateway(self.socket) as other, gateway.arm() as wheels:
            wheels.drive(200, 200)
            other.estop("a child runs by")
            raised = self.ended(lambda: wheels.drive(200, 200), "latched")
            self.assertIn("a child runs by", str(raised))

    def test_new_driver_is_reported_and_not_disturbed(self):
        with Gateway(self.socket) as gateway, Gateway(self.socket) as other:
            wheels = gateway.arm()
            mine = other.arm("second", takeover=True)
            self.ended(lambda: wheels.drive(0, 0), "not_holder")
            self.assertIn("second", str(self.ended(lambda: wheels.drive(0, 0), None)))
            mine.drive(0, 0)

    def test_connection_end_not_yet_read_counts_as_ended_lease(self):
        with Gateway(self.socket) as gateway:
            wheels = gateway.arm()
            wheels.drive(100, 100)
            self.rig.kill_gateway(signal.SIGKILL)
            self.ended(lambda: wheels.drive(100, 100), None, GatewayUnavailable, ConnectionLost)
            self.ended(lambda: wheels.drive(100, 100), None)


class OnStatus(RigCase):
    """Tests of drive_for with on_status."""

    def test_every_command_is_followed_by_a_snapshot(self):
        seen = []
        with Gateway(self.socket).arm() as wheels:
            wheels.drive_for(1.0, 300, 300, on_status=seen.append)
        self.assertGreaterEqual(len(seen), 9)  # A lease of 300 ms: ten a second, and one at the end.
        self.assertTrue(all(status["left"]["commanded_mm_s"] == 300 for status in seen))
        self.assertGreater(max(status["left"]["speed_mm_s"] for status in seen), 250)

    def test_they_come_as_fast_as_asked(self):
        times = []
        with Gateway(self.socket).arm() as wheels:
            wheels.drive_for(1.0, 100, 100, on_status=lambda status: times.append(status["t_us"]), rate_hz=50)
        self.assertGreater(len(times), 30)
        self.assertLessEqual(len(times), 52)

    def test_true_ends_the_drive(self):
        begin = time.monotonic()
        with Gateway(self.socket).arm() as wheels:
            applied = wheels.drive_for(30, 300, 300, on_status=lambda status: status["left"]["speed_mm_s"] > 150)
        self.assertEqual(applied.left_mm_s, 300)
        self.assertLess(time.monotonic() - begin, 4)
        self.assert_stood_by(now_us(), 0)

    def test_exception_in_on_status_stops_the_wheels(self):
        def stumble(status):
            if status["left"]["speed_mm_s"] > 100:
                raise ZeroDivisionError

        with self.assertRaises(ZeroDivisionError), Gateway(self.socket).arm() as wheels:
            wheels.drive_for(30, 300, 300, on_status=stumble)
        self.assert_stood_by(now_us(), 0)

    def test_one_that_hangs_loses_the_lease(self):
        with Gateway(self.socket) as gateway, gateway.arm() as wheels:
            with self.assertRaises(LeaseEnded):
                wheels.drive_for(30, 300, 300, on_status=lambda _: time.sleep(0.6))
            self.assertEqual(gateway.why()["cause"], "lease_lost")

    def test_a_lost_connection_is_an_ended_lease_there_too(self):
        def kill(_):
            self.rig.kill_gateway(signal.SIGKILL)

        with warnings.catch_warnings(record=True):
            warnings.simplefilter("always")
            with self.assertRaises(ConnectionLost), Gateway(self.socket).arm() as wheels:
                wheels.drive_for(30, 100, 100, on_status=kill)


class Answers(RigCase):
    """The gateway's replies are returned."""

    @pytest.mark.pace(1)
    def test_tare_returns_the_new_zero_and_the_previous_one(self):
        with Gateway(self.socket) as gateway:
            self.wait_until(lambda: self.granted(gateway.tare), 6)
            tared = gateway.tare("left")
            self.assertEqual(tared["state"], "listening")
            self.assertNotIn("right", tared)
            self.assertEqual(tared["left"]["before_provenance"], "operator")
            self.assertEqual(gateway.status()["left"]["force_offset_mN"], tared["left"]["offset_mN"])

    @staticmethod
    def granted(call):
        try:
            return call()
        except Refused:
            return None

    def test_confirm_returns_the_assumption_of_the_item(self):
        with Gateway(self.socket) as gateway:
            entry = gateway.confirm("wheel_radius", 200.0)
            self.assertEqual((entry["state"], entry["found"]), ("contradicted", "200"))
            self.assertIn("radius_mm", entry["disabled"])
            self.assertEqual(gateway.confirm("wheel_radius")["state"], "confirmed")
            self.assertEqual(gateway.confirm("mount_sign_left", "no")["item"], "mount_sign_left")
            self.assertEqual(gateway.confirm("track", how="a tape from tyre to tyre")["reason"], "found by a tape from tyre to tyre")
            with self.assertRaises(ValueError):
                gateway.confirm("wheel_radius", 192.5)

    def test_config_of_a_daemon_is_refused_and_its_file_named(self):
        with Gateway(self.socket) as gateway:
            for words in ({}, {"key": "drive.lease_ms", "value": 300}, {"commit": True}, {"commit": False}):
                with self.assertRaisesRegex(Refused, "configuration is a file"):
                    gateway.config(**words)
            with self.assertRaises(ValueError):
                gateway.config("drive.lease_ms", 300.5)

    def test_watch_returns_the_grant_and_stops_return_the_state(self):
        with Gateway(self.socket) as gateway:
            self.assertEqual(gateway.watch("state", rate_hz=500), {"topics": ["state"], "rate_hz": 100, "limited": True})
            gateway.watch()
            self.assertEqual(gateway.stop(), "listening")
            self.assertEqual(gateway.estop(), "latched")
            self.assertEqual(self.eventually(gateway.reset), "listening")

    def eventually(self, call):
        results = []
        self.wait_until(lambda: results.append(self.granted(call)) or results[-1], 4)
        return results[-1]


class Reconnecting(RigCase):
    def test_gateway_killed_is_reconnected_and_nothing_moves(self):
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

    @pytest.mark.pace(1)
    def test_unread_events_are_counted_as_lost(self):
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
    def test_unknown_values_are_none(self):
        with Gateway(self.socket) as gateway:
            self.assertIsNone(gateway.status()["left"]["commanded_mm_s"])
            self.assertEqual(gateway.why()["number"], 0)

    def test_two_threads_in_one_gateway_are_reported(self):
        with Gateway(self.socket) as gateway:
            gateway.watch("stop")
            watcher = threading.Thread(target=lambda: list(gateway.events(timeout=0.5)))
            watcher.start()
            time.sleep(0.1)
            with self.assertRaisesRegex(RuntimeError, "create one for each thread"):
                gateway.status()
            watcher.join()
            gateway.status()

    def test_stop_never_refused_while_a_thread_reads_events(self):
        with Gateway(self.socket) as gateway:
            wheels = gateway.arm("window with a stop button")
            gateway.watch("stop")
            wheels.drive(200, 200)
            reader = threading.Thread(target=lambda: list(gateway.events(timeout=1.5)))
            reader.start()
            time.sleep(0.1)
            self.assertTrue(wheels.stop())
            self.assertEqual(gateway.stop(), "stopping")
            self.assertEqual(gateway.estop("button"), "latched")
            self.assertTrue(reader.is_alive(), "the stops waited for the reader")
            reader.join()
            self.assertIn("button", gateway.why()["sentence"])

    def test_stop_ends_an_arm_that_waits(self):
        other = Gateway(self.socket)
        other.arm().drive_for(0.1, 200, 200)
        other.close()  # The gateway now refuses arm for half a second.
        outcomes = []

        def arm(gateway):
            try:
                outcomes.append(gateway.arm(wait=5))
            except Refused as refusal:
                outcomes.append(refusal.error)

        with Gateway(self.socket) as gateway:
            waiting = threading.Thread(target=arm, args=[gateway])
            waiting.start()
            time.sleep(0.1)
            gateway.stop()
            waiting.join()

        async def story():
            gateway = AsyncGateway(self.socket)
            waiting = asyncio.ensure_future(gateway._arm(None, False, 5))
            await asyncio.sleep(0.1)
            await gateway.stop()
            with self.assertRaises(Refused) as caught:
                await waiting
            outcomes.append(caught.exception.error)
            gateway.close()

        asyncio.run(story())
        self.assertEqual(len(outcomes), 2)
        self.assertLessEqual(set(outcomes), {*PASSING})

    def test_stop_before_the_reply_to_arm_ends_the_permission(self):
        with Gateway(self.socket) as gateway:
            ask = gateway._ask

            def stop_meanwhile(cmd, **fields):
                reply = ask(cmd, **fields)
                Gateway.stop(gateway)
                return reply

            with mock.patch.object(gateway, "_ask", stop_meanwhile), mock.patch.object(gateway, "_stop", return_value={"state": "stopping"}):
                wheels = gateway.arm()
            with self.assertRaisesRegex(LeaseEnded, "stopped while it was requested"):
                wheels.drive(200, 200)

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

    def test_estop_never_refused_for_its_reason(self):
        class Mute:
            def __str__(self):
                raise ZeroDivisionError

        seen = {
            ValueError("sensor\n  lost"): "sensor lost",
            None: None,
            "": None,
            " \t": None,
            7: "7",
            Mute(): "Mute (its text failed: ZeroDivisionError)",
            "a\tb\x00\x7f\u2028c\u200e\u202ed\ud800e": "a b c d e",
            "x" * 5000: "x" * 200,
            "y" + "\u00e9" * 100: "y" + "\u00e9" * 99,
            "\U0001f6d1" * 51: "\U0001f6d1" * 50,
            '"\\' * 101: '"\\' * 100,
        }
        with Gateway(self.socket) as gateway:
            for reason, shown in seen.items():
                self.assertEqual(reason_of(reason), shown)
                self.assertEqual(gateway.estop(reason), "latched")
            self.assertIn("sensor lost", gateway.why()["sentence"])
            self.assertEqual(asyncio.run(AsyncGateway(self.socket).estop(ValueError("two\nlines"))), "latched")

    def test_estop_latches_and_reset_leaves_it(self):
        with Gateway(self.socket) as gateway:
            gateway.estop("a test")
            self.assertIn("a test", gateway.why()["sentence"])
            with self.assertRaises(Refused) as caught:
                gateway.arm()
            self.assertEqual(caught.exception.error, "latched")
            self.wait_until(lambda: self.reset_worked(gateway), 4)
            self.assertEqual(gateway.status()["state"], "listening")
            self.assertEqual(gateway.release(), "listening")  # Without a hold it changes nothing.

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
