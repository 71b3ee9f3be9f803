#!/usr/bin/env python3
# SPDX-License-Identifier: MIT
"""Inside the kernel: runs one plan, candidate after candidate, round after round, and prints the results as lines of JSON.

Usage: guest.py PLAN.json    {"measures": [NAME...], "rounds": N, "build": DIR, "tools": DIR, "peers": DIR, "results": FILE, ...}
"""

import json
import os
import shutil
import subprocess
import sys
import traceback

HERE = os.path.dirname(os.path.abspath(__file__))
TEST = os.path.dirname(os.path.dirname(HERE))
sys.path[:0] = [HERE, os.path.join(TEST, "kernel"), os.path.join(TEST, "system")]

from measures import MEASURES
from surroundings import Surroundings

STALL_US = 10_000
TRIES = 3
PROGRAMS = {"candump": "candump", "cansend": "cansend", "cangen": "cangen", "gpiomon": "gpiomon"}


def available(candidate, plan):
    if candidate == "python_can":
        return bool(plan["peers"])
    return candidate not in PROGRAMS or shutil.which(PROGRAMS[candidate]) is not None


def one_turn(around, measure, candidate):
    """The figures, and the longest delay of a program that sleeps a millisecond. Only a turn in which the machine stalled is repeated."""
    stall_us = around.plan.get("stall_us", STALL_US)
    for tries in range(1, TRIES + 1):
        sleeper, figures, failed = around.tool("sleeper", piped=True), None, None
        try:
            figures = measure.turn(candidate)
        except (RuntimeError, OSError, TimeoutError, subprocess.TimeoutExpired) as error:
            failed = error
        late_us = int(sleeper.end() or 0)
        if late_us >= stall_us and tries < TRIES:
            around.end_gateway()
            continue
        if failed:
            raise failed
        return {**figures, "late_us": late_us, "repeated": tries - 1}
    return None


def play_round(around, measure, candidates, report):
    for candidate in candidates:
        try:
            report(candidate=candidate, figures=one_turn(around, measure, candidate))
        except Exception as error:  # noqa: BLE001
            report(candidate=candidate, failed=f"{type(error).__name__}: {error}", where=traceback.format_exc()[-1500:])


def play(plan, report):
    around = Surroundings(plan)
    for name in plan["measures"]:
        measure = MEASURES[name](around)
        candidates = [c for c in measure.candidates if c in plan.get("candidates", measure.candidates) and available(c, plan)]
        measure.begin()
        for number in range(plan["rounds"]):
            play_round(around, measure, candidates, lambda name=name, number=number, **what: report(measure=name, round=number, **what))
        measure.end()


def main(path):
    with open(path, encoding="utf-8") as file:
        plan = json.load(file)
    with open(plan["results"], "a", encoding="utf-8", buffering=1) as results:
        play(plan, lambda **what: results.write(json.dumps(what) + "\n"))
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1]))
