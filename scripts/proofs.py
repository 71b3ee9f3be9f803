#!/usr/bin/env python3
# SPDX-License-Identifier: MIT
"""Compares docs/developer/proofs.csv, the list of every proof, with what the tree has now.

usage: scripts/proofs.py [--update] [TABLE]

A row is a step of ./check, or one of several proofs in a step. `number` is a minimum of single tests. It fails: a step without a row, a row whose
step or runner is no longer there, and a number that has become smaller. Numbers come from the runners' lists, from the sources, and from the last
run of the step (build/check/STEP.counts); a step that was not run here is "not run", which is no pass. --update raises numbers and adds steps.
"""
import csv
import re
import subprocess
import sys
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
TABLE = ROOT / "docs/developer/proofs.csv"
FIELDS = ("id", "what", "command", "number", "list")
TIMEOUT_S = 60
# Proofs inside steps: (what, command of the runner that lists them) or (what, files, what begins each single test in them).
LISTED = {
    "system.scenarios": ("scenarios on the local bus", "test/system/run --list"), "serial.wires": ("scenarios of the relay", "test/serial/run --list"),
    "serial.image": ("scenarios with the real image", "test/serial/run_image --list"), "ros2.rides": ("scenarios of the ROS 2 bridge", "test/ros2/run --list"),
    "mqtt.trials": ("trials of the MQTT bridge", "test/mqtt/run --list"), "web.trials": ("trials of the web bridge", "test/web/run --list"),
    "kernel.check": ("tests on a real kernel", "test/kernel/run --list"), "kernel.full": ("the same, the long ones too", "test/kernel/run --list --full"),
    "python.tests": ("tests of the Python client", "python/tests/run --list"), "service.tests": ("tests of the service", "test/service/run --list"),
}
COUNTED = {
    "unit.functions": ("unit test functions in C", "test/unit/*.c", r"^ *RUN_TEST\("),
    "unit.ctl": ("tests of iwheelctl and ./demo", "test/ctl/test_*.py", r"^    def test_"), "unit.client": ("tests of the C client's example", "test/client/test_*.py", r"^    def test_"),
    "faults.table": ("seeded faults", "test/faults/*.faults", r"^@@ .* \| "), "target.driver": ("tests of the STM32 driver", "test/target/*.c", r"^ *RUN_TEST\("),
    "kernel.verdicts": ("tests of the kernel's runner", "test/kernel/test_*.py", r"^    def test_"), "fuzz.targets": ("fuzz targets", "test/fuzz/fuzz_*.c", r"^int LLVMFuzzerTestOneInput"),
    "dbc.tests": ("tests of the DBC file", "test/dbc/test_*.py", r"^    def test_"), "gates.faults": ("faults for gates", "scripts/planted_faults.py", r"^    \("),
    "verdicts.tests": ("tests of the verdicts", "test/support/test_verdict.py", r"^    def test_"),
}


def steps():
    """{step: what it proves}"""
    done = subprocess.run([ROOT / "check", "--list"], capture_output=True, text=True, check=True)
    return dict(line.split(None, 1) for line in done.stdout.splitlines())


def listed(command):
    """How many lines the runner lists; None if what it needs is missing here."""
    python = ROOT / ".venv/bin/python"
    words = [str(python) if python.exists() else sys.executable, *command.split()]
    done = subprocess.run(words, cwd=ROOT, capture_output=True, text=True, timeout=TIMEOUT_S, check=False)
    if done.returncode != 0 and "ModuleNotFoundError" not in done.stderr:
        return 0  # The runner, or its list, is gone or broken.
    return len(done.stdout.splitlines()) if done.returncode == 0 else None


def last_run(step):
    """Single tests that the step ran here last; None if it did not run, or skipped some."""
    path = ROOT / f"build/check/{step}.counts"
    if not path.exists():
        return None
    counts = [list(map(int, line.split())) for line in path.read_text().splitlines()]
    return None if any(sum(line[2:]) for line in counts) else sum(map(sum, counts))


def number_of(name):
    if name in LISTED:
        return listed(LISTED[name][1])
    if name in COUNTED:
        _, files, begins = COUNTED[name]
        return sum(len(re.findall(begins, path.read_text(), re.M)) for path in ROOT.glob(files))
    return last_run(name)


def rows_now(known):
    """Every row that there must be: (id, what, command, list)."""
    for name, what in known.items():
        yield name, what, f"./check {name}", "check"
    for name, (what, *_) in {**LISTED, **COUNTED}.items():
        step, full = name.split(".")[0], name.endswith(".full")
        yield name, what, f"./check {'--full ' if full else ''}{step}", "full" if full else "check"


def main(arguments):
    known, path = steps(), Path(next((word for word in arguments if not word.startswith("--")), TABLE))
    with open(path, newline="", encoding="utf-8") as file:
        table = {row["id"]: row for row in csv.DictReader(file)}
    wrong = []
    for name, what, command, where in rows_now(known):
        if "--update" in arguments:
            now = number_of(name)
            old = int(table.get(name, {}).get("number") or 0)
            table[name] = dict(zip(FIELDS, (name, what, command, max(old, now or 0) or "", where), strict=False))
        elif name not in table:
            wrong.append(f"{name}: no row in {path.name}; add it: scripts/proofs.py --update")
        elif table[name]["list"] != where:
            wrong.append(f"{name}: in list {where}, {table[name]['list']} recorded; a proof does not change its list without a reason")
    for name, row in table.items():
        if name.split(".")[0] not in known or ("." in name and name not in LISTED and name not in COUNTED):
            wrong.append(f"{name}: lost its place in list {row['list']}; restore the proof, or move its row with a reason")
            continue
        now = number_of(name)
        if row["number"] and now is not None and now < int(row["number"]):
            wrong.append(f"{name}: {now} single tests, {row['number']} recorded; restore what is gone")
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
