# SPDX-License-Identifier: MIT
"""The types of the events, as mypy --strict sees them in a program."""

import os
import subprocess
import sys
import tempfile
import unittest

PACKAGE = os.path.dirname(os.path.dirname(os.path.abspath(__file__)))
ROOT = os.path.dirname(PACKAGE)
sys.path[:0] = [os.path.join(ROOT, "test", "northbound"), os.path.join(ROOT, "scripts")]

PROGRAM = """
from iwheel import Gateway

for event in Gateway().events():
    if event["event"] == "state":
        print(event["left"]["speed_mm_s"], event["state"])
    elif event["event"] == "stop":
        print(event["sentence"])
    elif event["event"] == "disconnected":
        print(event["message"])
"""


def mypy(program):
    """Returns the errors of mypy --strict in the program."""
    with tempfile.TemporaryDirectory() as folder:
        path = os.path.join(folder, "program.py")
        with open(path, "w", encoding="utf-8") as file:
            file.write(program)
        command = [sys.executable, "-m", "mypy", "--strict", "--no-incremental", "--python-version", "3.10", path]
        environment = {**os.environ, "MYPYPATH": os.path.join(PACKAGE, "src")}
        run = subprocess.run(command, cwd=folder, env=environment, capture_output=True, text=True, check=False)
    return [line.partition("error: ")[2] for line in run.stdout.splitlines() if "error: " in line] + ([run.stderr] if run.stderr else [])


class Events(unittest.TestCase):
    def setUp(self):
        if subprocess.run([sys.executable, "-c", "import mypy"], capture_output=True, check=False).returncode:
            self.skipTest("mypy is not installed")

    def test_event_fields_that_exist_pass_mypy_strict(self):
        self.assertEqual(mypy(PROGRAM), [])

    def test_event_misspelt_field_fails_mypy_strict(self):
        for right, wrong in (("sentence", "sentences"), ("speed_mm_s", "speed_mm"), ('"message"', '"messages"')):
            errors = mypy(PROGRAM.replace(right, wrong))
            self.assertEqual(len(errors), 1, errors)
            self.assertIn("has no key", errors[0])

    def test_event_misspelt_name_fails_mypy_strict(self):
        self.assertTrue(mypy(PROGRAM.replace('== "stop"', '== "stops"')))


class Names(unittest.TestCase):
    def test_each_event_of_the_description_has_a_type(self):
        if not os.path.exists(os.path.join(ROOT, "share", "northbound.json")):
            self.skipTest("it needs the gateway's sources")
        from described import Description
        from northbound import camel

        sys.path.insert(0, os.path.join(PACKAGE, "src"))
        import iwheel

        for event in Description().events:
            fields = getattr(iwheel, camel(event) + "Event").__annotations__
            self.assertLessEqual({"event", *Description().fields(Description().events[event])}, set(fields), event)


if __name__ == "__main__":
    unittest.main()
