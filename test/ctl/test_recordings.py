# SPDX-License-Identifier: MIT
"""iwheelctl decode, learn and replay: what they make of recordings, good ones and bad ones. Needs no gateway."""

import csv
import io
import json
import os
import shutil
import struct
import subprocess
import tempfile
import unittest
from pathlib import Path

import ctl
import pytest

pytestmark = pytest.mark.exact
GOLDEN = os.path.join(os.path.dirname(os.path.abspath(__file__)), "..", "recordings")
CONFIG = os.path.join(GOLDEN, "..", "..", "share", "gateway.conf")
SECOND = "(1760000000.{:06d}) can0 {}\n"


def run(*words, text="", **more):
    """(exit code, stdout, stderr)"""
    return ctl.run(*words, input=text, env=ctl.environment(TZ="UTC"), **more)


def good(*words, **more):
    """The output; with success and without a message."""
    code, out, err = run(*words, **more)
    if (code, err) != (0, ""):
        raise AssertionError(f"{words}: {code}, {err}")
    return out


def lines(*frames):
    """A recording of these frames, a millisecond apart."""
    return "".join(SECOND.format(1000 * i, frame) for i, frame in enumerate(frames))


def drive_log(interface="can0", type_=1, set_clock=lambda n, t: t, count=1500):
    """A controller that drives both wheels, and their speeds; every 20 ms. `set_clock(n, us)`: the time that is recorded."""
    out = []
    for n in range(count):
        t = set_clock(n, 1700000000_000000 + n * 20000)
        for us, frame in ((0, f"10A#{type_:02X}000007D0"), (300, f"12A#{type_:02X}000007D0"), (600, "100#00000000"), (900, "120#00000000")):
            out.append(f"({(t + us) // 10**6}.{(t + us) % 10**6:06d}) {interface} {frame}\n")
    return "".join(out)


def merged(*logs):
    return "".join(sorted("".join(logs).splitlines(keepends=True)))


def refused(code, part, *words, **more):
    """The message, with this exit code and this part of it."""
    got, _, err = run(*words, **more)
    if got != code or part not in err:
        raise AssertionError(f"{words}: {got}, {err}")
    return err


class Clock(unittest.TestCase):
    """A clock that was set while something recorded, or a wrong stamp."""

    S = 1_000_000
    # name: time recorded for step n at t
    CLOCKS = {
        "1970, then NTP": lambda n, t: t if n >= 700 else 12_000000 + n * 20000,
        "an hour and more ahead": lambda n, t: t + (7200_000000 if n >= 700 else 0),
        "an hour back": lambda n, t: t - (3600_000000 if n >= 700 else 0),
        "a second back": lambda n, t: t - (1_000000 if n >= 700 else 0),
        "300 ms back": lambda n, t: t - (300_000 if n >= 700 else 0),
        "ahead and back": lambda n, t: t + (9999_000000 if 500 <= n < 700 else 0),
        "back and ahead": lambda n, t: t - (9999_000000 if 500 <= n < 700 else 0),
        "back and ahead by 10 s": lambda n, t: t - (10_000000 if 500 <= n < 700 else 0),
        "three steps": lambda n, t: t + (n // 400) * 90000_000000,
    }
    STAMPS = {"0": "(0.000000)", "far ahead": "(9700000000.000000)", "30 s ahead": "(1700000044.000000)", "5 s back": "(1700000009.000000)"}

    def judge(self, text, words):
        code, out, err = run("--json", "learn", "-", text=text)
        self.assertEqual(code, 0, err)
        seen = json.loads(out)
        self.assertAlmostEqual(seen["duration_us"] / 1e6, 30, delta=0.5)
        for each in (seen["setpoints"]["left"], *seen["telemetry"][:2]):
            self.assertLess(each["longest_us"], 50_000)
        self.assertIn(words, err)
        with tempfile.TemporaryDirectory() as folder:
            decided = []
            for name, log in (("a.log", text), ("b.log", drive_log())):
                path = Path(folder, name)
                path.write_text(log, encoding="utf-8")
                decided.append([line.split(None, 1)[-1] for line in run("replay", path, "--config", CONFIG)[1].splitlines()[1:]])
            self.assertEqual(*decided)

    def test_clock_set_while_recording_invents_nothing(self):
        for name, clock in self.CLOCKS.items():
            with self.subTest(name):
                self.judge(drive_log(set_clock=clock), "the clock was set")

    def test_time_of_one_frame_wrong_invents_nothing(self):
        for name, stamp in self.STAMPS.items():
            with self.subTest(name):
                rows = drive_log().splitlines(keepends=True)
                rows[2800] = stamp + rows[2800][rows[2800].index(")") + 1 :]
                self.judge("".join(rows), "1 single times are wrong, first in line 2801")

    def test_pause_of_ten_minutes_stays_a_pause(self):
        out = good("--json", "learn", "-", text=drive_log(set_clock=lambda n, t: t + (600_000000 if n >= 700 else 0)))
        self.assertGreater(json.loads(out)["setpoints"]["left"]["longest_us"], 590_000_000)


class Interfaces(unittest.TestCase):
    """Several buses in one recording (candump any)."""

    TWO = merged(drive_log("can0", 3, count=200), drive_log("can1", 7, count=200))
    THREE = merged(TWO, drive_log("vcan2", 1, count=200))

    def types(self, text, *words):
        return list(json.loads(good("--json", "learn", "-", *words, text=text))["setpoints"]["left"]["types"])

    def test_learn_of_several_interfaces_is_refused_by_name(self):
        for text in (self.TWO, self.THREE):
            code, out, err = run("learn", "-", text=text)
            self.assertEqual((code, out), (65, ""))
            self.assertIn("has frames of two interfaces, can0 and can1; choose one: --interface can0", err)
            self.assertEqual(len(err.splitlines()), 1)

    def test_learn_of_a_chosen_interface_mixes_nothing(self):
        for text in (self.TWO, self.THREE):
            self.assertEqual(self.types(text, "--interface", "can0"), ["3"])
            self.assertEqual(self.types(text, "--interface", "can1"), ["7"])
        self.assertEqual(self.types(self.THREE, "--interface", "vcan2"), ["1"])

    def test_interface_that_is_not_in_it_is_refused(self):
        refused(65, "it has no frame of interface can9", "learn", "-", "--interface", "can9", text=self.TWO)

    def test_replay_wants_one_interface(self):
        with tempfile.TemporaryDirectory() as folder:
            path = Path(folder, "two.log")
            path.write_text(self.TWO, encoding="utf-8")
            refused(65, "choose one: --interface can0", "replay", path, "--config", CONFIG)
            self.assertEqual(run("replay", path, "--config", CONFIG, "--interface", "can1")[0], 0)

    def test_decode_shows_every_interface(self):
        out = good("decode", "--csv", text=self.THREE)
        self.assertEqual({row["interface"] for row in csv.DictReader(io.StringIO(out))}, {"can0", "can1", "vcan2"})


class Forms(unittest.TestCase):
    """What other programs write: read, or refused in one line with the form and its converter."""

    LOG = drive_log(count=3)
    SCREEN = "  can0  10A   [5]  01 00 00 07 D0\n"

    def setUp(self):
        folder = tempfile.TemporaryDirectory()
        self.addCleanup(folder.cleanup)
        self.folder = folder.name

    def file(self, name, data):
        path = Path(self.folder, name)
        path.write_bytes(data if isinstance(data, bytes) else data.encode())
        return path

    def refused(self, path, *words):
        for verb in ("decode", "learn"):
            code, out, err = run(verb, path)
            self.assertEqual((code, out), (65, ""))
            self.assertEqual(len(err.splitlines()), 1, err)
            for word in words:
                self.assertIn(word, err)

    def test_forms_that_are_refused_name_their_converter(self):
        import bz2
        import gzip
        import lzma

        for name, data, words in (
            ("gz", gzip.compress(self.LOG.encode()), ("gzip", "gunzip -c")),
            ("bz2", bz2.compress(self.LOG.encode()), ("bzip2", "bzcat")),
            ("xz", lzma.compress(self.LOG.encode()), ("xz", "xzcat")),
            ("utf-16", self.LOG.encode("utf-16"), ("UTF-16", "iconv")),
            ("utf-16-be with mark", b"\xfe\xff" + self.LOG.encode("utf-16-be"), ("UTF-16", "iconv")),
            ("utf-16-le", self.LOG.encode("utf-16-le"), ("UTF-16", "iconv")),
            ("utf-16-be", self.LOG.encode("utf-16-be"), ("UTF-16", "iconv")),
            ("screen", self.SCREEN * 20, ("screen form", "candump -L")),
            ("screen -ta", "".join(f" (17000000{n:02}.000000){self.SCREEN}" for n in range(20)), ("screen form", "candump -L")),
            ("screen -x", "  can0  RX - -  10A   [5]  01 00 00 07 D0\n" * 20, ("screen form", "candump -L")),
            ("savvycan", "Time Stamp,ID,Extended,Dir,Bus,LEN,D1\n1,0000010A,false,Rx,0,1,01,\n" * 9, ("CSV",)),
            ("jsonl", '{"event":"head"}\n', ("JSON", ".log")),
            ("trc", ";$FILEVERSION=1.1\n;   x\n" * 9, ("TRC", "can_logconvert")),
        ):
            with self.subTest(name):
                self.refused(self.file("a", data), *words)

    def test_forms_that_are_read(self):
        for name, data in (
            ("mark", b"\xef\xbb\xbf" + self.LOG.encode()),
            ("CR LF", self.LOG.replace("\n", "\r\n")),
            ("R", self.LOG.replace("\n", " R\n")),
            ("T", self.LOG.replace("\n", " T\n")),
            ("spaces", self.LOG.replace(" can0 ", "  can0  ")),
            ("comment", "# a, b [1]\n" + self.LOG),
        ):
            with self.subTest(name):
                self.assertEqual(good("decode", self.file("a.log", data)).count("setpoint"), 6)

    def test_can_utils_forms(self):
        if not shutil.which("log2asc"):
            self.skipTest("can-utils is missing")
        asc = subprocess.run(["log2asc", "can0"], input=self.LOG, capture_output=True, text=True, check=True).stdout
        self.refused(self.file("a.asc", asc), "ASC", "asc2log")
        again = subprocess.run(["asc2log"], input=asc, capture_output=True, text=True, check=True).stdout
        self.assertEqual(good("decode", self.file("b.log", again)).count("setpoint"), 6)

    def test_python_can_forms(self):
        try:
            import can
        except ImportError:
            self.skipTest("python-can is missing")
        for ending, words in (
            (".log", None),
            (".asc", ("ASC",)),
            (".blf", ("BLF", "can_logconvert")),
            (".csv", ("CSV", "can_logconvert")),
            (".trc", ("TRC", "can_logconvert")),
            (".db", ("database", "can_logconvert")),
            (".txt", ("screen form",)),
        ):
            with self.subTest(ending):
                path = os.path.join(self.folder, "a" + ending)
                with can.Logger(path) as logger:
                    for n in range(30):
                        logger(can.Message(timestamp=1700000000 + n / 50, arbitration_id=0x10A, is_extended_id=False, channel="can0", data=b"\1\0\0\7\xd0"))
                if words:
                    self.refused(path, *words)
                else:
                    self.assertEqual(good("decode", path).count("setpoint"), 30)

    def test_extended_setpoints_name_the_option_of_python_can(self):
        text = lines("0000010A#01000007D0", "0000012A#01000007D0")
        self.assertIn("is_extended_id=False", run("decode", text=text)[1])
        self.assertIn("is_extended_id=False", run("learn", "-", text=text)[1])


class Decode(unittest.TestCase):
    def decode(self, text):
        return run("decode", text=text)

    def rows(self, text, *words):
        return list(csv.DictReader(io.StringIO(good("decode", "--csv", *words, text=text))))

    def test_every_message_is_shown_with_units(self):
        code, out, err = self.decode(
            lines(
                "10A#01012C07D0 T",
                "12A#01FED407D0 T",
                "100#000F0001",
                "120#FFF10001",
                "101#F81CFFFFFFFF1E",
                "122#0097FFF80000FF92",
                "200#04D90007",
                "220#FF9D003E",
                "201#007C",
                "221#FF9C",
            )
        )
        self.assertEqual((0, ""), (code, err))
        for part in (
            "from 2025-10-09 08:53:20.000000 local time",
            "0.000000   266 (0x10A) T left  setpoint  type 1, speed 300 mm/s, current 2000 mA",
            "0.001000   298 (0x12A) T right setpoint  type 1, speed -300 mm/s, current 2000 mA",
            "256 (0x100)   left  speed     15 rpm, acceleration 1 (unit unknown)",
            "288 (0x120)   right speed     -15 rpm",
            "left  status    battery 24.8 V, temperature 28 degC, odometry -1 ticks, CPU 30 %",
            "right pose      x 151 mm, y -8 mm, z 0 mm, psi -110 mrad",
            "left  force     raw 1241, force with offset 12.410 N, debug 7",
            "right force     raw -99, force with offset -9.900 N, debug 62",
            "left  offset    force offset 12.4 N",
            "right offset    force offset -10.0 N",
        ):
            self.assertIn(part, out)

    def test_csv_has_units_in_header_and_empty_cells_for_no_value(self):
        row, other = self.rows(lines("10A#01012C07D0", "101#FFFF000000641E"))
        self.assertEqual(
            ("1760000000.000000", "266", "0x10A", "5", "left", "setpoint"),
            tuple(row[name] for name in ("time_s", "id", "id_hex", "dlc_bytes", "wheel", "message")),
        )
        self.assertEqual(("1", "300", "2000", ""), tuple(row[name] for name in ("setpoint_type", "setpoint_speed_mm_s", "setpoint_current_mA", "speed_rpm")))
        self.assertEqual(("255", "", "100", "30"), tuple(other[name] for name in ("battery_dV", "temperature_degC", "odometry_ticks", "cpu_percent")))
        self.assertIn("impossible", other["note"])

    def test_undecodable_frames_are_shown_as_bytes_with_the_reason(self):
        rows = self.rows(lines("123#0102", "10A#0101", "0000010A#0101F40064", "10A#R5", "10A##0" + "AB" * 64, "20000004#00"))
        self.assertEqual(["unknown", "ignored", "ignored", "ignored", "ignored", "error"], [row["message"] for row in rows])
        self.assertEqual("0102", rows[0]["data_hex"])
        self.assertEqual("AB" * 64, rows[4]["data_hex"])
        self.assertIn("shorter", rows[1]["note"])
        self.assertIn("11-bit", rows[2]["note"])

    def test_decode_odd_frames_stay_in_their_columns(self):
        text = lines("20001004#00", "12345678#0102 T", "123#R8 R", "100##1" + "AB" * 12)
        self.assertEqual(
            [
                "    0.000000  4100 (0x1004)         error     1 byte: 00 (the controller's report of an error on the bus, not a frame)",
                "    0.001000  305419896 (0x12345678) T       unknown   2 bytes: 01 02",
                "    0.002000   291 (0x123)         unknown   remote, 8 bytes",
                "    0.003000   256 (0x100)         ignored   CAN FD, 12 bytes:" + " AB" * 12,
            ],
            [row.split(" (the wheels", maxsplit=1)[0] for row in self.decode(text)[1].splitlines()[1:]],
        )
        self.assertEqual(["0x1004", "0x12345678", "0x123", "0x100"], [row["id_hex"] for row in self.rows(text)])

    def test_decode_time_before_the_first_frame_is_negative(self):
        out = self.decode("(2.5) can0 123#\n(2.250001) can0 123#\n(1.0) can0 123#\n")[1]
        self.assertEqual(["0.000000", "-0.249999", "-1.500000"], [row.split()[0] for row in out.splitlines()[1:]])

    def test_bad_lines_are_reported_with_fix_and_lose_nothing_else(self):
        code, out, err = self.decode(lines("100#00000000") + "garbage\r\n" + lines("100#00000001").replace("\n", "\r\n") + "(1760000001.0) can0 100#0000")
        self.assertEqual(65, code)
        self.assertEqual(2, out.count("left  speed"))
        self.assertIn("standard input:2: does not begin with a time in parentheses; record with candump -L", err)
        self.assertIn("standard input:4: the last line has no line end", err)
        self.assertIn("2 of 4 lines", err)

    def test_interface_names_of_control_characters_are_bad_lines(self):
        for name in ("\x9b2J", "c\u009bn", "c\u202en", "c\u2028n", "\x7f"):
            for words in (("decode",), ("decode", "--csv"), ("--json", "decode")):
                code, out, err = run(*words, text=f"(1760000000.000000) {name} 100#00000000\n")
                self.assertEqual(65, code, (name, out, err))
                self.assertNotRegex(out + err, "[\x7f-\x9f\u2028-\u202e]")

    def test_thousand_bad_lines_are_counted_not_printed(self):
        code, _, err = self.decode("x\n" * 1000)
        self.assertEqual(65, code)
        self.assertLess(len(err.splitlines()), 15)
        self.assertIn("1000 of 1000", err)

    def test_screen_form_of_candump_is_recognised(self):
        refused(65, "screen form; record with candump -L", "decode", text=" (1760000000.000000)  can0  10A   [5]  01 01 2C 07 D0\n")

    def test_config_determines_the_unit_of_force(self):
        with tempfile.NamedTemporaryFile("w", suffix=".conf") as file:
            file.write("[left]\nforce_unit = dN\n")
            file.flush()
            (row,) = self.rows(lines("200#04D90000"), "--config", file.name)
        self.assertEqual("124100", row["force_with_offset_mN"])

    def test_interface_with_a_comma_stays_one_column(self):
        (row,) = self.rows('(1.0) a,"b 100#00000000\n')
        self.assertEqual("a__b", row["interface"])

    def test_time_that_goes_back_is_shown_as_it_is(self):
        code, out, _ = self.decode("(10.5) can0 100#00000000\n(9.25) can0 100#00000000\n")
        self.assertEqual(0, code)
        self.assertIn("-1.250000", out)

    def test_wrong_words_and_files_are_reported(self):
        for words, code, part in (
            (("--nonsense",), 64, "does not understand"),
            (("a", "b"), 64, '"b"'),
            (("--config",), 64, "--config needs"),
            (("/nonexistent",), 65, "does not exist"),
            (("--config", "/nonexistent"), 78, "cannot be opened"),
            (("/",), 65, "directory"),
        ):
            got, out, err = run("decode", *words)
            self.assertEqual((code, ""), (got, out), words)
            self.assertIn(part, err)

    def test_empty_recording_is_reported(self):
        refused(65, "it has no frame", "decode", text="")

    def test_huge_recording_is_streamed_in_constant_memory(self):
        def resident_kB(blocks):
            with tempfile.NamedTemporaryFile("w", suffix=".log") as file, tempfile.TemporaryFile("w+") as out:
                for _ in range(blocks):
                    file.write(block)
                file.flush()
                child = subprocess.Popen([ctl.program(), "decode", file.name, "--csv"], stdout=out)
                _, status, usage = os.wait4(child.pid, 0)
                child.returncode = os.waitstatus_to_exitcode(status)
                out.seek(0)
                self.assertEqual((0, 1000 * blocks + 1), (child.returncode, sum(1 for _ in out)))
                return usage.ru_maxrss

        block = lines(*["100#000F0001"] * 1000)
        self.assertLess(resident_kB(300) - resident_kB(1), 3000)  # The recording has 11 MB.

    def test_json_carries_what_the_csv_carries(self):
        text = lines(
            "10A#01012C07D0 T",
            "100#000F0001",
            "101#F81CFFFFFFFF1E",
            "122#0097FFF80000FF92",
            "220#FF9D003E",
            "221#FF9C",
            "00000123#11",
            "100#R4",
            "100#00",
            "7FF#",
        )
        out = good("--json", "decode", text=text)
        objects = [json.loads(line) for line in out.splitlines()]
        rows = self.rows(text)
        self.assertEqual(len(rows), len(objects))
        for row, got in zip(rows, objects, strict=True):
            self.assertEqual(row["time_s"], f"{got['t_us'] // 1000000}.{got['t_us'] % 1000000:06d}")
            self.assertEqual(
                (row["interface"], row["direction"], row["id"], row["dlc_bytes"], row["data_hex"], row["wheel"], row["message"], row["note"]),
                (got["interface"], got["direction"] or "", str(got["id"]), str(got["dlc"]), got["data"], got["wheel"] or "", got["message"], got["note"] or ""),
            )
            columns = list(row)[list(row).index("message") + 1 : -1]
            self.assertEqual({name: int(row[name]) for name in columns if row[name]}, got["values"])
        self.assertEqual([True, False], [objects[6]["extended"], objects[0]["extended"]])
        self.assertTrue(objects[7]["remote"])

    def test_csv_together_with_json_is_refused(self):
        code, out, err = run("--json", "decode", "--csv", text=lines("100#000F0001"))
        self.assertEqual((64, ""), (code, out))
        self.assertIn("not both", err)

    def test_live_input_is_decoded_line_by_line(self):
        child = subprocess.Popen([ctl.program(), "decode"], stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True)
        try:
            child.stdin.write(lines("100#000F0001"))
            child.stdin.flush()
            self.assertIn("standard input", child.stdout.readline())
            self.assertIn("15 rpm", child.stdout.readline())
        finally:
            child.stdin.close()
            child.stdout.close()
            child.wait(5)


class Replay(unittest.TestCase):
    def setUp(self):
        folder = tempfile.TemporaryDirectory()
        self.addCleanup(folder.cleanup)
        self.folder = folder.name
        for ending in ("log", "jsonl", "conf"):
            shutil.copy(os.path.join(GOLDEN, f"estop.{ending}"), self.folder)

    def replay(self, *words, name="estop.log"):
        return run("replay", name, *words, cwd=self.folder)

    def replayed(self, *words, **more):
        code, out, err = self.replay(*words, **more)
        self.assertEqual(0, code, err)
        return out

    def change(self, ending, change):
        path = Path(self.folder, f"estop.{ending}")
        path.write_text(change(path.read_text(encoding="utf-8")), encoding="utf-8")

    def test_golden_recording_decides_the_same_bytes_each_time(self):
        expected = Path(GOLDEN, "estop.replay").read_text(encoding="utf-8")
        for _ in range(3):
            self.assertEqual((0, expected, ""), self.replay())
        self.assertRegex(expected, r"setpoints on the bus: (\d+) of \1 as recorded")

    def test_other_configuration_shows_as_other_setpoints(self):
        self.change("conf", lambda text: text.replace("accel_mm_s2 = 800", "accel_mm_s2 = 400"))
        out = self.replayed()
        same, of = (int(out.split("setpoints on the bus: ")[1].split()[i]) for i in (0, 2))
        self.assertLess(same, of)

    def test_another_decision_than_recorded_is_reported(self):
        self.change(
            "jsonl",
            lambda text: text.replace('"type":"stopped"', '"type":"stopped"').replace(
                '"cause":"estop_line","side":null,"detail":1}', '"cause":"wheel_lost","side":null,"detail":51}'
            ),
        )
        _, out, _ = self.replay()
        self.assertIn("DIFFERENT  last stop estop_line (1), when it was recorded wheel_lost (51)", out)
        self.assertIn("stops: 0 of 1 as recorded", out)

    def test_a_press_that_is_left_out_changes_what_is_decided(self):
        self.change("jsonl", lambda text: "".join(line for line in text.splitlines(True) if '"type":"estop_line"' not in line or '"answer":0' in line))
        _, out, _ = self.replay()
        self.assertNotIn("estop_line: e-stop", out)
        self.assertIn("DIFFERENT  state armed, when it was recorded latched", out)

    def test_frames_alone_are_listened_to_with_a_configuration(self):
        os.remove(os.path.join(self.folder, "estop.jsonl"))
        out = self.replayed()
        self.assertIn("frames only: no client arms", out)
        self.assertIn("listening, 0 stops", out)
        self.assertIn("left online", out)
        os.remove(os.path.join(self.folder, "estop.conf"))
        code, _, err = self.replay()
        self.assertEqual(64, code)
        self.assertIn("--config FILE", err)

    def test_setpoints_of_another_controller_are_a_second_master(self):
        Path(self.folder, "other.log").write_text(lines("100#00000000", "120#00000000", "10A#0101F40064"), encoding="utf-8")
        out = self.replayed("--config", "estop.conf", name="other.log")
        self.assertIn("fault      second_master", out)

    def test_cut_files_are_replayed_to_their_end_and_reported(self):
        self.change("jsonl", lambda text: text[: len(text) // 2])
        self.change("log", lambda text: text[: len(text) * 2 // 3])
        code, out, err = self.replay()
        self.assertEqual(65, code)
        self.assertIn("incomplete", out)
        self.assertIn("not a JSON object", err)
        self.assertIn("may be cut", err)

    def test_hostile_events_end_nothing(self):
        numbers = ("-1", "1e999", "99999999999999999999", "9223372036854775807", "null", '"x"', "[]")
        for number in numbers:
            with self.subTest(number):
                self.setUp()
                self.change(
                    "jsonl",
                    lambda text, number=number: "".join(
                        line.replace('"answer":0', f'"answer":{number}')
                        .replace('"left_mm_s":300', f'"left_mm_s":{number}')
                        .replace('"age_us":', f'"age_us":{number},"was":')
                        for line in text.splitlines(True)
                    ),
                )
                code, out, _ = self.replay()
                self.assertIn(code, (0, 65))
                self.assertIn("# end:", out)

    def test_long_silence_is_cut(self):
        Path(self.folder, "gap.log").write_text("(1.0) can0 100#00000000\n(601.0) can0 100#00000000\n(600.95) can0 100#00000000\n", encoding="utf-8")
        out = self.replayed("--config", "estop.conf", name="gap.log")
        self.assertIn("the gap is shortened to 60 s", out)
        self.assertIn("time goes back 1 times", out)

    def test_wrong_words_are_reported(self):
        for words, code, part in (
            ((), 64, "needs a recording"),
            (("--x",), 64, "does not understand"),
            (("/nonexistent.log",), 65, "does not exist"),
            (("a", "b"), 64, '"b"'),
        ):
            got, out, err = run("replay", *words)
            self.assertEqual((code, ""), (got, out))
            self.assertIn(part, err)


class Why(unittest.TestCase):
    def test_recorded_stop_is_printed_without_a_gateway(self):
        out = good("why", "estop.jsonl", "--frames", "3", cwd=GOLDEN)
        shown = out.splitlines()
        self.assertIn("pressed while driving 300/-100 mm/s", shown[0])
        self.assertIn("iwheelctl replay estop.log", shown[2])
        moment = next(i for i, line in enumerate(shown) if line.startswith("------ stop"))
        self.assertEqual(4, moment - 3)
        self.assertEqual(3, len(shown) - moment - 1)
        self.assertIn("speed 0 mm/s", shown[moment + 1])

    def test_list_of_a_directory(self):
        with tempfile.TemporaryDirectory() as folder:
            for number, cause in ((2, "estop_line"), (11, "wheel_lost")):
                for ending in ("log", "jsonl", "conf"):
                    shutil.copy(os.path.join(GOLDEN, f"estop.{ending}"), os.path.join(folder, f"stop-{number:06d}-{cause}.{ending}"))
            Path(folder, "stop-000012-x.jsonl").write_text('{"type":"blackbox"}\n', encoding="utf-8")
            Path(folder, "stop-000013-x.jsonl").write_text("rubbish", encoding="utf-8")
            code, out, err = run("why", "--list", "--directory", folder)
            self.assertEqual(0, code)
            self.assertEqual(["2", "11", "12"], [line.split()[0] for line in out.splitlines() if line[:6].strip()][:3])
            self.assertIn("-- (the recording is cut)", out)
            self.assertIn("stop-000013-x.jsonl", err)
            code, out, _ = run("why", "11", "--directory", folder)
            self.assertEqual(0, code)
            self.assertIn("stop-000011-wheel_lost.log", out)
            refused(65, "why --list", "why", "5", "--directory", folder)

    def test_directory_that_is_not_there(self):
        refused(69, "--directory DIR", "why", "--list", "--directory", "/nonexistent")


class Learn(unittest.TestCase):
    """Drives of made-up controllers, a frame every 20 ms for each wheel, telemetry as specified."""

    def story(self, types=(3, 3), current=lambda speed: 1500, sign=(1, 1), raw=(200, 20), offset=(20, 20), gear=1.0, extra=b"", mark=""):
        text = []
        ticks = [0.0, 0.0]

        def put(at_ms, frame):
            text.append((at_ms, f"(1760000{at_ms // 1000:03d}.{at_ms % 1000:03d}000) can0 {frame}{mark if frame[:3] in ('10A', '12A') else ''}\n"))

        for at_ms in range(0, 12000, 20):
            speed = 0 if at_ms < 2000 else 400 if at_ms < 7000 else -400
            rpm = 0 if at_ms < 2200 else round(speed / 20.106 * gear)
            for side, (setpoint, measured, status, force, zero) in enumerate((("10A", "100", "101", "200", "201"), ("12A", "120", "121", "220", "221"))):
                put(at_ms, f"{setpoint}#{struct.pack('>Bhh', types[side], speed, current(speed)).hex()}{extra.hex()}")
                put(at_ms + 1, f"{measured}#{struct.pack('>hh', rpm * sign[side], 0).hex()}")
                ticks[side] += abs(rpm) / 60000 * 20 * 60
                if at_ms % 40 == 0:
                    put(at_ms + 2, f"{status}#F81C{struct.pack('>i', int(ticks[side])).hex()}1E")
                put(at_ms + 3, f"{force}#{struct.pack('>hh', raw[side], 0).hex()}")
                if at_ms % 1000 == 0 and offset[side] is not None:
                    put(at_ms + 4, f"{zero}#{struct.pack('>h', offset[side]).hex()}")
        return "".join(line for _, line in sorted(text, key=lambda item: item[0])).upper().replace("CAN0", "can0")

    def learn(self, **how):
        return good("learn", "-", text=self.story(**how))

    def test_type_ranges_length_period_are_printed_and_suggested(self):
        out = self.learn(types=(7, 7), extra=b"\0\0\0")
        for part in (
            "type       7 (100 %)",
            "speed      -400 to 400 mm/s",
            "current    always 1500 mA",
            "length     always 8 bytes",
            "period     20 ms",
            "+ setpoint type 7 moves the wheels",
            "+ current_role = limit",
            "+ left: a positive setpoint is measured as a positive speed",
            "setpoint_type = 7",
            "current_role = limit",
            "setpoint_dlc = 8",
        ):
            self.assertIn(part, out)

    def test_current_with_the_sign_of_the_speed_is_a_setpoint(self):
        out = self.learn(current=lambda speed: speed * 2)
        self.assertIn("+ current_role = setpoint", out)
        self.assertIn("current_role = setpoint\n", out)

    def test_current_that_fits_neither_is_not_suggested(self):
        out = self.learn(current=lambda speed: 100 if speed else 50)
        self.assertIn("? current role: the currents fit neither", out)
        self.assertNotIn("current_role =", out.split("for the configuration")[1])

    def test_different_types_left_and_right_are_counter_evidence(self):
        out = self.learn(types=(1, 2))
        self.assertIn("- setpoint type: setpoints with a speed have several types, or different ones", out)
        self.assertNotIn("setpoint_type =", out)

    def test_wheel_that_turns_against_its_command_is_reported(self):
        out = self.learn(sign=(1, -1))
        self.assertIn("- right: a positive setpoint is measured as a NEGATIVE speed", out)
        self.assertIn("+ left: a positive", out)

    def test_units_of_force_are_weighed_against_the_document(self):
        out = self.learn(raw=(20, 200), offset=(20, 20))
        self.assertIn("- left force at standstill / offset = 1.00: dN per count, if nothing pressed the handle (document: cN)", out)
        self.assertIn("- right force at standstill / offset = 10.00: cN per count, if nothing pressed the handle (document: dN)", out)
        self.assertIn("[left]\nforce_unit = dN\n[right]\nforce_unit = cN", out)
        out = self.learn(raw=(0, 80), offset=(20, 20))
        self.assertIn("- left force at standstill / offset = 0.00: the wheel subtracts the offset itself", out)
        self.assertIn("- right force at standstill / offset = 4.00: neither", out)
        self.assertNotIn("force_unit =", out)
        self.assertIn("? left force unit: needs", self.learn(offset=(None, 5)))

    def test_gear_shows_against_the_setpoint_and_against_the_ticks(self):
        out = self.learn(gear=3.0)
        self.assertRegex(out, r"- left: 6\.\d+ mm/s of setpoint per measured rpm")
        self.assertRegex(out, r"\+ left: (59|60)\.\d ticks per turn")
        self.assertRegex(self.learn(), r"\+ left: 20\.\d+ mm/s of setpoint per measured rpm")

    def test_setpoints_sent_by_the_recorder_prove_nothing(self):
        self.assertIn("- all setpoints are marked as sent by the program", self.learn(mark=" T"))

    def test_two_controllers_show(self):
        text = lines(*(f"10A#{1 + i % 2:02X}012C07D0" for i in range(100)))
        _, out, _ = run("learn", "-", text=text)
        self.assertIn("- left: the type changes 99 times in 100 setpoints: two controllers", out)

    def test_oddities_are_reported(self):
        text = lines("10A#0101F4FFFF07", "10A#0101F40BB8", "10A#R5", "0000010A#00", "10A#01", "20000004#00", "333#00")
        code, out, _ = run("learn", "-", text=text + lines("100#00000000"))
        self.assertEqual(0, code)
        for part in (
            "2 remote, extended or FD frames",
            "1 frames are shorter",
            "1 reports of errors",
            "time goes back 1 times",
            "1 setpoints with a current beyond",
            "1 setpoints have nonzero bytes after the five",
            "819 (0x333)",
        ):
            self.assertIn(part, out)

    def test_without_setpoints_the_answer_is_no(self):
        code, out, _ = run("learn", "-", text=lines("100#00000000"))
        self.assertEqual(1, code)
        self.assertIn("? setpoint type and current role: the recording has no setpoint", out)

    def test_wrong_words_are_reported(self):
        for words, code in (((), 64), (("--x",), 64), (("a", "b"), 64), (("/nonexistent",), 65)):
            self.assertEqual((code, ""), run("learn", *words)[:2])
