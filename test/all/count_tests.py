#!/usr/bin/env python3
# SPDX-License-Identifier: MIT
"""Sums up the single tests in CTest's JUnit files.

usage: count_tests.py --run FILE COMMAND...    runs CTest, which writes FILE, and prints the sum
       count_tests.py FILE                     prints the sum of ./check from the output of test/all/start: by layer, then each skipped and each failed test

A program counts as several tests if it prints a sum as our runners do ("12 passed, 0 failed, 0 skipped"), as Unity ("12 Tests 0 Failures 0 Ignored") or as Python's
unittest ("Ran 12 tests in 1.5s"); any other counts as one. A failed program counts at least one failure, whatever it prints, unless it prints that it was not judged
(test/support/verdict.py). The last line is "N passed, N failed, N skipped". Exit status: 1 if a test failed or none passed, 75 if one was not judged.
"""

import collections
import re
import subprocess
import sys
import xml.etree.ElementTree
from pathlib import Path

UNITY = re.compile(r"^(\d+) Tests (\d+) Failures (\d+) Ignored", re.MULTILINE)
OURS = re.compile(r"^(\d+) passed, (\d+) failed(?:, (\d+) skipped)?$", re.MULTILINE)
NOT_JUDGED = re.compile(r"^real time not judged: .*\n\d+ passed, 0 failed, \d+ skipped$", re.MULTILINE)
INCONCLUSIVE = re.compile(r"^(\d+) inconclusive", re.MULTILINE)
PYTHON = re.compile(r"^Ran (\d+) tests? in .*\n\n(?:OK|FAILED)(.*)$", re.MULTILINE)
REASON = re.compile(r"\d+: (E  |FAILED|check: )")  # A line of pytest in the output of `start`.
STARTED = re.compile(r"^layer=(\S+) status=(\d+) inconclusive=(\d+) processor_s=([\d.]+)$", re.MULTILINE)


def count(output, status):
    """(passed, failed, skipped) of a program with this output and exit status."""
    passed, failed, skipped = int(status == 0), 0, int(status == 77)
    if OURS.search(output):
        passed, failed, skipped = (int(number or 0) for number in OURS.findall(output)[-1])
    elif UNITY.search(output):
        total, failed, skipped = (sum(map(int, column)) for column in zip(*UNITY.findall(output), strict=True))
        passed = total - failed - skipped
    elif PYTHON.search(output):  # "Ran 12 tests", "OK" or "FAILED", " (failures=1, errors=1, skipped=2)"
        total, details = PYTHON.findall(output)[-1]
        numbers = collections.Counter({name: int(number) for name, number in re.findall(r"(\w+)=(\d+)", details)})
        failed, skipped = numbers["failures"] + numbers["errors"] + numbers["unexpectedSuccesses"], numbers["skipped"]
        passed = max(int(total) - failed - skipped, 0)
    judged = status not in (0, 77) and not (status == 75 and NOT_JUDGED.search(output))
    return passed, failed or int(judged), skipped


def cases_of(path):
    """(name, output, status, seconds) of each test; status 77: it did not run, 75: it reports that it was not judged."""
    for case in xml.etree.ElementTree.parse(path).getroot().iter("testcase"):
        output, skipped = case.findtext("system-out") or "", case.get("status") == "notrun" or case.find("skipped") is not None
        failed = 75 if NOT_JUDGED.search(output) else 1
        yield case.get("name"), output, 77 if skipped else failed if case.get("status") == "fail" else 0, float(case.get("time", 0))


def run(path, *command):
    Path(path).unlink(missing_ok=True)
    ended, sums, lines = subprocess.run(command, check=False).returncode, [0, 0, 0], []
    for name, output, status, _ in cases_of(path):
        counts = count(output, status)
        sums = [total + one for total, one in zip(sums, counts, strict=True)]
        lines += [f"{word}: {name}: {number} of {sum(counts)}" for word, number in (("failed", counts[1]), ("skip", counts[2])) if number]
        lines += [line for line in output.splitlines() if re.match(r"\d+ inconclusive|real time not judged", line)]
    print(*lines, "{} passed, {} failed, {} skipped".format(*sums), sep="\n")
    return 1 if sums[1] else 75 if any(line.startswith("real time") for line in lines) else ended


def main(path):
    sums, inconclusive, unjudged, skipped, failed, layers = [0, 0, 0], 0, [], [], [], collections.defaultdict(lambda: [0, 0.0, 0.0])
    for name, output, status, wall_s in cases_of(path):
        layer, ended, late, processor_s = STARTED.findall(output)[-1] if STARTED.search(output) else ("none", 77 if status == 77 else 1, 0, 0)
        counts, log = count(output, int(ended)), Path(f"build/check/{name}.log")
        sums, inconclusive = [total + one for total, one in zip(sums, counts, strict=True)], inconclusive + int(late)
        layers[layer] = [total + one for total, one in zip(layers[layer], (sum(counts), float(processor_s), wall_s), strict=True)]
        if counts[1]:
            failed.append(f"failed: {name}: {counts[1]} of {sum(counts)}; log: {log}")
            failed += [f"  {line}" for line in output.splitlines() if REASON.match(line)][:12]
            if layer == "none":
                failed += ["  did not end on its own; its last output:", *(log.read_text(errors="replace").splitlines()[-25:] if log.exists() else [])]
        elif counts[2]:
            why = [line.strip() for line in output.splitlines() if re.match(r" *skip", line, re.IGNORECASE)] or ["not run: a prerequisite failed"]
            skipped += [f"skipped: {name}: {re.sub('(?i)^skip(ped)?[: ]*', '', line)}" for line in why]
        unjudged += [name] if int(ended) == 75 and not counts[1] else []
    layers["all"] = [sum(column) for column in zip(*layers.values(), strict=True)]
    print(f"\n{'layer':12} {'single tests':>12} {'processor s':>12} {'wall s':>8}")
    print(*("{:12} {:12d} {:12.0f} {:8.0f}".format(layer, *numbers) for layer, numbers in layers.items()), *skipped, *failed, sep="\n")
    print(f"{inconclusive} inconclusive, counted as skipped: the machine stalled; their names are above\n" if inconclusive else "", end="")
    print(f"real time not judged: {' '.join(unjudged)}; repeat them on a machine with less load\n" if unjudged else "", end="")
    print("{} passed, {} failed, {} skipped".format(*sums))
    return 1 if sums[1] else 75 if unjudged else int(not sums[0])


if __name__ == "__main__":
    sys.exit(run(*sys.argv[2:]) if sys.argv[1:2] == ["--run"] else main(sys.argv[1]) if len(sys.argv) == 2 else __doc__)
