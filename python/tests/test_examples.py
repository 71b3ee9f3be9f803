# SPDX-License-Identifier: MIT
"""The examples, used as a person would use them."""

import csv
import itertools
import os
import pty
import select
import signal
import struct
import subprocess
import sys
import termios
import threading
import time
import unittest

from rig import EXAMPLES, SOURCES, RigCase, now_us

from iwheel import Gateway

ENVIRONMENT = {**os.environ, "PYTHONPATH": SOURCES}


class Examples(RigCase):
    def start(self, name, *arguments, **options):
        command = [sys.executable, os.path.join(EXAMPLES, name), *arguments]
        child = subprocess.Popen(command, env=ENVIRONMENT, **options)
        self.addCleanup(child.wait)
        self.addCleanup(child.kill)
        return child

    def cause(self):
        with Gateway(self.socket) as gateway:
            return gateway.why()["cause"]

    def holder(self):
        with Gateway(self.socket) as gateway:
            return gateway.status()["lease"]["name"]

    def test_keys_drive_while_they_repeat_and_q_ends(self):
        master, slave = pty.openpty()
        self.addCleanup(os.close, master)
        child = self.start("keys.py", "--socket", self.socket, stdin=slave, stdout=subprocess.DEVNULL)
        os.close(slave)
        self.wait_until(lambda: self.holder() == "keys")
        for _ in range(10):
            os.write(master, b"w")
            time.sleep(0.05)
        let_go_us = now_us()
        self.assertGreater(self.last_motion_us(), let_go_us - 300_000)
        time.sleep(1.2)
        self.assert_stood_by(let_go_us, 1200)
        os.write(master, b"q")
        self.assertEqual(child.wait(5), 0)
        self.assertEqual(self.cause(), "client_stop")

    def test_a_terminal_that_goes_away_stops(self):
        master, slave = pty.openpty()
        child = self.start("keys.py", "--socket", self.socket, stdin=slave, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
        os.close(slave)
        self.wait_until(lambda: self.holder() == "keys")
        os.write(master, b"w")
        time.sleep(0.3)
        os.close(master)
        closed_us = now_us()
        child.wait(5)
        self.assert_stood_by(closed_us, 700)

    def keys_waiting(self):
        """The terminal of keys.py, which waits in arm, and the hand that it waits for."""
        hand = self.push()
        master, slave = pty.openpty()
        self.addCleanup(os.close, master)
        child = self.start("keys.py", "--socket", self.socket, stdin=slave, stdout=subprocess.DEVNULL)
        self.wait_until(lambda: not termios.tcgetattr(slave)[3] & termios.ICANON)  # From here on it retains what is typed.
        os.close(slave)
        time.sleep(0.2)
        return master, child, hand

    def test_keys_pressed_before_armed_move_nothing(self):
        master, child, hand = self.keys_waiting()
        os.write(master, b"w")
        hand.let_go()
        self.wait_until(lambda: self.holder() == "keys")
        time.sleep(1)
        self.assert_never_moved()
        os.write(master, b"w")
        self.wait_until(lambda: self.last_motion_us() > 0)
        os.write(master, b"q")
        self.assertEqual(child.wait(5), 0)

    def test_key_held_since_before_armed_moves_nothing(self):
        master, child, hand = self.keys_waiting()
        hold = threading.Event()

        def repeat():
            while not hold.wait(0.04):
                os.write(master, b"w")

        held = threading.Thread(target=repeat)
        held.start()
        self.addCleanup(held.join)
        self.addCleanup(hold.set)
        time.sleep(0.1)
        hand.let_go()
        self.wait_until(lambda: self.holder() == "keys")
        time.sleep(1)
        hold.set()
        held.join()
        time.sleep(0.8)
        self.assertEqual(self.last_motion_us(), 0)
        os.write(master, b"w")
        self.wait_until(lambda: self.last_motion_us() > 0)
        os.write(master, b"q")
        self.assertEqual(child.wait(5), 0)

    def test_q_typed_before_armed_ends_keys(self):
        master, child, hand = self.keys_waiting()
        os.write(master, b"wqw")
        hand.let_go()
        self.assertEqual(child.wait(5), 0)
        self.assert_never_moved()

    def gamepad(self, events=()):
        device = self.rig.path("js0")
        os.mkfifo(device)
        pad = os.open(device, os.O_RDWR)
        for event in events:
            os.write(pad, event)
        child = self.start("gamepad.py", "--socket", self.socket, "--device", device, stderr=subprocess.PIPE, stdout=subprocess.DEVNULL)
        self.addCleanup(child.stderr.close)
        return pad, child

    @staticmethod
    def event(value, kind, number):
        return struct.pack("=IhBB", 0, value, kind, number)

    def test_a_gamepad_drives_only_while_its_button_is_held(self):
        pad, child = self.gamepad()
        self.wait_until(lambda: self.holder() == "gamepad", 5)
        os.write(pad, self.event(-32767, 2, 1))
        time.sleep(0.4)
        self.assertEqual(self.last_motion_us(), 0, "it moved without the hold-to-run button")
        os.write(pad, self.event(1, 1, 4))
        time.sleep(0.5)
        self.assertGreater(self.last_motion_us(), 0)
        os.write(pad, self.event(0, 1, 4))
        let_go_us = now_us()
        time.sleep(0.8)
        self.assert_stood_by(let_go_us, 700)
        os.write(pad, self.event(1, 1, 4))
        time.sleep(0.4)
        child.send_signal(signal.SIGINT)
        self.assertEqual(child.wait(5), 0)
        os.close(pad)
        self.assert_stood_by(now_us(), 0)

    def test_button_pressed_before_armed_moves_nothing(self):
        hand = self.push()
        pad, child = self.gamepad([self.event(0, 0x82, 1)])
        self.wait_until(lambda: not select.select([pad], [], [], 0)[0])  # It has read the state at the start.
        time.sleep(0.3)
        os.write(pad, self.event(-32767, 2, 1) + self.event(1, 1, 4))
        hand.let_go()
        self.wait_until(lambda: self.holder() == "gamepad", 5)
        time.sleep(1)
        self.assert_never_moved()
        os.write(pad, self.event(0, 1, 4) + self.event(1, 1, 4))
        self.wait_until(lambda: self.last_motion_us() > 0)
        child.send_signal(signal.SIGINT)
        self.assertEqual(child.wait(5), 0)
        os.close(pad)

    def test_an_unplugged_gamepad_stops(self):
        pad, child = self.gamepad()
        self.wait_until(lambda: self.holder() == "gamepad", 5)
        os.write(pad, self.event(-32767, 2, 1) + self.event(1, 1, 4))
        time.sleep(0.5)
        os.close(pad)
        gone_us = now_us()
        self.assertEqual(child.wait(5), 1)
        self.assertIn("the gamepad is gone", child.stderr.read().decode())
        self.assert_stood_by(gone_us, 700)

    def held(self):
        pad, child = self.gamepad()
        self.addCleanup(os.close, pad)
        self.wait_until(lambda: self.holder() == "gamepad", 5)
        os.write(pad, self.event(-32767, 2, 1) + self.event(1, 1, 4))
        return pad, child, now_us()

    def test_gamepad_whose_link_dies_stops_after_2_s(self):
        pad, child, last_us = self.held()
        time.sleep(1.7)
        self.assertGreater(self.last_motion_us(), last_us + 1_500_000, "it stopped before")
        os.set_blocking(child.stderr.fileno(), False)
        self.assertIn("no report of the gamepad for 1 s", os.read(child.stderr.fileno(), 1000).decode())
        time.sleep(1.8)
        self.assert_stood_by(last_us, 2000 + 150 + 700)
        self.assertIn("stopped: no report of the gamepad for 2 s", os.read(child.stderr.fileno(), 1000).decode())
        os.write(pad, self.event(-32000, 2, 1))  # The link is back, and the button was never released.
        time.sleep(0.5)
        self.assert_stood_by(last_us, 2000 + 150 + 700)
        os.write(pad, self.event(0, 1, 4) + self.event(1, 1, 4))
        again_us = now_us()
        time.sleep(0.5)
        self.assertGreater(self.last_motion_us(), again_us)

    def test_gamepad_that_reports_while_held_drives_on(self):
        pad, _, last_us = self.held()
        for n in range(12):
            time.sleep(0.4)
            os.write(pad, self.event(-32767 + n, 2, 1))
        self.assertGreater(self.last_motion_us(), now_us() - 150_000)
        gaps = sorted(t for t, _, speed in self.rig.bus.setpoints() if speed != 0 and t > last_us + 500_000)
        self.assertLess(max(b - a for a, b in itertools.pairwise(gaps)), 200_000, "it stopped in between")

    def test_gamepad_state_from_the_kernel_is_no_report(self):
        pad, _, last_us = self.held()
        for _ in range(8):
            time.sleep(0.4)
            os.write(pad, self.event(-32767, 0x82, 1) + self.event(1, 0x81, 4))
        os.write(pad, self.event(-32766, 2, 1))
        time.sleep(0.3)
        self.assert_stood_by(last_us, 2000 + 150 + 700)

    def test_a_button_held_at_the_start_does_not_arm(self):
        pad, child = self.gamepad([self.event(1, 0x81, 4)])
        self.assertEqual(child.wait(5), 1)
        self.assertIn("let go of it", child.stderr.read().decode())
        os.close(pad)

    def test_a_recording_is_complete_and_is_drawn(self):
        file = self.rig.path("drive.csv")
        child = self.start("record_csv.py", "--socket", self.socket, "--for", "2.5", file)
        with Gateway(self.socket, wait=2).arm() as wheels:
            wheels.drive_for(0.8, 250, 250)
        self.assertEqual(child.wait(6), 0)
        with open(file, newline="", encoding="utf-8") as source:
            rows = list(csv.DictReader(source))
        self.assertGreater(len(rows), 30)
        self.assertEqual(rows[-1]["left_commanded_mm_s"], "")
        self.assertGreater(max(int(row["left_speed_mm_s"]) for row in rows), 150)
        try:
            import matplotlib  # noqa: F401
        except ImportError:
            self.skipTest("matplotlib is missing in .venv: the picture is not drawn")
        picture = self.rig.path("drive.png")
        subprocess.run([sys.executable, os.path.join(EXAMPLES, "plot_csv.py"), file, picture], env=ENVIRONMENT, check=True)
        with open(picture, "rb") as png:
            self.assertEqual(png.read(8), b"\x89PNG\r\n\x1a\n")

    def recorder(self, socket, *arguments):
        child = self.start("record_csv.py", "--socket", socket, *arguments, stderr=subprocess.PIPE, text=True)
        self.addCleanup(child.stderr.close)
        return child

    def test_recording_reports_its_wait_and_its_start(self):
        self.rig.kill_gateway(signal.SIGTERM)
        child = self.recorder(self.socket, self.rig.path("a.csv"))
        line = child.stderr.readline()
        self.assertIn("no gateway listens there; start it", line)
        self.assertIn("Waiting for the gateway, 60 minutes at most", line)
        self.rig.start_gateway()
        self.assertIn("recording 20 lines a second into", child.stderr.readline())
        self.rig.kill_gateway(signal.SIGKILL)
        self.assertIn("Waiting until the gateway is back", child.stderr.readline())
        self.rig.start_gateway(restart_hold=True)
        self.assertIn("the gateway is back", child.stderr.readline())
        child.send_signal(signal.SIGINT)
        self.assertRegex(child.stderr.readline(), r"[0-9]+ lines in .*a\.csv")
        self.assertEqual(child.wait(5), 0)

    def test_timed_recording_without_gateway_ends_on_time(self):
        child = self.recorder(self.socket, "--for", "1.5", self.rig.path("a.csv"))
        self.assertIn("recording", child.stderr.readline())
        self.rig.kill_gateway(signal.SIGKILL)
        self.assertEqual(child.wait(5), 0)

    def test_recording_that_cannot_be_written_fails_immediately(self):
        child = self.recorder(self.socket, self.rig.path("no/such/folder.csv"))
        self.assertEqual(child.wait(5), 1)
        self.assertIn("No such file", child.stderr.read())


if __name__ == "__main__":
    unittest.main()
