# SPDX-License-Identifier: MIT
"""Runs the tests of a file several at a time, each in a process of its own: they wait more than they work."""
import concurrent.futures
import os
import re
import subprocess
import sys
import unittest


def cases(suite):
    for case in suite:
        yield from cases(case) if isinstance(case, unittest.TestSuite) else [case]


def line_of(case):
    return getattr(case, case.id().rsplit(".", 1)[1]).__func__.__code__.co_firstlineno


def names():
    """What is run by itself, as it stands in the file: a test, or a whole class whose tests share what it prepares once."""
    found = sorted(cases(unittest.defaultTestLoader.loadTestsFromModule(sys.modules["__main__"])), key=line_of)
    return list(dict.fromkeys(type(case).__name__ if "setUpClass" in vars(type(case)) else case.id().removeprefix("__main__.") for case in found))


def run_one(build, name):
    """(name, tests, whether they passed, output)"""
    done = subprocess.run([sys.executable, os.path.abspath(sys.modules["__main__"].__file__), build, name], capture_output=True, text=True, check=False)
    ran = re.search(r"^Ran (\d+) tests? in", done.stderr, re.MULTILINE)
    return name, int(ran[1]) if ran else 0, ran is not None and done.returncode == 0, done.stdout + done.stderr


def run_all(build, at_a_time):
    """The exit status. What fails among others is judged once more, alone: these tests run in real time."""
    with concurrent.futures.ThreadPoolExecutor(at_a_time) as pool:
        results = list(pool.map(lambda name: run_one(build, name), names()))
    results = [run_one(build, name) if not passed else (name, tests, True, "") for name, tests, passed, _ in results]
    for name, _, passed, output in results:
        if not passed or output:
            print("ok, alone" if passed else "FAILED", name, "" if passed else output, flush=True)
    failed = sum(not passed for _, _, passed, _ in results)
    print(f"{sum(tests for _, tests, passed, _ in results if passed)} passed, {failed} failed, 0 skipped")
    return 0 if results and not failed else 1


def main(build, at_a_time=4):
    """As unittest.main, if its arguments follow; else all of them."""
    if len(sys.argv) > 1:
        unittest.main()
    sys.exit(run_all(build, at_a_time))
