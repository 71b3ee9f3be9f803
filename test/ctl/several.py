# SPDX-License-Identifier: MIT
"""Runs the tests of a file several at a time, each in a process of its own: they wait more than they work."""

import os
import re
import subprocess
import sys
import unittest

sys.path.append(os.path.join(os.path.dirname(os.path.abspath(__file__)), "..", "support"))
import verdict

LIMIT_S = 240  # of one test


def cases(suite):
    for case in suite:
        yield from cases(case) if isinstance(case, unittest.TestSuite) else [case]


def line_of(case):
    return getattr(case, case.id().rsplit(".", 1)[1]).__func__.__code__.co_firstlineno


def names():
    """What is run by itself, as it stands in the file: a test, or a whole class whose tests share what it prepares once."""
    found = sorted(cases(unittest.defaultTestLoader.loadTestsFromModule(sys.modules["__main__"])), key=line_of)
    return list(dict.fromkeys(type(case).__name__ if "setUpClass" in vars(type(case)) else case.id().removeprefix("__main__.") for case in found))


def attempt(build, name):
    """Runs it in a process of its own."""
    command = [sys.executable, os.path.abspath(sys.modules["__main__"].__file__), build, "-v", name]
    try:
        done = subprocess.run(command, capture_output=True, text=True, check=False, timeout=LIMIT_S)
    except subprocess.TimeoutExpired as late:
        return verdict.Attempt([verdict.Failure(f"did not end within {LIMIT_S} s\n{late.output}", verdict.CRASH)])
    ran = re.search(r"^Ran (\d+) tests? in", done.stderr, re.MULTILINE)
    output = done.stdout + done.stderr
    if done.returncode < 0 or not ran:
        return verdict.Attempt([verdict.Failure(f"the test's own process ended with {done.returncode}\n{output}", verdict.CRASH)])
    if done.returncode != 0:
        return verdict.of_text(output)
    skips = re.findall(r"\.\.\. skipped ['\"](.*)['\"]$", done.stderr, re.MULTILINE)
    print(*(f"skip: {name}: {reason}\n" for reason in skips), sep="", end="", flush=True)
    return verdict.Attempt(tests=int(ran[1]), skips=len(skips))


def main(build, at_a_time=4):
    """As unittest.main, if its arguments follow; else all of them."""
    if len(sys.argv) > 1:
        unittest.main()
    sys.exit(verdict.run_all(names(), lambda name: attempt(build, name), at_a_time).end())
