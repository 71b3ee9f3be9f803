# SPDX-License-Identifier: MIT
"""The black box, and the commands record, why, replay and learn, on the simulator's bus with a real gateway."""

import base64
import glob
import json
import os
import re
import shutil
import signal
import socket
import subprocess
import sys
import threading
import time
import unittest
import zlib
from pathlib import Path

import ctl
import pytest
from client import Streamer
from harness import Rig, children
from trials import until


def read(path):
    return Path(path).read_text(encoding="utf-8")


# A busy machine starves the simulated wheels now and then; that is not what is tried here.
PATIENT = {"limits": {"wheel_silent_ms": 200, "echo_ms": 200}, "drive": {"lease_ms": 400, "max_speed_mm_s": 800}}


class WithRig(unittest.TestCase):
    config = {}
    sim_args = ()

    def setUp(self):
        self.rig = Rig(
            ctl.BUILD, config={**PATIENT, **self.config, "record": {"directory": "/nowhere", **self.config.get("record", {})}}, sim_args=self.sim_args
        )
        self.addCleanup(self.rig.close)
        self.folder = self.rig.path("records")
        self.rig.settings["record"]["directory"] = self.folder
        self.rig.write_config()
        self.rig.start_gateway()
        self.client = self.rig.client("tester")

    def ctl(self, *words):
        return ctl.run("--socket", self.rig.path("gateway.sock"), *words)

    def good(self, *words):
        """The output; with success and without a message."""
        code, out, err = self.ctl(*words)
        self.assertEqual((0, ""), (code, err))
        return out

    def drive(self, seconds, left=300, right=200):
        self.assertTrue(self.client.request("arm", name="tester")["ok"])
        stream = Streamer(self.client, left, right, 0.05)
        time.sleep(seconds)
        return stream

    def press_and_end(self, stream):
        self.rig.press()
        time.sleep(0.3)
        stream.stop()

    def recordings(self, ending="log"):
        return sorted(glob.glob(os.path.join(self.folder, f"stop-*.{ending}")))

    def wait_whole(self, count, seconds=10):
        """Waits until that many recordings have their last line; the last one's stem."""
        end = time.monotonic() + seconds
        while True:
            names = self.recordings("jsonl")
            whole = [name for name in names if '{"type":"end"' in read(name)[-200:]]
            if len(whole) >= count:
                return whole[-1][: -len(".jsonl")]
            if time.monotonic() > end:
                self.fail(f"{len(whole)} of {names} are whole; {self.rig.gateway.text()[-800:]}")
            time.sleep(0.05)

    def why(self):
        return self.client.request("why")

    def stop_by_button(self, seconds=1.0):
        stream = self.drive(seconds)
        self.press_and_end(stream)
        stem = self.wait_whole(1)
        # The writer reports to the gateway only after that.
        until(lambda: f"is recorded in {stem}.log" in self.rig.gateway.text(), 5)
        return stem


class BlackBox(WithRig):
    def test_latched_stop_recording_replays_byte_for_byte(self):
        stem = self.stop_by_button()
        self.assertTrue(stem.endswith("stop-000001-estop_line"))
        out = self.good("replay", stem + ".log")
        self.assertIn("estop_line: e-stop", out)
        self.assertIn("pressed while driving 300/200 mm/s", out)
        for what in ("setpoints on the bus", "answers to requests", "changes of state", "stops"):
            self.assertRegex(out, what + r": (\d+) of \1 as recorded")
        self.assertNotIn("DIFFERENT", out)
        self.assertEqual((0, out, ""), self.ctl("replay", stem + ".log"))
        # The frames are those of the bus, the gateway's own marked as such.
        own = [line for line in read(stem + ".log").splitlines() if line.endswith(" T")]
        self.assertGreater(len(own), 100)
        self.assertTrue(all(re.search(r" (10A|12A)#", line) for line in own))
        self.assertIn("is recorded in " + stem + ".log", self.rig.gateway.text())

    def test_arm_refused_by_contradicted_assumption_is_replayed(self):
        self.assertTrue(self.client.request("confirm", item="mount_sign_left", value="yes")["ok"])
        self.assertEqual("denied", self.client.request("arm", name="tester")["error"])
        time.sleep(1.2)  # Written again, for a recording that begins in the middle.
        self.assertTrue(self.client.request("confirm", item="mount_sign_left")["ok"])
        stem = self.stop_by_button()
        out = self.good("replay", stem + ".log")
        self.assertRegex(out, r"arm +client \d+: denied\n")
        self.assertNotIn("DIFFERENT", out)
        entries = [json.loads(line) for line in read(stem + ".jsonl").splitlines() if '"type":"ledger"' in line]
        self.assertEqual("contradicted", entries[0]["state"])
        self.assertEqual(("mount_sign_left", "confirmed", "operator"), tuple(entries[-1][name] for name in ("item", "state", "evidence")))

    def test_why_after_a_stop_prints_its_recording_and_frames(self):
        stem = self.stop_by_button()
        why = self.why()
        self.assertEqual((stem + ".log", None, self.folder), (why["recording"], why["recording_error"], why["directory"]))
        before, after = why["frames_before"], why["frames_after"]
        self.assertEqual((40, 40), (len(before), len(after)))
        self.assertLessEqual(before[-1]["t_us"], why["at_us"])
        self.assertGreaterEqual(after[0]["t_us"], why["at_us"])
        speeds = [frame["data"][2:6] for frame in before + after if frame["id"] == 266]
        self.assertEqual(("012C", "0000"), (speeds[0], speeds[-1]))
        out = self.good("why", "--frames", "40")
        self.assertIn(stem + ".log", out)
        self.assertIn("speed 300 mm/s", out.split("------ stop")[0])
        self.assertIn("speed 0 mm/s", out.split("------ stop")[1])
        out = self.good("why", "--list")
        self.assertIn("     1  ", out)
        self.assertIn("1 stop recorded in " + self.folder, out)

    def test_stop_that_does_not_latch_is_not_written(self):
        stream = self.drive(0.4)
        stream.stop()
        time.sleep(1.0)
        self.assertEqual("lease_lost", self.why()["cause"])
        self.assertEqual([], self.recordings())

    def test_latched_stops_in_quick_succession_are_all_written(self):
        for i in range(4):
            self.assertTrue(self.client.request("estop", reason=f"number {i}")["ok"])
            time.sleep(1.1)
            self.assertTrue(self.client.request("reset")["ok"])
        self.wait_whole(4)
        reasons = [json.loads(read(name).splitlines()[1])["sentence"] for name in self.recordings("jsonl")]
        self.assertEqual([True] * 4, [f"number {i}" in reason for i, reason in enumerate(reasons)])

    def test_gateway_killed_leaves_recording_and_restart_is_prompt(self):
        self.drive(0.8)
        self.rig.kill_gateway(signal.SIGKILL)
        answered_ms = self.rig.start_gateway(wheels=False, restart_hold=True)
        self.assertLess(answered_ms, 1000, "it waits for the recording, which follows for 2 s")
        stem = self.wait_whole(1)
        self.assertTrue(stem.endswith("gateway_died"))
        self.assertIn("the last ones left 300 mm/s and right 200 mm/s", read(stem + ".jsonl"))
        _, out, _ = self.ctl("replay", stem + ".log")
        self.assertIn("# end: armed, 0 stops", out)

    def test_ended_gateway_leaves_none(self):
        self.drive(0.5).stop()
        self.rig.gateway.signal(signal.SIGTERM)
        self.assertEqual(0, self.rig.gateway.wait(10))
        time.sleep(0.3)
        self.assertEqual([], self.recordings())

    def test_writer_frozen_or_killed_costs_only_the_recording(self):
        writer = children(self.rig.gateway.child.pid)["iwheel-blackbox"]
        os.kill(writer, signal.SIGSTOP)
        stream = self.drive(0.6)
        self.press_and_end(stream)
        self.assertEqual("estop_line", self.why()["cause"])
        self.assertIsNone(self.why()["recording"])
        self.assertEqual([], self.recordings())
        os.kill(writer, signal.SIGCONT)
        self.wait_whole(1)
        os.kill(writer, signal.SIGKILL)
        time.sleep(0.3)
        self.assertIn("the process that writes recordings has ended", self.rig.gateway.text())
        self.assertTrue(self.client.request("status")["ok"])

    def test_directory_unusable_is_logged_and_stops_nothing(self):
        self.rig.gateway.end()
        end = time.monotonic() + 3
        while os.path.isdir(self.folder) and time.monotonic() < end:  # The gateway's own helpers write their last file after it.
            shutil.rmtree(self.folder, ignore_errors=True)
        Path(self.folder).touch()
        self.rig.start_gateway()
        self.client = self.rig.client("again")
        self.assertIn("no recording can be written to " + self.folder, self.rig.gateway.text())
        stream = self.drive(0.5)
        self.rig.press()
        time.sleep(0.5)
        stream.stop()
        why = self.why()
        self.assertEqual("estop_line", why["cause"])
        self.assertIn("directory", why["recording_error"])
        self.assertEqual(40, len(why["frames_before"]))
        self.assertIn("not recorded on disk", self.ctl("why")[1])


class OverTheSocket(WithRig):
    """A client that has only the socket reads the same as from the files."""

    def away(self, *words):
        """As from another machine: in a name space in which there is another folder in its place."""
        command = [ctl.program(), "--socket", self.rig.path("gateway.sock"), *words]
        hidden = [*self.unshare, "sh", "-c", 'mount -t tmpfs none "$0" && exec "$@"', self.folder]
        done = subprocess.run(hidden + command, capture_output=True, text=True, timeout=60, check=False)
        return done.returncode, done.stdout, done.stderr

    def setUp(self):
        super().setUp()
        for self.unshare in (["unshare", "--mount"], ["unshare", "--user", "--map-root-user", "--mount"]):  # For root; for others.
            probe = [*self.unshare, "sh", "-c", f'mount -t tmpfs none "{self.rig.path("")}"']
            if subprocess.run(probe, capture_output=True, check=False).returncode == 0:
                return
        self.skipTest("this machine has no mount name spaces for this user")

    def test_why_and_replay_say_the_same_as_from_the_files(self):
        stem = self.stop_by_button()
        number = str(int(os.path.basename(stem).split("-")[1]))
        for words in (
            ("why", number),
            ("why", number, "--frames", "40"),
            ("why", "--list"),
            ("why", stem + ".log"),
            ("replay", stem + ".log"),
            ("--json", "replay", stem + ".log"),
            ("--json", "why", "--list"),
        ):
            here = self.ctl(*words)
            self.assertEqual((0, ""), (here[0], here[2]), words)
            self.assertEqual(here, self.away(*words), words)

    def test_directory_that_was_named_is_not_asked_for_elsewhere(self):
        self.stop_by_button()
        self.assertEqual(0, self.ctl("why", "--list", "--directory", self.folder)[0])
        code, out, _ = self.away("why", "--list", "--directory", self.folder)
        self.assertIn("0 stops recorded", out)
        self.assertEqual(69, self.away("why", "--list", "--directory", self.folder + "/none")[0])
        self.assertEqual(0, code)

    def test_other_file_is_not_asked_for(self):
        code, _, err = self.away("replay", "/nowhere/other.log")
        self.assertEqual(65, code)
        self.assertIn("the file does not exist", err)
        code, _, err = self.away("replay", "/nowhere/stop-000099-estop_line.log")
        self.assertEqual(65, code)
        self.assertIn("the file does not exist", err)


class Pieces(WithRig):
    """The requests themselves."""

    def connect(self):
        sock = socket.socket(socket.AF_UNIX)
        self.addCleanup(sock.close)
        sock.connect(self.rig.path("gateway.sock"))
        return sock

    def reset(self):
        """Over the latch of the first stop."""
        self.rig.release()
        time.sleep(1.2)
        self.assertTrue(self.client.request("reset")["ok"])

    def fetch(self, name):
        data = b""
        while True:
            reply = self.client.request("recording", name=name, offset=len(data))
            self.assertTrue(reply["ok"], reply)
            piece = base64.b64decode(reply["data"])
            self.assertEqual(zlib.crc32(piece), reply["crc32"])
            data += piece
            if len(data) == reply["size"]:
                self.assertEqual(zlib.crc32(data), reply["file_crc32"])
                return data
            self.assertEqual((24576, None), (len(piece), reply["file_crc32"]))

    def test_pieces_are_the_files_and_no_path_leaves(self):
        stem = self.stop_by_button()
        listed = self.client.request("recordings")
        self.assertNotIn("/", json.dumps(listed))
        entry = listed["recordings"][0]
        self.assertEqual(("stop-000001-estop_line", "estop_line"), (entry["name"], entry["cause"]))
        self.assertLess(abs(entry["wall_us"] / 1e6 - time.time()), 30)
        for ending in ("log", "jsonl", "conf"):
            data = Path(f"{stem}.{ending}").read_bytes()
            self.assertEqual(len(data), entry[f"{ending}_bytes"])
            self.assertEqual(data, self.fetch(f"stop-000001-estop_line.{ending}"))

    def test_nothing_else_is_read(self):
        self.stop_by_button()
        Path(self.folder, "secret").write_text("secret", encoding="ascii")
        os.symlink("secret", os.path.join(self.folder, "stop-000005-a.log"))
        for name in (
            "secret",
            "../gateway.conf",
            "/etc/passwd",
            self.folder + "/stop-000001-estop_line.log",
            "stop-000001-estop_line",
            "./stop-000001-estop_line.log",
            "stop-000001-estop_line.log/",
            ".",
        ):
            reply = self.client.request("recording", name=name)
            self.assertEqual("bad_value", reply["error"], (name, reply))
            self.assertNotIn(self.folder, reply["message"])
        self.assertEqual("denied", self.client.request("recording", name="stop-000009-estop_line.log")["error"])
        reply = self.client.request("recording", name="stop-000005-a.log")
        self.assertEqual("denied", reply["error"])
        self.assertNotIn("secret", json.dumps(self.client.request("recordings")))
        for name in ("", "a" * 64, "stop-000001-estop_line.log\0", "stop-000001-\u202e.log"):
            self.assertIn(self.client.request("recording", name=name)["error"], ("bad_value", "bad_json"), name)

    def test_reader_frozen_or_killed_delays_no_stop_or_recording(self):
        self.stop_by_button()
        self.reset()
        reader = children(self.rig.gateway.child.pid)["iwheel-records"]
        os.kill(reader, signal.SIGSTOP)
        sock = self.connect()
        lines = sock.makefile("r", encoding="utf-8")
        lines.readline()
        sock.sendall(b'{"cmd":"recordings","id":1}\n{"cmd":"recordings","id":2}\n{"cmd":"estop","id":3}\n{"cmd":"status","id":4}\n')
        replies = [json.loads(lines.readline()) for _ in range(3)]
        self.assertEqual([(2, False), (3, True), (4, True)], [(reply["id"], reply["ok"]) for reply in replies])
        self.assertEqual("denied", replies[0]["error"])
        self.wait_whole(2)  # Writing is another process's.
        os.kill(reader, signal.SIGCONT)
        reply = json.loads(lines.readline())
        self.assertEqual((1, True), (reply["id"], reply["ok"]))
        os.kill(reader, signal.SIGSTOP)
        sock.sendall(b'{"cmd":"recordings","id":5}\n')
        time.sleep(0.1)
        os.kill(reader, signal.SIGKILL)
        reply = json.loads(lines.readline())
        self.assertEqual((5, "denied"), (reply["id"], reply["error"]))
        self.assertTrue(self.client.request("status")["ok"])

    def test_question_of_who_says_nothing_more_is_answered(self):
        sock = self.connect()
        sock.sendall(b'{"cmd":"recordings","id":1}\n')
        sock.shutdown(socket.SHUT_WR)
        lines = sock.makefile("r", encoding="utf-8").read().splitlines()  # To the end of the file.
        self.assertEqual((1, True), tuple(json.loads(lines[-1])[name] for name in ("id", "ok")))

    @staticmethod
    def ran_us(pid):
        """How long the process was on a processor."""
        return int(read(f"/proc/{pid}/schedstat").split()[0]) / 1000

    @pytest.mark.native("processor time")
    def test_reading_large_recording_does_not_delay_the_loop(self):
        stem = self.stop_by_button()
        self.rig.release()
        large = Path(self.folder, "stop-000002-estop_line.log")
        large.write_text(read(stem + ".log") * 200, encoding="ascii")
        time.sleep(1.2)
        self.assertTrue(self.client.request("reset")["ok"])
        readers = [self.rig.client(f"reader{i}") for i in range(4)]
        end = time.monotonic() + 6
        got = [0] * len(readers)

        def read_on(i):
            offset = 0
            while time.monotonic() < end:
                reply = readers[i].request("recording", name=large.name, offset=offset)
                offset = (offset + 24576) % (reply["size"] + 1) if reply["ok"] else 0
                got[i] += reply["ok"]

        threads = [threading.Thread(target=read_on, args=(i,)) for i in range(len(readers))]
        pid = self.rig.gateway.child.pid
        stream = self.drive(0.5)
        idle_us, begin = self.ran_us(pid), time.monotonic()
        time.sleep(1.0)
        idle_us = (self.ran_us(pid) - idle_us) / (time.monotonic() - begin)
        read_us, begin = self.ran_us(pid), time.monotonic()
        for thread in threads:
            thread.start()
        for thread in threads:
            thread.join()
        read_us = self.ran_us(pid) - read_us - idle_us * (time.monotonic() - begin)
        self.assertTrue(self.client.request("status")["ok"])
        stream.stop()
        # Only the gateway's own processor time for a piece counts, not that of other programs on this machine.
        print(f"pieces read {got}; the loop needed {read_us / sum(got):.0f} us for each", file=sys.stderr)
        self.assertGreater(min(got), 20)
        self.assertLess(read_us / sum(got), 1000)


class ShortBox(WithRig):
    config = {"record": {"blackbox_s": 2}}

    def test_recording_that_begins_during_a_drive_is_replayed(self):
        stream = self.drive(4.0, 300, -200)
        self.press_and_end(stream)
        _, out, err = self.ctl("replay", self.wait_whole(1) + ".log")
        self.assertEqual("", err)
        self.assertIn("its state is restored", out)
        self.assertIn("pressed while driving 300/-200 mm/s", out)
        self.assertRegex(out, r"stops: (\d+) of \1 as recorded")
        self.assertRegex(out, r"answers to requests: (\d+) of \1 as recorded")
        self.assertNotIn("DIFFERENT", out)


class NoBox(WithRig):
    config = {"record": {"blackbox_s": 0}}

    def test_recording_of_0_s_writes_no_file_and_why_has_frames(self):
        self.assertEqual(["iwheel-gateway"], sorted({*children(self.rig.gateway.child.pid), "iwheel-gateway"} - {"iwheel-store"}))
        self.assertTrue(self.client.request("estop")["ok"])
        time.sleep(0.5)
        self.assertGreater(len(self.why()["frames_before"]), 20)
        self.assertEqual([], self.recordings())


@pytest.mark.pace(1)  # Recordings need a minimum of frames.
class Record(WithRig):
    def check(self, path):
        lines = read(path).splitlines(True)
        self.assertGreater(len(lines), 700)
        times = [float(line[1 : line.index(")")]) for line in lines]
        self.assertEqual(times, sorted(times))
        self.assertLess(abs(times[-1] - time.time()), 20)
        return lines

    def test_through_the_gateway_own_frames_are_marked(self):
        stream = self.drive(0.3)
        path = self.rig.path("one.log")
        code, _, err = self.ctl("record", path, "--for", "1500ms")
        stream.stop()
        self.assertEqual(0, code, err)
        self.assertIn("recording the frames of the gateway on unix:", err)
        lines = self.check(path)
        self.assertGreater(len([line for line in lines if line.endswith(" T\n")]), 100)
        self.assertEqual(64, self.ctl("record", path)[0])  # It is there already.

    def test_without_a_gateway_from_the_bus_and_nothing_is_sent(self):
        self.rig.gateway.end()
        path = self.rig.path("two.log")
        begin = len(self.rig.bus.frames)
        code, _, err = self.ctl("record", path, "--for", "1500ms", "--can", f"unix:{self.rig.path('bus')}")
        self.assertEqual(0, code, err)
        self.assertIn("sending nothing", err)
        self.check(path)
        self.assertEqual([], [frame for frame in self.rig.bus.frames[begin:] if frame.id in (266, 298)])

    def test_interrupted_recording_is_whole(self):
        path = self.rig.path("three.log")
        child = ctl.start("--socket", self.rig.path("gateway.sock"), "record", path, stderr=subprocess.PIPE, text=True)
        until(lambda: os.path.exists(path) and read(path).count("\n") > 800, 20, "800 frames")
        child.send_signal(signal.SIGINT)
        _, err = child.communicate(timeout=10)
        self.assertEqual(0, child.returncode, err)
        self.assertTrue(self.check(path)[-1].endswith("\n"))

    def test_dead_bus_leaves_no_file(self):
        path = self.rig.path("four.log")
        code, _, err = self.ctl("record", path, "--can", "unix:/nonexistent", "--for", "1s")
        self.assertEqual(69, code)
        self.assertIn("start it: iwheel-sim", err)
        self.assertFalse(os.path.exists(path))


@pytest.mark.pace(1)
class Learn(WithRig):
    config = {"wheels": {"setpoint_type": 9, "current_role": "setpoint", "setpoint_dlc": 8, "rpm_of": "rotor", "gear_ratio": "4"}, "left": {"force_unit": "dN"}}

    def test_learn_recording_of_strange_wheels_has_their_values(self):
        for command in ("type 9", "role setpoint", "unit left dN", "gear left 4", "gear right 4", "rpm left rotor", "rpm right rotor", "pose reversed"):
            self.rig.sim.ask(command)
        path = self.rig.path("other.log")
        child = ctl.start("--socket", self.rig.path("gateway.sock"), "record", path, "--for", "11s")
        time.sleep(1.5)
        self.assertTrue(self.client.request("arm")["ok"])
        for speed in (400, -400):
            for _ in range(70):
                self.client.request("drive", left_mm_s=speed, right_mm_s=speed, left_mA=1000 if speed > 0 else -1000, right_mA=1000 if speed > 0 else -1000)
                time.sleep(0.05)
        self.client.request("stop")
        child.wait(20)
        Path(path).write_text(read(path).replace(" T\n", "\n"), encoding="ascii")  # As if another controller had sent them.
        out = self.good("learn", path)
        for part in (
            "+ setpoint type 9 moves the wheels",
            "always 8 bytes",
            "setpoint_type = 9",
            "setpoint_dlc = 8",
            "- left force at standstill / offset",
            "force_unit = dN",
            "LEAST significant byte first",
            "another gear (rpm_of, gear_ratio)",
            "period     20 ms",
        ):
            self.assertIn(part, out)
