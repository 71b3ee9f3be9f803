# SPDX-License-Identifier: MIT
"""Third-party programs read an unmodified recording of the black box. cantools with share/iwheel.dbc decodes the same values as `iwheelctl decode`."""

import csv
import io
import os
import shutil
import subprocess
import tempfile
import unittest
from decimal import Decimal
from pathlib import Path

import pytest

can = pytest.importorskip("can", reason="python-can is missing in .venv")
cantools = pytest.importorskip("cantools", reason="cantools is missing in .venv")
pytestmark = pytest.mark.exact

ROOT = Path(__file__).resolve().parents[2]
RECORDING = ROOT / "test/recordings/estop.log"
LINES = RECORDING.read_text(encoding="ascii").splitlines()
PROGRAM = os.path.join(os.environ["IWHEEL_BUILD"], "app/ctl/iwheelctl")
# The columns of `iwheelctl decode` whose names differ from those in the DBC.
COLUMN = {
    "speed_mm_s": "setpoint_speed_mm_s",
    "current_mA": "setpoint_current_mA",
    "x_mm": "pose_x_mm",
    "y_mm": "pose_y_mm",
    "z_mm": "pose_z_mm",
    "psi_mrad": "pose_psi_mrad",
    "normal_force_cN": "force_raw",
    "normal_force_dN": "force_raw",
    "debug_raw": "force_debug_raw",
}


def rows():
    done = subprocess.run([PROGRAM, "decode", "--csv", str(RECORDING)], capture_output=True, text=True, check=True)
    return list(csv.DictReader(io.StringIO(done.stdout)))


class Readers(unittest.TestCase):
    def test_python_can_reads_every_frame_with_time_and_direction(self):
        with can.CanutilsLogReader(str(RECORDING)) as reader:
            messages = list(reader)
        self.assertEqual(len(LINES), len(messages))
        for line, message in zip(LINES, messages, strict=True):
            self.assertEqual(line.endswith("R"), message.is_rx)
            self.assertAlmostEqual(float(line[1 : line.index(")")]), message.timestamp, places=5)
            self.assertEqual(line.split()[2], f"{message.arbitration_id:03X}#{message.data.hex().upper()}")

    def test_cantools_reads_every_line_and_decodes_the_same_values(self):
        database = cantools.database.load_file(ROOT / "share/iwheel.dbc")
        with open(RECORDING, encoding="ascii") as file:
            frames = [frame for _, frame in cantools.logreader.Parser(file).iterlines() if frame is not None]
        decoded = rows()
        self.assertEqual((len(LINES), len(LINES)), (len(frames), len(decoded)))
        compared = 0
        for frame, row in zip(frames, decoded, strict=True):
            self.assertEqual(frame.frame_id, int(row["id"]))
            for name, value in database.decode_message(frame.frame_id, frame.data).items():
                self.assertEqual(Decimal(value), Decimal(row[COLUMN.get(name, name)]), (row, name))
                compared += 1
        self.assertGreater(compared, 2 * len(LINES))

    def test_file_of_python_can_is_read_back(self):
        path = os.path.join(tempfile.mkdtemp(), "written.log")
        with can.CanutilsLogWriter(path, channel="vcan0") as writer:
            for i, more in enumerate(({}, {"is_extended_id": True}, {"is_remote_frame": True, "dlc": 5}, {"is_fd": True, "data": bytes(12)}, {"is_rx": False})):
                message = {"arbitration_id": 266, "data": b"\1\1\x2c\7\xd0", "is_extended_id": False, "timestamp": 1e9 + i, **more}
                if message.get("is_remote_frame"):
                    message["data"] = b""
                writer(can.Message(**message))
        done = subprocess.run([PROGRAM, "decode", "--csv", path], capture_output=True, text=True, check=False)
        self.assertEqual((0, ""), (done.returncode, done.stderr))
        self.assertEqual(["setpoint", "ignored", "ignored", "ignored", "setpoint"], [row["message"] for row in csv.DictReader(io.StringIO(done.stdout))])

    @unittest.skipUnless(shutil.which("log2long"), "can-utils is not installed (apt-get install can-utils)")
    def test_can_utils_read_every_frame(self):
        with open(RECORDING, encoding="ascii") as file:
            done = subprocess.run(["log2long"], stdin=file, capture_output=True, text=True, check=True)
        self.assertEqual(len(LINES), len([line for line in done.stdout.splitlines() if line.startswith("(")]))
