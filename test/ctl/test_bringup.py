# SPDX-License-Identifier: MIT
"""iwheelctl bringup from start to end against simulated wheels that are not as assumed, and its ways out."""

import json
import os
import re
import shutil
import signal
import tempfile
import time
import unittest
from pathlib import Path

import ctl
from operator_at_terminal import Operator

from bus import now_us
from harness import Rig, children
from trials import until
from verdict import hold

GRAVITY = 9.8
FULL_TURN_M_PER_MM = 2 * 3.14159265 / 1000


def environment(runtime=None):
    return ctl.environment("XDG_RUNTIME_DIR", TERM="dumb", **({"XDG_RUNTIME_DIR": runtime} if runtime else {}))


class Bringup(unittest.TestCase):
    def setUp(self):
        self.rig = Rig(ctl.BUILD)
        self.addCleanup(self.rig.close)
        self.folder = tempfile.TemporaryDirectory(prefix="iwheel-bringup-test-", ignore_cleanup_errors=True)  # The gateway's last recording may follow.
        self.addCleanup(self.folder.cleanup)
        self.out = os.path.join(self.folder.name, "mine.conf")
        self.records = os.path.join(self.folder.name, "records")
        Path(self.out + ".from").write_text(f"[record]\ndirectory = {self.records}\n", encoding="utf-8")
        self.runtime = tempfile.mkdtemp(prefix="iwbr-", dir="/tmp")  # bringup uses a folder of at most 30 characters.
        self.addCleanup(self.nothing_left_behind)
        time.sleep(0.5)

    def nothing_left_behind(self):
        """Ends the programs after any exit of a test; a gateway without a client holds its zeros first."""
        try:
            self.nothing_left_soon(self.PATIENCE_S if self.killed else 0)
        finally:
            shutil.rmtree(self.runtime)

    killed = False
    PATIENCE_S = 16  # Zeros are held for ten seconds while a wheel turns.

    def nothing_left_soon(self, seconds=PATIENCE_S):
        end = time.monotonic() + seconds
        while os.listdir(self.runtime):
            self.assertLess(time.monotonic(), end, "bringup's folder is left behind")
            time.sleep(0.05)

    def start(self, *words, variables=None):
        """Up to the checks."""
        bus, button = (f"unix:{self.rig.path(name)}" for name in ("bus", "button"))
        return self.start_from(self.out + ".from", "--can", bus, "--estop", button, *words, variables=variables)

    def start_from(self, path, *words, variables=None):
        operator = Operator([ctl.program(), "bringup", self.out, "--from", path, *words], variables or environment(self.runtime))
        self.addCleanup(self.end, operator)
        operator.answer("finger on the e-stop?", "y")
        return operator

    def simulate_after(self, operator, text, command):
        """Waits for the text; then the wheels or the button change."""
        operator.expect(text)
        self.rig.sim.ask(command)

    def press_and_release(self, operator):
        self.simulate_after(operator, "Press the e-stop button now", "estop press")
        self.simulate_after(operator, "Release it", "estop release")

    def end(self, operator):
        self.killed = self.killed or operator.process.poll() is None
        operator.close()

    def begin(self, *words, gear=False, to="type"):
        """Through the checks and the e-stop, past the gear, and to the step about the type, role, signs or distance."""
        operator = self.start(*words)
        self.press_and_release(operator)
        if not gear:
            operator.answer("Turn the wheels by hand?", "n")
        if to == "role":
            self.find_type(operator)
        elif to != "type":
            self.drive_through(operator, signs=to == "distance")
        return operator

    def leave(self, operator, seconds=20.0):
        """Repeats and saves nothing."""
        end = time.monotonic() + seconds
        while operator.process.poll() is None and time.monotonic() < end:
            operator.pump(0.05)
            asked = re.search(r"(Do\sit\sagain\?|continue\slater\?) \[y\] ", operator.text[operator.seen :])
            if asked:
                operator.seen += asked.end()
                operator.type("n\n")
        self.assertEqual(1, operator.wait())

    def quit_at(self, operator, question):
        operator.answer(question, "q")
        self.leave(operator)

    def moving(self):
        """Setpoints on the bus that are no zeros."""
        time.sleep(0.05)
        return [frame for frame in self.rig.bus.setpoints() if frame[2] != 0]

    def ramped_down_since(self, begin_us):
        speeds = [speed for _, _, speed in self.rig.bus.setpoints(begin_us)]
        return any(speeds) and speeds[-1] == 0

    def written(self):
        return Path(self.out).read_text(encoding="utf-8")

    def value(self, section, key):
        here = None
        for line in self.written().splitlines():
            if line.startswith("["):
                here = line.strip()
            elif here == f"[{section}]" and line.startswith(f"{key} "):
                return line.split("=", 1)[1].split(";")[0].strip()
        raise AssertionError(f"no {section}.{key} in {self.out}")

    def begin_first_try(self):
        """Until the wheels are about to turn."""
        operator = self.begin()
        operator.answer("types to try", "1")
        operator.expect("any key stops it")
        return operator

    def answer_after(self, command, operator, question, line):
        """The wheels or the button change between the question and its answer."""
        self.simulate_after(operator, question, command)
        operator.seen -= len(question)
        operator.answer(question, line)

    def look_at_signs(self, operator, mirrored):
        for side in ("left", "right"):
            operator.answer(f"Watch the {side} wheel", "")
            operator.answer("r: repeat)", "b" if side in mirrored else "f")
        operator.answer("Now both", "")
        operator.answer("straight ahead?", "y")

    def skip_distance_and_track(self, operator):
        operator.answer("Distance in m", "")
        operator.answer("How many full turns", "")

    def look_at_signs_only(self, operator):
        """The signs as documented, and nothing is measured after them."""
        self.look_at_signs(operator, mirrored=())
        operator.answer("Measure the force?", "n")
        self.skip_distance_and_track(operator)

    def begin_to_weigh(self, operator, side, mass_kg=5):
        operator.answer(f"put on the {side} handle", str(mass_kg))
        operator.answer("from both handles", "")

    def weigh(self, operator, side, mass_kg):
        self.begin_to_weigh(operator, side, mass_kg)
        operator.expect("measuring")
        self.simulate_after(operator, "put the mass on", f"load {side} {mass_kg * GRAVITY:.2f}")
        operator.type("\n")
        self.simulate_after(operator, "the unit is", f"load {side} 0")

    def move_and_enter(self, operator, *commands):
        """One movement after the other."""
        operator.expect("press Enter ...")
        for command in commands:
            self.rig.sim.ask(command)
            self.wait_until_stands()
        operator.type("\n")

    def turn_by_hand(self, operator, radius_mm, turns=(3, 3), answer="y"):
        operator.answer("Turn the wheels by hand?", "y")
        for side, turn in zip(("left", "right"), turns, strict=True):
            self.move_and_enter(operator, f"push {side} {turn * radius_mm * FULL_TURN_M_PER_MM:.3f}")
        if answer:
            operator.answer("Use that?", answer)

    def turn_around(self, operator, *commands, turns=3):
        """The machine as a whole; by other commands, if it does not go as it should."""
        operator.answer("How many full turns", str(turns))
        operator.answer("Point the machine at the mark", "")
        self.move_and_enter(operator, *(commands or (f"turn {turns}",)))

    def find_type(self, operator, types="1", tries=True):
        """To the question about the role, or to its tries."""
        operator.answer("types to try", types)
        operator.answer("Did both wheels turn", "y")
        if tries:
            operator.answer("Enter begins the tries", "")

    def drive_through(self, operator, signs=True):
        """Type, role and signs of wheels as documented."""
        self.find_type(operator)
        operator.answer("current_role", "")
        if signs:
            self.look_at_signs(operator, mirrored=())
            operator.answer("Measure the force?", "n")

    def write(self, operator):
        """Writes the file and ends. How each key was found, by the file: {key: "confirmed: ..." or "noted: ..."}."""
        operator.answer("Write it to", "")
        self.assertEqual(0, operator.wait(), operator.text[-2000:])
        expected, found = None, {}
        for line in self.written().splitlines():
            if line.startswith("; BRINGUP "):
                expected = line.split(", ", 1)[1].strip()
            elif "=" in line and not line.startswith(";"):
                found[line.split(" = ")[0]], expected = expected, None
        return found

    def push(self, operator, distance_m, left_m, right_m):
        operator.answer("Distance in m", str(distance_m))
        operator.answer("Place the machine at the start mark", "")
        self.simulate_after(operator, "press Enter ...", f"push left {left_m}")
        self.rig.sim.ask(f"push right {right_m}")
        self.stand_and_enter(operator)

    def stand_and_enter(self, operator):
        self.wait_until_stands()
        operator.type("\n")

    def wait_until_stands(self):
        time.sleep(0.2)
        while any(json.loads(self.rig.sim.ask("status"))[side]["speed_mm_s"] for side in ("left", "right")):
            time.sleep(0.05)
        time.sleep(0.15)

    def test_wheels_mirrored_with_other_units_and_radius_are_learned(self):
        for command in (
            "type 3",
            "role limit",
            "unit left dN",
            "unit right cN",
            "radius both 160",
            "mirror left on",
            "gear both 4",
            "rpm both rotor",
            "track 620",
        ):
            self.rig.sim.ask(command)
        os.mkdir(self.records)
        with open(self.out + ".from", "a", encoding="utf-8") as file:
            file.write("[wheels]\ntrack_mm = 540\n")
        operator = self.begin(gear=True)
        self.turn_by_hand(operator, 160)
        self.find_type(operator, "0-7")
        operator.answer("current_role", "")
        self.look_at_signs(operator, mirrored=("left",))
        operator.answer("Measure the force?", "y")
        self.weigh(operator, "left", 5)
        self.weigh(operator, "right", 5)
        self.push(operator, 5, -5, 5)
        operator.answer("Use the mean?", "y")
        self.turn_around(operator)
        operator.expect("The configured track is 540 mm")
        operator.answer("Use that?", "y")
        operator.answer("Write it to", "")
        self.assertEqual(0, operator.wait(), operator.text[-2000:])
        expected = {
            ("wheels", "setpoint_type"): "3",
            ("wheels", "current_role"): "limit",
            ("left", "invert"): "yes",
            ("right", "invert"): "no",
            ("left", "force_unit"): "dN",
            ("right", "force_unit"): "cN",
            ("wheels", "gear_ratio"): "4",
            ("wheels", "rpm_of"): "rotor",
            ("drive", "max_speed_mm_s"): "1000",
            ("drive", "lease_ms"): "200",
        }
        self.assertEqual(expected, {place: self.value(*place) for place in expected})
        self.assertAlmostEqual(160, int(self.value("wheels", "radius_mm")), delta=2)
        text = self.written()
        self.assertAlmostEqual(620, int(self.value("wheels", "track_mm")), delta=8)
        self.assertEqual(9, text.count(", confirmed: "), text)
        self.assertIn(f"The confirmed results are stored in {self.records}", " ".join(operator.text.split()))
        self.assertEqual(["mine.conf", "mine.conf.from", "records"], sorted(os.listdir(self.folder.name)))
        self.gateway_takes_it()
        self.ledger_knows_it()

    def gateway_takes_it(self):
        """The real gateway starts with the file, and its wheels follow the commands."""
        code, out, err = ctl.run("-c", self.out, "--socket", self.rig.path("gateway.sock"), "--check", name="iwheel-gateway")
        self.assertEqual(0, code, out + err)

    def ledger_knows_it(self):
        """A gateway that starts with the file finds the operator's word."""
        self.rig.gateway_command = lambda *extra: [ctl.program("iwheel-gateway"), "-c", self.out, "--socket", self.rig.path("gateway.sock"), *extra]
        self.rig.start_gateway()
        client = self.rig.client()
        entries = self.rig.wait_status(client, lambda s: s["memory"]["state"] == "kept")["ledger"]
        for item, number in (
            ("setpoint_type", "commanded 100 mm/s, measured"),
            ("current_role", "500 mA alone and 100 mm/s alone turned no wheel, both together turned both"),
            ("mount_sign_left", "saw it turn backwards with invert = no"),
            ("mount_sign_right", ""),
            ("wheel_radius", r"5\.00 m pushed: left -?\d+, right -?\d+ ticks"),
            ("gear_ratio", r"\d+ and \d+ ticks in 3 turns by hand"),
            ("force_unit_left", r"5\.00 kg changed"),
            ("force_unit_right", ""),
            ("track", r"3 full turns by hand: left -?\d+, right -?\d+ ticks"),
        ):
            self.assertEqual("confirmed", entries[item]["state"], (item, entries[item]))
            self.assertRegex(entries[item]["reason"], f"^found by bringup: .*{number}")

    def test_current_that_is_a_setpoint_is_found_out(self):
        self.rig.sim.ask("role setpoint")
        operator = self.begin()
        self.find_type(operator, "7")
        operator.expect("it is a setpoint")
        operator.answer("current_role", "")
        self.look_at_signs(operator, mirrored=())
        self.quit_at(operator, "Measure the force?")
        self.assertIn("Nothing was written", operator.text)
        self.assertFalse(os.path.exists(self.out))

    def held_during_the_tries(self):
        """Both wheels are held from the first question about the role on; the operator continues."""
        self.rig.sim.ask("role setpoint")
        operator = self.begin()
        operator.answer("types to try", "7")
        self.answer_after("block both", operator, "Did both wheels turn", "y")
        operator.answer("Enter begins the tries", "")
        return operator

    def test_wheel_blocked_in_current_test_is_found_by_turning_zero(self):
        operator = self.held_during_the_tries()
        self.simulate_after(operator, "may be a limit", "unblock both")
        operator.expect("It TURNED")
        self.assertEqual("setpoint", self.offered(operator, "current_role"))

    def test_wheel_running_away_unobserved_is_found_by_the_stop(self):
        operator = self.held_during_the_tries()
        self.simulate_after(operator, "Neither wheel may turn", "unblock both")
        operator.expect("any key stops it")
        operator.process.send_signal(signal.SIGSTOP)  # Hangs, while the gateway sees a wheel run away.
        time.sleep(1.5)
        operator.process.send_signal(signal.SIGCONT)
        operator.expect("It TURNED")

    def offered(self, operator, question):
        operator.expect(question)
        operator.expect("[")
        return operator.expect("] ")

    def test_silence_of_a_wheel_during_a_try_is_no_finding(self):
        self.rig.sim.ask("role setpoint")
        operator = self.begin()
        self.find_type(operator, "7")
        self.simulate_after(operator, "any key stops it", "mute left")
        self.assertRegex(operator.expect("Try again?"), "left wheel (is )?(offline|not heard|sent no telemetry)")
        self.rig.sim.ask("unmute left")
        operator.type("y\n")
        operator.expect("it is a setpoint")

    def test_recording_of_other_controller_suggests_type_and_length(self):
        recording = os.path.join(self.folder.name, "old.log")
        with open(recording, "w", encoding="utf-8") as file:
            for at in range(50):
                file.write(f"({at * 0.02:.6f}) can0 10A#0300{at:02X}07D0000000\n({at * 0.02 + 0.001:.6f}) can0 12A#0300{at:02X}07D0000000\n")
        self.rig.sim.ask("type 3")
        operator = self.begin("--learn", recording)
        operator.expect("98 setpoints have a speed, with type 3")
        operator.expect("have 8 bytes")
        operator.answer("types to try", "")
        self.quit_at(operator, "Did both wheels turn")
        self.assertEqual({8}, {len(frame.data) for frame in self.rig.bus.frames if frame.id in (266, 298)})

    def test_recording_without_a_speed_leaves_the_types_to_try(self):
        recording = Path(self.folder.name, "zeros.log")
        recording.write_text("".join(f"({at * 0.02:.6f}) can0 10A#0300000000\n" for at in range(50)), encoding="utf-8")
        operator = self.begin("--learn", recording)
        operator.expect("has no setpoint with a speed")
        operator.expect("types to try [0-7] ")
        operator.type("q\n")
        self.leave(operator)

    def test_any_key_stops_the_wheels_immediately(self):
        operator = self.begin_first_try()
        until(self.moving, 5, "the wheels are commanded to turn")
        pressed_us = now_us()
        operator.type(" ")
        operator.expect("STOPPED: a key was pressed")
        late = [frame for frame in self.moving() if frame[0] > pressed_us + 150_000]
        self.assertFalse(late, "nonzero setpoints after the key")
        self.quit_at(operator, "Try again?")

    def test_key_before_or_after_the_motion_stops_the_wheels_too(self):
        operator = self.begin()
        operator.expect("types to try")
        operator.expect("] ")
        operator.type("1\n ")  # The second key comes while the trial gateway starts.
        self.simulate_after(operator, "did not start: a key was pressed", "push left 3")
        operator.answer("Try again?", "y")
        operator.expect("any key stops it")
        time.sleep(0.3)
        operator.type(" ")  # The program still waits until the wheel is at standstill.
        operator.expect("did not start: a key was pressed", 2)
        self.assertFalse(self.moving(), "setpoints after a key that came before the motion")
        self.wait_until_stands()
        begin_us = now_us()
        operator.answer("Try again?", "y")
        operator.expect("any key stops it")
        deadline = time.monotonic() + 10
        while not self.ramped_down_since(begin_us) and time.monotonic() < deadline:
            operator.pump(0.005)
        operator.type(" ")  # The zeros of the stop are still sent, for 0.2 s.
        operator.expect("STOPPED: a key was pressed", 3)
        self.quit_at(operator, "Try again?")

    # --- wheels turn only after an answer ----------------------------------------------------------------------------

    def nonzero_since(self, begin_us):
        return [frame for frame in self.moving() if frame[0] > begin_us]

    def stop_among_types(self, stop, release=lambda: None):
        """A stop while the first of three types is sent, and no repetition: the other types wait for an answer."""
        self.rig.sim.ask("type 200")
        operator = self.begin()
        operator.answer("types to try", "1-3")
        operator.expect("any key stops it")
        until(self.moving, 5, "the wheels are commanded to turn")
        stop(operator)
        operator.expect("STOPPED")
        release()
        operator.expect("Try again?")
        stopped_us = now_us()
        operator.type("n\n")
        operator.expect("types to try")
        time.sleep(0.5)
        hold(not self.nonzero_since(stopped_us), "setpoints of the next type after a stop, without an answer")
        self.assertNotIn("None of these moved", operator.text)
        operator.type("2\n")
        operator.expect("None of these moved")
        self.assertTrue(self.nonzero_since(stopped_us), "the answer tries the next type")
        operator.expect("types to try")
        operator.type("q\n")
        self.leave(operator)

    def test_key_among_types_returns_to_the_question(self):
        self.stop_among_types(lambda operator: operator.type(" "))

    def test_interrupt_among_types_returns_to_the_question(self):
        self.stop_among_types(lambda operator: operator.type("\x03"))

    def test_estop_among_types_returns_to_the_question(self):
        self.stop_among_types(lambda _: self.rig.sim.ask("estop press"), lambda: self.rig.sim.ask("estop release"))

    def test_estop_between_types_needs_an_answer(self):
        self.rig.sim.ask("type 200")
        operator = self.begin()
        operator.answer("types to try", "1-2")
        operator.expect("measured")  # The gateway of the first type holds its zeros, and ends.
        measured_us = now_us()
        self.rig.sim.ask("estop press")
        time.sleep(0.1)
        self.rig.sim.ask("estop release")
        operator.expect("did not start: the e-stop was pressed after your last answer", 10)
        hold(not self.nonzero_since(measured_us), "setpoints after the e-stop, without an answer")
        operator.answer("Try again?", "y")
        operator.expect("measured")
        self.assertTrue(self.nonzero_since(measured_us), "the answer turns the wheels")
        self.quit_at(operator, "types to try")

    def test_estop_pressed_at_the_answer_is_reported(self):
        operator = self.begin(to="signs")
        self.answer_after("estop press", operator, "Watch the left wheel", "")
        answered_us = now_us()
        time.sleep(1)
        self.rig.sim.ask("estop release")
        operator.expect("did not start: the e-stop is pressed")
        operator.expect("Try again?")
        time.sleep(1)
        hold(not self.nonzero_since(answered_us), "the release of the e-stop turns a wheel")
        operator.type("y\n")
        operator.expect("measured")
        self.assertTrue(self.nonzero_since(answered_us), "the answer after the release turns the wheel")
        self.quit_at(operator, "r: repeat)")

    def test_estop_pressed_and_released_before_the_answer_is_reset(self):
        operator = self.begin(to="signs")
        self.simulate_after(operator, "Watch the left wheel", "estop press")
        time.sleep(0.2)
        self.rig.sim.ask("estop release")
        pressed_us = now_us()
        time.sleep(1)
        hold(not self.nonzero_since(pressed_us), "the release of the e-stop turns a wheel")
        operator.type("\n")
        operator.expect("measured")
        self.assertTrue(self.nonzero_since(pressed_us), "the answer turns the wheel")
        self.quit_at(operator, "r: repeat)")

    def test_no_type_that_moves_asks_again_and_stores_none(self):
        self.rig.sim.ask("type 200")
        operator = self.begin()
        operator.answer("types to try", "nonsense")
        operator.expect("Types are numbers")
        operator.answer("types to try", "0-1")
        operator.expect("None of these moved both wheels")
        self.quit_at(operator, "types to try")
        self.assertFalse(os.path.exists(self.out))

    def test_exchanged_wheels_end_it_with_the_fix(self):
        operator = self.begin(to="role")
        operator.answer("current_role", "limit")
        operator.answer("Watch the left wheel", "")
        operator.answer("r: repeat)", "o")
        operator.expect("exchange the wheels")
        self.leave(operator)

    def test_feedback_of_wrong_sign_ends_bringup_with_the_reason(self):
        self.rig.sim.ask("sign right swapped")
        operator = self.begin(to="role")
        operator.answer("current_role", "limit")
        operator.answer("Watch the left wheel", "")
        operator.answer("r: repeat)", "f")
        operator.answer("Watch the right wheel", "")
        operator.expect("measures the opposite")
        self.leave(operator)

    def test_interrupt_while_wheels_turn_stops_them_and_cleans_up(self):
        operator = self.begin_first_try()
        time.sleep(0.5)
        operator.type("\x03")
        self.quit_at(operator, "Try again?")
        self.assertIn("STOPPED", operator.text)
        time.sleep(0.3)
        quiet = len(self.rig.bus.setpoints())
        time.sleep(0.5)
        self.assertEqual(quiet, len(self.rig.bus.setpoints()), "nothing is sent any more")

    def test_killed_bringup_ends_its_gateway(self):
        operator = self.begin_first_try()
        time.sleep(0.5)
        self.killed = True
        self.assertEqual(1, len(os.listdir(self.runtime)))
        operator.process.kill()
        killed_us = now_us()
        time.sleep(4.5)
        hold(not [frame for frame in self.moving() if frame[0] > killed_us + 1_000_000], "the wheels are commanded to turn after bringup is gone")
        last = max(frame[0] for frame in self.rig.bus.setpoints())
        self.assertLess(last, killed_us + 4_000_000, "its gateway ended")
        operator.close()
        self.nothing_left_soon()

    def test_bringup_killed_with_gateway_and_terminal_cleans_up(self):
        operator = self.begin()
        operator.expect("types to try")
        self.assertEqual(
            ["gateway.conf", "gateway.log", "gateway.sock"],
            sorted(name for name in os.listdir(os.path.join(self.runtime, *os.listdir(self.runtime))) if name.startswith("gateway")),
        )
        gateway = children(operator.process.pid)["iwheel-gateway"]
        os.killpg(operator.process.pid, signal.SIGKILL)
        os.kill(gateway, signal.SIGKILL)
        operator.close()
        self.nothing_left_soon()

    def test_nothing_goes_without_the_checks_or_the_press(self):
        self.rig.sim.ask("mute right")
        operator = self.start()
        operator.expect("Fix the failed checks")
        self.leave(operator)
        hold(not self.rig.bus.setpoints(), "setpoints without the checks")

    def test_existing_file_is_replaced_after_a_question_and_saved(self):
        Path(self.out).write_text("; precious\n", encoding="utf-8")
        operator = self.begin(to="role")
        operator.answer("current_role", "limit")
        self.look_at_signs_only(operator)
        operator.answer("Write it to", "")
        operator.answer("Replace it?", "")
        operator.answer("Write it to", "")
        operator.answer("Replace it?", "y")
        self.assertEqual(0, operator.wait(), operator.text[-1500:])
        self.assertEqual("; precious\n", Path(self.out + ".old").read_text(encoding="utf-8"))
        self.assertEqual("192", self.value("wheels", "radius_mm"))
        self.assertIn("iwheelctl confirm mount_sign_left no --how 'bringup: the operator saw it turn forwards with invert = no'", operator.text)

    # --- what was not seen is not concluded -----------------------------------------------------------------------

    def test_estop_that_is_pressed_from_the_start_is_no_press(self):
        self.rig.sim.ask("estop press")
        operator = self.start()
        operator.expect("reads as pressed already")
        self.assertNotIn("Press the e-stop button now", operator.text)
        self.rig.sim.ask("estop release")
        self.press_and_release(operator)
        self.quit_at(operator, "Turn the wheels by hand?")

    def test_gear_from_wrong_or_missing_turns_is_not_concluded(self):
        operator = self.begin(gear=True)
        operator.answer("Turn the wheels by hand?", "y")
        for pushes, expected in (
            (("push right 3.6",), "RIGHT"),
            ((), "fit no gear ratio"),
            (("push left 3.6", "push left -1.8", "push left 1.8"), "back and forth"),
        ):
            self.move_and_enter(operator, *pushes)
            operator.expect("The right wheel counted" if expected == "RIGHT" else expected)
            operator.answer("Try again?", "y" if expected != "back and forth" else "n")
        operator.expect("The gear is unchanged")
        self.quit_at(operator, "types to try")

    def test_gear_that_differs_from_wheel_to_wheel_is_none(self):
        operator = self.begin(gear=True)
        self.turn_by_hand(operator, 192, turns=(3, 4), answer=None)
        operator.expect("The gear is unchanged")
        self.quit_at(operator, "types to try")

    def test_gear_with_unknown_rpm_reference_is_not_confirmed(self):
        for command in ("gear both 4", "rpm left rotor"):
            self.rig.sim.ask(command)
        operator = self.begin(gear=True)
        self.turn_by_hand(operator, 192)
        self.assertIn("whether rpm counts the wheel or the rotor was not measured", operator.text.replace("\n", " "))
        self.rig.sim.ask("rpm left wheel")
        self.drive_through(operator)
        self.skip_distance_and_track(operator)
        found = self.write(operator)
        self.assertRegex(found["gear_ratio"], "^noted: .* ticks in 3 turns by hand; whether rpm counts the wheel or the rotor was not measured$")
        self.assertIsNone(found["rpm_of"])
        self.assertEqual("4", self.value("wheels", "gear_ratio"))

    def test_type_that_turns_at_another_speed_is_not_confirmed(self):
        for command in ("gear both 2", "rpm both rotor"):
            self.rig.sim.ask(command)
        operator = self.begin()
        self.find_type(operator, tries=False)
        operator.expect("notes it as not confirmed")
        self.quit_at(operator, "Enter begins the tries")

    def test_type_that_turns_one_wheel_only_is_not_accepted(self):
        self.rig.sim.ask("block right")
        operator = self.begin()
        operator.answer("types to try", "1")
        operator.expect("Only the left wheel turned")
        operator.expect("None of these moved both wheels")
        self.quit_at(operator, "types to try")

    def test_wheels_that_cannot_turn_are_no_limit(self):
        operator = self.begin()
        operator.answer("types to try", "1")
        self.answer_after("block both", operator, "Did both wheels turn", "y")
        operator.answer("Enter begins the tries", "")
        operator.expect("the result counts only if both wheels turn")
        self.simulate_after(operator, "Now no wheel turned", "unblock both")
        self.assertEqual("?", self.offered(operator, "current_role"))
        operator.type("limit\n")
        self.look_at_signs_only(operator)
        self.assertEqual("noted: typed by the operator; the wheels did not show it", self.write(operator)["current_role"])
        self.assertNotIn("confirm current_role", operator.text)

    def test_current_turning_one_wheel_is_unconfirmed_setpoint(self):
        self.rig.sim.ask("role setpoint")
        operator = self.begin()
        operator.answer("types to try", "1")
        self.answer_after("block right", operator, "Did both wheels turn", "y")
        operator.answer("Enter begins the tries", "")
        operator.expect("The current alone turned the left wheel")
        self.simulate_after(operator, "only one wheel showed it", "unblock right")
        operator.answer("current_role", "")
        self.look_at_signs_only(operator)
        self.assertEqual("noted: 250 mA without speed turned the left wheel", self.write(operator)["current_role"])
        self.assertEqual("setpoint", self.value("wheels", "current_role"))

    def test_straight_ahead_with_one_wheel_still_is_not_asked(self):
        operator = self.begin(to="signs")
        for side in ("left", "right"):
            operator.answer(f"Watch the {side} wheel", "")
            operator.answer("r: repeat)", "f")
        self.answer_after("block left", operator, "Now both", "")
        self.simulate_after(operator, "The bus shows that a wheel did not turn forwards", "unblock left")
        self.look_at_signs(operator, mirrored=())
        self.quit_at(operator, "Measure the force?")

    def test_wheel_that_turns_uncommanded_ends_the_signs(self):
        operator = self.begin(to="signs")
        self.answer_after("runaway right on 80", operator, "Watch the left wheel", "")
        operator.expect("BOTH wheels turned")
        self.leave(operator)

    def test_force_that_ends_sways_or_saturates_is_no_unit(self):
        operator = self.begin(to="signs")
        self.look_at_signs(operator, mirrored=())
        operator.answer("Measure the force?", "y")
        self.begin_to_weigh(operator, "left")
        self.simulate_after(operator, "put the mass on", "raw left 32767")
        operator.type("\n")
        operator.expect("at the end of its range")
        operator.answer("Try again?", "n")
        self.begin_to_weigh(operator, "right")
        self.simulate_after(operator, "put the mass on", "load right 49")
        operator.type("\n")
        operator.expect("measuring for 2 s")
        time.sleep(0.7)
        self.rig.sim.ask("load right 250")
        operator.expect("The force swayed")
        operator.answer("Try again?", "n")
        self.quit_at(operator, "Distance in m")

    def test_radius_and_track_rest_on_gear_and_distance_and_say_so(self):
        operator = self.begin(to="distance")
        self.push(operator, 3, 3, 3)
        operator.expect("if the gear is as configured: it was not measured")
        operator.answer("Use the mean?", "y")
        self.turn_around(operator)
        operator.answer("Use that?", "y")  # The distance per tick follows from the distance, for any gear.
        found = self.write(operator)
        self.assertRegex(found["radius_mm"], r"^noted: 3\.00 m pushed: .* ticks; the gear is assumed$")
        self.assertRegex(found["track_mm"], r"^confirmed: 3 full turns by hand: left -?\d+, right -?\d+ ticks$")
        self.assertAlmostEqual(540, int(self.value("wheels", "track_mm")), delta=8)

    def test_radius_of_curve_or_track_of_none_is_not_confirmed(self):
        operator = self.begin(gear=True)
        self.turn_by_hand(operator, 192)
        self.drive_through(operator)
        self.push(operator, 3, 3, 3.3)
        operator.expect("it was a curve")
        operator.answer("Use the mean?", "y")
        self.turn_around(operator)
        operator.expect("if the radius is as configured: no distance was measured")
        operator.answer("Use that?", "y")
        found = self.write(operator)
        self.assertRegex(found["radius_mm"], "^noted: .* ticks; not straight$")
        self.assertRegex(found["track_mm"], "^noted: 3 full turns by hand: .* ticks; the radius is assumed$")
        self.assertNotIn("confirm track", operator.text)

    def test_track_is_concluded_only_from_a_turn_on_the_spot(self):
        operator = self.begin(to="distance")
        operator.answer("Distance in m", "")
        for turns, commands, expected in (
            (3, ("push both 2",), "rolled in the same direction"),
            (3, ("turn 0.5",), "Too few ticks"),
            (3, ("turn 1", "turn -0.5", "turn 1"), "back and forth"),
            (3, ("push right 4", "push left -1.5"), "moved away"),
            (20, ("turn 1",), "outside 200"),
        ):
            self.turn_around(operator, *commands, turns=turns)
            operator.expect(expected)
        operator.answer("How many full turns", "2.5")
        operator.expect("a number of full turns")
        self.turn_around(operator, "turn 3", turns=2)  # Counted wrongly.
        operator.expect("No track was configured. Check the number of turns")
        operator.answer("Use that?", "")
        operator.answer("How many full turns", "")
        operator.expect("Without a track the gateway refuses arm: set track_mm under [wheels]")
        self.assertNotIn("track_mm", self.write(operator))
        self.assertIn("\n;track_mm = ?", self.written())
        self.assertFalse([frame for frame in self.rig.bus.frames[-200:] if frame.id in (266, 298)], "nothing was sent")

    def freeze(self, process_number, seconds):
        os.kill(process_number, signal.SIGSTOP)
        time.sleep(seconds)
        os.kill(process_number, signal.SIGCONT)

    def test_track_is_concluded_though_the_computer_stalls(self):
        operator = self.begin(to="distance")
        operator.answer("Distance in m", "")
        for gateway in (False, True):  # The wheels count on, and nothing of it is lost.
            self.begin_to_turn(operator)
            self.freeze(children(operator.process.pid)["iwheel-gateway"] if gateway else operator.process.pid, 0.8)
            self.stand_and_enter(operator)
            self.assertRegex(operator.expect("No track was configured"), r"in 3\s+turns: the\s+track\s+is 5[34]\d\s+mm")
            operator.answer("Use that?", "n")
        self.begin_to_turn(operator)
        self.rig.sim.ask("mute left")
        time.sleep(1.5)
        self.rig.sim.ask("unmute left")
        self.stand_and_enter(operator)
        operator.expect("The wheels were offline for a while")
        self.begin_to_turn(operator)
        self.freeze(operator.process.pid, 2.5)
        self.stand_and_enter(operator)
        operator.expect("too busy to follow the wheels")
        self.quit_at(operator, "How many full turns")

    def begin_to_turn(self, operator):
        operator.answer("How many full turns", "3")
        operator.answer("Point the machine at the mark", "")
        self.simulate_after(operator, "press Enter ...", "turn 3")
        time.sleep(0.5)

    # --- a disturbed step, and results that are saved --------------------------------------------------------------

    def test_disturbed_step_is_repeated_by_enter(self):
        operator = self.begin()
        operator.answer("types to try", "1")
        operator.answer("Did both wheels turn", "y")
        self.answer_after("estop press", operator, "Enter begins the tries", "")
        operator.answer("Try again?", "n")
        moved = len(self.moving())
        self.answer_after("estop release", operator, "Do it again?", "")
        operator.expect("Step 5 of 10")
        operator.answer("Enter begins the tries", "")
        operator.answer("current_role", "")
        self.assertGreater(len(self.moving()), moved)
        self.look_at_signs_only(operator)
        found = self.write(operator)
        self.assertTrue(found["current_role"].startswith("confirmed: "), found)

    def save(self):
        """Ends after the role, with the results saved. Returns the path of the file."""
        operator = self.begin(to="signs")
        operator.answer("Watch the left wheel", "q")
        operator.answer("Save the 2 confirmed results", "")
        self.assertEqual(1, operator.wait())
        self.assertIn(f"  iwheelctl bringup {self.out} --from {self.out}.part\n", operator.text)
        self.assertFalse(os.path.exists(self.out))
        return self.out + ".part"

    def go_on(self, path, same):
        """Continues with the saved file, through the checks and the e-stop."""
        operator = self.start_from(path)
        if same:
            operator.answer("The same wheels, mounted in the same way?", same)
        self.press_and_release(operator)
        operator.answer("Turn the wheels by hand?", "n")
        return operator

    def test_saved_results_are_left_out_and_confirmed_at_the_end(self):
        operator = self.go_on(self.save(), same="y")
        operator.expect("Step 4 of 10: confirmed by the earlier bringup; skipped")
        operator.expect("Step 5 of 10: confirmed by the earlier bringup; skipped")
        self.look_at_signs_only(operator)
        found = self.write(operator)
        self.assertEqual(("1", "limit"), (self.value("wheels", "setpoint_type"), self.value("wheels", "current_role")))
        for key in ("setpoint_type", "current_role", "invert"):
            self.assertTrue(found[key].startswith("confirmed: "), found)
        self.assertNotIn("BRINGUP SAVED", self.written())

    def test_saved_type_alone_turns_no_wheel_after_the_release(self):
        operator = self.begin()
        self.find_type(operator, tries=False)
        operator.answer("Enter begins the tries", "q")
        operator.answer("Save the 1 confirmed results", "")
        self.assertEqual(1, operator.wait())
        begin_us = now_us()
        operator = self.go_on(self.out + ".part", same="y")
        operator.expect("Step 5 of 10")
        time.sleep(1.5)
        hold(not self.nonzero_since(begin_us), "the release of the e-stop turns a wheel")
        self.quit_at(operator, "Enter begins the tries")

    def test_saved_results_of_other_wheels_do_not_count(self):
        operator = self.go_on(self.save(), same="n")
        self.quit_at(operator, "types to try")

    def test_saved_results_in_a_changed_file_do_not_count(self):
        saved = Path(self.save())
        saved.write_text(saved.read_text(encoding="utf-8").replace("setpoint_type = 1 ", "setpoint_type = 2 "), encoding="utf-8")
        operator = self.go_on(str(saved), same=None)
        self.assertIn("was changed after bringup had saved it", " ".join(operator.text.split()))
        self.quit_at(operator, "types to try")

    # --- ways out, and nothing left behind (see nothing_left_behind) ----------------------------------------------

    def ends_soon(self, operator, within_s=6):
        begin = time.monotonic()
        self.assertEqual(1, operator.wait(within_s + 4), operator.text[-1500:])
        self.assertLess(time.monotonic() - begin, within_s)
        self.assertIn("Nothing was written", operator.text)
        self.assertFalse(os.path.exists(self.out))

    def test_interrupt_while_it_waits_for_the_estop_ends_it(self):
        operator = self.start()
        operator.expect("Press the e-stop button now")
        time.sleep(0.2)
        operator.type("\x03")
        self.ends_soon(operator)

    def test_interrupt_while_hands_turn_a_wheel_ends_it(self):
        operator = self.begin(gear=True)
        operator.answer("Turn the wheels by hand?", "y")
        operator.expect("press Enter ...")
        time.sleep(0.2)
        operator.type("\x03")
        self.ends_soon(operator)

    def test_interrupt_at_question_or_force_reading_ends_bringup(self):
        operator = self.begin(to="signs")
        self.look_at_signs(operator, mirrored=())
        operator.answer("Measure the force?", "y")
        self.begin_to_weigh(operator, "left")
        operator.expect("measuring for 2 s")
        operator.type("\x03")
        self.ends_soon(operator)
        self.assertNotIn("were offline", operator.text)

    def test_signals_that_end_programs_end_it_in_order(self):
        for number in (signal.SIGTERM, signal.SIGHUP):
            operator = self.begin()
            operator.expect("types to try")
            operator.process.send_signal(number)
            self.ends_soon(operator)

    def test_folder_in_tmp_without_runtime_directory_is_removed(self):
        operator = self.start(variables=environment())
        operator.expect("Press the e-stop button now")
        command = Path(f"/proc/{children(operator.process.pid)['iwheel-gateway']}/cmdline").read_bytes()
        folder = os.path.dirname(command.split(b"\0")[2].decode())
        self.assertRegex(folder, "^/tmp/iwheel-bringup-")
        self.rig.sim.ask("estop press")  # A stop, which the gateway records.
        self.simulate_after(operator, "Release it", "estop release")
        operator.answer("Turn the wheels by hand?", "q")
        self.ends_soon(operator)
        self.assertFalse(os.path.exists(folder))

    def test_a_running_gateway_is_not_driven_past(self):
        self.rig.start_gateway()
        operator = Operator(
            [ctl.program(), "--socket", self.rig.path("gateway.sock"), "bringup", self.out, "--can", f"unix:{self.rig.path('bus')}"], environment()
        )
        self.addCleanup(operator.close)
        operator.answer("finger on the e-stop?", "y")
        operator.expect("A gateway already runs on this bus")
        self.leave(operator)

    def test_end_of_input_ends_it_and_wrong_words_are_usage(self):
        code, out, _ = ctl.run("bringup", "--can", f"unix:{self.rig.path('bus')}", "--estop", "none", env=environment())
        self.assertEqual(1, code)
        self.assertIn("Nothing was written", out)
        for words in (("--current", "5"), ("--learn", "/nonexistent"), ("--can",), ("a", "b"), ("--wheel",), ("--can", "a/b")):
            code, _, err = ctl.run("bringup", *words, env=environment())
            self.assertEqual(64, code, (words, err))
