#!/usr/bin/env python3
# SPDX-License-Identifier: MIT
"""Compares docs/developer/proofs.csv, the list of every proof, with the tree.

usage: scripts/proofs.py [--update] [TABLE]

A row is a step of ./check (the tests STEP and STEP.* of test/all/steps.cmake), a test STEP.NAME that is in a longer list, or one of several proofs
in a step. `number` is a minimum of single tests. Failures: a step without a row, a row whose step or runner does not exist any more or has moved to a
longer list, and a number that has become smaller. Numbers come from the runners' lists, from the sources, and from the last run of the step
(build/check/STEP*.counts). A step that did not run is "not run", which is no pass. --update raises numbers and adds steps. No tool does it: CTest and
pytest compare no list with an earlier one.
"""

import csv
import functools
import re
import subprocess
import sys
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
TABLE = ROOT / "docs/developer/proofs.csv"
TESTS = ROOT / "test/all/steps.cmake"
FIELDS = ("id", "what", "command", "number", "list")
LISTS = ("quick", "check", "ci", "full")
TIMEOUT_S = 600
# Proofs inside steps: (description, command of the runner that lists them) or (description, files, pattern of a single test in them).
LISTED = {
    "system.scenarios": ("scenarios on the local bus", "-m pytest --collect-only -q test/system/test_scenarios.py"),
    "serial.wires": ("scenarios of the relay", "-m pytest --collect-only -q test/serial/test_wires.py"),
    "serial.image": ("scenarios with the real image", "-m pytest --collect-only -q test/serial/test_image.py"),
    "ros2.rides": ("scenarios of the ROS 2 bridge", "-m pytest --collect-only -q test/ros2"),
    "mqtt.trials": ("trials of the MQTT bridge", "-m pytest --collect-only -q test/mqtt"),
    "web.trials": ("trials of the web bridge", "-m pytest --collect-only -q test/web"),
    "kernel.check": ("tests on a real kernel", "test/kernel/run --list"),
    "kernel.full": ("the same, with the long ones", "test/kernel/run --list --full"),
    "python.tests": ("tests of the Python client", "-m pytest --collect-only -q python/tests"),
    "service.tests": ("tests of the service", "-m pytest --collect-only -q test/service"),
}
COUNTED = {
    "unit.functions": ("unit test functions in C", "test/unit/*.c", r"^TEST\(|^ *RUN_TEST\("),
    "ctl.tests": ("tests of iwheelctl and ./demo", "test/ctl/test_*.py", r"^    def test_"),
    "unit.client": ("tests of the C client's example", "test/client/test_*.py", r"^    def test_"),
    "faults.table": ("seeded faults", "test/faults/*.faults", r"^@@ .* \| "),
    "unit.driver": ("tests of the STM32 driver", "test/target/*.c", r"^TEST\(|^ *RUN_TEST\("),
    "kernel.verdicts": ("tests of the kernel's runner", "test/kernel/test_*.py", r"^    def test_"),
    "fuzz.targets": ("fuzz targets", "test/fuzz/fuzz_*.c", r"^int LLVMFuzzerTestOneInput"),
    "dbc.tests": ("tests of the DBC file", "test/dbc/test_*.py", r"^    def test_"),
    "gates.faults": ("faults for gates", "test/gates/test_seeded_faults.py", r"^    \("),
    "verdicts.tests": ("tests of the verdicts", "test/support/test_*verdict.py", r"^    def test_"),
}


def tests():
    """Returns [(test, list)]; a `*` in a test's name replaces a variable of steps.cmake."""
    found = re.findall(r"^ *(?:build\(|tests\(|test\((?:idle|real|waits) )(\S+) (quick|check|ci|full)", TESTS.read_text(), re.M)
    return [(re.sub(r"\$\{\w+\}", "*", name), where) for name, where in found]


def row_of(test, table):
    """Returns the id of the row that a test belongs to."""
    return test if test in table and test not in COUNTED and test not in LISTED else test.split(".")[0]


def steps(table):
    """Returns {row: the shortest list that has all tests of the row: quick, check, ci; full only if all of them are in it}."""
    found = {}
    for name, where in tests():
        step = row_of(name, table)
        found[step] = max(found.get(step, "quick"), where, key=LISTS.index) if where != "full" or step not in found else found[step]
    return found


@functools.cache
def listed(command):
    """Returns the number of tests that the runner lists; None if a tool of the runner is missing."""
    python = ROOT / ".venv/bin/python"
    words = [str(python) if python.exists() else sys.executable, *command.split()]
    done = subprocess.run(words, cwd=ROOT, capture_output=True, text=True, timeout=TIMEOUT_S, check=False)
    if done.returncode != 0 and not re.search("ModuleNotFoundError|No module named", done.stdout + done.stderr):
        return 0  # The runner or its list is missing or broken.
    return sum("::" in line or "pytest" not in command for line in done.stdout.splitlines()) if done.returncode == 0 else None


def last_run(row, table):
    """Returns the number of single tests in the last run of the row; None if a test of it did not run, or skipped some."""
    paths = [list(ROOT.glob(f"build/check/{name}.counts")) for name, where in tests() if row_of(name, table) == row and where != "full"]
    counts = [list(map(int, path.read_text().split())) for of_test in paths for path in of_test]
    return sum(map(sum, counts)) if paths and all(paths) and not any(sum(one[2:]) for one in counts) else None


def number_of(name, table):
    if name in LISTED:
        return listed(LISTED[name][1])
    if name in COUNTED:
        _, files, begins = COUNTED[name]
        return sum(len(re.findall(begins, path.read_text(), re.M)) for path in ROOT.glob(files))
    return last_run(name, table)


def rows_now(known, table):
    """Yields every required row: (id, description, command, list)."""
    for name, where in known.items():
        yield name, table.get(name, {}).get("what", ""), f"./check {name}", where
    for name, (what, *_) in {**LISTED, **COUNTED}.items():
        step, full = name.split(".")[0], name.endswith(".full")
        yield name, what, f"./check {'--full ' if full else ''}{step}", "full" if full else known.get(step, "")


def main(arguments):
    if "--help" in arguments:
        print(__doc__)
        return 0
    path = Path(next((word for word in arguments if not word.startswith("--")), TABLE))
    with open(path, newline="", encoding="utf-8") as file:
        table = {row["id"]: row for row in csv.DictReader(file)}
    known = steps(table)
    wrong = []
    for name, what, command, where in rows_now(known, table):
        if "--update" in arguments:
            now = number_of(name, table)
            old = int(table.get(name, {}).get("number") or 0)
            table[name] = dict(zip(FIELDS, (name, what, command, max(old, now or 0) or "", where), strict=False))
        elif name not in table:
            wrong.append(f"{name}: no row in {path.name}; add it: scripts/proofs.py --update")
        elif table[name]["list"] != where:
            wrong.append(f"{name}: in list {where}, {table[name]['list']} recorded; a proof does not change its list without a reason")
    for name, row in table.items():
        if name not in known and ((name not in LISTED and name not in COUNTED) or name.split(".")[0] not in known):
            wrong.append(f"{name}: no longer in list {row['list']}; restore the proof, or move its row with a reason")
            continue
        now = number_of(name, table)
        if row["number"] and now is not None and now < int(row["number"]):
            wrong.append(f"{name}: {now} single tests, {row['number']} recorded; restore the missing ones")
        if now is None:
            print(f"not run: {name}")
    if "--update" in arguments:
        with open(path, "w", newline="", encoding="utf-8") as file:
            writer = csv.DictWriter(file, FIELDS, lineterminator="\n")
            writer.writeheader()
            writer.writerows(table.values())
    print(*(f"failed: {text}" for text in wrong), f"{len(table)} proofs, {len(wrong)} wrong", sep="\n")
    return 1 if wrong else 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
