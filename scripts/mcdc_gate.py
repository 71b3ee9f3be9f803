#!/usr/bin/env python3
# SPDX-License-Identifier: MIT
"""Fails unless every condition of core was shown to decide its decision alone (MC/DC), as clang 19 counts it.

usage: mcdc_gate.py BUILD_DIR [SOURCE_DIR]

Reads the profiles (*.profraw) that the unit tests left below BUILD_DIR/profiles and the programs below BUILD_DIR. Only files below
SOURCE_DIR (default core/) count; a header's decision counts as shown if it was in any of the files that include it.
"""
import json
import os
import subprocess
import sys
from pathlib import Path

VERSION = "19"


def export(build, source):
    """What llvm-cov knows of each file below the source folder."""
    programs = sorted(path for path in build.rglob("unit_*") if path.is_file() and os.access(path, os.X_OK))
    profiles = sorted(map(str, (build / "profiles").glob("*.profraw")))
    if not programs or not profiles:
        sys.exit(f"no profiles or no programs in {build}: configure with the preset mcdc and run the unit tests")
    merged = str(build / "profiles/all.profdata")
    subprocess.run([f"llvm-profdata-{VERSION}", "merge", "-sparse", *profiles, "-o", merged], check=True)
    objects = [str(programs[0]), *(word for program in programs[1:] for word in ("-object", str(program)))]
    run = subprocess.run([f"llvm-cov-{VERSION}", "export", "-format=text", "-instr-profile", merged, *objects, str(source)],
                         capture_output=True, text=True, check=True)
    return json.loads(run.stdout)["data"][0]["files"]


def decisions_of(record):
    """{where: [shown of each condition]}, of all copies of a decision together."""
    found = {}
    for line, column, *_, conditions in record["mcdc_records"]:
        before = found.get((line, column), [False] * len(conditions))
        found[(line, column)] = [old or new for old, new in zip(before, conditions, strict=True)]
    return found


def main(arguments):
    if len(arguments) not in (2, 3):
        sys.exit(__doc__)
    build = Path(arguments[1]).resolve()
    source = Path(arguments[2] if len(arguments) == 3 else "core").resolve()
    total = shown = 0
    for record in sorted(export(build, source), key=lambda record: record["filename"]):
        decisions = decisions_of(record)
        if not decisions:
            continue
        name = Path(record["filename"]).relative_to(source.parent)
        conditions = sum(len(flags) for flags in decisions.values())
        good = sum(sum(flags) for flags in decisions.values())
        total, shown = total + conditions, shown + good
        print(f"{name}: {len(decisions)} decisions, {good} of {conditions} conditions shown")
        for (line, column), flags in sorted(decisions.items()):
            missed = ", ".join(str(index + 1) for index, flag in enumerate(flags) if not flag)
            if missed:
                print(f"{name}:{line}:{column}: condition {missed} of {len(flags)} never decided alone")
    if total == 0:
        sys.exit(f"no decision with more than one condition below {source}")
    print(f"{shown} of {total} conditions ({100 * shown / total:.2f} %)")
    return 0 if shown == total else 1


if __name__ == "__main__":
    sys.exit(main(sys.argv))
