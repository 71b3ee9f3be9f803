#!/usr/bin/env python3
# SPDX-License-Identifier: MIT
"""Writes the numbers of events sent, arrived and doubled in the tests, and in the hours in virtual time, into docs/user/mqtt.md.

usage: IWHEEL_FIGURES=FILE IWHEEL_FULL=1 .venv/bin/pytest test/mqtt (as often as you like), then test/mqtt/figures.py BUILD FILE
"""

import subprocess
import sys
from pathlib import Path

HERE = Path(__file__).resolve().parent
sys.path[:0] = [str(HERE), str(HERE.parent / "system")]

from mqtt_rig import put_table

PAGE = HERE.parent.parent / "docs/user/mqtt.md"
HEAD = ["| fault | tried | events sent | arrived | doubled | the longest until one arrived |", "|---|---:|---:|---:|---:|---:|"]


def sum_up(rows):
    """One row for each fault: trials, events sent, arrived and doubled in all its trials, and the longest time of them."""
    faults = {}
    for fault, often, sent, arrived, doubled, longest_s in rows:
        before = faults.get(fault, (0, 0, 0, 0, 0))
        faults[fault] = (before[0] + often, before[1] + sent, before[2] + arrived, before[3] + doubled, max(before[4], longest_s))
    return [
        f"| {fault} | {often} | {sent} | {arrived} | {doubled} | {longest_s:.1f} s |" for fault, (often, sent, arrived, doubled, longest_s) in faults.items()
    ]


def rows_in(text):
    """(fault, number of trials, events sent, arrived, doubled, seconds until the last arrived)"""
    lines = [line.removeprefix("figures: ").split(" | ") for line in text.splitlines() if line.startswith("figures: ")]
    return [(fault, *map(int, numbers), float(longest.split()[0])) for fault, *numbers, longest in lines]


if __name__ == "__main__":
    hours = subprocess.run([Path(sys.argv[1]) / "test/mqtt/mqtt_hours"], capture_output=True, text=True, check=True).stdout
    put_table(PAGE, "test/mqtt/figures.py", HEAD + sum_up(rows_in(Path(sys.argv[2]).read_text(encoding="utf-8") + hours)))
