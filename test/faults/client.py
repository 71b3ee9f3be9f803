# SPDX-License-Identifier: MIT
"""Tests of the Python client with a copy of it that has a fault."""

import os
import re
import shutil
import subprocess
import sys

from table import ROOT

sys.path.insert(0, str(ROOT / "test/support"))
from verdict import FAILED, INCONCLUSIVE, Attempt, of_text, run_all

TIMEOUT_S = 300  # The longest takes 30 s; a lost cancellation or reply makes some of them wait.


def run(applied, tests, folder):
    """(the finding or None, the output). `tests`: a file of python/tests without its ending, or a class or a test in it."""
    shutil.copytree(ROOT / "python", folder / "python", ignore=shutil.ignore_patterns("__pycache__"), dirs_exist_ok=True)
    for name in ("build", "scripts", "share", "test"):
        if not (folder / name).exists():
            (folder / name).symlink_to(ROOT / name)
    if applied:
        (folder / applied.file).write_text(applied.text)
    try:
        done = subprocess.run(
            [sys.executable, "-m", "unittest", "-f", tests],
            cwd=folder / "python/tests",
            capture_output=True,
            text=True,
            timeout=TIMEOUT_S,
            env={**os.environ, "PYTHONPATH": str(folder / "python/src"), "PYTHONDONTWRITEBYTECODE": "1"},
            check=False,
        )
    except subprocess.TimeoutExpired:
        return f"does not end within {TIMEOUT_S} s", ""
    if done.returncode == 0:
        return None, ""
    failed = re.search(r"^(?:FAIL|ERROR): (\w+)", done.stderr, re.M)
    return failed[1] if failed else f"ends with status {done.returncode}", done.stderr


def judge(applied, tests, folder):
    """The first failed test with the fault, or None."""
    return run(applied, tests, folder)[0]


def judge_unchanged(tests, folder):
    """The first failed test without a fault, or None. If a stall of the machine can be the cause, it runs again, as in the step `python`."""
    found = {}

    def attempt(name):
        finding, output = run(None, name, folder)
        return of_text(f"{finding}\n{output}") if finding else Attempt()

    def note(name, verdict, attempt, tries):
        if verdict in (FAILED, INCONCLUSIVE):
            found[name] = attempt.failures[0].text.splitlines()[0]

    run_all([tests], attempt, show=note)
    return found.get(tests)
