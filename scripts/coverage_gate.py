#!/usr/bin/env python3
# SPDX-License-Identifier: MIT
"""Fails unless every line and every branch of core/src was executed.

usage: coverage_gate.py BUILD_DIR [SOURCE_PREFIX]

Reads what the unit tests left in BUILD_DIR (preset coverage) through gcov's JSON. Only files below SOURCE_PREFIX count
(default core/src/). A header or source that several objects share counts as executed if any of them executed it.
"""
import json
import subprocess
import sys
from pathlib import Path


def gcov_files(build, prefix):
    """Yields gcov's record of each source below the prefix, once per object that contains it."""
    notes = sorted(path for path in build.rglob("*.gcno") if "iwheel_core.dir" in path.parts)
    for note in notes:
        run = subprocess.run(["gcov", "--json-format", "--branch-probabilities", "--stdout", str(note)],
                             capture_output=True, text=True, check=True)
        for text in run.stdout.splitlines():
            for record in json.loads(text)["files"]:
                name = str((Path(".") / record["file"]).resolve())
                if f"/{prefix}" in name:
                    yield name[name.rindex(f"/{prefix}") + 1:], record


def merge(build, prefix):
    """{file: {(function, line): [count, [branch counts]]}}, summed over objects."""
    merged = {}
    for name, record in gcov_files(build, prefix):
        lines = merged.setdefault(name, {})
        for line in record["lines"]:
            key = (line.get("function_name", ""), line["line_number"])
            entry = lines.setdefault(key, [0, [0] * len(line["branches"])])
            entry[0] += line["count"]
            for index, branch in enumerate(line["branches"]):
                entry[1][index] += branch["count"]
    return merged


def main(arguments):
    if len(arguments) not in (2, 3):
        sys.exit(__doc__)
    build = Path(arguments[1])
    prefix = arguments[2] if len(arguments) == 3 else "core/src/"
    merged = merge(build, prefix)
    lines = branches = lines_hit = branches_hit = 0
    for name in sorted(merged):
        for (function, number), (count, taken) in sorted(merged[name].items(), key=lambda item: item[0][1]):
            lines += 1
            lines_hit += count > 0
            branches += len(taken)
            branches_hit += sum(branch > 0 for branch in taken)
            if count == 0:
                print(f"{name}:{number}: {function}: never executed")
            elif 0 in taken:
                missed = ", ".join(str(index) for index, branch in enumerate(taken) if branch == 0)
                print(f"{name}:{number}: {function}: branch {missed} of {len(taken)} never taken")
    if lines == 0:
        sys.exit(f"no coverage data of {prefix} in {build}: configure with the preset coverage and run the unit tests")
    print(f"{len(merged)} files: {lines_hit} of {lines} lines ({100 * lines_hit / lines:.2f} %), "
          f"{branches_hit} of {branches} branches ({100 * branches_hit / max(branches, 1):.2f} %)")
    return 0 if (lines_hit, branches_hit) == (lines, branches) else 1


if __name__ == "__main__":
    sys.exit(main(sys.argv))
