#!/usr/bin/env python3
# SPDX-License-Identifier: MIT
"""Counts single tests in CTest's JUnit file: prints "PASSED FAILED SKIPPED", after a line for each that failed.

usage: count_tests.py JUNIT_FILE

A program that sums up in the words of Unity ("12 Tests 0 Failures 0 Ignored"), of our own runners ("12 passed, 0 failed,
0 skipped") or of Python's unittest ("Ran 12 tests in 1.5s") counts as that many tests; any other as one. A program that failed counts at least one failure, whatever it said,
unless it says that it was not judged (test/support/verdict.py). Exit status 1 if one failed, 75 if one was not judged.
"""
import re
import sys
import xml.etree.ElementTree

UNITY = re.compile(r"^(\d+) Tests (\d+) Failures (\d+) Ignored", re.MULTILINE)
OURS = re.compile(r"^(\d+) passed, (\d+) failed(?:, (\d+) skipped)?$", re.MULTILINE)
NOT_JUDGED = re.compile(r"^real time not judged: .*\n\d+ passed, 0 failed, \d+ skipped$", re.MULTILINE)
INCONCLUSIVE = re.compile(r"^(?:\d+ inconclusive|real time not judged).*$", re.MULTILINE)
PYTHON = re.compile(r"^Ran (\d+) tests? in .*\n\n(?:OK|FAILED)(.*)$", re.MULTILINE)


def of_python(total, details):
    """From "Ran 12 tests" and " (failures=1, errors=1, skipped=2)"."""
    numbers = {name: int(number) for name, number in re.findall(r"(\w+)=(\d+)", details)}
    failed = sum(numbers.get(name, 0) for name in ("failures", "errors", "unexpectedSuccesses"))
    skipped = numbers.get("skipped", 0)
    return max(int(total) - failed - skipped, 0), failed, skipped


def count(case):
    """(passed, failed, skipped) of one CTest test."""
    output = case.findtext("system-out") or ""
    unity = UNITY.findall(output)
    ours = OURS.findall(output)
    if unity:
        total, failed, skipped = (sum(int(row[i]) for row in unity) for i in range(3))
        passed = total - failed - skipped
    elif ours:
        passed, failed, skipped = (int(number or 0) for number in ours[-1])
    elif PYTHON.search(output):
        passed, failed, skipped = of_python(*PYTHON.findall(output)[-1])
    elif case.get("status") == "notrun" or case.find("skipped") is not None:
        passed, failed, skipped = 0, 0, 1
    else:
        passed, failed, skipped = 1, 0, 0
    if case.get("status") == "fail" and failed == 0 and not NOT_JUDGED.search(output):
        passed, failed = (0, 1) if passed == 1 else (passed, 1)
    return passed, failed, skipped


def main(arguments):
    if len(arguments) != 2:
        sys.exit(__doc__)
    sums, unjudged = [0, 0, 0], False
    for case in xml.etree.ElementTree.parse(arguments[1]).getroot().iter("testcase"):
        counts = count(case)
        sums = [total + one for total, one in zip(sums, counts, strict=True)]
        for word, number in (("failed", counts[1]), ("skipped", counts[2])):
            if number:
                print(f"{word}: {case.get('name')}: {number} of {sum(counts)}")
        for line in INCONCLUSIVE.findall(case.findtext("system-out") or ""):
            print(line)
            unjudged = unjudged or line.startswith("real time")
    print(*sums)
    return 1 if sums[1] else 75 if unjudged else 0


if __name__ == "__main__":
    sys.exit(main(sys.argv))
