# SPDX-License-Identifier: MIT
"""iwheelctl export: other programs' libraries read back what it writes. The golden recording ends with a pressed e-stop. Needs no gateway."""

import fcntl
import json
import os
import pty
import re
import shutil
import struct
import subprocess
import sys
import tempfile
import termios
import unittest
from pathlib import Path

import ctl
import pytest

can = pytest.importorskip("can")
pandas = pytest.importorskip("pandas")
make_reader = pytest.importorskip("mcap.reader").make_reader

Reader = pytest.importorskip("rosbags.rosbag2").Reader
get_typestore, Stores = (getattr(pytest.importorskip("rosbags.typesys"), name) for name in ("get_typestore", "Stores"))

HERE = os.path.dirname(os.path.abspath(__file__))
ROOT = os.path.dirname(os.path.dirname(HERE))
pytestmark = pytest.mark.exact
GOLDEN = os.path.join(ROOT, "test", "recordings", "estop.log")
NUMBERS = [f"{side}_{name}" for side in ("left", "right") for name in ("commanded_m_s", "applied_m_s", "measured_m_s", "net_force_N")]
# The left wheel: speed 0.5 m/s commanded, 19 rpm measured; times a millisecond apart.
FRAMES = [("10A#0101F40064", "T"), ("12A#01FE0C0064", "T"), ("100#00130000", "R"), ("120#FFED0000", "R")]


def lines(frames):
    return "".join(f"(1760000000.{1000 * n:06}) can0 {frame} {mark}\n" for n, (frame, mark) in enumerate(frames))


class Export(unittest.TestCase):
    def setUp(self):
        self.folder = tempfile.mkdtemp()
        self.addCleanup(shutil.rmtree, self.folder)
        # The python3 of these tests has the libraries.
        self.environment = {
            **os.environ,
            "PATH": os.path.dirname(sys.executable) + os.pathsep + os.environ["PATH"],
            "PYTHONPATH": os.path.join(ROOT, "python", "src"),
        }

    def run_export(self, *words, **more):
        """(exit code, stderr)"""
        code, out, err = ctl.run("export", *words, cwd=self.folder, env=self.environment, **more)
        self.assertEqual(out, "")
        return code, err

    def refused(self, expected, part, *words):
        code, said = self.run_export(*words)
        self.assertEqual(code, expected, said)
        self.assertIn(part, said)

    def export(self, recording, to, *words):
        code, said = self.run_export(recording, "--to", to, *words)
        self.assertEqual(code, 0, said)
        return os.path.join(self.folder, f"{os.path.splitext(os.path.basename(recording))[0]}.{to}")

    def write(self, name, text):
        path = os.path.join(self.folder, name)
        Path(path).write_text(text, encoding="utf-8")
        return path

    def table(self):
        return pandas.read_csv(self.export(GOLDEN, "csv"))

    def test_csv_pandas_reads_columns_with_their_units(self):
        table = self.table()
        self.assertEqual(list(table.columns), ["time_s", "state", *NUMBERS, "event", "text"])
        self.assertTrue((table[NUMBERS].dtypes == "float64").all(), table.dtypes)
        self.assertTrue(table["time_s"].is_monotonic_increasing)

    def test_csv_has_speeds_force_states_and_events_of_the_recording(self):
        table = self.table()
        samples = table[table["event"].isna()]
        self.assertEqual(list(dict.fromkeys(samples["state"])), ["listening", "armed", "latched"])
        driving = samples[samples["state"] == "armed"].iloc[-1]
        self.assertEqual((driving["left_commanded_m_s"], driving["right_commanded_m_s"]), (0.3, -0.1))
        self.assertEqual((driving["left_applied_m_s"], driving["right_applied_m_s"]), (0.3, -0.1))
        self.assertAlmostEqual(driving["left_measured_m_s"], 0.3, delta=0.02)
        self.assertAlmostEqual(driving["right_measured_m_s"], -0.1, delta=0.02)
        last = samples.iloc[-1]
        self.assertTrue(pandas.isna(last["left_commanded_m_s"]))
        self.assertLess(abs(last["left_net_force_N"]), 1.0)
        stop = table[table["event"] == "stop"]
        self.assertEqual(len(stop), 1)
        self.assertIn("e-stop unix:/tmp/iwheel/button pressed while driving 300/-100 mm/s", stop["text"].iloc[0])
        self.assertEqual(list(table[table["event"] == "state"]["text"]), ["armed", "latched"])

    def test_csv_force_is_unknown_before_its_offset_is_known(self):
        samples = self.table()
        valid = samples[samples["text"] == "left: valid"]["time_s"].iloc[0]
        self.assertTrue(samples[samples["time_s"] < valid]["left_net_force_N"].isna().all())

    def test_csv_frames_only_has_no_state_and_no_command(self):
        table = pandas.read_csv(self.export(self.write("drive.log", lines(FRAMES * 20)), "csv"))
        samples = table[table["event"].isna()].iloc[-1]
        self.assertTrue(table["state"].isna().all())
        self.assertTrue(table["left_commanded_m_s"].isna().all())
        self.assertEqual((samples["left_applied_m_s"], samples["right_applied_m_s"]), (0.5, -0.5))
        self.assertEqual((samples["left_measured_m_s"], samples["right_measured_m_s"]), (0.382, -0.382))
        self.assertEqual(samples["time_s"], 1760000000.06)

    def test_csv_old_setpoint_is_not_the_applied_speed(self):
        late = "(1760000000.502000) can0 100#00130000 R\n(1760000000.540000) can0 100#00130000 R\n"
        table = pandas.read_csv(self.export(self.write("drive.log", lines(FRAMES) + late), "csv"))
        samples = table[table["event"].isna()]
        self.assertTrue(pandas.isna(samples["left_applied_m_s"].iloc[-1]))
        self.assertEqual(samples["left_applied_m_s"].iloc[0], 0.5)

    def test_csv_mirrored_wheel_is_in_the_machines_sense(self):
        text = Path(GOLDEN.replace(".log", ".conf")).read_text(encoding="utf-8")
        text = re.sub(r"(.*\ninvert *= *)no", r"\1yes", text, flags=re.DOTALL)  # The last one: [right].
        self.assertEqual(text.count("invert = yes"), 1)
        config = self.write("mirrored.conf", text)
        table = pandas.read_csv(self.export(self.write("drive.log", lines(FRAMES * 20)), "csv", "--config", config))
        samples = table[table["event"].isna()].iloc[-1]
        self.assertEqual((samples["left_applied_m_s"], samples["right_applied_m_s"]), (0.5, 0.5))
        self.assertEqual((samples["left_measured_m_s"], samples["right_measured_m_s"]), (0.382, 0.382))

    def test_mcap_is_read_back_with_its_schemas_and_values(self):
        table = self.table()
        with open(self.export(GOLDEN, "mcap"), "rb") as file:
            messages = list(make_reader(file).iter_messages())
        by_topic = {}
        for schema, channel, message in messages:
            value = json.loads(message.data)
            fields = json.loads(schema.data)["properties"]
            self.assertEqual((schema.encoding, channel.message_encoding), ("jsonschema", "json"))
            self.assertLessEqual(set(value), set(fields))
            kinds = {"number": (int, float), "string": str}
            self.assertTrue(all(isinstance(one, kinds[fields[name]["type"]]) for name, one in value.items()), value)
            by_topic.setdefault(channel.topic, []).append((message.log_time, value))
        samples = table[table["event"].isna()]
        self.assertEqual(len(by_topic["/left"]), len(samples))
        self.assertEqual([value["state"] for _, value in by_topic["/state"]], ["listening", "armed", "latched"])
        self.assertEqual([value["event"] for _, value in by_topic["/event"]], list(table["event"].dropna()))
        for n, (time_ns, value) in enumerate(by_topic["/left"]):
            row = samples.iloc[n]
            self.assertEqual(round(time_ns / 1000), round(row["time_s"] * 1e6))
            expected = {name.removeprefix("left_"): row[name] for name in NUMBERS[:4] if not pandas.isna(row[name])}
            self.assertEqual(value, expected)

    def test_rosbag2_has_the_values_in_messages_of_ros(self):
        table = self.table()
        samples = table[table["event"].isna()]
        events = table[["event", "text"]].dropna(subset="event").fillna("")
        store = get_typestore(Stores.ROS2_JAZZY)
        by_topic = {}
        with Reader(self.export(GOLDEN, "rosbag2")) as reader:
            for connection, time_ns, data in reader.messages():
                by_topic.setdefault(connection.topic, []).append((time_ns, store.deserialize_cdr(data, connection.msgtype)))
        for column in NUMBERS:
            side, name = column.split("_", 1)
            known = samples[~samples[column].isna()]
            force = name == "net_force_N"
            messages = by_topic.pop(f"/{side}/{'wrench' if force else name.removesuffix('_m_s')}")
            self.assertEqual([message.wrench.force.x if force else message.twist.linear.x for _, message in messages], list(known[column]))
            self.assertEqual([round(time_ns / 1000) for time_ns, _ in messages], [round(time * 1e6) for time in known["time_s"]])
            stamps = [message.header.stamp.sec * 10**9 + message.header.stamp.nanosec for _, message in messages]
            self.assertEqual(stamps, [time_ns for time_ns, _ in messages])
            self.assertEqual(messages[0][1].header.frame_id, f"{side}_{'handle' if force else 'wheel'}")
        self.assertEqual([message.data for _, message in by_topic.pop("/state")], ["listening", "armed", "latched"])
        self.assertEqual([message.data for _, message in by_topic.pop("/event")], list(events["event"] + ": " + events["text"]))
        self.assertEqual(by_topic, {})

    def test_blf_has_the_frames_of_the_recording(self):
        def known(frame):
            return round(frame.timestamp * 1e6), frame.arbitration_id, bytes(frame.data), frame.is_extended_id, frame.is_rx

        written = [known(frame) for frame in can.BLFReader(self.export(GOLDEN, "blf"))]
        self.assertEqual(written, [known(frame) for frame in can.CanutilsLogReader(GOLDEN)])
        self.assertGreater(len(written), 1000)

    def test_existing_file_stays_as_it_is(self):
        for to in ("csv", "mcap", "blf", "rosbag2"):
            path = self.write(f"estop.{to}", "mine")
            code, said = self.run_export(GOLDEN, "--to", to)
            self.assertNotEqual(code, 0)
            self.assertIn("exists; name another file: --output FILE", said)
            self.assertEqual(Path(path).read_text(encoding="utf-8"), "mine")

    def test_recording_that_is_none_leaves_no_file(self):
        empty = self.write("empty.log", "")
        for recording, to in ((empty, "csv"), (empty, "mcap"), (empty, "blf"), (empty, "rosbag2"), ("none.log", "csv"), ("none.log", "blf")):
            code, said = self.run_export(recording, "--to", to)
            self.assertEqual(code, 65, (recording, to, said))
            self.assertNotIn("Traceback", said)
            self.assertEqual(os.listdir(self.folder), ["empty.log"])

    def test_bad_line_is_reported_and_left_out(self):
        path = self.write("drive.log", lines(FRAMES * 20) + "broken\n")
        self.refused(65, "drive.log:81:", path, "--to", "csv")
        self.assertGreater(len(pandas.read_csv(os.path.join(self.folder, "drive.csv"))), 3)
        self.refused(65, "line 81 is no frame", path, "--to", "blf")

    def test_missing_library_is_named_with_its_fix(self):
        for to, package in (("mcap", "mcap"), ("blf", "python-can"), ("rosbag2", "rosbags")):
            module = Path(self.folder, to, {"blf": "can"}.get(to, package))
            module.mkdir(parents=True)
            (module / "__init__.py").write_text("raise ImportError('absent')\n", encoding="utf-8")
            self.environment["PYTHONPATH"] = os.pathsep.join([os.path.join(self.folder, to), os.path.join(ROOT, "python", "src")])
            self.refused(65, f"needs the Python package {package}; install it:", GOLDEN, "--to", to)

    def test_missing_package_is_named_with_its_fix(self):
        self.environment["PYTHONPATH"] = os.path.join(self.folder, "nothing")
        self.refused(69, "python3-iwheel", GOLDEN, "--to", "csv")

    def test_interface_is_chosen(self):
        path = self.write("two.log", lines(FRAMES * 20) + lines(FRAMES).replace("can0", "can1"))
        self.refused(64, "--interface", path, "--to", "csv")
        self.assertEqual(os.listdir(self.folder), ["two.log"])
        self.export(path, "csv", "--interface", "can0")
        blf = self.export(path, "blf", "--interface", "can1")
        self.assertEqual(len(list(can.BLFReader(blf))), 4)

    def test_long_recording_shows_its_progress_on_a_terminal(self):
        path = self.write("long.log", "".join(f"({n // 1000}.{n % 1000:03}000) can0 100#00130000 R\n" for n in range(200_000)))
        self.environment["TERM"] = "xterm"
        for to in ("csv", "blf"):
            parent, child = pty.openpty()
            fcntl.ioctl(child, termios.TIOCSWINSZ, struct.pack("HHHH", 24, 80, 0, 0))
            subprocess.run([ctl.program(), "export", path, "--to", to], cwd=self.folder, env=self.environment, stderr=child, timeout=60, check=True)
            os.close(child)
            said = os.read(parent, 65536).decode()
            os.close(parent)
            shown = [int(share) for share in re.findall(r"\r *(\d+) %\r", said)]
            self.assertGreaterEqual(len(shown), 3, said)
            self.assertEqual(shown, sorted(shown))
            self.assertGreater(shown[-1], 90)


class Convert(unittest.TestCase):
    """docs/user/recordings.md has one command for each form of other programs."""

    def test_each_other_form_is_converted_with_the_documented_command(self):
        page = Path(ROOT, "docs", "user", "recordings.md").read_text(encoding="utf-8")
        commands = re.findall(r"^ +can_logconvert FILE\.(\w+) FILE\.log", page, re.MULTILINE)
        self.assertEqual(sorted(commands), ["asc", "blf", "trc"])
        frames = list(can.CanutilsLogReader(GOLDEN))[:300]
        folder = tempfile.mkdtemp()
        self.addCleanup(shutil.rmtree, folder)
        for ending in commands:
            path, log = os.path.join(folder, f"drive.{ending}"), os.path.join(folder, f"{ending}.log")
            with can.Logger(path) as writer:
                for frame in frames:
                    frame.channel = 0
                    writer.on_message_received(frame)
            program = os.path.join(os.path.dirname(sys.executable), "can_logconvert")
            subprocess.run([sys.executable, program, path, log], check=True, timeout=60)
            code, out, err = ctl.run("--json", "decode", log)
            self.assertEqual((code, err), (0, ""), ending)
            decoded = [json.loads(line) for line in out.splitlines()]
            self.assertEqual([(one["id"], bytes.fromhex(one["data"])) for one in decoded], [(one.arbitration_id, bytes(one.data)) for one in frames], ending)


if __name__ == "__main__":
    unittest.main()
