# SPDX-License-Identifier: MIT
"""Recordings in Python: what iwheelctl decodes, as typed samples; recording the bus; the live plot; the notebook."""

import json
import os
import shutil
import subprocess
import sys
import tempfile
import time
import unittest
from unittest import mock

from rig import BUILD, EXAMPLES, ROOT, SOURCES, RigCase, require_gateway

import iwheel
from iwheel import Gateway, RecordingError, read_recording

GOLDEN = os.path.join(ROOT, "test", "recordings", "estop.log")
IWHEELCTL = os.path.join(BUILD, "app", "ctl", "iwheelctl")


class Folder(unittest.TestCase):
    def setUp(self):
        require_gateway()
        super().setUp()
        self.folder = tempfile.mkdtemp()
        self.addCleanup(shutil.rmtree, self.folder)
        environment = mock.patch.dict(os.environ, IWHEELCTL=IWHEELCTL, IWHEEL_RECORDING=GOLDEN)
        environment.start()
        self.addCleanup(environment.stop)

    def path(self, name, text=None):
        path = os.path.join(self.folder, name)
        if text is not None:
            with open(path, "w", encoding="utf-8") as file:
                file.write(text)
        return path


class Read(Folder):
    def test_recording_has_typed_samples_and_events(self):
        recording = read_recording(GOLDEN)
        armed = [sample for sample in recording.samples if sample.state == "armed"][-1]
        self.assertEqual((armed.left.commanded_m_s, armed.right.applied_m_s), (0.3, -0.1))
        self.assertAlmostEqual(armed.left.measured_m_s, 0.3, delta=0.02)
        self.assertIsNone(armed.left.net_force_N)
        self.assertEqual([event.text for event in recording.events if event.event == "state"], ["armed", "latched"])
        self.assertEqual(recording.complaints, ())

    def test_recording_becomes_a_pandas_table(self):
        recording = read_recording(GOLDEN)
        table = recording.to_pandas()
        self.assertEqual(list(table.columns), list(iwheel._recording.COLUMNS[:-2]))
        self.assertEqual(len(table), len(recording.samples))
        self.assertEqual(table["left_applied_m_s"].dtype, "float64")
        self.assertEqual(table["left_applied_m_s"].max(), 0.3)
        self.assertTrue(table["left_applied_m_s"].iloc[:3].isna().all())

    def test_recording_bad_line_is_a_complaint(self):
        path = self.path("drive.log", "(1.000000) can0 100#00130000\nbroken\n")
        recording = read_recording(path)
        self.assertEqual(len(recording.samples), 1)
        self.assertTrue(any("drive.log:2:" in line for line in recording.complaints), recording.complaints)

    def test_recording_missing_file_or_program_is_an_error_with_its_fix(self):
        with self.assertRaisesRegex(RecordingError, "the file does not exist"):
            read_recording(self.path("none.log"))
        os.environ["IWHEELCTL"] = self.path("none")
        with self.assertRaisesRegex(RecordingError, "set IWHEELCTL"):
            read_recording(GOLDEN)
        os.environ["PATH"] = ""
        del os.environ["IWHEELCTL"]
        with self.assertRaisesRegex(RecordingError, "iwheelctl is not installed; install it"):
            read_recording(GOLDEN)

    def test_recording_table_of_another_version_is_refused(self):
        program = self.path("old", "#!/bin/sh\necho time_s,speed\n")
        os.chmod(program, 0o755)
        os.environ["IWHEELCTL"] = program
        with self.assertRaisesRegex(RecordingError, "the same version"):
            read_recording(GOLDEN)


class Live(Folder, RigCase):
    def test_record_writes_frames_that_can_be_read(self):
        path = self.path("bus.log")
        with Gateway(self.socket) as gateway:
            count = gateway.record(path, seconds=1.0)
            self.assertEqual(list(gateway.events(timeout=0.1)), [])
        self.assertGreater(count, 100)
        with open(path, encoding="utf-8") as file:
            self.assertEqual(len([line for line in file if not line.startswith("#")]), count)
        recording = read_recording(path)
        self.assertEqual(recording.samples[-1].left.measured_m_s, 0.0)
        self.assertLess(abs(recording.samples[-1].time_s - recording.samples[0].time_s - 1.0), 0.5)
        with Gateway(self.socket) as gateway, self.assertRaises(FileExistsError):
            gateway.record(path, seconds=0.1)

    def test_record_leaves_no_frame_behind(self):
        path = self.path("late.log")
        with Gateway(self.socket) as gateway:
            watch = gateway.watch

            def watch_late(*topics, **rest):
                time.sleep(0.0 if topics else 0.2)  # Meanwhile frames arrive.
                return watch(*topics, **rest)

            with mock.patch.object(gateway, "watch", watch_late):
                count = gateway.record(path, seconds=0.2)
            self.assertEqual(list(gateway.events(timeout=0.1)), [])
        with open(path, encoding="utf-8") as file:
            self.assertEqual(len(file.readlines()), count)

    def test_plot_draws_the_states_into_a_picture(self):
        picture = self.path("plot.png")
        command = [sys.executable, "-m", "iwheel.plot", "--socket", self.socket, "--for", "1.5", "--seconds", "2", "--save", picture]
        environment = {**os.environ, "PYTHONPATH": SOURCES, "MPLBACKEND": "Agg", "MPLCONFIGDIR": self.folder}
        done = subprocess.run(command, env=environment, capture_output=True, text=True, timeout=60, check=False)
        self.assertEqual(done.returncode, 0, done.stderr)
        self.assertRegex(done.stderr, r"iwheel.plot: \d\d+ states")
        with open(picture, "rb") as file:
            self.assertEqual(file.read(4), b"\x89PNG")

    def test_plot_without_gateway_names_the_fix(self):
        command = [sys.executable, "-m", "iwheel.plot", "--socket", self.path("none.sock"), "--for", "1"]
        environment = {**os.environ, "PYTHONPATH": SOURCES, "MPLBACKEND": "Agg", "MPLCONFIGDIR": self.folder}
        done = subprocess.run(command, env=environment, capture_output=True, text=True, timeout=60, check=False)
        self.assertEqual(done.returncode, 69)
        self.assertNotIn("Traceback", done.stderr)


class Frames(unittest.TestCase):
    def test_line_of_each_kind_of_frame(self):
        frame = {"event": "frame", "t_us": 1_000_000, "id": 0x10A, "dlc": 2, "data": "01ff", "kind": "echo", "flags": []}
        line_of = iwheel._record.line_of
        self.assertEqual(line_of(frame, 500, "can0"), "(1.000500) can0 10A#01FF T\n")
        self.assertEqual(line_of({**frame, "kind": "received", "flags": ["extended"]}, 0, "can0"), "(1.000000) can0 0000010A#01FF R\n")
        self.assertEqual(line_of({**frame, "flags": ["remote"]}, 0, "can0"), "(1.000000) can0 10A#R T\n")
        self.assertEqual(line_of({**frame, "flags": ["fd"]}, 0, "can0"), "(1.000000) can0 10A##001FF T\n")


class Notebook(Folder):
    """The cells have no magic commands, so they run without Jupyter, in order and in one name space."""

    def test_notebook_runs_from_its_first_cell_to_its_last(self):
        import matplotlib

        matplotlib.use("Agg")
        with open(os.path.join(EXAMPLES, "recording.ipynb"), encoding="utf-8") as file:
            notebook = json.load(file)
        self.assertEqual(notebook["nbformat"], 4)
        cells = [cell for cell in notebook["cells"] if cell["cell_type"] == "code"]
        self.assertGreater(len(cells), 3)
        names = {}
        for cell in cells:
            self.assertEqual((cell["outputs"], cell["execution_count"]), ([], None), "commit it without its outputs")
            exec(compile("".join(cell["source"]), "recording.ipynb", "exec"), names)
        self.assertGreater(names["stopping_s"], 0)
        self.assertIn("e-stop", names["stop"].text)


if __name__ == "__main__":
    unittest.main()
