#!/usr/bin/env python3
# SPDX-License-Identifier: MIT
"""cppcheck with its MISRA C:2012 addon on the core; what docs/static.md does not allow fails.

usage: cppcheck_gate.py SOURCE... [-- PAGE]

Exit status 77 (skipped) with a cppcheck other than VERSION: each version of the addon finds and overlooks other things.
"""
import re
import subprocess
import sys
from pathlib import Path

from deviations import PAGE, rows_of

ROOT = Path(__file__).resolve().parent.parent
VERSION = "2.10"
FINDING = re.compile(r"^(?P<file>[^:]+):(?P<line>\d+): (?P<id>[\w.-]+): (?P<message>.*)$")


def findings_of(sources):
    command = ["cppcheck", "--std=c99", "--enable=warning,performance,portability,style", "--addon=misra", "--quiet",
               "--template={file}:{line}: {id}: {message}", "-I", str(ROOT / "core/include"), *sources]
    run = subprocess.run(command, capture_output=True, text=True, check=False)
    if run.returncode != 0:
        sys.exit(f"cppcheck failed:\n{run.stdout}{run.stderr}")
    for line in run.stderr.splitlines():
        match = FINDING.match(line)
        if not match:
            sys.exit(f"cppcheck says what this script does not understand: {line}")
        yield match["file"].removeprefix(f"{ROOT}/"), match["line"], match["id"], match["message"]


def main(arguments):
    sources, _, rest = " ".join(arguments[1:]).partition(" -- ")
    deviations = [row for row in rows_of(rest or ROOT / PAGE) if row.tool == "cppcheck"]
    if not sources:
        sys.exit(__doc__)
    version = subprocess.run(["cppcheck", "--version"], capture_output=True, text=True, check=True).stdout.split()[1]
    if version != VERSION:
        print(f"skip: the deviations are written for cppcheck {VERSION}, this is {version}")
        return 77
    used, bad, total = set(), 0, 0
    for file, line, finding, message in findings_of(sources.split()):
        total += 1
        row = next((row for row in deviations if row.covers("cppcheck", finding, file)), None)
        if row:
            used.add(row.number)
        else:
            bad += 1
            print(f"{file}:{line}: {finding}: {message.removesuffix(' (use --rule-texts=<file> to get proper output)')}")
    idle = [row for row in deviations if row.number not in used] if not rest else []
    for row in idle:
        print(f"deviation {row.number} ({row.what}) is not needed any more: delete it")
    print(f"{total} findings, {total - bad} allowed by {len(used)} deviations, {bad} not allowed")
    return 1 if bad or idle else 0


if __name__ == "__main__":
    sys.exit(main(sys.argv))
